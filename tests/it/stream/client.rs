//! A client of the stream that checks what it is sent.

use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use image::ImageFormat;
use serde_json::{Value, json};
use tokio::net::TcpStream;
use tokio::time::{Instant, timeout};
use tokio_tungstenite::tungstenite::client::IntoClientRequest;
use tokio_tungstenite::tungstenite::handshake::client::Response;
use tokio_tungstenite::tungstenite::{Error, Message};
use tokio_tungstenite::{MaybeTlsStream, WebSocketStream, connect_async};

use crate::support::process::{PATIENCE, Process};

pub(crate) type Socket = WebSocketStream<MaybeTlsStream<TcpStream>>;

/// What the server said.
#[derive(Debug)]
pub(crate) enum Said {
    Frame(Frame),
    Text(Value),
    /// It closed the connection in order.
    Closed,
    /// It was cut off.
    Cut,
}

/// A picture and its header.
#[derive(Clone, Debug)]
pub(crate) struct Frame {
    pub(crate) header: Value,
    pub(crate) bytes: Vec<u8>,
}

impl Frame {
    pub(crate) fn number(&self, field: &str) -> u64 {
        self.header[field].as_u64().unwrap_or_else(|| panic!("{field}: {}", self.header))
    }

    pub(crate) fn is_final(&self) -> bool {
        self.header["phase"] == "final"
    }

    /// Width, height and values, 8-bit RGBA.
    pub(crate) fn pixels(&self) -> (u32, u32, Vec<u8>) {
        pixels(&self.bytes)
    }
}

/// Width, height and 8-bit RGBA values of an image file.
pub(crate) fn pixels(file: &[u8]) -> (u32, u32, Vec<u8>) {
    let picture = image::load_from_memory(file).expect("an image").to_rgba8();
    (picture.width(), picture.height(), picture.into_raw())
}

/// What is wrong with a picture as its header describes it.
pub(crate) fn frame_fault(header: &Value, bytes: &[u8]) -> Option<String> {
    let (format, encoding) = match image::guess_format(bytes) {
        Ok(format @ ImageFormat::Png) => (format, "png"),
        Ok(format @ ImageFormat::Jpeg) => (format, "jpeg"),
        Ok(format @ ImageFormat::WebP) => (format, "webp"),
        other => return Some(format!("{other:?}")),
    };
    let (width, height) = match image::load_from_memory_with_format(bytes, format) {
        Ok(picture) => (picture.width(), picture.height()),
        Err(error) => return Some(error.to_string()),
    };
    let found = json!([encoding, bytes.len(), width, height]);
    let told = json!([header["encoding"], header["bytes"], header["width"], header["height"]]);
    (found != told).then(|| format!("{found}, not {told}"))
}

/// Asks for an upgrade with extra headers.
pub(crate) async fn upgrade(
    server: &Process,
    scene: &str,
    headers: &[(&'static str, String)],
) -> Result<(Socket, Response), Error> {
    let url = format!("ws://{}/v1/scenes/{scene}/stream", server.address);
    let mut request = url.into_client_request().expect("the address is right");
    for (name, value) in headers {
        request.headers_mut().insert(*name, value.parse().expect("a header's value"));
    }
    timeout(PATIENCE, connect_async(request)).await.expect("upgrades are quick")
}

/// Hello with everything at its default, in small pictures.
pub(crate) fn hello() -> Value {
    json!({ "type": "hello", "protocol": 1, "encodings": ["png"], "width": 64, "height": 48 })
}

pub(crate) struct Client {
    pub(crate) socket: Socket,
    pub(crate) welcome: Value,
    pub(crate) seq: u64,
    /// Whether pictures are acknowledged as they come.
    pub(crate) acks: bool,
}

impl Client {
    /// A connection on which nothing was said.
    pub(crate) async fn silent(server: &Process, scene: &str) -> Self {
        let (socket, _) = upgrade(server, scene, &[]).await.expect("the upgrade is granted");
        Self { socket, welcome: Value::Null, seq: 0, acks: true }
    }

    /// A connection after hello and welcome.
    pub(crate) async fn connect(server: &Process, scene: &str, hello: &Value) -> Self {
        let mut client = Self::silent(server, scene).await;
        client.say(hello).await;
        match client.next().await {
            Said::Text(welcome) if welcome["type"] == "welcome" => client.welcome = welcome,
            other => panic!("{other:?} instead of a welcome"),
        }
        client
    }

    pub(crate) async fn say(&mut self, message: &Value) {
        self.say_text(&message.to_string()).await;
    }

    pub(crate) async fn say_text(&mut self, text: &str) {
        self.socket.send(Message::text(text)).await.expect("the server listens");
    }

    /// Sends an update under the next number.
    pub(crate) async fn update(&mut self, change: Value) {
        self.seq += 1;
        let message = numbered(self.seq, change);
        self.say(&message).await;
    }

    /// Waits until the server has heard everything so far: the answer to nonsense comes after all else.
    pub(crate) async fn heard(&mut self) {
        self.say_text("nonsense").await;
        assert_eq!(self.next_text().await["code"], "malformed");
    }

    /// What comes next; pictures are checked and acknowledged.
    pub(crate) async fn next(&mut self) -> Said {
        let said = timeout(PATIENCE, receive(&mut self.socket)).await.expect("the server says something");
        if let Said::Frame(frame) = &said
            && self.acks
        {
            let _ = self.socket.send(ack(frame)).await;
        }
        said
    }

    /// The next message that is no picture.
    pub(crate) async fn next_text(&mut self) -> Value {
        loop {
            match self.next().await {
                Said::Frame(_) => {}
                Said::Text(text) => return text,
                end => panic!("{end:?}"),
            }
        }
    }

    /// Everything up to the final picture of the last update.
    pub(crate) async fn settle(&mut self) -> (Vec<Frame>, Vec<Value>) {
        let (mut frames, mut texts) = (Vec::new(), Vec::new());
        loop {
            match self.next().await {
                Said::Frame(frame) => {
                    let done = frame.is_final() && frame.number("seq") == self.seq;
                    frames.push(frame);
                    if done {
                        return (frames, texts);
                    }
                }
                Said::Text(text) => texts.push(text),
                end => panic!("{end:?}"),
            }
        }
    }

    /// The final picture of the last update.
    pub(crate) async fn last_frame(&mut self) -> Frame {
        self.settle().await.0.pop().expect("there is one at the end")
    }

    /// Everything that comes within a time.
    pub(crate) async fn listen(&mut self, time: Duration) -> (Vec<Frame>, Vec<Value>) {
        let (mut frames, mut texts) = (Vec::new(), Vec::new());
        let until = Instant::now() + time;
        // A picture that has begun is waited for: only the time between messages is cut.
        while let Ok(Some(message)) = tokio::time::timeout_at(until, self.socket.next()).await {
            match complete(message, &mut self.socket).await {
                Said::Frame(frame) => {
                    if self.acks {
                        self.socket.send(ack(&frame)).await.expect("the server listens");
                    }
                    frames.push(frame);
                }
                Said::Text(text) => texts.push(text),
                end => panic!("{end:?}"),
            }
        }
        (frames, texts)
    }

    /// Everything said up to the orderly end.
    pub(crate) async fn until_closed(&mut self) -> Vec<Value> {
        let mut texts = Vec::new();
        loop {
            match self.next().await {
                Said::Frame(_) => {}
                Said::Text(text) => texts.push(text),
                Said::Closed => return texts,
                Said::Cut => panic!("cut off after {texts:?}"),
            }
        }
    }
}

/// An update's message.
pub(crate) fn numbered(seq: u64, mut change: Value) -> Value {
    change["type"] = "update".into();
    change["seq"] = seq.into();
    change
}

pub(crate) fn ack(frame: &Frame) -> Message {
    Message::text(json!({ "type": "ack", "frame": frame.header["frame"] }).to_string())
}

/// Reads one message, a picture with its header.
pub(crate) async fn receive(stream: &mut (impl StreamExt<Item = Result<Message, Error>> + Unpin)) -> Said {
    match stream.next().await {
        Some(message) => complete(message, stream).await,
        None => Said::Closed,
    }
}

async fn complete(
    message: Result<Message, Error>,
    stream: &mut (impl StreamExt<Item = Result<Message, Error>> + Unpin),
) -> Said {
    match message {
        Ok(Message::Text(text)) => {
            let header: Value = serde_json::from_str(&text).expect("texts are JSON");
            if header["type"] != "frame" {
                return Said::Text(header);
            }
            let next = loop {
                match stream.next().await {
                    Some(Ok(Message::Ping(_) | Message::Pong(_))) => {}
                    other => break other,
                }
            };
            let bytes = match next {
                Some(Ok(Message::Binary(bytes))) => bytes.to_vec(),
                other => panic!("{other:?} instead of a picture"),
            };
            assert_eq!(frame_fault(&header, &bytes), None);
            Said::Frame(Frame { header, bytes })
        }
        Ok(Message::Binary(_)) => panic!("a picture without a header"),
        Ok(Message::Close(_)) => Said::Closed,
        Ok(_) => Box::pin(receive(stream)).await,
        Err(Error::ConnectionClosed) => Said::Closed,
        Err(_) => Said::Cut,
    }
}
