//! Pictures: of scenes, and of scene documents that are not kept.

use axum::body::Body;
use axum::http::Method;
use image::{DynamicImage, GenericImageView};
use serde_json::{Value, json};

use super::{Answer, Server, request};

fn picture(answer: &Answer) -> DynamicImage {
    assert_eq!(answer.status, 200, "{answer:?}");
    image::load_from_memory(&answer.bytes).expect("a picture")
}

/// Names and values of `Server-Timing`.
fn timings(header: &str) -> Vec<(&str, f64)> {
    let stage = |stage: &'_ str| -> Option<(usize, f64)> {
        let (name, duration) = stage.split_once(";dur=")?;
        Some((name.len(), duration.parse().ok()?))
    };
    header.split(", ").filter_map(|text| stage(text).map(|(length, ms)| (&text[..length], ms))).collect()
}

#[tokio::test]
async fn a_frame_has_the_size_and_format_that_was_asked_for() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    for (query, media_type, size) in [
        ("", "image/png", (48, 32)),
        ("width=20&height=10", "image/png", (20, 10)),
        ("width=1&height=1&format=webp", "image/webp", (1, 1)),
        ("height=7&format=jpeg", "image/jpeg", (48, 7)),
    ] {
        let answer = server.get(&format!("{scene}/frame?{query}")).await;
        assert_eq!(answer.header("content-type"), media_type, "{query}");
        assert_eq!(picture(&answer).dimensions(), size, "{query}");
        assert_eq!(answer.header("x-scene-revision"), "1");
        let names: Vec<_> = timings(answer.header("server-timing")).into_iter().map(|(name, _)| name).collect();
        assert_eq!(names, ["queue", "ao", "raycast", "readback", "encode"]);
    }
}

#[tokio::test]
async fn a_frame_names_the_revision_it_shows() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let before = server.get(&format!("{scene}/frame")).await;
    server.patch(&scene, &json!({ "rendering": { "background": "#204060" } })).await;
    let after = server.get(&format!("{scene}/frame")).await;
    assert_eq!(after.header("x-scene-revision"), "2");
    assert_ne!(before.bytes, after.bytes);
    assert_eq!(server.get(&format!("{scene}/frame")).await.bytes, after.bytes, "the same scene, the same picture");
}

#[tokio::test]
async fn an_opaque_frame_is_rgb_and_a_transparent_background_stays_transparent() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let opaque = picture(&server.get(&format!("{scene}/frame")).await);
    assert_eq!(opaque.color(), image::ColorType::Rgb8);
    server.patch(&scene, &json!({ "rendering": { "background": "#00000000" } })).await;
    let clear = picture(&server.get(&format!("{scene}/frame?width=64&height=8")).await);
    assert_eq!(clear.color(), image::ColorType::Rgba8);
    assert_eq!(clear.get_pixel(63, 7).0[3], 0);
    let jpeg = picture(&server.get(&format!("{scene}/frame?width=64&height=8&format=jpeg")).await);
    assert_eq!(jpeg.color(), image::ColorType::Rgb8);
    let webp = picture(&server.get(&format!("{scene}/frame?width=64&height=8&format=webp")).await);
    assert_eq!(webp.to_rgba8(), clear.to_rgba8(), "both are lossless");
}

#[tokio::test]
async fn a_frame_beyond_the_limit_is_refused_with_the_limit() {
    let server = Server::new(&["--max-image", "100"]);
    let scene = server.scene().await;
    let answer = server.get(&format!("{scene}/frame?width=101")).await;
    assert_eq!(answer.verdict(), (413, "too_large".into(), "width".into()));
    assert_eq!(answer.json()["error"]["details"]["limit"], 100);
    server.patch(&scene, &json!({ "viewport": { "height": 200 } })).await;
    let answer = server.get(&format!("{scene}/frame")).await;
    assert_eq!(answer.verdict(), (413, "too_large".into(), "viewport.height".into()));
    assert_eq!(server.get(&format!("{scene}/frame?width=100&height=100")).await.status, 200);
}

#[tokio::test]
async fn a_render_is_the_same_for_the_same_body_and_leaves_no_scene() {
    let server = Server::new(&[]);
    let scene = json!({ "volume": server.volume().await, "rendering": { "background": "#336699" } });
    let body = json!({ "scene": scene, "width": 40, "height": 30, "format": "png" });
    let first = server.post("/v1/render", &body).await;
    assert_eq!(picture(&first).dimensions(), (40, 30));
    assert!(!first.headers.contains_key("x-scene-revision"));
    assert_eq!(timings(first.header("server-timing")).len(), 5);
    assert_eq!(server.post("/v1/render", &body).await.bytes, first.bytes);
    assert_eq!(server.get("/v1/scenes").await.json(), json!({ "scenes": [] }));
}

#[tokio::test]
async fn a_render_request_is_checked_to_the_last_field() {
    let server = Server::new(&["--max-image", "100"]);
    let volume = server.volume().await;
    let with = |name: &str, value: Value| {
        let mut body = json!({ "scene": { "volume": volume }, "width": 8, "height": 8 });
        body[name] = value;
        body
    };
    for (body, status, path) in [
        (with("size", json!(3)), 422, "size"),
        (with("width", json!(0)), 422, "width"),
        (with("width", json!(-1)), 422, "width"),
        (with("width", json!(101)), 413, "width"),
        (with("height", json!("8")), 422, "height"),
        (with("format", json!("gif")), 422, "format"),
        (with("scene", json!({})), 422, "scene.volume"),
        (with("scene", json!({ "volume": "v_none" })), 404, "scene.volume"),
        (with("scene", json!({ "volume": volume, "camera": { "fov_y_deg": 0 } })), 422, "scene.camera.fov_y_deg"),
        (with("scene", json!([])), 422, "scene"),
        (json!({ "width": 8 }), 422, "$"),
    ] {
        let answer = server.post("/v1/render", &body).await;
        assert_eq!((answer.status.as_u16(), answer.path().as_str()), (status, path), "{body}: {answer:?}");
    }
    let large = json!({ "scene": { "volume": volume, "viewport": { "width": 200 } } });
    assert_eq!(server.post("/v1/render", &large).await.path(), "scene.viewport.width");
}

#[tokio::test]
async fn more_pictures_at_once_than_there_are_places_are_turned_away() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let places: Vec<_> = std::iter::from_fn(|| server.state.render_slot().ok()).collect();
    assert!(places.len() >= 8);
    let answer = server.get(&format!("{scene}/frame")).await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (503, "busy"));
    assert_eq!(answer.header("retry-after"), "1");
    drop(places);
    assert_eq!(server.get(&format!("{scene}/frame")).await.status, 200);
}

#[tokio::test]
async fn pages_need_nothing_from_elsewhere() {
    let server = Server::new(&[]);
    for path in ["/", "/docs"] {
        let page = server.get(path).await;
        assert!(page.header("content-security-policy").starts_with("default-src 'none'"));
        let html = String::from_utf8(page.bytes).expect("UTF-8").replace("http://www.w3.org/2000/svg", "");
        assert!(!html.contains("://"), "{path}: {html}");
    }
}

#[tokio::test]
async fn the_viewers_files_are_served_with_their_types_and_nothing_else_is() {
    let server = Server::new(&[]);
    for (path, kind) in
        [("/", "text/html"), ("/viewer/app.js", "text/javascript"), ("/viewer/css/theme.css", "text/css")]
    {
        let file = server.get(path).await;
        assert_eq!(file.status, 200, "{path}");
        assert!(file.header("content-type").starts_with(kind), "{path}");
        let tag = file.header("etag").to_owned();
        let again = request(Method::GET, path, &[("if-none-match", &tag)], Body::empty());
        assert_eq!(server.send(again).await.status, 304, "{path}");
    }
    for path in ["/viewer/", "/viewer/nope.js", "/viewer/../Cargo.toml", "/viewer/%2e%2e/Cargo.toml"] {
        assert_eq!(server.get(path).await.status, 404, "{path}");
    }
}
