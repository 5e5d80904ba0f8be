//! How bright pictures are: the measure of open surfaces on the GPU, and what follows from it.

use serde_json::{Value, json};
use spao_server::reference::{OpacityField, surface_reference};
use spao_server::renderer::exposure;
use spao_server::scene::Scene;
use spao_server::volume::{ProceduralKind, Volume};

use super::support::{Studio, boxes, ct_head, gyroid, procedural};

/// Accessibility of open surfaces, by the GPU.
fn measured(studio: &Studio, scene: &Scene) -> f64 {
    let mut build = studio.renderer.fresh_ao_build(scene).expect("the build fits");
    let (gpu, stages) = studio.renderer.ao_tools();
    while !build.advance(gpu, stages).expect("the build goes on") {}
    build.finish(gpu).expect("the build ends").expect("there is a result").surface_reference
}

fn opacity(volume: &Volume, scene: &Scene) -> OpacityField {
    let values: Vec<f64> = (0..volume.voxels.len()).map(|i| volume.voxels.value(i)).collect();
    OpacityField::from_values(volume.grid.dims, &values, &scene.transfer_function, volume.grid.smallest_spacing())
}

/// How many of 255 bins over the square root of accessibility the GPU is off.
fn bins_off(studio: &mut Studio, document: &Value) -> f64 {
    let scene = studio.scene(document);
    let accessibility = studio.accessibility(&scene);
    let expected = surface_reference(&opacity(&studio.volume, &scene), &accessibility);
    255.0 * (measured(studio, &scene).sqrt() - expected.sqrt()).abs()
}

/// Half a bin of rounding, and as much for weights that are rounded to 1/255.
const BINS: f64 = 1.0;

#[test]
fn the_gpu_finds_the_accessibility_of_open_surfaces() {
    let thin = procedural(ProceduralKind::SphereFlake, [33, 34, 35]);
    for volume in [boxes().into(), gyroid().into(), thin.into(), ct_head()] {
        let mut studio = Studio::new(volume);
        for occlusion in [
            json!({"levels": 5}),
            json!({"levels": 3, "normal_factor": 0}),
            json!({"levels": 6, "structure": "mipmap"}),
        ] {
            let off = bins_off(&mut studio, &json!({"ambient_occlusion": occlusion}));
            assert!(off <= BINS, "{off} bins for {occlusion} on {:?}", studio.volume.grid.dims);
        }
    }
}

#[test]
fn the_ray_traced_method_counts_its_surface_too() {
    let mut studio = Studio::new(boxes());
    let off = bins_off(&mut studio, &json!({"ambient_occlusion": {"method": "raytraced", "levels": 4, "rays": 16}}));
    assert!(off <= BINS, "{off} bins");
}

#[test]
fn a_surface_that_is_counted_a_little_differently_is_noticed() {
    let mut studio = Studio::new(gyroid());
    let scene = studio.scene(&json!({"ambient_occlusion": {"levels": 5}}));
    let gpu = measured(&studio, &scene).sqrt();
    let accessibility = studio.accessibility(&scene);
    let opacity = opacity(&studio.volume, &scene);
    let off = |opacity: &OpacityField, accessibility: &[f64]| {
        255.0 * (gpu - surface_reference(opacity, accessibility).sqrt()).abs()
    };
    assert!(off(&opacity, &accessibility) <= BINS);
    let darker: Vec<f64> = accessibility.iter().map(|a| 0.96 * a).collect();
    assert!(off(&opacity, &darker) > BINS);
    let inverted = OpacityField { alpha: opacity.alpha.iter().map(|a| 1.0 - a).collect(), ..opacity.clone() };
    assert!(off(&inverted, &accessibility) > BINS);
}

#[test]
fn without_a_surface_the_measure_is_1() {
    let studio = Studio::new(boxes());
    let clear = json!({"transfer_function": {"points": [{"value": 0, "color": "#ffffff", "opacity": 0.0}]}});
    assert_eq!(measured(&studio, &studio.scene(&clear)), 1.0);
}

#[test]
fn exposure_follows_the_scene_first_and_the_surface_otherwise() {
    let studio = Studio::new(boxes());
    let of = |document: &Value, reference: f64| {
        let chosen = exposure(&studio.scene(document), reference);
        (chosen.factor, chosen.inverse_reference)
    };
    assert_eq!(of(&json!({"lighting": {"exposure": 2.5}}), 0.25), (2.5, 0.0));
    assert_eq!(of(&json!({"ambient_occlusion": {"method": "off"}}), 0.25), (1.0, 0.0));
    assert_eq!(of(&json!({}), 0.25), (1.0, 4.0));
    assert_eq!(of(&json!({"ambient_occlusion": {"strength": 0.5}}), 0.25), (1.0, 1.6));
    assert_eq!(of(&json!({"ambient_occlusion": {"strength": 0.0}}), 0.25), (1.0, 1.0));
    // What is seen is a cavity and looks like one.
    assert_eq!(of(&json!({}), 1e-6), (1.0, 64.0));
}
