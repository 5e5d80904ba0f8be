//! Scenes that are not: each is refused with the field named, and changes nothing.

use axum::body::Body;
use axum::http::Method;

use super::{Server, request};

/// Patches, the status they get, and the field that is to blame.
const BAD_PATCHES: [(&str, u16, &str); 46] = [
    ("{", 400, ""),
    ("[1, 2]", 422, "$"),
    ("\"scene\"", 422, "$"),
    ("null", 422, "$"),
    (r#"{"colour": 1}"#, 422, "colour"),
    (r#"{"revision": "one"}"#, 422, "revision"),
    (r#"{"id": "s_other"}"#, 422, "id"),
    (r#"{"volume": null}"#, 422, "volume"),
    (r#"{"volume": 7}"#, 422, "volume"),
    (r#"{"volume": ""}"#, 422, "volume"),
    (r#"{"volume": "v_none"}"#, 404, "volume"),
    (r#"{"camera": {"fov_y_deg": 0}}"#, 422, "camera.fov_y_deg"),
    (r#"{"camera": {"fov_y_deg": 180}}"#, 422, "camera.fov_y_deg"),
    (r#"{"camera": {"fov_y_deg": "40"}}"#, 422, "camera.fov_y_deg"),
    (r#"{"camera": {"fov": 40}}"#, 422, "camera.fov"),
    (r#"{"camera": {"eye": [1, 2]}}"#, 422, "camera.eye"),
    (r#"{"camera": {"eye": [1, 2, 1e31]}}"#, 422, "camera.eye[2]"),
    (r#"{"camera": {"eye": [1, 2, 3], "target": [1, 2, 3]}}"#, 422, "camera.target"),
    (r#"{"camera": {"up": [0, 0, 0]}}"#, 422, "camera.up"),
    (r#"{"camera": {"eye": [0, 0, 0], "target": [0, 0, 9], "up": [0, 0, 1]}}"#, 422, "camera.up"),
    (r#"{"camera": {"projection": "fisheye"}}"#, 422, "camera.projection"),
    (r#"{"camera": {"height": -1}}"#, 422, "camera.height"),
    (r#"{"camera": [1]}"#, 422, "camera"),
    (r#"{"transfer_function": {"points": []}}"#, 422, "transfer_function.points"),
    (
        r##"{"transfer_function": {"points": [{"value": 1, "color": "#fff"}]}}"##,
        422,
        "transfer_function.points[0].opacity",
    ),
    (
        r##"{"transfer_function": {"points": [{"value": 1, "color": "red", "opacity": 1}]}}"##,
        422,
        "transfer_function.points[0].color",
    ),
    (
        r##"{"transfer_function": {"points": [{"value": 1, "color": "#ffffff", "opacity": 1.5}]}}"##,
        422,
        "transfer_function.points[0].opacity",
    ),
    (
        r##"{"transfer_function": {"points": [{"value": 2, "color": "#ffffff", "opacity": 1},
            {"value": 1, "color": "#ffffff", "opacity": 1}]}}"##,
        422,
        "transfer_function.points[1].value",
    ),
    (r#"{"transfer_function": {"opacity_unit_distance": 0}}"#, 422, "transfer_function.opacity_unit_distance"),
    (r#"{"transfer_function": {"preset": "none"}}"#, 422, "transfer_function.preset"),
    (r#"{"ambient_occlusion": {"method": "magic"}}"#, 422, "ambient_occlusion.method"),
    (r#"{"ambient_occlusion": {"method": "vicinity"}}"#, 422, "ambient_occlusion.method"),
    (r#"{"ambient_occlusion": {"levels": 0}}"#, 422, "ambient_occlusion.levels"),
    (r#"{"ambient_occlusion": {"levels": 9}}"#, 422, "ambient_occlusion.levels"),
    (r#"{"ambient_occlusion": {"levels": 2.5}}"#, 422, "ambient_occlusion.levels"),
    (r#"{"ambient_occlusion": {"levels": 3, "mip_levels": 4}}"#, 422, "ambient_occlusion.mip_levels"),
    (r#"{"ambient_occlusion": {"normal_factor": -0.1}}"#, 422, "ambient_occlusion.normal_factor"),
    (r#"{"ambient_occlusion": {"rays": 4294967297}}"#, 422, "ambient_occlusion.rays"),
    (r#"{"ambient_occlusion": {"radius": "far"}}"#, 422, "ambient_occlusion.radius"),
    (r#"{"lighting": {"ambient": -1}}"#, 422, "lighting.ambient"),
    (r#"{"lighting": {"direction": [0, 0, 0]}}"#, 422, "lighting.direction"),
    (r#"{"rendering": {"mode": "maximum"}}"#, 422, "rendering.mode"),
    (r#"{"rendering": {"sampling_rate": 100}}"#, 422, "rendering.sampling_rate"),
    (r#"{"rendering": {"clip_box": [[0, 0, 0], [1, 0, 1]]}}"#, 422, "rendering.clip_box"),
    (r#"{"viewport": {"width": 0}}"#, 422, "viewport.width"),
    (r#"{"viewport": {"height": 16385}}"#, 422, "viewport.height"),
];

#[tokio::test]
async fn a_bad_patch_names_its_field_and_changes_nothing() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let before = server.get(&scene).await;
    let headers = [("content-type", "application/json")];
    for (patch, status, path) in BAD_PATCHES {
        let answer = server.send(request(Method::PATCH, &scene, &headers, Body::from(patch))).await;
        assert_eq!((answer.status.as_u16(), answer.path().as_str()), (status, path), "{patch}: {answer:?}");
        let after = server.get(&scene).await;
        assert_eq!((after.json(), after.header("etag")), (before.json(), before.header("etag")), "{patch}");
    }
    let frame = server.get(&format!("{scene}/frame")).await;
    assert_eq!(frame.status, 200, "the server still draws");
}

#[tokio::test]
async fn what_this_version_cannot_do_is_told_apart_from_what_is_wrong() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    for (patch, code) in [
        (r#"{"ambient_occlusion": {"method": "vicinity"}}"#, "not_implemented"),
        (r#"{"ambient_occlusion": {"color_bleeding": 0.5}}"#, "not_implemented"),
        (r#"{"rendering": {"mode": "isosurface"}}"#, "not_implemented"),
        (r#"{"rendering": {"iso_value": 3}}"#, "not_implemented"),
        (r#"{"ambient_occlusion": {"method": "magic"}}"#, "invalid"),
    ] {
        let headers = [("content-type", "application/json")];
        let answer = server.send(request(Method::PATCH, &scene, &headers, Body::from(patch))).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (422, code), "{patch}");
    }
}
