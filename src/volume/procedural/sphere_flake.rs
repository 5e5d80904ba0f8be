//! Sphere flake (Haines, "A Proposal for Standard Graphics Environments", 1987): sparse, with contact shadows.

use std::f64::consts::{PI, TAU};

use glam::{DQuat, DVec3};

use super::{coverage, dims_vec, each_slice};
use crate::volume::{LoadWatch, VolumeError};

/// Generations of spheres, if voxels are fine enough to show them.
const GENERATIONS: u32 = 5;

/// A child's radius over its parent's.
const SHRINK: f64 = 1.0 / 3.0;

/// Polar angle of the three children at the top, asin(1/√3).
const TOP_ANGLE: f64 = 0.615_479_708_670_387_3;

struct Sphere {
    /// In index space.
    centre: DVec3,
    radius: f64,
}

/// 255 inside the spheres, with a ramp over two voxels at their surface: central differences see all of it, so that
/// shading is smooth. The flake fills the shortest axis.
pub(super) fn fill(dims: [u32; 3], out: &mut [u8], watch: &LoadWatch) -> Result<(), VolumeError> {
    let size = dims_vec(dims);
    let mut spheres = Vec::new();
    // A line of ever smaller touching spheres reaches (1 + 2/3 + 2/9 + ...) = 2 radii from the centre.
    let first = Sphere { centre: 0.5 * size, radius: 0.25 * size.min_element() };
    add_flake(&mut spheres, first, DVec3::Z, GENERATIONS);

    let [nx, ny, _] = dims.map(|n| n as usize);
    each_slice(dims, out, watch, |k, slice| {
        let z = k as f64 + 0.5;
        for sphere in spheres.iter().filter(|s| (s.centre.z - z).abs() < s.radius + 1.0) {
            draw(sphere, z, slice, [nx, ny]);
        }
    })
}

/// A sphere, six children around its equator and three at its top, and theirs.
fn add_flake(spheres: &mut Vec<Sphere>, sphere: Sphere, up: DVec3, generations: u32) {
    let Sphere { centre, radius } = sphere;
    spheres.push(sphere);
    let child_radius = radius * SHRINK;
    // Finer than half a voxel, spheres would only be noise.
    if generations <= 1 || child_radius < 0.5 {
        return;
    }
    let turned = DQuat::from_rotation_arc(DVec3::Z, up);
    let equator = (0..6).map(|i| (0.5 * PI, TAU / 6.0 * f64::from(i)));
    let top = (0..3).map(|i| (TOP_ANGLE, TAU / 12.0 + TAU / 3.0 * f64::from(i)));
    for (polar, azimuth) in equator.chain(top) {
        let direction = turned * DVec3::new(polar.sin() * azimuth.cos(), polar.sin() * azimuth.sin(), polar.cos());
        let child = Sphere { centre: centre + direction * (radius + child_radius), radius: child_radius };
        add_flake(spheres, child, direction.normalize(), generations - 1);
    }
}

/// Adds the voxels of a sphere to the slice at `z`.
fn draw(sphere: &Sphere, z: f64, slice: &mut [u8], [nx, ny]: [usize; 2]) {
    let reach = sphere.radius + 1.5;
    // `as` saturates at 0.
    let range = |centre: f64, n: usize| (centre - reach) as usize..((centre + reach).ceil() as usize).min(n);
    for j in range(sphere.centre.y, ny) {
        for i in range(sphere.centre.x, nx) {
            let p = DVec3::new(i as f64 + 0.5, j as f64 + 0.5, z);
            let out = &mut slice[j * nx + i];
            *out = (*out).max(coverage(0.5 * (p.distance(sphere.centre) - sphere.radius)));
        }
    }
}
