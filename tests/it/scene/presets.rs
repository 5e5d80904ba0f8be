//! The ready-made transfer functions.

use std::collections::HashSet;

use serde_json::json;
use spao_server::scene::{PresetUnits, preset, presets};

use super::{TestVolume, scene};

#[test]
fn every_preset_is_a_valid_transfer_function_for_every_range() {
    for range in [[-1024.0, 3071.0], [0.0, 255.0], [5.0, 5.0], [-1.7e308, 1.7e308], [1e16, 1e16 + 2.0]] {
        for preset in presets() {
            let mut complete = scene(&json!({"volume": "v_1"})).expect("valid");
            complete.transfer_function = preset.transfer_function(range);
            assert_eq!(scene(&complete.to_json()), Ok(complete), "{} over {range:?}", preset.id);
        }
    }
}

#[test]
fn presets_have_names_of_their_own_and_can_be_found_by_them() {
    let ids: HashSet<_> = presets().iter().map(|preset| preset.id).collect();
    assert_eq!(ids.len(), presets().len());
    for id in ["ct_bone", "ct_skin_bone", "ct_muscle", "ct_lung", "ct_vessels", "mr_default", "gray_ramp"] {
        assert_eq!(preset(id).map(|preset| preset.id), Some(id));
    }
    assert_eq!(preset("CT_BONE"), None);
}

#[test]
fn relative_presets_span_the_value_range_and_others_are_in_hounsfield_units() {
    let ramp = preset("gray_ramp").expect("a preset");
    assert_eq!(ramp.units, PresetUnits::Relative);
    let values: Vec<_> = ramp.transfer_function([100.0, 300.0]).points.iter().map(|p| p.value).collect();
    assert_eq!(values, [100.0, 300.0]);
    let bone = preset("ct_bone").expect("a preset");
    assert_eq!(bone.transfer_function([100.0, 300.0]).points[0].value, bone.points[0].value);
}

#[test]
fn a_preset_is_published_with_its_points_and_units() {
    let json = serde_json::to_value(preset("ct_bone").expect("a preset")).expect("plain data");
    assert_eq!((&json["modality"], &json["units"]), (&json!("CT"), &json!("hounsfield")));
    for field in ["id", "name", "description", "opacity_unit_distance"] {
        assert!(!json[field].is_null(), "{field}");
    }
    assert_eq!(json["points"][0]["opacity"], json!(0.0));
}

#[test]
fn points_in_hounsfield_units_are_a_valid_document_as_published() {
    let json = serde_json::to_value(preset("ct_skin_bone").expect("a preset")).expect("plain data");
    let document = json!({"volume": "v_1", "transfer_function": {
        "points": json["points"], "opacity_unit_distance": json["opacity_unit_distance"]
    }});
    let expected =
        preset("ct_skin_bone").map(|preset| preset.transfer_function(TestVolume::eight_bit().facts().value_range));
    assert_eq!(scene(&document).map(|s| s.transfer_function).ok(), expected);
}
