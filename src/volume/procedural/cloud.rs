//! Cloud: fractal gradient noise, translucent, so that no ray ends early.

use glam::DVec3;

use super::{dims_vec, fold_seed, hash, voxel_centre};

const OCTAVES: u32 = 5;

/// Noise cells along the longest axis in the first octave.
const CELLS: f64 = 5.0;

/// How far noise pushes the cloud's border in and out, in radii.
const RAGGEDNESS: f64 = 1.1;

/// 0 in clear air to 65535 in the densest part, an ellipsoid that fills the volume and whose border noise moves.
pub(super) fn voxel(dims: [u32; 3], seed: u64) -> impl Fn([u32; 3]) -> u16 + Sync {
    let dims = dims_vec(dims);
    let seed = fold_seed(seed);
    let scale = CELLS / dims.max_element();
    move |voxel| {
        let p = voxel_centre(voxel);
        let radius = (2.0 * p / dims - 1.0).length();
        if radius >= 1.0 {
            return 0;
        }
        // The last factor brings the density to 0 at the ellipsoid's border, wherever the noise would go on.
        let density = (0.55 - radius + RAGGEDNESS * fractal(p * scale, seed)) * (8.0 * (1.0 - radius)).min(1.0);
        (65535.0 * density.clamp(0.0, 1.0)).round() as u16
    }
}

/// Sum of octaves of noise, each at twice the frequency and half the amplitude; about -1 to 1.
fn fractal(p: DVec3, seed: u32) -> f64 {
    (0..OCTAVES)
        .map(|octave| {
            let frequency = f64::from(1_u32 << octave);
            noise(p * frequency, seed.wrapping_add(octave.wrapping_mul(0x85eb_ca6b))) / frequency
        })
        .sum()
}

/// Gradient noise (Perlin 2002) over a hashed lattice.
fn noise(p: DVec3, seed: u32) -> f64 {
    let cell = p.floor();
    let f = p - cell;
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let corner = |dx: i32, dy: i32, dz: i32| {
        let [x, y, z] = cell.to_array().map(|c| c as i32);
        let to_p = f - DVec3::new(f64::from(dx), f64::from(dy), f64::from(dz));
        gradient(hash([x + dx, y + dy, z + dz], seed)).dot(to_p)
    };
    let mix = |a: f64, b: f64, t: f64| a + (b - a) * t;
    let along_x = |dy, dz| mix(corner(0, dy, dz), corner(1, dy, dz), fade.x);
    let along_y = |dz| mix(along_x(0, dz), along_x(1, dz), fade.y);
    mix(along_y(0), along_y(1), fade.z)
}

/// One of the twelve directions to the middle of a cube's edge.
fn gradient(hash: u32) -> DVec3 {
    let sign = |bit: u32| if hash >> bit & 1 == 0 { 1.0 } else { -1.0 };
    let (a, b) = (sign(0), sign(1));
    match (hash >> 2) % 3 {
        0 => DVec3::new(0.0, a, b),
        1 => DVec3::new(a, 0.0, b),
        _ => DVec3::new(a, b, 0.0),
    }
}
