//! The ray caster: front-to-back compositing of lit samples, without any skipping.
//!
//! Everything happens in sRGB-encoded space, as is the field's convention: transfer functions and backgrounds
//! are authored by eye on a display, where half-way between two colours means half-way between their codes.

use glam::{DMat3, DVec3};
use rayon::prelude::*;

use super::field::{ValueField, trilinear_clamped, voxel_count};
use super::gradient::voxel_gradients;
use super::ray_setup::{Ray, first_sample, pixel_ray, visible_interval};
use super::shading::{Illumination, illuminate};
use crate::scene::{RayBasis, Scene};
use crate::volume::{CodeMap, Grid};

/// A ray this opaque has reached its end; what lies behind could change no 8-bit channel by more than one.
const OPAQUE: f64 = 0.999;

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
    /// Factor on the illumination.
    pub exposure: f64,
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
    /// ∇v̂ per voxel, in index space.
    gradients: Vec<DVec3>,
    /// -h J^-T: from an index-space gradient to the dimensionless world normal.
    normal_from_gradient: DMat3,
    /// World length between samples.
    step: f64,
}

impl<'a> Raycaster<'a> {
    /// Prepares what does not depend on the pixel.
    pub fn new(input: RaycastInput<'a>) -> Self {
        assert_eq!(input.grid.dims, input.values.dims, "values on the grid");
        let voxels = voxel_count(input.grid.dims);
        assert!(
            input.accessibility.is_none_or(|a| a.len() == voxels),
            "one accessibility per voxel"
        );
        let h = input.grid.smallest_spacing();
        Self {
            input,
            basis: input.scene.camera.ray_basis(input.width, input.height),
            gradients: voxel_gradients(input.values),
            normal_from_gradient: input.grid.index_from_world().matrix3.transpose() * -h,
            step: h / input.scene.rendering.sampling_rate,
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

    /// N = -∇v̂ h in world space at an index-space position: gradients of voxels, interpolated.
    pub fn world_normal(&self, index_position: DVec3) -> DVec3 {
        self.normal_from_gradient * trilinear_clamped(self.input.grid.dims, index_position, &self.gradients)
    }

    /// Composites the samples t_k = (k + 1/2) step of the visible interval: premultiplied colour and alpha.
    ///
    /// A ray ends early once its alpha passes `OPAQUE`; alpha is left as it is then.
    fn march(&self, ray: &Ray) -> (DVec3, f64) {
        let (mut color, mut alpha) = (DVec3::ZERO, 0.0);
        let interval = visible_interval(ray, self.input.grid, &self.input.scene.rendering);
        if interval.is_empty() {
            return (color, alpha);
        }
        let index_from_world = self.input.grid.index_from_world();
        let first = first_sample(interval.enter, self.step);
        // Counted, because adding 1 to a huge k would not end.
        let most_samples = ((interval.exit - interval.enter) / self.step).ceil() as u64;
        for n in 0..=most_samples {
            let t = (first + n as f64 + 0.5) * self.step;
            if t >= interval.exit || alpha > OPAQUE {
                break;
            }
            let index_position = index_from_world.transform_point3(ray.origin + ray.direction * t);
            let (sample_color, sample_alpha) = self.sample(index_position, ray.direction);
            color += (1.0 - alpha) * sample_alpha * sample_color;
            alpha += (1.0 - alpha) * sample_alpha;
        }
        (color, alpha)
    }

    /// Lit colour and opacity over one step; the value is interpolated first and classified then.
    fn sample(&self, index_position: DVec3, ray_direction: DVec3) -> (DVec3, f64) {
        let RaycastInput { scene, grid, .. } = self.input;
        let [lowest, highest] = self.input.code_map.value_range();
        let value = lowest + (highest - lowest) * self.input.values.trilinear(index_position);
        let alpha = scene
            .transfer_function
            .opacity_over(value, self.step, grid.smallest_spacing());
        if alpha == 0.0 {
            return (DVec3::ZERO, 0.0);
        }
        let (base, _) = scene.transfer_function.sample(value);
        let illumination = Illumination {
            ray_direction,
            occlusion: self.occlusion(index_position),
            exposure: self.input.exposure,
        };
        let lit = illuminate(base, self.world_normal(index_position), &scene.lighting, &illumination);
        (DVec3::from_array(lit.0), alpha)
    }

    /// O' = 1 + strength (A - 1), A interpolated between voxel centres.
    fn occlusion(&self, index_position: DVec3) -> f64 {
        let Some(accessibility) = self.input.accessibility else {
            return 1.0;
        };
        let a = trilinear_clamped(self.input.grid.dims, index_position, accessibility);
        1.0 + self.input.scene.ambient_occlusion.strength * (a - 1.0)
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
