//! Views: a camera and a size of each connection's own.

use std::time::Duration;

use serde_json::{Value, json};

use super::client::{Client, hello, pixels};
use super::{SCENE, small, turned};
use crate::support::process::Process;

/// Hello of a client that comes back.
fn hello_again(token: &Value) -> Value {
    json!({ "type": "hello", "protocol": 1, "resume": token })
}

#[tokio::test]
async fn two_clients_see_one_scene_from_two_sides() {
    let server = small();
    let mut one = Client::connect(&server, "default", &hello()).await;
    let mut other = Client::connect(&server, "default", &hello()).await;
    let scene = one.welcome["scene"].clone();
    other.settle().await;
    let patch = turned(&scene["camera"], 70.0);
    one.update(json!({ "view": patch })).await;
    let (mine, theirs) = (one.last_frame().await, server.get(&format!("{SCENE}/frame?width=64&height=48")));
    assert_ne!(mine.pixels(), pixels(&theirs));
    assert_eq!(server.get_json(SCENE), scene, "a view is nobody else's");
    let mut document = scene.clone();
    json_patch::merge(&mut document, &patch);
    json_patch::merge(&mut document, &json!({ "id": null, "revision": null }));
    let body = json!({ "scene": document, "width": 64, "height": 48 });
    let request = ureq::post(server.url("/v1/render")).header("content-type", "application/json");
    let mut answer = request.send(body.to_string()).expect("the scene is right");
    assert_eq!(mine.pixels(), pixels(&answer.body_mut().read_to_vec().expect("a picture")));
    let (frames, texts) = other.listen(Duration::from_millis(100)).await;
    assert_eq!((frames.len(), texts.len()), (0, 0), "the other one neither sees nor hears of it");

    one.update(json!({ "view": { "camera": null } })).await;
    assert_eq!(one.last_frame().await.pixels(), pixels(&theirs));
    // A patch of the scene's camera moves whoever has none of their own.
    other.update(json!({ "scene": patch })).await;
    assert_eq!(other.last_frame().await.pixels(), mine.pixels());
    server.stop_clean();
}

#[tokio::test]
async fn a_client_that_comes_back_finds_its_view_once() {
    let server = Process::start(&["--volume", "procedural:gyroid:24", "--volume", "procedural:boxes:8"]);
    let scenes = server.get_json("/v1/scenes");
    let second = scenes["scenes"][1]["id"].as_str().expect("an id").to_owned();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let mut patch = turned(&client.welcome["view"]["camera"], 30.0);
    patch["width"] = json!(40);
    client.update(json!({ "view": patch })).await;
    let seen = client.last_frame().await;
    let token = client.welcome["resume_token"].clone();
    // The line breaks, and the server has not noticed: the first client is still there.
    let elsewhere = Client::connect(&server, &second, &hello_again(&token)).await;
    assert_ne!(elsewhere.welcome["view"]["width"], 40, "a token is for one scene");
    let mut back = Client::connect(&server, "default", &hello_again(&token)).await;
    assert_eq!(back.welcome["view"]["camera"]["eye"], patch["camera"]["eye"]);
    assert_eq!((&back.welcome["view"]["width"], &back.welcome["view"]["height"]), (&json!(40), &json!(48)));
    assert_eq!(back.last_frame().await.pixels(), seen.pixels());
    drop(client);
    let third = Client::connect(&server, "default", &hello_again(&token)).await;
    assert_ne!(third.welcome["view"]["width"], 40, "a token is used up");

    // After an orderly end too, and hello's own size comes first.
    let token = back.welcome["resume_token"].clone();
    back.socket.close(None).await.expect("the server answers");
    back.until_closed().await;
    let mut hello = hello_again(&token);
    hello["width"] = json!(50);
    let back = Client::connect(&server, "default", &hello).await;
    assert_eq!(back.welcome["view"]["camera"]["eye"], patch["camera"]["eye"]);
    assert_eq!((&back.welcome["view"]["width"], &back.welcome["view"]["height"]), (&json!(50), &json!(48)));
    server.stop_clean();
}

#[tokio::test]
async fn a_hidden_client_gets_no_pictures_until_it_is_seen() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    client.settle().await;
    client.say(&json!({ "type": "visibility", "visible": false })).await;
    let camera = client.welcome["view"]["camera"].clone();
    for step in 1..=5 {
        client.update(json!({ "view": turned(&camera, f64::from(step)) })).await;
    }
    client.heard().await;
    server.patch(SCENE, &json!({ "lighting": { "ambient": 0.2 } }));
    let (frames, texts) = client.listen(Duration::from_millis(700)).await;
    assert!(frames.is_empty(), "{}", frames[0].header);
    assert_eq!(texts.len(), 1, "changes are told all the same: {texts:?}");
    client.say(&json!({ "type": "visibility", "visible": true })).await;
    let last = client.last_frame().await;
    assert_eq!((last.number("seq"), last.number("scene_revision")), (5, 2));
    server.stop_clean();
}

#[tokio::test]
async fn refresh_sends_a_picture_now() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let first = client.last_frame().await;
    assert_eq!(client.listen(Duration::from_millis(400)).await.0.len(), 0, "at rest nothing is sent");
    client.say(&json!({ "type": "refresh" })).await;
    assert_eq!(client.last_frame().await.pixels(), first.pixels());
}
