//! Ambient occlusion: computed when opacities change, and only then.

use std::time::Duration;

use serde_json::{Value, json};

use super::client::{Client, Frame, hello};
use super::{HEAD, turned};
use crate::support::process::Process;

/// Whether no work went into the accessibility of a picture.
fn without_work(frame: &Frame, version: &Value) -> bool {
    let ao = &frame.header["ao"];
    let timings = &frame.header["timings_ms"];
    ["cached", "none"].contains(&ao["update"].as_str().unwrap_or_default())
        && ao["version"] == *version
        && ao["ms"] == 0.0
        && timings["ao"] == 0.0
        && ao["bricks_recomputed"] == 0
}

#[tokio::test]
async fn a_camera_move_or_a_change_of_color_costs_no_ambient_occlusion() {
    let server = Process::start(&["--volume", HEAD]);
    let mut client = Client::connect(&server, "default", &hello()).await;
    let first = client.last_frame().await;
    client.listen(Duration::from_millis(300)).await;
    let version = first.header["ao"]["version"].clone();
    assert_ne!(version, 0);
    let scene = client.welcome["scene"].clone();
    for (part, turn) in [("view", 5.0), ("scene", 9.0)] {
        for step in 1..=10 {
            client.update(json!({ part: turned(&scene["camera"], f64::from(step) * turn) })).await;
            client.listen(Duration::from_millis(20)).await.0.iter().for_each(|frame| {
                assert!(without_work(frame, &version), "{}", frame.header);
            });
        }
    }
    let mut points = scene["transfer_function"]["points"].clone();
    for point in points.as_array_mut().expect("points") {
        point["color"] = json!("#3366cc");
    }
    client.update(json!({ "scene": { "transfer_function": { "points": points } } })).await;
    let (frames, texts) = client.settle().await;
    for frame in &frames {
        assert!(without_work(frame, &version), "{}", frame.header);
    }
    let last = &frames[frames.len() - 1];
    assert_eq!((&last.header["ao"]["state"], &last.header["exact"]), (&json!("exact"), &json!(true)));
    assert_eq!(texts, Vec::<Value>::new(), "no progress without work");
    assert!(!without_work(last, &json!(0)));
    server.stop_clean();
}

#[tokio::test]
async fn a_change_of_opacity_is_seen_at_once_and_refined() {
    let server = Process::start(&["--volume", HEAD]);
    let mut client = Client::connect(&server, "default", &hello()).await;
    let version = client.last_frame().await.header["ao"]["version"].as_u64().expect("a number");
    // The last word on the progress of the first accessibility may come after the picture that shows it.
    client.listen(Duration::from_millis(300)).await;
    let mut points = client.welcome["scene"]["transfer_function"]["points"].clone();
    for point in points.as_array_mut().expect("points") {
        point["opacity"] = json!(point["opacity"].as_f64().expect("a number") * 0.5);
    }
    client.update(json!({ "scene": { "transfer_function": { "points": points } } })).await;
    let (frames, texts) = client.settle().await;
    let (first, last) = (&frames[0].header, &frames[frames.len() - 1].header);
    assert_eq!((&first["exact"], &first["ao"]["state"]), (&json!(false), &json!("refining")), "{first}");
    assert_eq!(first["ao"]["version"], version, "the earlier accessibility serves until then");
    assert_eq!((&last["exact"], &last["ao"]["state"]), (&json!(true), &json!("exact")), "{last}");
    assert!(last["ao"]["version"].as_u64() > Some(version), "{last}");
    let told: Vec<_> = frames.iter().map(|f| &f.header["ao"]).filter(|ao| ao["update"] != "cached").collect();
    let [told] = told[..] else { panic!("the work is told once: {told:?}") };
    assert_eq!((&told["update"], &told["version"]), (&json!("incremental"), &last["ao"]["version"]), "{told}");
    let count = |name: &str| told[name].as_u64().filter(|&n| n > 0 && n <= told["bricks"].as_u64().unwrap_or(0));
    assert!(count("bricks_classified").is_some() && count("bricks_recomputed").is_some(), "{told}");
    assert!(told["ms"].as_f64() > Some(0.0), "{told}");
    let fractions: Vec<f64> = texts.iter().filter_map(|text| text["fraction"].as_f64()).collect();
    assert!(!fractions.is_empty() && fractions.len() == texts.len(), "{texts:?}");
    assert!(fractions.is_sorted() && fractions.iter().all(|f| (0.0..=1.0).contains(f)), "{fractions:?}");
    assert!(texts.iter().all(|text| text["what"] == "ambient_occlusion"), "{texts:?}");
    server.stop_clean();
}

#[tokio::test]
async fn a_volume_that_had_made_room_comes_back_with_progress() {
    let server = Process::start(&["--gpu-memory", "140M"]);
    let volume = |kind: &str| {
        let source = json!({ "source": { "procedural": { "kind": kind, "dims": [256, 256, 256] } } });
        server.post("/v1/volumes?reduce=never", &source)["id"].clone()
    };
    let first = volume("gyroid");
    let scene = server.post("/v1/scenes", &json!({ "volume": first, "ambient_occlusion": { "method": "off" } }));
    volume("boxes");
    let path = format!("/v1/volumes/{}", first.as_str().expect("an id"));
    assert_eq!(server.get_json(&path)["state"], "evicted");
    let mut client = Client::connect(&server, scene["id"].as_str().expect("an id"), &hello()).await;
    let (frames, texts) = client.settle().await;
    assert!(frames.last().is_some_and(Frame::is_final));
    assert_eq!(server.get_json(&path)["state"], "resident");
    assert!(texts.iter().all(|text| text["type"] == "progress" && text["what"] == "volume"), "{texts:?}");
    let told: Vec<f64> = texts.iter().filter_map(|text| text["fraction"].as_f64()).collect();
    // A card may be faster than the first look.
    if server.get_json("/v1/server")["software"] == true {
        assert!(told.len() > 1, "{told:?}");
    }
    assert!(told.is_sorted() && told.last().is_none_or(|&last| last == 1.0), "{told:?}");
    server.stop_clean();
}
