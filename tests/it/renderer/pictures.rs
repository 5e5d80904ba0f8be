//! Every pixel of small pictures, by the GPU and by its twin.
//!
//! Where both round differently, and by how much: the GPU stores gradients in 8 bits and pictures too (half a step
//! each), interpolates values with the texture unit's weights, and finds the place of a segment by bisection. With
//! ambient occlusion a few pixels on silhouettes are far off: there the normal is at right angles to the view, and
//! rounding decides to which side of it accessibility is looked up.

use glam::DVec3;
use serde_json::{Value, json};
use spao_server::reference::Exposure;
use spao_server::scene::{AoMethod, ClipPlane, Rgba, Scene};

use super::support::{
    Change, Difference, Light, SIZE, Studio, Twin, UNOCCLUDED, all_pixels, boxes, gyroid, oblique, some_pixels, unit,
};

/// Pixels of a picture that are compared.
const PIXELS: u64 = 1500;

fn opaque() -> Value {
    json!({"points": [
        {"value": 40, "color": "#cc4422", "opacity": 0.0},
        {"value": 90, "color": "#f2e6d9", "opacity": 0.9},
        {"value": 200, "color": "#2266ff", "opacity": 1.0}
    ]})
}

fn soft() -> Value {
    json!({"points": [
        {"value": 20, "color": "#cc4422", "opacity": 0.0},
        {"value": 120, "color": "#22e6d9", "opacity": 0.1},
        {"value": 250, "color": "#2266ff", "opacity": 0.3}
    ]})
}

/// A picture of the GPU against the twin of `described`, which is the same scene unless something is to be noticed.
fn difference(studio: &mut Studio, drawn: &Scene, described: &Scene) -> Difference {
    let size = [SIZE, SIZE * 3 / 4];
    let picture = studio.picture(drawn, size);
    let exposure = Exposure::explicit(described.lighting.exposure.expect("these scenes have explicit exposure"));
    let accessibility = studio.accessibility(drawn);
    let light = match drawn.ambient_occlusion.method {
        AoMethod::Off => Light { exposure, ..UNOCCLUDED },
        _ => Light { accessibility: Some(&accessibility), exposure },
    };
    let pixels = some_pixels(size, PIXELS);
    let twin = Twin::new(&studio.volume).pixels(described, &light, size, &pixels);
    Difference::between(pixels.iter().map(|&[x, y]| unit(picture.at(x, y))), twin)
}

fn is_right(difference: &Difference, scene: &Scene) -> bool {
    let worst = if scene.ambient_occlusion.method == AoMethod::Off { 8.0 } else { 24.0 };
    difference.is_within(1.0, 3.0, worst)
}

fn assert_right(studio: &mut Studio, document: &Value) {
    let scene = studio.scene(document);
    let difference = difference(studio, &scene, &scene);
    assert!(is_right(&difference, &scene), "{difference:?} for {document}");
}

fn document(transfer_function: Value, projection: &str, occlusion: Value) -> Value {
    json!({
        "transfer_function": transfer_function,
        "camera": {"projection": projection},
        "ambient_occlusion": occlusion,
        "lighting": {"exposure": 1.0},
        "viewport": {"width": 4, "height": 3}
    })
}

fn every_combination() -> Vec<Value> {
    let mut documents = Vec::new();
    for transfer_function in [opaque(), soft()] {
        for projection in ["perspective", "orthographic"] {
            for occlusion in [json!({"method": "off"}), json!({"levels": 4}), json!({"levels": 3, "strength": 0.4})] {
                documents.push(document(transfer_function.clone(), projection, occlusion));
            }
        }
    }
    documents
}

#[test]
fn hard_boxes_look_as_the_twin_has_them() {
    let mut studio = Studio::new(boxes());
    for document in every_combination() {
        assert_right(&mut studio, &document);
    }
}

#[test]
fn a_smooth_surface_on_an_oblique_grid_with_unequal_spacing_looks_as_the_twin_has_it() {
    let mut studio = Studio::new(oblique(gyroid()));
    for document in every_combination() {
        assert_right(&mut studio, &document);
    }
}

/// What else a scene can say: light, background, clipping, sampling and where the eye is.
fn varied(studio: &Studio) -> Vec<(&'static str, Scene)> {
    let grid = &studio.volume.grid;
    let center = grid.center();
    let base = |transfer_function| studio.scene(&document(transfer_function, "perspective", json!({"levels": 4})));
    let with = |mut scene: Scene, change: &dyn Fn(&mut Scene)| {
        change(&mut scene);
        scene
    };
    let plane = |normal: DVec3, through: DVec3| ClipPlane { normal, d: -normal.dot(through) };
    let slanted = DVec3::new(0.48, -0.6, 0.64);
    let clip = json!({"rendering": {"clip_box": [
        (center - DVec3::new(9.0, 11.0, 7.3)).to_array(), (center + DVec3::new(12.0, 8.5, 9.1)).to_array()
    ]}});
    let mut clipped = document(opaque(), "perspective", json!({"levels": 4}));
    json_patch::merge(&mut clipped, &clip);
    vec![
        (
            "colored light from aside",
            with(base(opaque()), &|s| {
                s.lighting.direction = Some(DVec3::new(0.36, -0.48, 0.8));
                s.lighting.color.0 = [1.0, 0.8, 0.5];
                (s.lighting.specular, s.lighting.shininess) = (0.7, 12.0);
            }),
        ),
        ("light from behind", with(base(soft()), &|s| s.lighting.direction = Some(DVec3::Y))),
        ("bright", with(base(soft()), &|s| s.lighting.exposure = Some(3.0))),
        ("opaque background", with(base(soft()), &|s| s.rendering.background = Rgba([0.2, 0.6, 0.9, 1.0]))),
        ("translucent background", with(base(soft()), &|s| s.rendering.background = Rgba([0.9, 0.6, 0.2, 0.4]))),
        ("no background", with(base(soft()), &|s| s.rendering.background = Rgba([0.9, 0.6, 0.2, 0.0]))),
        ("clip box", studio.scene(&clipped)),
        (
            "clip box and planes",
            with(studio.scene(&clipped), &|s| {
                s.rendering.clip_planes = vec![plane(slanted, center), plane(DVec3::NEG_Z, center + 6.0 * DVec3::Z)];
            }),
        ),
        (
            "everything clipped",
            with(base(soft()), &|s| {
                s.rendering.clip_planes = vec![plane(slanted, center), plane(-slanted, center - slanted)];
            }),
        ),
        ("coarse sampling", with(base(soft()), &|s| s.rendering.sampling_rate = 0.3)),
        ("fine sampling", with(base(opaque()), &|s| s.rendering.sampling_rate = 3.7)),
        ("denser medium", with(base(soft()), &|s| s.transfer_function.opacity_unit_distance = Some(0.35))),
        ("eye inside", with(base(soft()), &|s| s.camera.eye = center + DVec3::new(1.0, -3.0, 2.0))),
        (
            "along an axis",
            with(base(opaque()), &|s| {
                s.camera.eye = center - 60.0 * DVec3::X;
                s.camera.target = center;
            }),
        ),
    ]
}

#[test]
fn light_background_clipping_and_sampling_do_what_the_twin_does() {
    for volume in [gyroid(), oblique(boxes())] {
        let mut studio = Studio::new(volume);
        for (name, scene) in varied(&studio) {
            let difference = difference(&mut studio, &scene, &scene);
            assert!(is_right(&difference, &scene), "{name}: {difference:?}");
        }
    }
}

#[test]
fn the_comparison_notices_every_parameter_that_is_a_little_off() {
    let mut studio = Studio::new(gyroid());
    let center = studio.volume.grid.center();
    let mut drawn = studio.scene(&document(soft(), "perspective", json!({"levels": 4})));
    drawn.lighting.direction = Some(DVec3::new(0.36, -0.48, 0.8));
    (drawn.lighting.specular, drawn.lighting.shininess) = (0.6, 10.0);
    drawn.rendering.background = Rgba([0.2, 0.6, 0.9, 0.6]);
    drawn.rendering.clip_planes = vec![ClipPlane { normal: DVec3::NEG_Y, d: center.y + 4.0 }];
    let same = difference(&mut studio, &drawn, &drawn);
    assert!(is_right(&same, &drawn), "{same:?}");
    let changes: [Change<'_>; 15] = [
        ("ambient", &|s| s.lighting.ambient += 0.03),
        ("diffuse", &|s| s.lighting.diffuse += 0.05),
        ("specular", &|s| s.lighting.specular -= 0.1),
        ("shininess", &|s| s.lighting.shininess = 5.0),
        ("direction", &|s| s.lighting.direction = Some(DVec3::new(-0.36, -0.48, 0.8))),
        ("head light", &|s| s.lighting.direction = None),
        ("exposure", &|s| s.lighting.exposure = Some(1.03)),
        ("strength", &|s| s.ambient_occlusion.strength = 0.9),
        ("eye", &|s| s.camera.eye.x += 0.7),
        ("field of view", &|s| s.camera.projection = spao_server::scene::Projection::Perspective { fov_y_deg: 41.0 }),
        ("opacity", &|s| s.transfer_function.points[1].opacity = 0.12),
        ("color", &|s| s.transfer_function.points[2].color.0[1] += 0.05),
        ("unit distance", &|s| s.transfer_function.opacity_unit_distance = Some(1.15)),
        ("clip plane", &|s| s.rendering.clip_planes[0].d += 0.5),
        ("background", &|s| s.rendering.background.0[3] = 0.57),
    ];
    for (name, change) in changes {
        let mut described = drawn.clone();
        change(&mut described);
        let difference = difference(&mut studio, &drawn, &described);
        assert!(!is_right(&difference, &drawn), "{name} goes unnoticed: {difference:?}");
    }
}

#[test]
fn the_comparison_of_pictures_measures_the_worst_channel_as_it_counts() {
    let gray = |value: f64| [value, value, value, 1.0];
    let a: Vec<[f64; 4]> = (0..200).map(|_| gray(0.5)).collect();
    let mut b = a.clone();
    b[7] = [0.5, 0.5 + 10.0 / 255.0, 0.5, 1.0];
    b[8] = gray(0.5 - 4.0 / 255.0);
    b[9] = gray(0.5 - 2.0 / 255.0);
    let difference = Difference::between(a.clone(), b);
    assert!((difference.worst - 10.0).abs() < 1e-9 && (difference.mean - 16.0 / 200.0).abs() < 1e-9);
    assert!((difference.percentile_99 - 2.0).abs() < 1e-9, "{difference:?}");
    assert!(difference.is_within(0.1, 2.1, 10.1));
    assert!(!difference.is_within(0.07, 2.1, 10.1) && !difference.is_within(0.1, 1.9, 10.1));
    assert!(!difference.is_within(0.1, 2.1, 9.9));
    // A color that is hardly there counts hardly.
    let faint = Difference::between([[1.0, 0.0, 0.0, 0.01]], [[0.0, 0.0, 1.0, 0.01]]);
    assert!(faint.worst < 3.0);
    assert_eq!(all_pixels([2, 2]), [[0, 0], [1, 0], [0, 1], [1, 1]]);
}
