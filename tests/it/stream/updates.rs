//! Updates: what they change, who hears of them, and what undo takes back.

use std::time::{Duration, Instant};

use serde_json::{Value, json};

use super::client::{Client, hello, numbered};
use super::{SCENE, small, turned};

/// Seconds after which a change is no longer part of the gesture before it.
const SAME_GESTURE: f64 = 0.7;

/// A document after a merge patch.
fn merged(document: &Value, patch: &Value) -> Value {
    let mut merged = document.clone();
    json_patch::merge(&mut merged, patch);
    merged
}

#[tokio::test]
async fn what_one_client_changes_the_others_are_told_and_it_is_not() {
    let server = small();
    let mut one = Client::connect(&server, "default", &hello()).await;
    let mut other = Client::connect(&server, "default", &hello()).await;
    one.settle().await;
    other.settle().await;
    one.update(json!({ "scene": { "lighting": { "ambient": 0.25 }, "rendering": { "background": "#123456" } } })).await;
    let told = other.next_text().await;
    let now = server.get_json(SCENE);
    assert_eq!((&told["type"], &told["revision"]), (&json!("scene"), &now["revision"]));
    let changes = json!({ "lighting": { "ambient": 0.25 }, "rendering": { "background": "#123456" } });
    assert_eq!(told["patch"], changes);
    let mut known = merged(&other.welcome["scene"], &told["patch"]);
    known["revision"] = told["revision"].clone();
    assert_eq!(known, now);
    let (frames, texts) = one.settle().await;
    assert_eq!(texts, Vec::<Value>::new(), "nobody is told what he said");
    assert_eq!(frames[frames.len() - 1].header["scene_revision"], now["revision"]);

    // Over HTTP nobody in particular changes it: all are told.
    let patched = server.patch(SCENE, &json!({ "transfer_function": { "points": now["transfer_function"]["points"].as_array().expect("points")[..2] } }));
    for client in [&mut one, &mut other] {
        let told = client.next_text().await;
        let mut known = merged(&now, &told["patch"]);
        known["revision"] = told["revision"].clone();
        assert_eq!(known, patched);
        assert_ne!(merged(&now, &json!({})), patched);
    }
    server.stop_clean();
}

#[tokio::test]
async fn an_invalid_update_is_answered_with_its_number_and_changes_nothing() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let before = client.last_frame().await;
    let scene = server.get_json(SCENE);
    let good = json!({ "lighting": { "ambient": 0.1 } });
    let table = [
        (json!({ "scene": { "camera": { "fov_y_deg": 0 } } }), "scene.camera.fov_y_deg"),
        (json!({ "scene": { "colour": 1 } }), "scene.colour"),
        (json!({ "scene": 7 }), "scene"),
        (json!({ "scene": { "volume": "v_none" } }), "scene.volume"),
        (json!({ "scene": good, "view": { "camera": { "fov_y_deg": 500 } } }), "view.camera.fov_y_deg"),
        (json!({ "scene": good, "view": { "width": 0 } }), "view.width"),
        (json!({ "scene": good, "view": { "height": 100_000 } }), "view.height"),
        (json!({ "scene": good, "view": { "zoom": 1 } }), "view.zoom"),
        (json!({ "scene": good, "view": 3 }), "view"),
        (json!({ "scene": { "lighting": { "ambient": -1 } }, "view": { "width": 32 } }), "scene.lighting.ambient"),
    ];
    for (index, (change, path)) in table.into_iter().enumerate() {
        let seq = index as u64 + 10;
        client.say(&numbered(seq, change.clone())).await;
        let error = client.next_text().await;
        assert_eq!((&error["type"], &error["seq"]), (&json!("error"), &json!(seq)), "{change}: {error}");
        assert_eq!(error["details"]["path"], path, "{error}");
    }
    assert_eq!(server.get_json(SCENE), scene);
    client.say(&json!({ "type": "refresh" })).await;
    let after = client.last_frame().await;
    assert_eq!(after.pixels(), before.pixels());
    // Nothing was applied, so the numbers are free.
    client.update(json!({ "scene": good, "view": { "width": 32 } })).await;
    assert_eq!(client.last_frame().await.number("width"), 32);
    assert_eq!(server.get_json(SCENE)["lighting"]["ambient"], 0.1);
    for seq in [1, 0] {
        client.say(&numbered(seq, json!({ "view": { "width": 64 } }))).await;
        let error = client.next_text().await;
        assert_eq!((&error["seq"], &error["details"]["path"]), (&json!(seq), &json!("seq")), "{error}");
    }
    server.stop_clean();
}

#[tokio::test]
async fn a_drag_is_one_step_of_undo() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let start = client.welcome["scene"].clone();
    let content = |scene: &Value| merged(scene, &json!({ "revision": null }));
    let begin = Instant::now();
    for step in 1..=50 {
        client.update(json!({ "scene": turned(&start["camera"], f64::from(step)) })).await;
    }
    client.settle().await;
    let pauses = (begin.elapsed().as_secs_f64() / SAME_GESTURE) as usize;
    let dragged = server.get_json(SCENE);
    assert_eq!(dragged["revision"], 51);
    // One step, unless the machine was so busy that the drag paused between two updates.
    let mut steps = 1;
    while content(&server.post(&format!("{SCENE}/undo"), &json!({}))) != content(&start) {
        steps += 1;
        assert!(steps <= 1 + pauses, "{steps} steps of a drag with at most {pauses} pauses");
    }
    assert!(ureq::post(server.url(&format!("{SCENE}/undo"))).send("{}").is_err(), "it was the only step");
    let redo = || server.post(&format!("{SCENE}/redo"), &json!({}));
    let redone = (1..steps).fold(redo(), |_, _| redo());
    assert_eq!(content(&redone), content(&dragged));

    server.stop_clean();
}

#[tokio::test]
async fn a_change_by_others_ends_the_gesture_and_one_that_changes_nothing_begins_none() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let ambient = |value: f64| json!({ "lighting": { "ambient": value } });
    let undone = || server.post(&format!("{SCENE}/undo"), &json!({}))["lighting"]["ambient"].clone();
    // Several times, as the client may hear of the change before it sends its own, or after.
    for round in 1..=8 {
        let (before, others) = (f64::from(round) / 64.0, f64::from(round) / 32.0);
        client.update(json!({ "scene": ambient(before) })).await;
        client.settle().await;
        server.patch(SCENE, &ambient(others));
        client.update(json!({ "scene": ambient(others) })).await;
        client.update(json!({ "scene": ambient(0.75) })).await;
        client.settle().await;
        assert_eq!([undone(), undone()], [others, before]);
    }
    server.stop_clean();
}

#[tokio::test]
async fn changes_with_a_pause_between_them_are_steps_of_their_own() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    for ambient in [0.1, 0.2] {
        client.update(json!({ "scene": { "lighting": { "ambient": ambient } } })).await;
        client.settle().await;
        client.listen(Duration::from_millis(900)).await;
    }
    assert_eq!(server.post(&format!("{SCENE}/undo"), &json!({}))["lighting"]["ambient"], 0.1);
}
