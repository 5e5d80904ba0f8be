//! Latest wins, and nobody pays for somebody else's slowness.

use std::time::Duration;

use futures_util::SinkExt;
use serde_json::{Value, json};
use tokio::time::{Instant, sleep};
use tokio_tungstenite::tungstenite::Message;

use super::client::{Client, Said, ack, hello, numbered, pixels};
use super::{HEAD, SCENE, small, turned};
use crate::support::process::Process;

#[tokio::test]
async fn two_hundred_updates_during_a_picture_cost_at_most_three_pictures() {
    let server = Process::start(&["--volume", HEAD]);
    let hello = json!({ "type": "hello", "protocol": 1, "encodings": ["jpeg"], "width": 800, "height": 600 });
    let mut client = Client::connect(&server, "default", &hello).await;
    client.settle().await;
    let camera = client.welcome["scene"]["camera"].clone();
    for seq in 1..=200 {
        let message = numbered(seq, json!({ "scene": turned(&camera, seq as f64 * 0.4) }));
        client.socket.feed(Message::text(message.to_string())).await.expect("the server listens");
    }
    client.socket.flush().await.expect("the server listens");
    client.seq = 200;
    let (frames, _) = client.settle().await;
    let headers: Vec<&Value> = frames.iter().map(|frame| &frame.header).collect();
    assert!(frames.len() <= 3, "{headers:?}");
    let last = &frames[frames.len() - 1];
    assert_eq!((last.number("seq"), &last.header["exact"]), (200, &json!(true)));
    let (drawn, dropped) = (frames.len() as u64 - 1, frames.iter().map(|frame| frame.number("dropped")).sum::<u64>());
    assert_eq!(drawn + dropped, 200, "every update is seen or counted: {headers:?}");
    let single = |width: u32| pixels(&server.get(&format!("{SCENE}/frame?width={width}&height=600")));
    assert_eq!(last.pixels(), single(800));
    assert_ne!(last.pixels(), single(801));
    server.stop_clean();
}

/// Moves the scene's camera for a while; how many pictures came.
async fn drag(client: &mut Client, camera: &Value, time: Duration) -> usize {
    let until = Instant::now() + time;
    let mut frames = 0;
    while Instant::now() < until {
        let angle = client.seq as f64 * 0.7;
        client.update(json!({ "scene": turned(camera, angle) })).await;
        frames += client.listen(Duration::from_millis(10)).await.0.len();
    }
    frames
}

#[tokio::test]
async fn a_slow_client_does_not_slow_a_fast_one_and_both_end_with_the_right_picture() {
    let server = small();
    let mut fast = Client::connect(&server, "default", &hello()).await;
    let camera = fast.welcome["scene"]["camera"].clone();
    fast.settle().await;
    let alone = drag(&mut fast, &camera, Duration::from_secs(2)).await;

    let mut slow = Client::connect(&server, "default", &hello()).await;
    slow.acks = false;
    let (stop, mut stopped) = tokio::sync::watch::channel(0);
    let slow = tokio::spawn(async move {
        let mut count = 0;
        loop {
            let Said::Frame(frame) = slow.next().await else { continue };
            count += 1;
            if frame.is_final() && frame.number("scene_revision") == *stopped.borrow_and_update() {
                return (frame, count);
            }
            sleep(Duration::from_secs(1)).await;
            slow.socket.send(ack(&frame)).await.expect("the server listens");
        }
    });
    let together = drag(&mut fast, &camera, Duration::from_secs(2)).await;
    let last = fast.last_frame().await;
    stop.send_replace(last.number("scene_revision"));
    assert!(together * 3 >= alone && alone > 4, "{together} pictures instead of {alone}");
    let (slow_last, slow_count) = slow.await.expect("it ends");
    assert!(slow_count < together, "{slow_count} pictures at one a second");
    let now = pixels(&server.get(&format!("{SCENE}/frame?width=64&height=48")));
    assert_eq!(last.pixels(), now);
    assert_eq!(slow_last.pixels(), now);
    server.stop_clean();
}

#[tokio::test]
async fn no_more_pictures_are_on_their_way_than_agreed() {
    let server = small();
    for agreed in [1, 3] {
        let mut hello = hello();
        hello["max_in_flight"] = json!(agreed);
        let mut client = Client::connect(&server, "default", &hello).await;
        client.acks = false;
        let camera = client.welcome["view"]["camera"].clone();
        let mut frames = Vec::new();
        for step in 1..=20 {
            client.update(json!({ "view": turned(&camera, f64::from(step)) })).await;
            frames.extend(client.listen(Duration::from_millis(40)).await.0);
        }
        assert_eq!(frames.len(), agreed);
        // One acknowledgement covers all pictures before it.
        client.say(&json!({ "type": "ack", "frame": agreed })).await;
        client.acks = true;
        assert_eq!(client.last_frame().await.number("seq"), 20);
    }
    server.stop_clean();
}
