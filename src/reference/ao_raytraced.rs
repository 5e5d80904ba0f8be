//! Ray-traced ambient occlusion: the reference that other methods are measured against (METHODS 3).

use std::f64::consts::PI;

use glam::DVec3;

use super::field::{OpacityField, ValueField, at_voxel_centres, dims_vec};
use super::gradient::offset_normal;
use crate::scene::{AmbientOcclusion, Radius};

/// Euclidean length of a step along a ray, in voxels.
const STEP: f64 = 0.5;
/// Max-norm distance at which rays start: the cut-out of SPAO's level 0.
const START: f64 = 0.5;
/// Below this length of n there is no hemisphere to speak of.
const WEAKEST_NORMAL: f64 = 1e-3;

/// `count` unit directions spread evenly over the sphere, in order from +z to -z:
/// z_i = 1 - (2i + 1) / count, azimuth i π (3 - √5).
pub fn fibonacci_directions(count: u32) -> Vec<DVec3> {
    let golden_angle = PI * (3.0 - 5.0_f64.sqrt());
    let direction = |i: u32| {
        let z = 1.0 - f64::from(2 * i + 1) / f64::from(count);
        let (sin, cos) = (f64::from(i) * golden_angle).sin_cos();
        let radius = (1.0 - z * z).sqrt();
        DVec3::new(radius * cos, radius * sin, z)
    };
    (0..count).map(direction).collect()
}

/// Accessibility by rays in all directions. Lengths are in voxels: index space, whatever the spacing.
#[derive(Clone, Debug)]
pub struct RaytracedAo<'a> {
    opacity: &'a OpacityField,
    values: &'a ValueField,
    directions: Vec<DVec3>,
    /// Max-norm distance at which rays end.
    reach: f64,
    full_sphere: bool,
}

impl<'a> RaytracedAo<'a> {
    /// `opacity` and `values` are of the same volume; of `settings`, `levels`, `normal_factor` (only whether it
    /// is 0), `rays` and `radius` count.
    pub fn new(opacity: &'a OpacityField, values: &'a ValueField, settings: &AmbientOcclusion) -> Self {
        assert_eq!(opacity.dims, values.dims, "opacity and values of one volume");
        let reach = match settings.radius {
            Radius::SameAsLevels => 0.5 * f64::from(1 << settings.levels),
            Radius::Voxels(voxels) => voxels,
            Radius::Unlimited => f64::INFINITY,
        };
        let directions = fibonacci_directions(settings.rays);
        Self { opacity, values, directions, reach, full_sphere: settings.normal_factor == 0.0 }
    }

    /// A(x) in [0, 1] at an index-space position.
    ///
    /// Full sphere: the mean of T over the directions. Hemisphere about n̂ = n/|n|: Σ T w / Σ w with
    /// w = max(0, n̂·ω). Dividing by Σ w instead of by its limit (rays / 4) keeps an open point at exactly 1.
    pub fn accessibility(&self, position: DVec3) -> f64 {
        let normal = offset_normal(self.values, position);
        let sphere = self.full_sphere || normal.length() < WEAKEST_NORMAL;
        let (mut open, mut total) = (0.0, 0.0);
        for &direction in &self.directions {
            let weight = if sphere { 1.0 } else { normal.normalize().dot(direction).max(0.0) };
            if weight > 0.0 {
                open += weight * self.transmittance(position, direction);
                total += weight;
            }
        }
        // With very few rays none may lie in the hemisphere: nothing seen to block.
        if total > 0.0 { open / total } else { 1.0 }
    }

    /// T(ω) in [0, 1] from an index-space position along a unit direction.
    ///
    /// With m = max |d_i|, the ray runs over [START / m, reach / m). Samples lie in the middle of each step,
    /// at START / m + (k + 1/2) STEP for k = 0, 1, ... while that is less than reach / m; each stands for a
    /// whole step, the last one too.
    pub fn transmittance(&self, position: DVec3, direction: DVec3) -> f64 {
        let per_max_norm = 1.0 / direction.abs().max_element();
        let start = START * per_max_norm;
        // Beyond the support of the interpolation every sample is 0, so stopping there changes nothing.
        let end = (self.reach * per_max_norm).min(self.exit_distance(position, direction));
        let mut transmittance = 1.0;
        for k in 0.. {
            let t = start + (f64::from(k) + 0.5) * STEP;
            if t >= end || transmittance == 0.0 {
                break;
            }
            // Interpolating may round to above 1.
            let clear = (1.0 - self.opacity.trilinear(position + direction * t)).max(0.0);
            transmittance *= clear.powf(STEP);
        }
        transmittance
    }

    /// Where the ray leaves the volume extended by the half voxel over which opacity fades.
    fn exit_distance(&self, position: DVec3, direction: DVec3) -> f64 {
        let (low, high) = (DVec3::splat(-0.5), dims_vec(self.opacity.dims) + 0.5);
        let exit = |a: usize| {
            let face = if direction[a] > 0.0 { high[a] } else { low[a] };
            if direction[a] == 0.0 { f64::INFINITY } else { (face - position[a]) / direction[a] }
        };
        exit(0).min(exit(1)).min(exit(2))
    }

    /// A at every voxel centre, x fastest.
    pub fn at_voxel_centres(&self) -> Vec<f64> {
        at_voxel_centres(self.values.dims, |centre| self.accessibility(centre))
    }
}
