//! A real CT head: random pixels against the twin.

use glam::DVec3;
use serde_json::json;
use spao_server::reference::{Exposure, OpacityField, surface_reference};
use spao_server::renderer::exposure;
use spao_server::scene::{AoMethod, ClipPlane, Rgba, Scene};

use super::support::{Change, Difference, Light, Studio, Twin, ct_head, some_pixels, unit};

const SIZE: [u32; 2] = [320, 240];
const PIXELS: u64 = 500;

/// Random pixels against the twin, which computes the exposure itself and lights with the GPU's accessibility
/// (that has tests of its own).
fn difference(studio: &mut Studio, drawn: &Scene, described: &Scene) -> Difference {
    let picture = studio.picture(drawn, SIZE);
    let accessibility = studio.accessibility(drawn);
    let light = light(studio, described, &accessibility);
    let pixels = some_pixels(SIZE, PIXELS);
    let twin = Twin::new(&studio.volume).pixels(described, &light, SIZE, &pixels);
    Difference::between(pixels.iter().map(|&[x, y]| unit(picture.at(x, y))), twin)
}

fn light<'a>(studio: &Studio, scene: &Scene, accessibility: &'a [f64]) -> Light<'a> {
    let volume = &studio.volume;
    let values: Vec<f64> = (0..volume.voxels.len()).map(|i| volume.voxels.value(i)).collect();
    let spacing = volume.grid.smallest_spacing();
    let opacity = OpacityField::from_values(volume.grid.dims, &values, &scene.transfer_function, spacing);
    let chosen = exposure(scene, surface_reference(&opacity, accessibility));
    Light {
        accessibility: (scene.ambient_occlusion.method != AoMethod::Off).then_some(accessibility),
        exposure: Exposure { factor: chosen.factor, inverse_reference: chosen.inverse_reference },
    }
}

/// Mean within half a step of rounding; the worst pixel lies on a silhouette (see `pictures`).
fn is_right(difference: &Difference) -> bool {
    difference.is_within(0.6, 2.5, 32.0)
}

#[test]
fn a_head_looks_as_the_twin_has_it() {
    let mut studio = Studio::new(ct_head());
    let center = studio.volume.grid.center();
    let documents = [
        json!({}),
        json!({"ambient_occlusion": {"method": "off"}}),
        json!({"transfer_function": {"preset": "ct_bone"}, "ambient_occlusion": {"structure": "mipmap"}}),
        json!({"transfer_function": {"preset": "ct_soft_tissue"}, "camera": {"projection": "orthographic"},
               "lighting": {"direction": [0.6, -0.8, 0.0]}, "ambient_occlusion": {"structure": "mipmap"}}),
        json!({"transfer_function": {"preset": "ct_bone"}, "rendering": {"sampling_rate": 0.5},
               "ambient_occlusion": {"structure": "mipmap"}}),
    ];
    for document in documents {
        let scene = studio.scene(&document);
        let difference = difference(&mut studio, &scene, &scene);
        assert!(is_right(&difference), "{difference:?} for {document}");
    }
    let mut cut = studio.scene(&json!({"ambient_occlusion": {"method": "off"}}));
    cut.rendering.clip_planes = vec![ClipPlane { normal: DVec3::Y, d: -center.y - 3.3 }];
    cut.rendering.background = Rgba([1.0, 1.0, 1.0, 0.3]);
    let difference = difference(&mut studio, &cut, &cut);
    assert!(is_right(&difference), "{difference:?} for a head that is cut open");
}

#[test]
fn a_head_whose_twin_is_lit_a_little_differently_is_noticed() {
    let mut studio = Studio::new(ct_head());
    let drawn = studio.scene(&json!({"ambient_occlusion": {"structure": "mipmap"}}));
    let changes: [Change<'_>; 4] = [
        ("strength", &|s| s.ambient_occlusion.strength = 0.9),
        ("exposure", &|s| s.lighting.exposure = Some(1.5)),
        ("diffuse", &|s| s.lighting.diffuse += 0.04),
        ("opacity", &|s| s.transfer_function.points.iter_mut().for_each(|p| p.opacity *= 0.7)),
    ];
    for (name, change) in changes {
        let mut described = drawn.clone();
        change(&mut described);
        let difference = difference(&mut studio, &drawn, &described);
        assert!(!is_right(&difference), "{name} goes unnoticed: {difference:?}");
    }
}
