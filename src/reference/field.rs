//! Opacities and normalised values at voxels, and trilinear look-ups between voxel centres (METHODS 1).

use std::ops::{Add, Mul, Sub};

use glam::DVec3;
use rayon::prelude::*;

use crate::scene::TransferFunction;
use crate::volume::CodeMap;

/// Opacity α of one step of the smallest spacing, per voxel (pre-interpolation); 0 outside.
#[derive(Clone, Debug, PartialEq)]
pub struct OpacityField {
    /// Voxels along x (fastest), y, z.
    pub dims: [u32; 3],
    /// In [0, 1], x fastest.
    pub alpha: Vec<f64>,
}

/// Normalised value v̂ per voxel; the border's value outside.
#[derive(Clone, Debug, PartialEq)]
pub struct ValueField {
    /// Voxels along x (fastest), y, z.
    pub dims: [u32; 3],
    /// In [0, 1], x fastest.
    pub normalised: Vec<f64>,
}

impl OpacityField {
    /// α from the integer position of a voxel.
    pub fn from_fn(dims: [u32; 3], alpha: impl Fn([u32; 3]) -> f64) -> Self {
        Self { dims, alpha: per_voxel(dims, alpha) }
    }

    /// Classifies values in the file's units; `smallest_spacing` h is the length of one step, in world units.
    pub fn from_values(dims: [u32; 3], values: &[f64], transfer: &TransferFunction, smallest_spacing: f64) -> Self {
        assert_eq!(values.len(), voxel_count(dims), "one value per voxel");
        let alpha = values.iter().map(|&v| transfer.opacity_over(v, smallest_spacing, smallest_spacing)).collect();
        Self { dims, alpha }
    }

    /// Classifies the codes that the GPU holds.
    pub fn from_codes(
        dims: [u32; 3],
        codes: &[u16],
        code_map: &CodeMap,
        transfer: &TransferFunction,
        smallest_spacing: f64,
    ) -> Self {
        let values: Vec<f64> = codes.iter().map(|&code| code_map.value_from_code(f64::from(code))).collect();
        Self::from_values(dims, &values, transfer, smallest_spacing)
    }

    /// α of a voxel, 0 outside the volume.
    pub fn at(&self, voxel: [i64; 3]) -> f64 {
        let inside = (0..3).all(|a| (0..i64::from(self.dims[a])).contains(&voxel[a]));
        if inside { self.alpha[linear(self.dims, voxel)] } else { 0.0 }
    }

    /// α interpolated between voxel centres at an index-space position; fades to 0 half a voxel outside.
    pub fn trilinear(&self, position: DVec3) -> f64 {
        if !self.is_in_support(position) {
            return 0.0;
        }
        trilinear(position, |voxel| self.at(voxel))
    }

    /// Whether interpolation can give anything but 0 there.
    fn is_in_support(&self, position: DVec3) -> bool {
        position.cmpgt(DVec3::splat(-0.5)).all() && position.cmplt(dims_vec(self.dims) + 0.5).all()
    }
}

impl ValueField {
    /// v̂ from the integer position of a voxel.
    pub fn from_fn(dims: [u32; 3], normalised: impl Fn([u32; 3]) -> f64) -> Self {
        Self { dims, normalised: per_voxel(dims, normalised) }
    }

    /// Normalises values in the file's units over the volume's range.
    pub fn from_values(dims: [u32; 3], values: &[f64], code_map: &CodeMap) -> Self {
        assert_eq!(values.len(), voxel_count(dims), "one value per voxel");
        Self { dims, normalised: values.iter().map(|&v| code_map.normalised(v)).collect() }
    }

    /// Normalises the codes that the GPU holds.
    pub fn from_codes(dims: [u32; 3], codes: &[u16], code_map: &CodeMap) -> Self {
        let values: Vec<f64> = codes.iter().map(|&code| code_map.value_from_code(f64::from(code))).collect();
        Self::from_values(dims, &values, code_map)
    }

    /// v̂ of the nearest voxel of the volume.
    pub fn at(&self, voxel: [i64; 3]) -> f64 {
        self.normalised[linear(self.dims, clamped(self.dims, voxel))]
    }

    /// v̂ interpolated between voxel centres at an index-space position, clamped at the border.
    pub fn trilinear(&self, position: DVec3) -> f64 {
        trilinear_clamped(self.dims, position, &self.normalised)
    }
}

/// Evaluates `f` at the index-space centre of every voxel, x fastest, in parallel.
pub(super) fn at_voxel_centres(dims: [u32; 3], f: impl Fn(DVec3) -> f64 + Sync) -> Vec<f64> {
    let [nx, ny, _] = dims.map(|n| n as usize);
    (0..voxel_count(dims))
        .into_par_iter()
        .map(|i| f(DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64) + 0.5))
        .collect()
}

/// Evaluates `f` at every voxel, x fastest.
pub(super) fn per_voxel<T>(dims: [u32; 3], f: impl Fn([u32; 3]) -> T) -> Vec<T> {
    let mut values = Vec::with_capacity(voxel_count(dims));
    for k in 0..dims[2] {
        for j in 0..dims[1] {
            for i in 0..dims[0] {
                values.push(f([i, j, k]));
            }
        }
    }
    values
}

/// Trilinear interpolation between voxel centres of a quantity stored per voxel, clamped at the border.
pub(super) fn trilinear_clamped<T>(dims: [u32; 3], position: DVec3, values: &[T]) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let between_centres = position.max(DVec3::splat(0.5)).min(dims_vec(dims) - 0.5);
    trilinear(between_centres, |voxel| values[linear(dims, clamped(dims, voxel))])
}

/// Trilinear interpolation between voxel centres; `at` answers for every integer position.
fn trilinear<T>(position: DVec3, at: impl Fn([i64; 3]) -> T) -> T
where
    T: Copy + Add<Output = T> + Sub<Output = T> + Mul<f64, Output = T>,
{
    let from_centre = position - 0.5;
    let base = from_centre.floor();
    let t = from_centre - base;
    let [x, y, z] = base.to_array().map(|b| b as i64);
    let mix = |a: T, b: T, t: f64| a + (b - a) * t;
    let row = |y: i64, z: i64| mix(at([x, y, z]), at([x + 1, y, z]), t.x);
    let slice = |z: i64| mix(row(y, z), row(y + 1, z), t.y);
    mix(slice(z), slice(z + 1), t.z)
}

/// Number of voxels.
pub(super) fn voxel_count(dims: [u32; 3]) -> usize {
    dims.iter().map(|&n| n as usize).product()
}

/// Dimensions as a vector.
pub(super) fn dims_vec(dims: [u32; 3]) -> DVec3 {
    DVec3::from_array(dims.map(f64::from))
}

/// Position of an inside voxel in memory.
fn linear(dims: [u32; 3], voxel: [i64; 3]) -> usize {
    let [x, y, z] = voxel.map(|v| v as usize);
    (z * dims[1] as usize + y) * dims[0] as usize + x
}

/// The nearest voxel of the volume.
fn clamped(dims: [u32; 3], voxel: [i64; 3]) -> [i64; 3] {
    std::array::from_fn(|a| voxel[a].clamp(0, i64::from(dims[a]) - 1))
}
