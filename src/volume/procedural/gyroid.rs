//! Gyroid: deep cavities everywhere and nothing to skip, the worst case for a ray caster.

use std::f64::consts::TAU;

use glam::DVec3;

use super::{fold_seed, hash, voxel_centre};

/// Periods along the longest axis.
const PERIODS: f64 = 4.0;

/// Largest value of the gyroid function.
const LARGEST: f64 = 1.5;

/// 0 to 255 for the gyroid function's -1.5 to 1.5; the surface is at 127.5. Seed 0 has a node at index (0, 0, 0).
pub(super) fn voxel(dims: [u32; 3], seed: u64) -> impl Fn([u32; 3]) -> u8 + Sync {
    let longest = dims.into_iter().max().unwrap_or(1);
    let scale = PERIODS * TAU / f64::from(longest);
    let phase = match fold_seed(seed) {
        0 => DVec3::ZERO,
        seed => {
            DVec3::from_array([0, 1, 2].map(|axis| TAU * f64::from(hash([axis, 0, 0], seed)) / f64::from(u32::MAX)))
        }
    };
    move |voxel| {
        let p = voxel_centre(voxel) * scale + phase;
        let (sin, cos) = (p.map(f64::sin), p.map(f64::cos));
        let g = sin.x * cos.y + sin.y * cos.z + sin.z * cos.x;
        (127.5 + 127.5 * g / LARGEST).round() as u8
    }
}
