//! Scenes write themselves as documents that read back as the same scene; nothing that is read panics.

use proptest::prelude::*;
use serde_json::{Map, Value, json};
use spao_server::scene::Scene;

use super::{default_scene, scene};

fn hex(digits: usize) -> impl Strategy<Value = Value> {
    prop::collection::vec(0u8..16, digits).prop_map(|digits| {
        let digits: String = digits.iter().map(|&digit| char::from_digit(digit.into(), 16).unwrap_or('0')).collect();
        json!(format!("#{digits}"))
    })
}

fn triple(range: std::ops::Range<f64>) -> impl Strategy<Value = Value> {
    prop::array::uniform3(range).prop_map(|v| json!(v))
}

fn transfer_functions() -> impl Strategy<Value = Value> {
    let point = (-1e4..1e4f64, hex(6), 0.0..=1.0f64);
    (prop::collection::vec(point, 1..40), prop::option::of(1e-3..1e3f64)).prop_map(|(mut points, unit)| {
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        let points = points.iter().map(|(v, color, a)| json!({"value": v, "color": color, "opacity": a}));
        json!({"points": points.collect::<Vec<_>>(), "opacity_unit_distance": unit})
    })
}

fn cameras() -> impl Strategy<Value = Value> {
    let projection = prop::sample::select(vec!["perspective", "orthographic"]);
    let numbers = (0.001..179.9f64, prop::option::of(1e-6..1e6f64));
    // Eye and target apart, up across: always valid.
    (triple(100.0..1e4), triple(-1e4..-100.0), projection, numbers).prop_map(|(eye, target, projection, numbers)| {
        let (fov, height) = numbers;
        json!({"eye": eye, "target": target, "up": [0.3, -7, 2], "projection": projection, "fov_y_deg": fov, "height": height})
    })
}

fn ambient_occlusions() -> impl Strategy<Value = Value> {
    let names = (
        prop::sample::select(vec!["off", "spao", "raytraced"]),
        prop::sample::select(vec!["n_buffer", "mipmap", "hybrid"]),
    );
    let radius = prop_oneof![Just(json!(null)), Just(json!("unlimited")), (1.0..=1024.0f64).prop_map(|r| json!(r))];
    let levels = (1u32..=8).prop_flat_map(|levels| (Just(levels), 0..=levels));
    (names, levels, 0.0..=2.0f64, 0.0..=1.0f64, 1u32..=4096, radius).prop_map(
        |((method, structure), (levels, mip_levels), normal_factor, strength, rays, radius)| {
            json!({
                "method": method, "structure": structure, "levels": levels, "mip_levels": mip_levels,
                "normal_factor": normal_factor, "strength": strength, "rays": rays, "radius": radius
            })
        },
    )
}

fn lightings() -> impl Strategy<Value = Value> {
    (0.0..=4.0f64, 1.0..=1000.0f64, prop::option::of(triple(0.01..9.0)), hex(3), prop::option::of(0.0..=16.0f64)).prop_map(
        |(ambient, shininess, direction, color, exposure)| {
            json!({"ambient": ambient, "shininess": shininess, "direction": direction, "color": color, "exposure": exposure})
        },
    )
}

fn renderings() -> impl Strategy<Value = Value> {
    let planes = prop::collection::vec((triple(0.01..9.0), -1e3..1e3f64), 0..=8)
        .prop_map(|planes| planes.into_iter().map(|(n, d)| json!([n[0], n[1], n[2], d])).collect::<Value>());
    let clip_box = prop::option::of((triple(-9.0..0.0), triple(0.1..9.0)).prop_map(|(min, max)| json!([min, max])));
    (0.1..=8.0f64, prop_oneof![hex(6), hex(8)], clip_box, planes).prop_map(|(rate, background, clip_box, planes)| {
        json!({"sampling_rate": rate, "background": background, "clip_box": clip_box, "clip_planes": planes})
    })
}

fn documents() -> impl Strategy<Value = Value> {
    let sections = (
        prop::option::of(transfer_functions()),
        prop::option::of(cameras()),
        ambient_occlusions(),
        lightings(),
        renderings(),
        (1u32..=16384, 1u32..=16384),
    );
    sections.prop_map(|(transfer_function, camera, ambient_occlusion, lighting, rendering, (width, height))| {
        json!({
            "volume": "v_1", "transfer_function": transfer_function, "camera": camera,
            "ambient_occlusion": ambient_occlusion, "lighting": lighting, "rendering": rendering,
            "viewport": {"width": width, "height": height}
        })
    })
}

/// Any JSON, with numbers, names and nesting that scenes use.
fn arbitrary_json() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        any::<u64>().prop_map(Value::from),
        any::<f64>().prop_map(|x| json!(x)),
        prop::sample::select(vec![f64::MAX, f64::MIN, f64::MIN_POSITIVE, 5e-324, -0.0, 1e30, 1e-100])
            .prop_map(|x| json!(x)),
        any::<String>().prop_map(Value::from),
        prop::sample::select(vec!["spao", "ct_bone", "#fff", "#", "#é", "unlimited", "v_1"]).prop_map(Value::from),
    ];
    leaf.prop_recursive(4, 48, 6, |inner| {
        let names = vec![
            "volume",
            "transfer_function",
            "points",
            "value",
            "camera",
            "eye",
            "up",
            "rendering",
            "clip_box",
            "radius",
            "ambient_occlusion",
            "lighting",
            "direction",
            "preset",
        ];
        let key = prop_oneof![3 => prop::sample::select(names).prop_map(String::from), 1 => any::<String>()];
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::vec((key, inner), 0..5)
                .prop_map(|items| Value::from(items.into_iter().collect::<Map<_, _>>())),
        ]
    })
}

/// Puts `value` where the `place`-th node of a document is.
fn replace_node(json: &mut Value, place: &mut usize, value: &Value) {
    if *place == 0 {
        *json = value.clone();
    }
    *place = place.wrapping_sub(1);
    match json {
        Value::Array(items) => items.iter_mut().for_each(|item| replace_node(item, place, value)),
        Value::Object(fields) => fields.values_mut().for_each(|field| replace_node(field, place, value)),
        _ => {}
    }
}

/// Whether a scene, written as text and read again, is the same.
fn survives(before: &Scene, change: impl Fn(String) -> String) -> bool {
    let text = change(before.to_json().to_string());
    serde_json::from_str(&text).is_ok_and(|json| scene(&json).as_ref() == Ok(before))
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn a_scene_reads_back_exactly(document in documents()) {
        let before = scene(&document).map_err(|error| TestCaseError::fail(error.to_string()))?;
        prop_assert_eq!(scene(&before.to_json()), Ok(before.clone()));
        prop_assert!(survives(&before, |text| text), "as text");
    }

    #[test]
    fn any_json_is_a_scene_or_an_error_with_a_path(json in arbitrary_json()) {
        if let Err(error) = scene(&json) {
            prop_assert!(!error.path.is_empty() && error.path.len() < 500 && error.message.len() < 500);
        }
    }

    #[test]
    fn a_document_with_any_node_replaced_is_a_scene_or_an_error(
        document in documents(), place in 0usize..160, value in arbitrary_json(),
    ) {
        let mut document = scene(&document).map_or(document, |scene| scene.to_json());
        let mut left = place;
        replace_node(&mut document, &mut left, &value);
        if let Ok(scene_of_it) = scene(&document) {
            prop_assert_eq!(scene(&scene_of_it.to_json()), Ok(scene_of_it));
        }
    }

    #[test]
    fn any_patch_gives_a_scene_or_an_error(patch in arbitrary_json()) {
        let patched = default_scene().patched_document(&patch);
        prop_assert!(patched.is_ok() || patched.is_err_and(|error| !error.path.is_empty()));
    }
}

#[test]
fn the_round_trip_notices_a_changed_last_digit() {
    let mut before = default_scene();
    before.ambient_occlusion.strength = 0.7;
    assert!(survives(&before, |text| text));
    assert!(!survives(&before, |text| text.replace("\"strength\":0.7", "\"strength\":0.7000000000000001")));
}
