//! Documents that are refused, and where they say it is wrong.

use serde_json::{Value, json};
use spao_server::scene::SceneErrorKind::{self, Invalid, NotImplemented};

use super::scene;

/// A valid document with one field, named by its path, set to something.
fn with(path: &str, value: Value) -> Value {
    let mut json = json!({"volume": "v_1"});
    let mut place = &mut json;
    for field in path.split('.') {
        place = &mut place[field];
    }
    *place = value;
    json
}

/// Asserts that every document is refused with the kind and at the path beside it.
fn check(kind: SceneErrorKind, cases: &[(&str, Value, &str)]) {
    for (field, value, path) in cases {
        let document = with(field, value.clone());
        let error = scene(&document).err().unwrap_or_else(|| panic!("accepted: {document}"));
        assert_eq!((error.kind, error.path.as_str()), (kind, *path), "{document}: {error}");
        assert!(!error.message.is_empty() && error.message.len() < 500, "{document}: {error}");
    }
}

fn points(points: &[f64]) -> Value {
    points.iter().map(|v| json!({"value": v, "color": "#000", "opacity": 0.5})).collect()
}

fn with_point(field: &str, value: Value) -> Value {
    let mut points = points(&[0.0, 1.0, 2.0]);
    points[2][field] = value;
    points
}

#[test]
fn values_out_of_range_are_refused_at_their_path() {
    check(
        Invalid,
        &[
            ("camera.fov_y_deg", json!(200), "camera.fov_y_deg"),
            ("camera.fov_y_deg", json!(180), "camera.fov_y_deg"),
            ("camera.fov_y_deg", json!(0), "camera.fov_y_deg"),
            ("camera.eye", json!([0, 1e31, 0]), "camera.eye[1]"),
            ("camera.up", json!([0, 0, 0]), "camera.up"),
            ("camera.projection", json!("fisheye"), "camera.projection"),
            ("camera.height", json!(0), "camera.height"),
            ("camera.height", json!(-3), "camera.height"),
            ("ambient_occlusion.method", json!("ssao"), "ambient_occlusion.method"),
            ("ambient_occlusion.structure", json!("octree"), "ambient_occlusion.structure"),
            ("ambient_occlusion.levels", json!(0), "ambient_occlusion.levels"),
            ("ambient_occlusion.levels", json!(9), "ambient_occlusion.levels"),
            ("ambient_occlusion.levels", json!(2.5), "ambient_occlusion.levels"),
            ("ambient_occlusion.mip_levels", json!(7), "ambient_occlusion.mip_levels"),
            ("ambient_occlusion.mip_levels", json!(-1), "ambient_occlusion.mip_levels"),
            ("ambient_occlusion.normal_factor", json!(2.1), "ambient_occlusion.normal_factor"),
            ("ambient_occlusion.strength", json!(-0.1), "ambient_occlusion.strength"),
            ("ambient_occlusion.rays", json!(0), "ambient_occlusion.rays"),
            ("ambient_occlusion.rays", json!(4097), "ambient_occlusion.rays"),
            ("ambient_occlusion.radius", json!(0.5), "ambient_occlusion.radius"),
            ("ambient_occlusion.radius", json!(1025), "ambient_occlusion.radius"),
            ("ambient_occlusion.radius", json!("far"), "ambient_occlusion.radius"),
            ("ambient_occlusion.radius", json!([1]), "ambient_occlusion.radius"),
            ("ambient_occlusion.falloff", json!(9), "ambient_occlusion.falloff"),
            ("ambient_occlusion.color_bleeding", json!(-1), "ambient_occlusion.color_bleeding"),
            ("lighting.ambient", json!(4.5), "lighting.ambient"),
            ("lighting.diffuse", json!(-1), "lighting.diffuse"),
            ("lighting.specular", json!(1e300), "lighting.specular"),
            ("lighting.shininess", json!(0), "lighting.shininess"),
            ("lighting.direction", json!([0, 0, 0]), "lighting.direction"),
            ("lighting.direction", json!([0, 0, 2e30]), "lighting.direction[2]"),
            ("lighting.color", json!("white"), "lighting.color"),
            ("lighting.color", json!("#ffffff80"), "lighting.color"),
            ("lighting.color", json!("#ééé"), "lighting.color"),
            ("lighting.exposure", json!(17), "lighting.exposure"),
            ("rendering.mode", json!("xray"), "rendering.mode"),
            ("rendering.sampling_rate", json!(0.05), "rendering.sampling_rate"),
            ("rendering.background", json!("#12345"), "rendering.background"),
            ("rendering.background", json!("#12345g"), "rendering.background"),
            ("rendering.background", json!(""), "rendering.background"),
            ("rendering.clip_box", json!([[0, 0, 0], [1, 0, 1]]), "rendering.clip_box"),
            ("rendering.clip_box", json!([[0, 0, 0], [1, 1, 1e40]]), "rendering.clip_box[1][2]"),
            ("rendering.clip_planes", json!([[1, 0, 0, 0], [0, 0, 0, 1]]), "rendering.clip_planes[1]"),
            ("rendering.clip_planes", json!(vec![[1, 0, 0, 0]; 9]), "rendering.clip_planes"),
            ("viewport.width", json!(0), "viewport.width"),
            ("viewport.height", json!(16385), "viewport.height"),
            ("viewport.height", json!(1e19), "viewport.height"),
            ("volume", json!(""), "volume"),
            ("volume", json!("v".repeat(129)), "volume"),
        ],
    );
}

#[test]
fn wrong_types_and_unknown_fields_are_refused_at_their_path() {
    check(
        Invalid,
        &[
            ("volume", json!(null), "volume"),
            ("volume", json!(3), "volume"),
            ("colour", json!(1), "colour"),
            ("camera", json!([]), "camera"),
            ("camera", json!([[0, 0, 1], [0, 0, 0]]), "camera"),
            ("camera.fov", json!(40), "camera.fov"),
            ("camera.eye", json!([0, 1]), "camera.eye"),
            ("camera.eye", json!([0, 1, 2, 3]), "camera.eye"),
            ("camera.eye", json!([0, "1", 2]), "camera.eye[1]"),
            ("camera.eye", json!([0, null, 2]), "camera.eye[1]"),
            ("camera.eye", json!({"x": 0}), "camera.eye"),
            ("camera.fov_y_deg", json!("40"), "camera.fov_y_deg"),
            ("camera.fov_y_deg", json!(true), "camera.fov_y_deg"),
            ("ambient_occlusion", json!("spao"), "ambient_occlusion"),
            ("ambient_occlusion.level", json!(3), "ambient_occlusion.level"),
            ("ambient_occlusion.method", json!(0), "ambient_occlusion.method"),
            ("lighting.direction", json!("head"), "lighting.direction"),
            ("lighting.color", json!([1, 1, 1]), "lighting.color"),
            ("lighting.shine", json!(null), "lighting.shine"),
            ("rendering.clip_box", json!([[0, 0, 0]]), "rendering.clip_box"),
            ("rendering.clip_planes", json!([[1, 0, 0]]), "rendering.clip_planes[0]"),
            ("rendering.clip_planes", json!([[1, 0, 0, "d"]]), "rendering.clip_planes[0][3]"),
            ("viewport", json!([640, 480]), "viewport"),
            ("viewport.depth", json!(1), "viewport.depth"),
            ("transfer_function", json!("ct_bone"), "transfer_function"),
            ("transfer_function.points", json!({}), "transfer_function.points"),
            ("transfer_function.points", json!([[0, "#000", 0]]), "transfer_function.points[0]"),
        ],
    );
    for root in [json!([]), json!(null), json!("v_1"), json!(["v_1"])] {
        assert_eq!(scene(&root).expect_err("not an object").path, "$", "{root}");
    }
}

#[test]
fn bad_transfer_functions_are_refused_at_their_path() {
    let at = "transfer_function.points";
    let step_of_three = points(&[0.0, 1.0, 1.0, 1.0]);
    check(
        Invalid,
        &[
            (at, json!([]), "transfer_function.points"),
            (at, points(&[0.0; 1025]), "transfer_function.points"),
            (at, points(&[0.0, 2.0, 1.0]), "transfer_function.points[2].value"),
            (at, step_of_three, "transfer_function.points[3].value"),
            (at, points(&[1e301]), "transfer_function.points[0].value"),
            (at, with_point("opacity", json!(1.5)), "transfer_function.points[2].opacity"),
            (at, with_point("opacity", json!(-0.5)), "transfer_function.points[2].opacity"),
            (at, with_point("opacity", json!("1")), "transfer_function.points[2].opacity"),
            (at, with_point("opacity", json!(null)), "transfer_function.points[2].opacity"),
            (at, with_point("value", json!(null)), "transfer_function.points[2].value"),
            (at, with_point("color", json!(null)), "transfer_function.points[2].color"),
            (at, with_point("color", json!("red")), "transfer_function.points[2].color"),
            (at, with_point("alpha", json!(1)), "transfer_function.points[2].alpha"),
            (at, json!([null]), "transfer_function.points[0]"),
            ("transfer_function.opacity_unit_distance", json!(0), "transfer_function.opacity_unit_distance"),
            ("transfer_function.preset", json!("ct_unicorn"), "transfer_function.preset"),
            ("transfer_function", json!({"preset": "ct_bone", "points": []}), "transfer_function"),
        ],
    );
}

#[test]
fn vectors_that_contradict_each_other_are_refused() {
    check(
        Invalid,
        &[
            ("camera", json!({"eye": [1, 2, 3], "target": [1, 2, 3]}), "camera.target"),
            ("camera", json!({"eye": [0, 0, 9], "target": [0, 0, 0], "up": [0, 0, 1]}), "camera.up"),
            ("camera", json!({"eye": [0, 0, 9], "target": [0, 0, 0], "up": [0, 1e-9, -1]}), "camera.up"),
            ("ambient_occlusion", json!({"levels": 2, "mip_levels": 3}), "ambient_occlusion.mip_levels"),
        ],
    );
}

#[test]
fn what_is_known_but_not_implemented_says_so_by_name() {
    let methods =
        ["directional", "vao_cdf", "vao_gaussian", "vao_penner", "vicinity", "obscurances", "local", "histogram"];
    for method in methods {
        check(NotImplemented, &[("ambient_occlusion.method", json!(method), "ambient_occlusion.method")]);
    }
    for mode in ["maximum", "minimum", "average", "isosurface"] {
        check(NotImplemented, &[("rendering.mode", json!(mode), "rendering.mode")]);
    }
    check(
        NotImplemented,
        &[
            ("rendering.iso_value", json!(300), "rendering.iso_value"),
            ("rendering.opacity_modulation", json!("variance"), "rendering.opacity_modulation"),
            ("ambient_occlusion.color_bleeding", json!(0.5), "ambient_occlusion.color_bleeding"),
        ],
    );
    let error = scene(&with("ambient_occlusion.method", json!("directional"))).expect_err("not implemented");
    assert!(error.message.contains("`directional`"), "{error}");
    assert!(error.message.contains("off, spao, raytraced"), "{error}");
}

#[test]
fn messages_name_the_range_and_the_value_and_stay_short() {
    let error = scene(&with("camera.fov_y_deg", json!(200))).expect_err("out of range");
    assert_eq!(error.to_string(), "camera.fov_y_deg: expected a number in (0, 180), got 200");
    assert_eq!(error.under("scene").path, "scene.camera.fov_y_deg");
    assert_eq!(scene(&json!(5)).expect_err("not an object").under("scene").path, "scene");
    for long in [with("camera.fov_y_deg", json!("é".repeat(9999))), with("lighting.color", json!("é".repeat(9999)))] {
        assert!(scene(&long).expect_err("neither a number nor a colour").message.len() < 500);
    }
    assert!(scene(&with(&"é".repeat(9999), json!(1))).expect_err("an unknown field").path.len() < 500);
}

#[test]
fn the_helper_of_these_tests_notices_a_valid_document_and_a_wrong_path() {
    let fails = |value: Value, path: &'static str| {
        std::panic::catch_unwind(|| check(Invalid, &[("camera.fov_y_deg", value, path)])).is_err()
    };
    assert!(!fails(json!(200), "camera.fov_y_deg"));
    assert!(fails(json!(20), "camera.fov_y_deg"));
    assert!(fails(json!(200), "camera.fov"));
}
