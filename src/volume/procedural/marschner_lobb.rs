//! The test signal of Marschner and Lobb, "An Evaluation of Reconstruction Filters for Volume Rendering" (1994).

use std::f64::consts::{FRAC_PI_2, TAU};

use super::{dims_vec, voxel_centre};

const ALPHA: f64 = 0.25;
const FREQUENCY: f64 = 6.0;

/// 0 to 65535 for the signal's 0 to 1 over [-1, 1]³. At 40³ it is sampled just above the Nyquist rate.
pub(super) fn voxel(dims: [u32; 3]) -> impl Fn([u32; 3]) -> u16 + Sync {
    let dims = dims_vec(dims);
    move |voxel| {
        let p = 2.0 * voxel_centre(voxel) / dims - 1.0;
        let ripple = (TAU * FREQUENCY * (FRAC_PI_2 * p.x.hypot(p.y)).cos()).cos();
        let signal = (1.0 - (FRAC_PI_2 * p.z).sin() + ALPHA * (1.0 + ripple)) / (2.0 * (1.0 + ALPHA));
        (65535.0 * signal).round() as u16
    }
}
