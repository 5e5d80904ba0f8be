//! Settings, repeatable random numbers and comparisons for the tests of the reference.

use glam::DVec3;
use spao_server::reference::{OpacityField, ValueField};
use spao_server::scene::{AmbientOcclusion, AoMethod, AoStructure, Radius};

/// Full-sphere SPAO on N-buffers with four shells.
pub(super) fn ao_settings() -> AmbientOcclusion {
    AmbientOcclusion {
        method: AoMethod::Spao,
        structure: AoStructure::NBuffer,
        levels: 4,
        mip_levels: 0,
        normal_factor: 0.0,
        strength: 1.0,
        rays: 512,
        radius: Radius::SameAsLevels,
        falloff: 0.5,
        color_bleeding: 0.0,
    }
}

/// The same numbers on every run, evenly in [0, 1).
pub(super) struct Random(u64);

impl Random {
    pub(super) fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// splitmix64.
    pub(super) fn unit(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) >> 11) as f64 / (1u64 << 53) as f64
    }

    /// A position in the volume's box enlarged by `margin` voxels.
    pub(super) fn position(&mut self, dims: [u32; 3], margin: f64) -> DVec3 {
        DVec3::from_array(dims.map(|n| self.unit() * (f64::from(n) + 2.0 * margin) - margin))
    }
}

/// Asymmetric, sparse opacity with every voxel different.
pub(super) fn random_opacity(dims: [u32; 3], seed: u64) -> OpacityField {
    let mut random = Random::new(seed);
    let mut alpha = || {
        let (a, occupied) = (random.unit(), random.unit() < 0.4);
        if occupied { a } else { 0.0 }
    };
    let count = dims.iter().map(|&n| n as usize).product();
    OpacityField { dims, alpha: (0..count).map(|_| alpha()).collect() }
}

/// Values equal to opacities, so that normals point away from what is dense.
pub(super) fn values_like(opacity: &OpacityField) -> ValueField {
    ValueField { dims: opacity.dims, normalised: opacity.alpha.clone() }
}

/// Mean of α over a cube, by the overlap of the cube with every cell.
pub(super) fn brute_force_box_mean(opacity: &OpacityField, centre: DVec3, width: f64) -> f64 {
    let overlap = |cell: u32, a: usize| {
        let (low, high) = (centre[a] - width / 2.0, centre[a] + width / 2.0);
        (high.min(f64::from(cell) + 1.0) - low.max(f64::from(cell))).max(0.0)
    };
    let [nx, ny, nz] = opacity.dims;
    let mut sum = 0.0;
    for k in 0..nz {
        for j in 0..ny {
            for i in 0..nx {
                let alpha = opacity.at([i, j, k].map(i64::from));
                sum += alpha * overlap(i, 0) * overlap(j, 1) * overlap(k, 2);
            }
        }
    }
    sum / width.powi(3)
}

/// The largest |a - b|; infinite when the lengths differ or a number is NaN.
pub(super) fn largest_difference(a: &[f64], b: &[f64]) -> f64 {
    if a.len() != b.len() {
        return f64::INFINITY;
    }
    a.iter()
        .zip(b)
        .map(|(a, b)| (a - b).abs())
        .fold(0.0, |worst, d| if d.is_nan() { f64::INFINITY } else { d.max(worst) })
}

#[track_caller]
pub(super) fn assert_close(actual: f64, expected: f64, tolerance: f64) {
    assert!((actual - expected).abs() <= tolerance, "{actual} is not {expected} within {tolerance}");
}

#[test]
fn the_comparison_of_numbers_notices_one_wrong_a_missing_and_an_undefined_one() {
    assert_eq!(largest_difference(&[1.0, 2.0, 3.0], &[1.0, 2.0, 3.0]), 0.0);
    assert_eq!(largest_difference(&[1.0, 2.5, 3.0], &[1.0, 2.0, 3.0]), 0.5);
    assert_eq!(largest_difference(&[1.0, 2.0], &[1.0, 2.0, 3.0]), f64::INFINITY);
    assert_eq!(largest_difference(&[f64::NAN, 2.0], &[1.0, 2.0]), f64::INFINITY);
}

#[test]
#[should_panic(expected = "is not")]
fn two_numbers_that_differ_are_not_close() {
    assert_close(1.0, 1.1, 0.05);
}

#[test]
#[should_panic(expected = "is not")]
fn an_undefined_number_is_close_to_nothing() {
    assert_close(f64::NAN, 1.0, 0.05);
}

#[test]
fn the_brute_force_box_mean_notices_one_changed_voxel() {
    let mut opacity = random_opacity([5, 4, 3], 1);
    let centre = DVec3::new(2.2, 1.7, 1.4);
    let before = brute_force_box_mean(&opacity, centre, 3.0);
    opacity.alpha[5 * 4 + 5 + 2] += 0.1;
    assert!((brute_force_box_mean(&opacity, centre, 3.0) - before).abs() > 1e-3);
}
