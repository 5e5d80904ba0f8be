//! Mandelbulb of power 8 (White and Nylander, 2009): crevices at all scales.

use glam::DVec3;

use super::{coverage, dims_vec, voxel_centre};

/// Half the width of the cube around the bulb.
const HALF_WIDTH: f64 = 1.2;

const ITERATIONS: u32 = 8;

/// Squared distance from the origin beyond which the orbit never comes back.
const ESCAPE: f64 = 256.0;

/// 255 inside, falling to 0 over the first two voxels outside. The bulb fills the shortest axis.
pub(super) fn voxel(dims: [u32; 3]) -> impl Fn([u32; 3]) -> u8 + Sync {
    let dims = dims_vec(dims);
    let scale = 2.0 * HALF_WIDTH / dims.min_element();
    move |voxel| coverage(distance((voxel_centre(voxel) - 0.5 * dims) * scale) / (2.0 * scale) - 0.5)
}

/// Estimated distance outside the bulb, 0 inside (Hart's estimator, 0.25 log|z|² |z| / |dz|).
fn distance(c: DVec3) -> f64 {
    let mut z = c;
    let mut derivative = 1.0;
    for _ in 0..ITERATIONS {
        let squared = z.length_squared();
        if squared > ESCAPE {
            return 0.25 * squared.ln() * squared.sqrt() / derivative;
        }
        derivative = 8.0 * squared.powi(3) * squared.sqrt() * derivative + 1.0;
        z = eighth_power(z) + c;
    }
    0.0
}

/// The triplex power z⁸, multiplied out so that it needs no angles.
fn eighth_power(z: DVec3) -> DVec3 {
    let DVec3 { x, y, z } = z;
    let (x2, y2, z2) = (x * x, y * y, z * z);
    let (x4, y4, z4) = (x2 * x2, y2 * y2, z2 * z2);
    // On the polar axis the quotients below are 0/0; the limit is 0.
    let k3 = (x2 + z2).max(1e-30);
    let k2 = k3.powi(7).sqrt().recip();
    let k1 = x4 + y4 + z4 - 6.0 * y2 * z2 - 6.0 * x2 * y2 + 2.0 * z2 * x2;
    let k4 = x2 - y2 + z2;
    DVec3::new(
        64.0 * x * y * z * (x2 - z2) * k4 * (x4 - 6.0 * x2 * z2 + z4) * k1 * k2,
        -16.0 * y2 * k3 * k4 * k4 + k1 * k1,
        -8.0 * y * k4 * (x4 * x4 - 28.0 * x4 * x2 * z2 + 70.0 * x4 * z4 - 28.0 * x2 * z2 * z4 + z4 * z4) * k1 * k2,
    )
}
