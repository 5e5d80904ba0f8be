//! One client's connection: the socket, and everything else that its watcher has to hear of.

use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use futures_util::StreamExt as _;
use futures_util::stream::SplitStream;
use tokio::sync::watch;
use tokio::time::{Instant, Interval, interval, timeout};

use super::messages;
use super::outbox::Outbox;
use super::watcher::{Watcher, Work};
use crate::api::Phase;
use crate::error::{ApiError, ErrorCode};
use crate::session::SceneEntry;

/// Two missed: closed.
const PING: Duration = Duration::from_secs(20);
/// Longest time for the last messages to arrive, and for the client's answer to our close.
pub(super) const FAREWELL: Duration = Duration::from_secs(2);

/// What happens to a connection.
enum Event {
    Message(Message),
    /// The client closed, broke the protocol, or is gone.
    Gone(Option<&'static str>),
    Revision(u64),
    Work(Work),
    Ping,
    Draining,
    /// There is room for messages again.
    Room,
}

/// Why a connection ends; sent as `goodbye` where there is a reason.
struct End(Option<&'static str>);

/// Everything that events come from, but the watcher.
struct Sources {
    incoming: SplitStream<WebSocket>,
    revisions: watch::Receiver<u64>,
    phases: watch::Receiver<Phase>,
    ping: Interval,
}

/// Serves the client until either side ends it.
pub(super) async fn serve(
    mut watcher: Watcher,
    entry: Arc<SceneEntry>,
    phases: watch::Receiver<Phase>,
    socket: WebSocket,
) {
    let (sink, incoming) = socket.split();
    let (out, writer) = Outbox::open(sink);
    let mut sources = Sources { incoming, revisions: entry.watch(), phases, ping: interval(PING) };
    // The scene may have changed, or gone, before anybody watched.
    sources.revisions.mark_changed();
    sources.ping.reset();
    let mut heard = Instant::now();
    out.say(&watcher.welcome());
    let end = loop {
        watcher.begin_work();
        let event = next_event(&mut watcher, &mut sources, &out).await;
        match event {
            Event::Message(_) => heard = Instant::now(),
            Event::Ping if heard.elapsed() > 2 * PING => break End(Some("timeout")),
            _ => {}
        }
        if let Err(end) = handle(event, &mut watcher, &entry, &out) {
            break end;
        }
    };
    // Its work ends here, whatever the client still takes.
    drop(watcher);
    if let Some(reason) = end.0 {
        out.say(&messages::goodbye(reason));
        out.close();
    }
    drop(out);
    let _ = timeout(FAREWELL, async {
        let _ = writer.await;
        // A socket dropped with something unread is reset, and the goodbye is lost with it.
        while let Some(Ok(_)) = sources.incoming.next().await {}
    })
    .await;
}

async fn next_event(watcher: &mut Watcher, sources: &mut Sources, out: &Outbox) -> Event {
    let Sources { incoming, revisions, phases, ping } = sources;
    let draining = async {
        let _ = phases.wait_for(|&phase| phase == Phase::Draining).await;
    };
    if !out.has_room() {
        // The client does not read. Nothing can be said to it, so it is not listened to either.
        return tokio::select! {
            room = out.room() => if room { Event::Room } else { Event::Gone(None) },
            () = draining => Event::Draining,
        };
    }
    tokio::select! {
        message = incoming.next() => match message {
            Some(Ok(Message::Close(_))) | None => Event::Gone(None),
            Some(Ok(message)) => Event::Message(message),
            // Too long, not UTF-8, a line that broke: whether it hears why is its own affair.
            Some(Err(_)) => Event::Gone(Some("malformed")),
        },
        Ok(()) = revisions.changed() => Event::Revision(*revisions.borrow_and_update()),
        work = watcher.work() => Event::Work(work),
        _ = ping.tick() => Event::Ping,
        () = draining => Event::Draining,
        () = out.closed() => Event::Gone(None),
    }
}

fn handle(event: Event, watcher: &mut Watcher, entry: &SceneEntry, out: &Outbox) -> Result<(), End> {
    match event {
        Event::Gone(reason) => return Err(End(reason)),
        Event::Message(Message::Text(text)) => {
            if let Err((error, seq)) = watcher.hear(&text, out) {
                out.say(&messages::error(&error, seq));
            }
        }
        Event::Message(Message::Binary(_)) => {
            let error = ApiError::new(ErrorCode::Invalid, "expected text, got a binary message");
            out.say(&messages::error(&error, None));
        }
        Event::Message(_) | Event::Room => {}
        Event::Revision(SceneEntry::DELETED) => return Err(End(Some("scene_deleted"))),
        Event::Revision(_) => watcher.catch_up(&entry.snapshot(), None, out),
        Event::Work(work) => watcher.worked(work, out),
        Event::Ping => out.ping(),
        Event::Draining => return Err(End(Some("draining"))),
    }
    Ok(())
}
