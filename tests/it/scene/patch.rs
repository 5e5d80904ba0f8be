//! JSON Merge Patch (RFC 7396) on scenes.

use serde_json::json;
use spao_server::scene::{Projection, Scene, SceneError};

use super::{TestVolume, default_scene, scene};

fn patched(before: &Scene, patch: serde_json::Value) -> Result<Scene, SceneError> {
    before.patched(&patch, &TestVolume::eight_bit().facts())
}

fn edited() -> Scene {
    let points = json!([
        {"value": 10, "color": "#102030", "opacity": 0.25}, {"value": 90, "color": "#ffeedd", "opacity": 1}
    ]);
    scene(&json!({
        "volume": "v_1",
        "transfer_function": {"points": points, "opacity_unit_distance": 2.5},
        "camera": {"eye": [100, -200, 30.5], "target": [20, 30, 30], "up": [0, 0, 2]},
        "ambient_occlusion": {"levels": 4, "radius": 12},
        "lighting": {"direction": [1, 2, 3]},
        "rendering": {"clip_planes": [[1, 2, 3, 4]]}
    }))
    .expect("valid")
}

#[test]
fn an_empty_patch_changes_nothing() {
    assert_eq!(patched(&edited(), json!({})), Ok(edited()));
    assert_ne!(patched(&edited(), json!({"viewport": {"width": 9}})), Ok(edited()));
}

#[test]
fn a_patch_changes_what_it_names_and_nothing_else() {
    let after = patched(&edited(), json!({"camera": {"fov_y_deg": 25}, "ambient_occlusion": {"strength": 0.5}}));
    let mut expected = edited();
    expected.camera.projection = Projection::Perspective { fov_y_deg: 25.0 };
    expected.ambient_occlusion.strength = 0.5;
    assert_eq!(after, Ok(expected));
}

#[test]
fn null_resets_a_field_or_a_section_to_its_default() {
    let default = default_scene();
    let field = patched(&edited(), json!({"ambient_occlusion": {"levels": null}})).expect("valid");
    assert_eq!(field.ambient_occlusion.levels, 6);
    assert_eq!(field.ambient_occlusion.radius, edited().ambient_occlusion.radius);
    let sections = json!({
        "transfer_function": null, "camera": null, "ambient_occlusion": null, "lighting": null, "rendering": null
    });
    assert_eq!(patched(&edited(), sections), Ok(default.clone()));
    let points = patched(&edited(), json!({"transfer_function": {"points": null}})).expect("valid");
    assert_eq!(points.transfer_function.points, default.transfer_function.points);
    assert_eq!(points.transfer_function.opacity_unit_distance, Some(2.5));
}

#[test]
fn an_array_is_replaced_whole() {
    let point = json!({"value": 7, "color": "#777777", "opacity": 0.5});
    let after = patched(&edited(), json!({"transfer_function": {"points": [point]}})).expect("valid");
    assert_eq!(after.transfer_function.points.len(), 1);
    assert_eq!(after.transfer_function.opacity_unit_distance, Some(2.5));
}

#[test]
fn a_preset_replaces_the_whole_transfer_function() {
    let after = patched(&edited(), json!({"transfer_function": {"preset": "ct_bone"}})).expect("valid");
    let fresh = scene(&json!({"volume": "v_1", "transfer_function": {"preset": "ct_bone"}})).expect("valid");
    assert_eq!(after.transfer_function, fresh.transfer_function);
}

#[test]
fn an_invalid_patch_names_its_path() {
    let path = |patch| patched(&edited(), patch).expect_err("invalid").path;
    assert_eq!(path(json!({"camera": {"fov_y_deg": 200}})), "camera.fov_y_deg");
    assert_eq!(path(json!({"camera": {"nose": 1}})), "camera.nose");
    assert_eq!(path(json!({"camera": {"target": [100, -200, 30.5]}})), "camera.target");
    assert_eq!(path(json!({"ambient_occlusion": {"mip_levels": 5}})), "ambient_occlusion.mip_levels");
    assert_eq!(path(json!({"volume": null})), "volume");
    assert_eq!(path(json!([])), "$");
    assert_eq!(path(json!(null)), "$");
}

#[test]
fn a_camera_can_go_to_the_other_projection_and_back() {
    let there = patched(&edited(), json!({"camera": {"projection": "orthographic"}})).expect("valid");
    assert!(matches!(there.camera.projection, Projection::Orthographic { .. }));
    let back = patched(&there, json!({"camera": {"projection": "perspective"}}));
    assert_eq!(back, Ok(edited()));
}

#[test]
fn a_patch_may_name_another_volume() {
    let document = edited().patched_document(&json!({"volume": "v_2"})).expect("valid");
    assert_eq!(document.volume().0, "v_2");
    let facts_about_another = document.complete(&TestVolume::eight_bit().facts());
    assert_eq!(facts_about_another.expect_err("facts about v_1").path, "volume");
}
