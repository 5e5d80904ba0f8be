//! Voxel types, degenerate volumes, and adapters without optional features.

use glam::DVec3;
use serde_json::{Value, json};
use spao_server::gpu::GpuOptions;
use spao_server::reference::Exposure;
use spao_server::volume::{Grid, ProceduralKind, Volume, Voxels};

use super::support::{Difference, Light, SIZE, Studio, Twin, all_pixels, boxes, gyroid, procedural, unit, volume_of};

/// Only what every adapter has: 16-bit values live in r32float textures, accessibility in r16float ones.
fn baseline() -> GpuOptions {
    GpuOptions { baseline_features_only: true, ..GpuOptions::default() }
}

/// From `lowest` to `highest` a ramp of opacity and color.
fn ramp(lowest: f64, highest: f64, opacity: f64) -> Value {
    json!({
        "transfer_function": {"points": [
            {"value": lowest + 0.3 * (highest - lowest), "color": "#cc4422", "opacity": 0.0},
            {"value": lowest + 0.6 * (highest - lowest), "color": "#22e6d9", "opacity": 0.6 * opacity},
            {"value": highest, "color": "#2266ff", "opacity": opacity}
        ]},
        "ambient_occlusion": {"levels": 3},
        "lighting": {"exposure": 1.0},
        "viewport": {"width": 64, "height": 64}
    })
}

/// The picture against its twin, drawn with all features of the adapter or with the least.
fn difference(volume: &Volume, options: &GpuOptions, drawn: &Value, described: &Value) -> Difference {
    let mut studio = Studio::with_options(volume.clone(), options);
    assert!(!options.baseline_features_only || !studio.renderer.info().texture_16bit_norm);
    let (drawn, described) = (studio.scene(drawn), studio.scene(described));
    let picture = studio.picture(&drawn, [SIZE, SIZE]);
    let accessibility = studio.accessibility(&drawn);
    let light = Light { accessibility: Some(&accessibility), exposure: Exposure::NONE };
    let twin = Twin::new(volume).pixels(&described, &light, [SIZE, SIZE], &all_pixels([SIZE, SIZE]));
    Difference::between(picture.pixels.iter().copied().map(unit), twin)
}

fn is_right(difference: &Difference) -> bool {
    difference.is_within(1.0, 3.0, 24.0)
}

#[track_caller]
fn assert_right(volume: &Volume, document: &Value) {
    for options in [GpuOptions::default(), baseline()] {
        let difference = difference(volume, &options, document, document);
        assert!(is_right(&difference), "{difference:?} with {options:?}");
    }
}

/// Smooth, over the whole range of the type, and no two axes alike.
fn signal([i, j, k]: [u32; 3]) -> f64 {
    let p = DVec3::new(f64::from(i), f64::from(j), f64::from(k));
    0.5 + 0.5 * (0.55 * p.x).sin() * (0.4 * p.y + 0.2 * p.x).cos() * (0.3 * p.z + 0.8).sin()
}

fn volume_from(dims: [u32; 3], voxels: impl FnOnce(Vec<f64>) -> Voxels) -> Volume {
    let values =
        (0..dims[2]).flat_map(|k| (0..dims[1]).flat_map(move |j| (0..dims[0]).map(move |i| signal([i, j, k]))));
    Volume::new(Grid::axis_aligned(dims, DVec3::new(1.0, 1.1, 0.9)), voxels(values.collect())).expect("a valid volume")
}

const DIMS: [u32; 3] = [21, 18, 23];

#[test]
fn eight_bit_volumes_look_as_the_twin_has_them_with_and_without_optional_features() {
    assert_right(&gyroid(), &ramp(0.0, 255.0, 0.5));
    let signed = volume_from(DIMS, |v| Voxels::I8(v.iter().map(|v| (v * 200.0 - 100.0) as i8).collect()));
    assert_right(&signed, &ramp(-100.0, 100.0, 0.5));
}

#[test]
fn sixteen_bit_volumes_look_as_the_twin_has_them_with_and_without_optional_features() {
    assert_right(&procedural(ProceduralKind::MarschnerLobb, DIMS), &ramp(0.0, 65535.0, 0.4));
    let signed = volume_from(DIMS, |v| Voxels::I16(v.iter().map(|v| (v * 4000.0 - 1024.0) as i16).collect()));
    assert_right(&signed, &ramp(-1024.0, 2976.0, 0.5));
}

#[test]
fn volumes_of_numbers_that_are_no_codes_look_as_the_twin_has_them() {
    let floats = volume_from(DIMS, |v| {
        let mut values: Vec<f32> = v.iter().map(|v| (v * 3e-3) as f32).collect();
        // Counts as the lowest value.
        values[4000] = f32::NAN;
        Voxels::F32(values)
    });
    assert_right(&floats, &ramp(0.0, 3e-3, 0.5));
    let wide = volume_from(DIMS, |v| Voxels::I32(v.iter().map(|v| (v * 2e9 - 1e9) as i32).collect()));
    assert_right(&wide, &ramp(-1e9, 1e9, 0.5));
}

#[test]
fn a_constant_volume_is_a_cloud_in_the_shape_of_its_box() {
    let constant = volume_of([13, 9, 11], |_| 7);
    let cloud = json!({
        "transfer_function": {"points": [{"value": 7, "color": "#ff8844", "opacity": 0.05}]},
        "ambient_occlusion": {"levels": 3}, "lighting": {"exposure": 1.0}
    });
    assert_right(&constant, &cloud);
    let clear = json!({"transfer_function": {"points": [{"value": 7, "color": "#ff8844", "opacity": 0.0}]}});
    let mut studio = Studio::new(constant);
    let scene = studio.scene(&clear);
    assert!(studio.picture(&scene, [16, 16]).pixels.iter().all(|&p| p == [0, 0, 0, 255]));
}

#[test]
fn volumes_of_one_voxel_and_of_one_slice_or_row_are_drawn() {
    let cloud = json!({
        "transfer_function": {"points": [
            {"value": 0, "color": "#ff8844", "opacity": 0.3}, {"value": 900, "color": "#4488ff", "opacity": 0.7}
        ]},
        "ambient_occlusion": {"levels": 2}, "lighting": {"exposure": 1.0}
    });
    for dims in [[1, 1, 1], [9, 7, 1], [1, 8, 6], [7, 1, 9], [17, 1, 1]] {
        let volume = volume_of(dims, |[i, j, k]| (100 * i + 37 * j + 53 * k) as u16);
        assert_right(&volume, &cloud);
        let mut studio = Studio::new(volume);
        let scene = studio.scene(&cloud);
        let picture = studio.picture(&scene, [SIZE, SIZE]);
        assert!(picture.pixels.iter().any(|p| p[0] > 20), "{dims:?}: nothing to see");
    }
}

#[test]
fn the_least_of_features_gives_the_same_picture() {
    for (volume, document) in [
        (boxes(), ramp(0.0, 255.0, 0.9)),
        (procedural(ProceduralKind::Cloud, DIMS), ramp(0.0, 65535.0, 0.5)),
        (procedural(ProceduralKind::MarschnerLobb, DIMS), ramp(0.0, 65535.0, 0.9)),
    ] {
        let pictures = [GpuOptions::default(), baseline()].map(|options| {
            let mut studio = Studio::with_options(volume.clone(), &options);
            let scene = studio.scene(&document);
            studio.picture(&scene, [SIZE, SIZE])
        });
        let difference = Difference::between_pictures(&pictures[0], &pictures[1]);
        assert!(difference.is_within(0.1, 1.0, 4.0), "{difference:?}");
    }
}

#[test]
fn a_range_that_is_a_little_off_is_noticed_in_every_format() {
    let floats = volume_from(DIMS, |v| Voxels::F32(v.iter().map(|&v| v as f32).collect()));
    for (volume, lowest, highest) in
        [(gyroid(), 0.0, 255.0), (procedural(ProceduralKind::MarschnerLobb, DIMS), 0.0, 65535.0), (floats, 0.0, 1.0)]
    {
        for options in [GpuOptions::default(), baseline()] {
            let (drawn, described) = (ramp(lowest, highest, 0.5), ramp(lowest, 1.02 * highest, 0.5));
            let difference = difference(&volume, &options, &drawn, &described);
            assert!(!is_right(&difference), "{difference:?}");
        }
    }
}
