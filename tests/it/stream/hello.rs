//! The first messages, and messages that are not understood.

use std::time::Duration;

use futures_util::SinkExt;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Message;

use super::client::{Client, Said, frame_fault, hello};
use super::{SCENE, small};

/// The fields of an object, in order.
fn names(value: &Value) -> Vec<&str> {
    let mut names: Vec<&str> = value.as_object().expect("an object").keys().map(String::as_str).collect();
    names.sort_unstable();
    names
}

#[tokio::test]
async fn welcome_tells_the_scene_the_view_and_the_server() {
    let server = small();
    let client = Client::connect(&server, "default", &hello()).await;
    let welcome = &client.welcome;
    let fields = ["max_in_flight", "protocol", "resume_token", "revision", "scene", "server", "type", "view"];
    assert_eq!(names(welcome), fields);
    let scene = server.get_json(SCENE);
    assert_eq!(welcome["scene"], scene);
    assert_eq!((&welcome["protocol"], &welcome["revision"]), (&json!(1), &scene["revision"]));
    assert_eq!(welcome["view"], json!({ "camera": scene["camera"], "width": 64, "height": 48 }));
    assert_eq!(names(&welcome["server"]), ["adapter", "software", "version"]);
    assert_eq!(welcome["max_in_flight"], 2);
    assert!(welcome["resume_token"].as_str().is_some_and(|token| token.len() >= 32), "{welcome}");

    let bare = Client::connect(&server, "default", &json!({ "type": "hello", "protocol": 1 })).await;
    assert_eq!(bare.welcome["view"]["width"], scene["viewport"]["width"]);
    assert_ne!(bare.welcome["resume_token"], welcome["resume_token"]);
    let greedy = json!({ "type": "hello", "protocol": 1, "max_in_flight": 1000 });
    assert_eq!(Client::connect(&server, "default", &greedy).await.welcome["max_in_flight"], 8);
}

#[tokio::test]
async fn pictures_come_small_and_fast_first_and_exact_in_the_end() {
    let server = small();
    let hello = json!({ "type": "hello", "protocol": 1, "encodings": ["tiff", "jpeg"], "width": 100, "height": 70 });
    let mut client = Client::connect(&server, "default", &hello).await;
    let (frames, _) = client.settle().await;
    let (first, last) = (&frames[0].header, &frames[frames.len() - 1].header);
    let fields = [
        "ao",
        "bytes",
        "dropped",
        "encoding",
        "exact",
        "frame",
        "height",
        "phase",
        "scene_revision",
        "seq",
        "timings_ms",
        "type",
        "width",
    ];
    for header in [first, last] {
        assert_eq!(names(header), fields);
        let ao = ["bricks", "bricks_classified", "bricks_recomputed", "ms", "state", "update", "version"];
        assert_eq!(names(&header["ao"]), ao);
        assert_eq!(names(&header["timings_ms"]), ["ao", "encode", "queue", "raycast", "readback"]);
        assert_eq!((&header["seq"], &header["scene_revision"]), (&json!(0), &json!(1)));
    }
    assert_eq!((&first["frame"], &first["phase"]), (&json!(1), &json!("moving")));
    assert_eq!((&first["encoding"], &first["exact"]), (&json!("jpeg"), &json!(false)));
    assert_eq!((&last["phase"], &last["exact"], &last["encoding"]), (&json!("final"), &json!(true), &json!("png")));
    assert_eq!((&last["width"], &last["height"]), (&json!(100), &json!(70)));
    assert_eq!(frames.iter().map(|f| f.number("frame")).collect::<Vec<_>>(), Vec::from_iter(1..=frames.len() as u64));

    let (bytes, mut told) = (&frames[0].bytes, first.clone());
    assert_eq!(frame_fault(&told, bytes), None);
    told["width"] = json!(101);
    assert!(frame_fault(&told, bytes).is_some() && frame_fault(first, &bytes[1..]).is_some());
    server.stop_clean();
}

#[tokio::test]
async fn what_is_no_hello_gets_an_error_and_a_goodbye() {
    let server = small();
    let hello_with = |fields: Value| {
        let mut message = json!({ "type": "hello", "protocol": 1 });
        json_patch::merge(&mut message, &fields);
        Message::text(message.to_string())
    };
    let text = |text: &str| Message::text(text);
    let table = [
        (text("garbage"), "malformed", ""),
        (text("[1]"), "invalid", "$"),
        (text("{}"), "invalid", "type"),
        (text(r#"{"type": "greeting"}"#), "invalid", "type"),
        (text(r#"{"type": "hello"}"#), "invalid", "$"),
        (text(r#"{"type": "update", "seq": 1}"#), "invalid", ""),
        (text(r#"{"type": "refresh"}"#), "invalid", ""),
        (Message::binary(vec![0; 100]), "invalid", ""),
        (hello_with(json!({ "protocol": 2 })), "invalid", "protocol"),
        (hello_with(json!({ "protocol": "1" })), "invalid", "protocol"),
        (hello_with(json!({ "encodings": "png" })), "invalid", "encodings"),
        (hello_with(json!({ "colour": 1 })), "invalid", "colour"),
        (hello_with(json!({ "width": 0 })), "invalid", "width"),
        (hello_with(json!({ "height": 4097 })), "invalid", "height"),
        (hello_with(json!({ "width": -1 })), "invalid", "width"),
        (hello_with(json!({ "max_in_flight": 0 })), "invalid", "max_in_flight"),
        (hello_with(json!({ "resume": 7 })), "invalid", "resume"),
    ];
    for (message, code, path) in table {
        let mut client = Client::silent(&server, "default").await;
        client.socket.send(message.clone()).await.expect("the server listens");
        // Something unread must not cost the client the error.
        client.say_text(r#"{"type": "refresh"}"#).await;
        let said = client.until_closed().await;
        assert_eq!(said.len(), 2, "{message}: {said:?}");
        assert_eq!((&said[0]["type"], &said[0]["code"]), (&json!("error"), &json!(code)), "{message}: {said:?}");
        assert_eq!(said[0]["details"]["path"].as_str().unwrap_or_default(), path, "{message}: {said:?}");
        assert_eq!(said[1], json!({ "type": "goodbye", "reason": code }));
    }
    server.stop_clean();
}

#[tokio::test]
async fn a_client_that_never_says_hello_is_sent_away() {
    let server = small();
    let mut mute = Client::silent(&server, "default").await;
    let said = mute.until_closed().await;
    assert_eq!(said[0]["code"], "invalid");
    assert!(said[0]["message"].as_str().is_some_and(|text| text.contains("10 s")), "{said:?}");
    assert_eq!(said[1]["type"], "goodbye");
    server.stop_clean();
}

#[tokio::test]
async fn messages_that_are_not_understood_name_the_field_and_the_stream_goes_on() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    client.settle().await;
    let table = [
        ("garbage", "malformed", ""),
        ("", "malformed", ""),
        ("null", "invalid", "$"),
        (r#"{"type": 1}"#, "invalid", "type"),
        (r#"{"type": "hello", "protocol": 1}"#, "invalid", ""),
        (r#"{"type": "ack"}"#, "invalid", "$"),
        (r#"{"type": "ack", "frame": 1000}"#, "invalid", "frame"),
        (r#"{"type": "ack", "frame": -1}"#, "invalid", "frame"),
        (r#"{"type": "visibility", "visible": 1}"#, "invalid", "visible"),
        (r#"{"type": "refresh", "now": true}"#, "invalid", "now"),
        (r#"{"type": "update", "seq": "1"}"#, "invalid", "seq"),
        (r#"{"type": "update", "seq": 1, "zoom": 2}"#, "invalid", "zoom"),
    ];
    for (message, code, path) in table {
        client.say_text(message).await;
        let error = client.next_text().await;
        assert_eq!((&error["type"], &error["code"]), (&json!("error"), &json!(code)), "{message}: {error}");
        assert_eq!(error["details"]["path"].as_str().unwrap_or_default(), path, "{message}: {error}");
    }
    client.socket.send(Message::binary(vec![1, 2, 3])).await.expect("the server listens");
    assert_eq!(client.next_text().await["code"], "invalid");
    assert_eq!(client.listen(Duration::from_millis(300)).await.0.len(), 0, "nothing was to be drawn");
    client.update(json!({ "view": { "width": 32 } })).await;
    assert_eq!(client.last_frame().await.number("width"), 32);

    // Longer than any message may be.
    let long = "x".repeat(2 << 20);
    let _ = client.socket.send(Message::text(long)).await;
    loop {
        match client.next().await {
            Said::Frame(_) => {}
            Said::Text(text) => assert_eq!(text, json!({ "type": "goodbye", "reason": "malformed" })),
            Said::Closed | Said::Cut => break,
        }
    }
    server.stop_clean();
}
