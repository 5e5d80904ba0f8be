//! What must not change a result: how bindings are cut, when it is computed, and on which formats.

use glam::DVec3;
use spao_server::ao::{Cuts, level_layouts};
use spao_server::gpu::GpuOptions;
use spao_server::render_thread::RenderHandle;
use spao_server::scene::{AmbientOcclusion, AoMethod};

use super::support::{Subject, all_work, boxes, hybrid, mipmap, n_buffer, opacities, random_volume, raytraced};

fn spawn(options: GpuOptions) -> RenderHandle {
    RenderHandle::spawn(options).expect("tests need an adapter; a software one will do").0
}

fn with_bindings(bytes: u64) -> RenderHandle {
    spawn(GpuOptions { max_storage_binding_bytes: Some(bytes), ..GpuOptions::default() })
}

/// Number of steps of a build with bindings of at most so many bytes, if it has a plan.
fn steps(dims: [u32; 3], settings: &AmbientOcclusion, largest_binding: u64, sampled: bool) -> Option<usize> {
    let layouts = level_layouts(dims, settings);
    // No gradient of values in [0, 1] is longer than 1/2 along an axis.
    let half_offset = 0.25 * settings.normal_factor;
    let cuts = Cuts { dims, layouts: &layouts, largest_binding, sampled, half_offset };
    cuts.plan(settings, &all_work(dims, &layouts)).map(|steps| steps.len())
}

/// The smallest binding, in steps of a sixteenth of the largest level, with which a build has a plan at all.
fn tightest_binding(dims: [u32; 3], settings: &AmbientOcclusion, sampled: bool) -> u64 {
    let layouts = level_layouts(dims, settings);
    let largest = layouts.iter().map(|l| l.bytes()).max().expect("levels");
    let mut bindings = (1..16).map(|n| (largest * n / 16).next_multiple_of(256));
    bindings.find(|&b| steps(dims, settings, b, sampled).is_some()).expect("less than everything suffices")
}

#[test]
fn windows_of_levels_give_the_same_bits_as_whole_levels() {
    let transfer = opacities(&[(20.0, 0.0), (200.0, 0.7)]);
    let whole = Subject::new(boxes());
    let dims = whole.volume.grid.dims;
    for settings in [n_buffer(5, 1.0), n_buffer(6, 0.0), mipmap(6, 2.0), hybrid(6, 2, 1.0), raytraced(3, 1.0, 16)] {
        let sampled = whole.renderer.info().texture_16bit_norm && settings.method == AoMethod::Spao;
        let binding = tightest_binding(dims, &settings, sampled);
        let layouts = level_layouts(dims, &settings);
        assert!(layouts.iter().any(|l| l.bytes() > binding), "{settings:?}: {binding} bytes hold every level");
        if settings.method == AoMethod::Spao {
            assert!(
                steps(dims, &settings, binding, sampled) > steps(dims, &settings, u64::MAX, sampled),
                "{settings:?}"
            );
        }
        let windowed = Subject::on(with_bindings(binding), boxes());
        let (a, b) = (whole.accessibility(&transfer, settings), windowed.accessibility(&transfer, settings));
        assert!(a == b, "{settings:?}");
    }
}

#[test]
fn a_volume_that_is_built_twice_gives_the_same_bits() {
    let transfer = opacities(&[(20.0, 0.0), (200.0, 0.7)]);
    for settings in [n_buffer(6, 1.0), mipmap(6, 1.0), hybrid(6, 2, 1.0), raytraced(4, 1.0, 16)] {
        // Under another name, so that it does not come from the cache.
        let results = [Subject::new(boxes()), Subject::new(boxes())].map(|s| s.accessibility(&transfer, settings));
        assert!(results[0] == results[1], "{settings:?}");
    }
    let subject = Subject::new(boxes());
    let other = opacities(&[(20.0, 0.0), (200.0, 0.71)]);
    assert!(subject.accessibility(&transfer, n_buffer(6, 1.0)) != subject.accessibility(&other, n_buffer(6, 1.0)));
}

#[test]
fn an_adapter_without_16_bit_textures_gives_the_same_up_to_half_floats() {
    let baseline = spawn(GpuOptions { baseline_features_only: true, ..GpuOptions::default() });
    assert!(!baseline.info().texture_16bit_norm);
    // 8 bits stay r8unorm, 16 bits become r32float.
    for volume in [boxes(), random_volume([35, 22, 17], DVec3::ONE)] {
        let [lowest, highest] = volume.code_map.value_range();
        let transfer = opacities(&[(lowest + 0.1 * (highest - lowest), 0.0), (highest, 0.7)]);
        let (usual, fallback) = (Subject::new(volume.clone()), Subject::on(baseline.clone(), volume));
        for settings in [n_buffer(6, 1.0), hybrid(6, 2, 1.0), raytraced(4, 1.0, 16)] {
            let (a, b) = (usual.accessibility(&transfer, settings), fallback.accessibility(&transfer, settings));
            let largest = a.iter().zip(&b).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
            // Eleven bits, so half a step of 1/2048 below 1, and of the sixteen bits.
            assert!(largest > 0.0 && largest < 1.0 / 4096.0 + 1.0 / 65535.0, "{settings:?}: {largest}");
        }
    }
}
