//! Scenes: made, shown, changed under conditions, taken back, deleted.

use axum::body::Body;
use axum::http::Method;
use serde_json::{Value, json};

use super::{Server, request};

#[tokio::test]
async fn a_new_scene_is_complete_and_at_revision_1() {
    let server = Server::new(&[]);
    let volume = server.volume().await;
    let answer = server.post("/v1/scenes", &json!({ "volume": volume })).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    assert_eq!(answer.header("etag"), "\"1\"");
    let scene = answer.json();
    assert_eq!(scene["revision"], 1);
    assert_eq!(answer.header("location"), format!("/v1/scenes/{}", scene["id"].as_str().expect("an id")));
    for section in ["transfer_function", "camera", "ambient_occlusion", "lighting", "rendering", "viewport"] {
        assert!(scene[section].is_object(), "{section}: {scene}");
    }
    let shown = server.get(answer.header("location")).await;
    assert_eq!((shown.json(), shown.header("etag")), (scene.clone(), "\"1\""));
    assert_eq!(server.get("/v1/scenes").await.json(), json!({ "scenes": [scene] }));
}

#[tokio::test]
async fn a_scene_of_no_volume_is_refused() {
    let server = Server::new(&[]);
    let answer = server.post("/v1/scenes", &json!({ "volume": "v_none" })).await;
    assert_eq!(answer.verdict(), (404, "volume_not_found".into(), "volume".into()));
    assert_eq!(server.post("/v1/scenes", &json!({})).await.verdict(), (422, "invalid".into(), "volume".into()));
    assert_eq!(server.get("/v1/scenes").await.json(), json!({ "scenes": [] }));
}

#[tokio::test]
async fn a_patch_changes_what_it_names_and_null_restores_the_default() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let before = server.get(&scene).await.json();
    let answer = server
        .patch(&scene, &json!({ "lighting": { "ambient": 0.25 }, "rendering": { "background": "#102030" } }))
        .await;
    assert_eq!((answer.status.as_u16(), answer.header("etag")), (200, "\"2\""), "{answer:?}");
    let mut expected = before.clone();
    expected["revision"] = 2.into();
    expected["lighting"]["ambient"] = 0.25.into();
    expected["rendering"]["background"] = answer.json()["rendering"]["background"].clone();
    assert_eq!(answer.json(), expected);
    assert!(expected["rendering"]["background"].as_str().is_some_and(|text| text.starts_with("#102030")));
    let restored = server.patch(&scene, &json!({ "lighting": null, "rendering": null })).await.json();
    assert_eq!(restored["lighting"], before["lighting"]);
    assert_eq!(restored["rendering"], before["rendering"]);
    let merge_patch = [("content-type", "application/merge-patch+json")];
    let answer = server.send(request(Method::PATCH, &scene, &merge_patch, Body::from("{}"))).await;
    assert_eq!(answer.status, 200);
}

#[tokio::test]
async fn put_replaces_the_whole_scene_and_takes_what_get_gave() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let first = server.get(&scene).await.json();
    let changed = server
        .json(Method::PUT, &scene, &[], &json!({ "volume": first["volume"], "lighting": { "ambient": 1 } }))
        .await;
    assert_eq!(changed.status, 200, "{changed:?}");
    assert_ne!(changed.json()["viewport"], first["viewport"], "what is missing gets its default");
    let mut again = first.clone();
    let stale = server.json(Method::PUT, &scene, &[], &again).await;
    assert_eq!((stale.status.as_u16(), stale.code().as_str()), (409, "revision_mismatch"));
    again["revision"] = 2.into();
    let restored = server.json(Method::PUT, &scene, &[], &again).await;
    assert_eq!(restored.status, 200, "{restored:?}");
    assert_eq!(restored.json()["viewport"], first["viewport"]);
    again["id"] = "s_other".into();
    let refused = server.json(Method::PUT, &scene, &[], &again).await;
    assert_eq!(refused.verdict(), (422, "invalid".into(), "id".into()));
}

#[tokio::test]
async fn if_match_guards_every_change() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let undo = format!("{scene}/undo");
    let patch = json!({ "lighting": { "ambient": 0.1 } });
    let revision = async || server.get(&scene).await.json()["revision"].as_u64().expect("a number");
    for tag in ["\"2\"", "W/\"1\"", "\"x\"", "\"2\", \"3\"", "\"\""] {
        for (method, path) in
            [(Method::PATCH, &scene), (Method::PUT, &scene), (Method::DELETE, &scene), (Method::POST, &undo)]
        {
            let answer = server.json(method.clone(), path, &[("if-match", tag)], &patch).await;
            assert_eq!((answer.status.as_u16(), answer.code().as_str()), (409, "revision_mismatch"), "{method} {tag}");
            assert_eq!(answer.json()["error"]["details"]["revision"], 1);
        }
    }
    for tag in ["1", "\"1", "\"1\" \"2\"", "\"1\",", "*1"] {
        let answer = server.json(Method::PATCH, &scene, &[("if-match", tag)], &patch).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (400, "malformed"), "{tag}");
    }
    assert_eq!(revision().await, 1);
    for (tag, ambient) in [("\"1\"", 0.2), ("*", 0.3), ("\"9\", \"3\"", 0.4), ("W/\"4\", \"4\"", 0.5)] {
        let patch = json!({ "lighting": { "ambient": ambient } });
        let answer = server.json(Method::PATCH, &scene, &[("if-match", tag)], &patch).await;
        assert_eq!(answer.status, 200, "{tag}: {answer:?}");
    }
    assert_eq!(revision().await, 5);
    let deleted = server.send(request(Method::DELETE, &scene, &[("if-match", "\"5\"")], Body::empty())).await;
    assert_eq!(deleted.status, 204);
    assert_eq!(server.get(&scene).await.status, 404);
}

#[tokio::test]
async fn undo_and_redo_make_new_revisions() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let post =
        async |what: &str| server.send(request(Method::POST, &format!("{scene}/{what}"), &[], Body::empty())).await;
    let content = |json: &Value| json["lighting"]["ambient"].clone();
    let first = server.get(&scene).await.json();
    for what in ["undo", "redo"] {
        let answer = post(what).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (409, "nothing_to_undo"), "{what}");
    }
    server.patch(&scene, &json!({ "lighting": { "ambient": 0.125 } })).await;
    let undone = post("undo").await;
    assert_eq!((undone.header("etag"), content(&undone.json())), ("\"3\"", content(&first)));
    let redone = post("redo").await;
    assert_eq!((redone.header("etag"), content(&redone.json())), ("\"4\"", json!(0.125)));
}

#[tokio::test]
async fn undo_and_redo_pass_over_what_was_of_a_volume_that_is_gone() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let source = json!({ "source": { "procedural": { "kind": "boxes", "dims": [8, 8, 8] } } });
    let other = server.post("/v1/volumes", &source).await.json()["id"].clone();
    let first = server.get(&scene).await.json();
    let ambient = |value: f64| json!({ "lighting": { "ambient": value } });
    server.patch(&scene, &ambient(0.125)).await;
    server.patch(&scene, &json!({ "volume": other })).await;
    server.patch(&scene, &json!({ "volume": first["volume"], "lighting": { "ambient": 0.25 } })).await;
    assert_eq!(server.delete(&format!("/v1/volumes/{}", other.as_str().expect("an id"))).await.status, 204);
    let seen = async |what: &str| {
        let answer = server.send(request(Method::POST, &format!("{scene}/{what}"), &[], Body::empty())).await;
        assert_eq!(answer.status, 200, "{answer:?}");
        let json = answer.json();
        assert_eq!(json["volume"], first["volume"]);
        json["lighting"]["ambient"].clone()
    };
    assert_eq!(seen("undo").await, 0.125);
    assert_eq!(seen("undo").await, first["lighting"]["ambient"]);
    assert_eq!(seen("redo").await, 0.125);
    assert_eq!(seen("redo").await, 0.25);
}

#[tokio::test]
async fn concurrent_patches_all_happen_one_after_the_other() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let patches = (0..40).map(|i| {
        let section = if i % 2 == 0 { "ambient" } else { "diffuse" };
        let patch = json!({ "lighting": { section: f64::from(i) / 64.0 } });
        let (server, scene) = (&server, &scene);
        async move { server.patch(scene, &patch).await.json()["revision"].as_u64().expect("a number") }
    });
    let mut revisions = futures_util::future::join_all(patches).await;
    revisions.sort_unstable();
    assert_eq!(revisions, (2..42).collect::<Vec<_>>());
}

#[tokio::test]
async fn there_may_be_so_many_scenes() {
    let server = Server::new(&["--max-scenes", "1"]);
    let scene = server.scene().await;
    let body = json!({ "volume": server.volume().await });
    let refused = server.post("/v1/scenes", &body).await;
    assert_eq!((refused.status.as_u16(), refused.code().as_str()), (429, "too_many"));
    server.delete(&scene).await;
    assert_eq!(server.post("/v1/scenes", &body).await.status, 201);
}

#[tokio::test]
async fn presets_are_listed_and_their_values_become_those_of_a_volume() {
    let server = Server::new(&[]);
    let presets = server.get("/v1/presets").await.json();
    let presets = presets["presets"].as_array().expect("a list");
    assert!(presets.len() >= 3);
    let volume = server.volume().await;
    let range = server.get(&format!("/v1/volumes/{volume}")).await.json()["value_range"].clone();
    let of_volume = server.get(&format!("/v1/presets?volume={volume}")).await.json();
    for (preset, of_volume) in presets.iter().zip(of_volume["presets"].as_array().expect("a list")) {
        assert_eq!(of_volume["units"], "data");
        let (points, values) = (preset["points"].as_array(), of_volume["points"].as_array());
        let (last, value) = (points.and_then(|p| p.last()), values.and_then(|p| p.last()));
        if preset["units"] == "relative" && last.is_some_and(|point| point["value"] == 1.0) {
            assert_eq!(value.map(|point| &point["value"]), Some(&range[1]));
        }
        let thumbnail = server.get(preset["thumbnail"].as_str().expect("a path")).await;
        assert_eq!((thumbnail.status.as_u16(), thumbnail.header("content-type")), (200, "image/png"));
        let picture = image::load_from_memory(&thumbnail.bytes).expect("a PNG");
        assert_eq!((picture.width(), picture.height()), (128, 48));
    }
    assert_eq!(server.get("/v1/presets?volume=v_none").await.code(), "volume_not_found");
}
