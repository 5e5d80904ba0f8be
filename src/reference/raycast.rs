//! The ray caster: front-to-back compositing of lit, pre-integrated segments, without any skipping.
//!
//! Everything happens in sRGB-encoded space, as is the field's convention: transfer functions and backgrounds
//! are authored by eye on a display, where half-way between two colours means half-way between their codes.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::field::{ValueField, trilinear_clamped, voxel_count};
use super::gradient::voxel_gradients;
use super::ray_setup::{Ray, pixel_ray, sample_places, visible_interval};
use super::segment::OpticalDepth;
use super::shading::{Exposure, Illumination, clearness, facing_normal, illuminate, openness};
use crate::scene::{RayBasis, Scene};
use crate::volume::{CodeMap, Grid};

/// A ray this opaque has reached its end; what lies behind could change no 8-bit channel by more than one.
const OPAQUE: f64 = 0.999;
/// Smallest spacings between a sample of a clear surface and the accessibility it is lit by.
const IN_FRONT: f64 = 1.0;
/// Longest gradient that is told from longer ones: three differences of half the range, √3 / 2.
const LONGEST_GRADIENT: f64 = 0.866_025_403_784_438_6;

/// What a picture is made of.
#[derive(Clone, Copy, Debug)]
pub struct RaycastInput<'a> {
    /// Where the voxels are in the world.
    pub grid: &'a Grid,
    /// Normalised values, of the grid's dimensions.
    pub values: &'a ValueField,
    /// Turns normalised values into the file's units.
    pub code_map: &'a CodeMap,
    /// Transfer function, camera, lighting, rendering and the strength of ambient occlusion.
    pub scene: &'a Scene,
    /// A at every voxel centre, x fastest, before `strength`; `None` is 1 everywhere.
    pub accessibility: Option<&'a [f64]>,
    /// What turns O' into light.
    pub exposure: Exposure,
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
}

/// Casts rays through one volume for one picture.
#[derive(Clone, Debug)]
pub struct Raycaster<'a> {
    input: RaycastInput<'a>,
    basis: RayBasis,
    depth: OpticalDepth<'a>,
    /// World gradient of every voxel, encoded: see [`encoded`].
    gradients: Vec<DVec3>,
    /// World length between samples.
    step: f64,
}

/// A gradient with the square root of its length, in units of [`longest_gradient`] and at most 1, for its length.
/// The GPU stores it like that because eight bits must still hold the direction of weak gradients; and since
/// it interpolates what it has stored, so does this twin (in f64, without rounding to eight bits).
fn encoded(gradient: DVec3) -> DVec3 {
    gradient.normalize_or_zero() * (gradient.length() / LONGEST_GRADIENT).min(1.0).sqrt()
}

fn decoded(encoded: DVec3) -> DVec3 {
    encoded * encoded.length() * LONGEST_GRADIENT
}

impl<'a> Raycaster<'a> {
    /// Prepares what does not depend on the pixel.
    pub fn new(input: RaycastInput<'a>) -> Self {
        assert_eq!(input.grid.dims, input.values.dims, "values on the grid");
        let voxels = voxel_count(input.grid.dims);
        assert!(input.accessibility.is_none_or(|a| a.len() == voxels), "one accessibility per voxel");
        let h = input.grid.smallest_spacing();
        let step = h / input.scene.rendering.sampling_rate;
        // h J^-T makes dimensionless world gradients of index-space ones.
        let world_from_gradient: DMat3 = input.grid.index_from_world().matrix3.transpose() * h;
        Self {
            input,
            basis: input.scene.camera.ray_basis(input.width, input.height),
            depth: OpticalDepth::new(&input.scene.transfer_function, step, h),
            gradients: voxel_gradients(input.values).into_iter().map(|g| encoded(world_from_gradient * g)).collect(),
            step,
        }
    }

    /// Straight-alpha sRGB-encoded colours, rows from the top.
    pub fn picture(&self) -> Vec<[f64; 4]> {
        let width = self.input.width as usize;
        (0..width * self.input.height as usize)
            .into_par_iter()
            .map(|i| self.pixel((i % width) as u32, (i / width) as u32))
            .collect()
    }

    /// Straight-alpha sRGB-encoded colour of pixel (x, y), y counted from the top.
    pub fn pixel(&self, x: u32, y: u32) -> [f64; 4] {
        let ray = pixel_ray(&self.basis, x, y, self.input.width, self.input.height);
        self.over_background(self.march(&ray))
    }

    /// ∇v̂ h in world space at an index-space position, at most √3 / 2 long: encoded gradients of voxels,
    /// interpolated, then decoded. h is the smallest spacing.
    pub fn world_gradient(&self, index_position: DVec3) -> DVec3 {
        decoded(trilinear_clamped(self.input.grid.dims, index_position, &self.gradients))
    }

    /// Composites the segments between neighbouring samples ([`sample_places`]) of the visible interval, along each
    /// of which the value runs linearly: premultiplied colour and alpha.
    ///
    /// A segment of the length l has the opacity 1 - e^-(mean τ · l / step) and is coloured and lit where half of
    /// that lies in front ([`OpticalDepth`]). A ray ends early once its alpha passes `OPAQUE`; alpha is left as it
    /// is then.
    fn march(&self, ray: &Ray) -> (DVec3, f64) {
        let (mut color, mut alpha) = (DVec3::ZERO, 0.0);
        let interval = visible_interval(ray, self.input.grid, &self.input.scene.rendering);
        if interval.is_empty() {
            return (color, alpha);
        }
        let index_from_world = self.input.grid.index_from_world();
        let at = |t: f64| index_from_world.transform_point3(ray.origin + ray.direction * t);
        let mut near: Option<(f64, f64)> = None;
        for far_t in sample_places(interval, self.step) {
            let far = (far_t, self.value(at(far_t)));
            let Some((near_t, near_value)) = near.replace(far) else { continue };
            let steps = (far_t - near_t) / self.step;
            let depth = steps * self.depth.mean(near_value, far.1);
            if depth == 0.0 {
                continue;
            }
            let share = self.depth.half_way(near_value, far.1, steps);
            let value = near_value + (far.1 - near_value) * share;
            let lit = self.lit(value, at(near_t + (far_t - near_t) * share), ray.direction);
            let weight = (1.0 - alpha) * -(-depth).exp_m1();
            color += weight * lit;
            alpha += weight;
            if alpha > OPAQUE {
                break;
            }
        }
        (color, alpha)
    }

    /// Value in the file's units, interpolated between voxel centres.
    fn value(&self, index_position: DVec3) -> f64 {
        let [lowest, highest] = self.input.code_map.value_range();
        lowest + (highest - lowest) * self.input.values.trilinear(index_position)
    }

    /// Colour of a value under the light of a place.
    fn lit(&self, value: f64, index_position: DVec3, ray_direction: DVec3) -> DVec3 {
        let RaycastInput { scene, exposure, .. } = self.input;
        let gradient = self.world_gradient(index_position);
        let accessibility = self.accessibility(index_position, gradient, -ray_direction);
        let openness = openness(accessibility, scene.ambient_occlusion.strength, exposure);
        let illumination = Illumination { ray_direction, openness };
        let (base, _) = scene.transfer_function.sample(value);
        DVec3::from_array(illuminate(base, gradient, &scene.lighting, &illumination).0)
    }

    /// A, interpolated between voxel centres, one smallest spacing in front of a clear surface, and proportionally
    /// less where the gradient has no clear direction. On the surface itself A falls to nothing within a voxel, and
    /// a picture would show where in its voxel the surface lies.
    fn accessibility(&self, index_position: DVec3, gradient: DVec3, to_viewer: DVec3) -> f64 {
        let Some(accessibility) = self.input.accessibility else {
            return 1.0;
        };
        let grid = self.input.grid;
        let ahead = facing_normal(gradient, to_viewer) * (clearness(gradient) * IN_FRONT * grid.smallest_spacing());
        let in_front = index_position + grid.index_from_world().transform_vector3(ahead);
        trilinear_clamped(grid.dims, in_front, accessibility)
    }

    /// Puts premultiplied colour over the background; the answer has straight alpha.
    fn over_background(&self, (color, alpha): (DVec3, f64)) -> [f64; 4] {
        let [red, green, blue, opacity] = self.input.scene.rendering.background.0;
        let behind = (1.0 - alpha) * opacity;
        let alpha_out = alpha + behind;
        if alpha_out == 0.0 {
            return [0.0; 4];
        }
        let [r, g, b] = ((color + behind * DVec3::new(red, green, blue)) / alpha_out).to_array();
        [r, g, b, alpha_out]
    }
}
