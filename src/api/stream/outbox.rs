//! What waits to be written to a client.

use std::time::Duration;

use axum::body::Bytes;
use axum::extract::ws::{Message, WebSocket};
use futures_util::SinkExt as _;
use futures_util::stream::SplitSink;
use serde_json::Value;
use tokio::sync::mpsc;
use tokio::task::JoinHandle;
use tokio::time::timeout;

/// Messages that may wait to be written. Pictures among them are bounded by what the client acknowledges.
const WAITING: usize = 32;
/// Room that one event may need: a `scene`, an `error`, a picture's two.
const ROOM: usize = 4;
/// A client that takes nothing for so long is gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(40);

/// Messages on their way to the client. Whoever has waited for room may say what one event says.
#[derive(Debug)]
pub(super) struct Outbox(mpsc::Sender<Message>);

impl Outbox {
    /// An empty outbox, and the task that writes it to the socket; it ends when the client takes nothing any more,
    /// or with the outbox.
    pub(super) fn open(sink: SplitSink<WebSocket, Message>) -> (Self, JoinHandle<()>) {
        let (sender, waiting) = mpsc::channel(WAITING);
        (Self(sender), tokio::spawn(write(sink, waiting)))
    }

    pub(super) fn has_room(&self) -> bool {
        self.0.capacity() >= ROOM
    }

    /// Waits for room; false when the client takes nothing any more.
    pub(super) async fn room(&self) -> bool {
        self.0.reserve_many(ROOM).await.is_ok()
    }

    /// Waits until the client takes nothing any more.
    pub(super) async fn closed(&self) {
        self.0.closed().await;
    }

    pub(super) fn say(&self, message: &Value) {
        self.push(Message::Text(message.to_string().into()));
    }

    pub(super) fn picture(&self, bytes: Bytes) {
        self.push(Message::Binary(bytes));
    }

    pub(super) fn ping(&self) {
        self.push(Message::Ping(Bytes::new()));
    }

    /// The last message.
    pub(super) fn close(&self) {
        self.push(Message::Close(None));
    }

    fn push(&self, message: Message) {
        // There is room, or the client is gone and the connection about to hear of it.
        let _ = self.0.try_send(message);
    }
}

async fn write(mut sink: SplitSink<WebSocket, Message>, mut waiting: mpsc::Receiver<Message>) {
    while let Some(message) = waiting.recv().await {
        let last = matches!(message, Message::Close(_));
        match timeout(WRITE_TIMEOUT, sink.send(message)).await {
            Ok(Ok(())) if !last => {}
            _ => return,
        }
    }
}
