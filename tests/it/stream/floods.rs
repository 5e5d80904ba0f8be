//! Clients that do not read, vanish, or say far too much.

use std::time::Duration;

use futures_util::{SinkExt, StreamExt};
use serde_json::{Value, json};
use tokio::time::{Instant, sleep_until};
use tokio_tungstenite::tungstenite::Message;

use super::client::{Client, Said, ack, hello, numbered, receive};
use super::{SCENE, small, turned};

/// Memory that clients who misbehave may cost: their outboxes, some pictures, and what the allocator keeps of
/// what was freed. Without bounds it would be the sum of all messages and pictures, several times as much.
const BOUND: u64 = 64 << 20;

/// A patch of some 40 kB.
fn large_patch(step: u64) -> Value {
    let points: Vec<Value> = (0..600)
        .map(|i| json!({ "value": i, "color": format!("#{:06x}", (step * 7919 + i) & 0xff_ffff), "opacity": 0.5 }))
        .collect();
    json!({ "transfer_function": { "points": points } })
}

#[tokio::test]
async fn clients_that_never_read_or_never_acknowledge_cost_a_bounded_amount_of_memory() {
    let server = small();
    let mut busy = Client::connect(&server, "default", &hello()).await;
    busy.update(json!({ "scene": large_patch(0) })).await;
    busy.settle().await;
    let mut greedy = hello();
    (greedy["max_in_flight"], greedy["width"], greedy["height"]) = (json!(8), json!(256), json!(192));
    let mut deaf = Vec::new();
    for _ in 0..3 {
        let mut client = Client::silent(&server, "default").await;
        client.say(&greedy).await;
        deaf.push(client);
    }
    let mut ungrateful = Client::connect(&server, "default", &greedy).await;
    ungrateful.acks = false;
    let listening = tokio::spawn(async move {
        let mut frames = 0;
        loop {
            match ungrateful.next().await {
                Said::Frame(_) => frames += 1,
                Said::Text(text) if text["type"] == "goodbye" => return frames,
                Said::Text(_) => {}
                end => panic!("{end:?}"),
            }
        }
    });
    let before = server.resident_bytes();
    let mut most = before;
    for step in 1..=1000 {
        busy.update(json!({ "scene": large_patch(step) })).await;
        if step % 20 == 0 {
            busy.listen(Duration::from_millis(1)).await;
            most = most.max(server.resident_bytes());
        }
    }
    assert_eq!(busy.last_frame().await.number("seq"), 1001);
    most = most.max(server.resident_bytes());
    assert!(most < before + BOUND, "{} MiB more", (most - before) >> 20);
    server.stop_clean();
    assert_eq!(listening.await.expect("it ends"), 8);
}

#[tokio::test]
async fn pictures_leave_nothing_behind() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let camera = client.welcome["view"]["camera"].clone();
    let mut first = 0;
    for step in 0..330 {
        client.update(json!({ "view": turned(&camera, f64::from(step)) })).await;
        while !matches!(client.next().await, Said::Frame(_)) {}
        if step == 30 {
            first = server.resident_bytes();
        }
    }
    // A tenth of a MiB for each picture would be found; it would be gigabytes in an hour.
    let more = server.resident_bytes().saturating_sub(first);
    assert!(more < 24 << 20, "{} MiB more after 300 pictures", more >> 20);
    server.stop_clean();
}

#[tokio::test]
async fn clients_that_vanish_during_a_picture_cost_nothing() {
    let server = small();
    let mut large = hello();
    (large["width"], large["height"]) = (json!(600), json!(400));
    for _ in 0..20 {
        let mut client = Client::connect(&server, "default", &large).await;
        client.update(json!({ "view": { "width": 599 } })).await;
        drop(client);
    }
    drop(Client::silent(&server, "default").await);
    let mut client = Client::connect(&server, "default", &hello()).await;
    client.settle().await;
    assert_eq!(server.get("/livez"), br#"{"status":"alive"}"#);
    server.stop_clean();
}

/// Says 100 things every 10 ms for two seconds and reads what comes; the last number and the pictures.
async fn flood(client: Client, message: impl Fn(u64) -> String + Send + 'static) -> (u64, Vec<Value>) {
    let (mut sink, mut stream) = client.socket.split();
    let (acks, mut to_ack) = tokio::sync::mpsc::unbounded_channel();
    let writer = tokio::spawn(async move {
        let start = Instant::now();
        let mut seq = 0;
        for batch in 1..=200 {
            for _ in 0..100 {
                seq += 1;
                sink.feed(Message::text(message(seq))).await.expect("the server listens");
            }
            while let Ok(ack) = to_ack.try_recv() {
                sink.feed(ack).await.expect("the server listens");
            }
            sink.flush().await.expect("the server listens");
            sleep_until(start + batch * Duration::from_millis(10)).await;
        }
        while let Some(ack) = to_ack.recv().await {
            sink.send(ack).await.expect("the server listens");
        }
        seq
    });
    let mut headers = Vec::new();
    // The last picture, or, where there are only errors, the last of these.
    let mut answers = 0;
    loop {
        match receive(&mut stream).await {
            Said::Frame(frame) => {
                acks.send(ack(&frame)).expect("the writer lives");
                headers.push(frame.header);
            }
            Said::Text(text) => {
                assert_eq!((&text["type"], &text["code"]), (&json!("error"), &json!("malformed")));
                answers += 1;
            }
            end => panic!("{end:?}"),
        }
        let last_seen = headers.last().is_some_and(|h| h["phase"] == "final" && h["seq"] == 20_000);
        if last_seen || answers == 20_000 {
            drop(acks);
            return (writer.await.expect("it ends"), headers);
        }
    }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn floods_of_garbage_and_of_updates_leave_others_served() {
    let server = small();
    let mut other = Client::connect(&server, "default", &hello()).await;
    other.settle().await;
    let before = server.resident_bytes();
    let garbage = Client::connect(&server, "default", &hello()).await;
    let garbage = tokio::spawn(flood(garbage, |seq| format!("{{garbage {seq}")));
    let updates = Client::connect(&server, "default", &hello()).await;
    let camera = updates.welcome["view"]["camera"].clone();
    let updates = tokio::spawn(flood(updates, move |seq| {
        numbered(seq, json!({ "view": turned(&camera, seq as f64 * 0.01) })).to_string()
    }));
    let mut most = 0;
    let camera = other.welcome["view"]["camera"].clone();
    for step in 1..=5 {
        other.update(json!({ "view": turned(&camera, f64::from(step)) })).await;
        assert_eq!(other.last_frame().await.number("seq"), other.seq);
        most = most.max(server.resident_bytes());
    }
    let (seq, headers) = updates.await.expect("it ends");
    assert_eq!(seq, 20_000);
    let seen = |header: &Value| header["seq"].as_u64();
    assert!(headers.is_sorted_by_key(seen) && headers.len() < 1000, "{} pictures", headers.len());
    garbage.await.expect("it ends");
    most = most.max(server.resident_bytes());
    assert!(most < before + BOUND, "{} MiB more", (most - before) >> 20);
    assert_eq!(server.get_json(SCENE)["revision"], 1);
    server.stop_clean();
}
