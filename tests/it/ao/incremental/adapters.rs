//! That levels do not depend on what adapters can do, and accessibility hardly.

use std::sync::Arc;

use glam::DVec3;
use spao_server::gpu::GpuOptions;
use spao_server::renderer::Coverage;
use spao_server::scene::AmbientOcclusion;
use spao_server::volume::Volume;

use super::edits::Editor;
use super::{Bench, Bits, SMALL_BINDING, State, balls, bytes_of, shorts_of};
use crate::ao::support::{hybrid, mipmap, n_buffer};

/// The bits of some settings on an adapter.
fn bits(volume: &Arc<Volume>, options: &GpuOptions, all: &[AmbientOcclusion]) -> Vec<Bits> {
    let bench = Bench::with_options(volume.clone(), options);
    let transfer = Editor::new(0, volume.code_map.value_range()).usual();
    let state = |&settings| State { transfer: transfer.clone(), settings, coverage: Coverage::Everywhere };
    all.iter().map(|settings| bench.fresh_bits(&state(settings))).collect()
}

fn largest_difference(a: &Bits, b: &Bits) -> f32 {
    let pairs = a.samples.iter().zip(&b.samples);
    pairs.map(|(a, b)| (f32::from_bits(*a) - f32::from_bits(*b)).abs()).fold(0.0, f32::max)
}

#[test]
fn levels_are_the_same_on_every_adapter_and_accessibility_to_the_precision_of_its_format() {
    let settings = [n_buffer(6, 1.0), n_buffer(5, 0.0), mipmap(6, 1.0), hybrid(7, 2, 2.0)];
    let baseline = GpuOptions { baseline_features_only: true, ..GpuOptions::default() };
    let small = GpuOptions { max_storage_binding_bytes: Some(SMALL_BINDING), ..GpuOptions::default() };
    let small_baseline = GpuOptions { max_storage_binding_bytes: Some(SMALL_BINDING), ..baseline.clone() };
    let bytes = bytes_of([37, 29, 101], DVec3::ONE, balls([37, 29, 101], 9, 0.25));
    let shorts = shorts_of([83, 25, 90], DVec3::new(0.7, 1.9, 1.0), balls([83, 25, 90], 4, 0.0));
    for volume in [bytes, shorts] {
        let usual = bits(&volume, &GpuOptions::default(), &settings);
        let largest = usual[0].levels.iter().map(Vec::len).max().expect("levels");
        assert!(4 * largest as u64 > SMALL_BINDING, "every level fits");
        for (options, half_floats) in [(&small, false), (&baseline, true), (&small_baseline, true)] {
            for ((a, b), settings) in usual.iter().zip(bits(&volume, options, &settings)).zip(&settings) {
                assert!(a.levels == b.levels, "{options:?} {settings:?}");
                let difference = largest_difference(a, &b);
                // Half floats have eleven bits: half a step of 1/2048 below 1.
                let allowed = 2.0 / 65535.0 + if half_floats { 1.0 / 4096.0 } else { 0.0 };
                assert!(difference <= allowed, "{options:?} {settings:?}: {difference}");
            }
        }
    }
}
