//! What a document that says nothing means.

use glam::DVec3;
use serde_json::json;
use spao_server::scene::{Projection, Radius, SceneDocument, framed_camera, preset};

use super::{TestVolume, default_scene, scene};

#[test]
fn a_document_with_only_a_volume_gets_the_defaults_of_the_contract() {
    let mut complete = default_scene().to_json();
    // These two depend on the volume and are looked at by themselves below.
    assert!(complete["transfer_function"]["points"].as_array().is_some_and(|points| points.len() >= 2));
    for field in ["eye", "target", "up"] {
        assert_eq!(complete["camera"][field].as_array().map(Vec::len), Some(3), "{field}");
        complete["camera"][field] = json!(null);
    }
    complete["transfer_function"]["points"] = json!(null);
    let expected = json!({
        "volume": "v_1",
        "transfer_function": {"points": null, "opacity_unit_distance": null},
        "camera": {"eye": null, "target": null, "up": null, "projection": "perspective", "fov_y_deg": 40.0, "height": null},
        "ambient_occlusion": {
            "method": "spao", "structure": "n_buffer", "levels": 6, "mip_levels": 0, "normal_factor": 1.0, "strength": 1.0,
            "rays": 512, "radius": null, "falloff": 0.5, "color_bleeding": 0.0
        },
        "lighting": {
            "ambient": 0.5, "diffuse": 0.6, "specular": 0.2, "shininess": 30.0, "direction": null, "color": "#ffffff",
            "exposure": null
        },
        "rendering": {
            "mode": "composite", "iso_value": null, "sampling_rate": 1.0, "background": "#000000", "clip_box": null,
            "clip_planes": [], "opacity_modulation": null
        },
        "viewport": {"width": 1024, "height": 768}
    });
    assert_eq!(complete, expected);
    assert_eq!(complete.to_string(), expected.to_string(), "the order of fields is part of the shape");
}

#[test]
fn null_means_the_same_as_missing_everywhere() {
    let nothing = default_scene();
    let null_sections = json!({
        "volume": "v_1", "transfer_function": null, "camera": null, "ambient_occlusion": null, "lighting": null,
        "rendering": null, "viewport": null
    });
    assert_eq!(scene(&null_sections).as_ref(), Ok(&nothing));
    let mut null_fields = nothing.to_json();
    for section in null_fields.as_object_mut().expect("a scene is an object").values_mut() {
        for field in section.as_object_mut().into_iter().flat_map(serde_json::Map::values_mut) {
            *field = json!(null);
        }
    }
    assert_eq!(scene(&null_fields), Ok(nothing));
}

#[test]
fn a_missing_camera_frames_the_volume() {
    let volume = TestVolume::eight_bit();
    let expected = framed_camera(&volume.grid, 1024.0 / 768.0);
    assert_eq!(default_scene().camera, expected);
    let partial = scene(&json!({"volume": "v_1", "camera": {"eye": [0, 0, 900]}})).expect("valid");
    assert_eq!(partial.camera.eye, DVec3::new(0.0, 0.0, 900.0));
    assert_eq!(partial.camera.target, expected.target);
}

#[test]
fn a_view_along_z_without_up_gets_another_up() {
    let camera = json!({"eye": [0, 0, 900], "target": [0, 0, 0]});
    let seen = scene(&json!({"volume": "v_1", "camera": camera})).expect("valid");
    assert_eq!(seen.camera.up, -DVec3::Y);
}

#[test]
fn an_orthographic_camera_gets_a_height_and_ignores_the_field_of_view() {
    let seen = scene(&json!({"volume": "v_1", "camera": {"projection": "orthographic", "fov_y_deg": 20}}));
    let Ok(Projection::Orthographic { height }) = seen.map(|scene| scene.camera.projection) else {
        panic!("not orthographic");
    };
    assert!(height > 60.0 && height < 200.0, "{height}");
    let given = json!({"volume": "v_1", "camera": {"projection": "orthographic", "height": 12.5}});
    assert_eq!(scene(&given).map(|s| s.camera.projection), Ok(Projection::Orthographic { height: 12.5 }));
}

#[test]
fn a_preset_expands_to_its_points() {
    let document = json!({"volume": "v_1", "transfer_function": {"preset": "ct_bone"}});
    let bone = preset("ct_bone").expect("a preset");
    assert_eq!(scene(&document).map(|s| s.transfer_function), Ok(bone.transfer_function([0.0, 255.0])));
    let denser = json!({"volume": "v_1", "transfer_function": {"preset": "ct_bone", "opacity_unit_distance": 0.5}});
    let denser = scene(&denser).expect("valid").transfer_function;
    assert_eq!(denser.opacity_unit_distance, Some(0.5));
    assert_eq!(denser.points, bone.transfer_function([0.0, 255.0]).points);
}

#[test]
fn every_form_of_a_value_is_understood() {
    let document = json!({
        "volume": "v_1",
        "ambient_occlusion": {"method": "raytraced", "structure": "hybrid", "levels": 6.0, "mip_levels": 2, "radius": "unlimited"},
        "lighting": {"direction": [0, 3, 4], "color": "#fA0", "exposure": 1.5},
        "rendering": {"background": "#00000000", "clip_box": [[0, 0, 0], [1, 2, 3]], "clip_planes": [[0, 0, 2, 6]]}
    });
    let seen = scene(&document).expect("valid");
    assert_eq!((seen.ambient_occlusion.levels, seen.ambient_occlusion.radius), (6, Radius::Unlimited));
    assert_eq!(seen.lighting.direction, Some(DVec3::new(0.0, 3.0, 4.0) * (1.0 / 5.0)));
    assert_eq!(seen.lighting.color.to_hex(), "#ffaa00");
    assert_eq!(seen.rendering.background.0, [0.0; 4]);
    let plane = seen.rendering.clip_planes[0];
    assert_eq!((plane.normal, plane.d), (DVec3::Z, 3.0), "d is scaled with the normal");
    let radius = json!({"volume": "v_1", "ambient_occlusion": {"radius": 7.5}});
    assert_eq!(scene(&radius).map(|s| s.ambient_occlusion.radius), Ok(Radius::Voxels(7.5)));
}

#[test]
fn a_document_names_its_volume_before_it_is_completed() {
    let document = SceneDocument::from_json(&json!({"volume": "v_3f2a"})).expect("valid");
    assert_eq!(document.volume().0, "v_3f2a");
}
