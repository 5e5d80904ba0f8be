//! The voxels of a stack, of a type that holds what becomes of all stored values, filled slice by slice.

use super::image::{Samples, Slice};
use crate::volume::sample::with_voxels;
use crate::volume::{VoxelType, Voxels};

/// The type of a stack's voxels, as far as headers tell.
///
/// Integers stay integers if slope and intercept are whole numbers. A CT that fills 16 bits on paper hardly ever does:
/// `i16` is taken, and [`Target`] widens if it has to.
pub(super) fn voxel_type(slices: &[Slice]) -> VoxelType {
    let first = slices[0].samples;
    let alike = slices.iter().all(|slice| slice.samples == first);
    let untouched = slices.iter().all(|slice| slice.slope == 1.0 && slice.intercept == 0.0);
    if let (true, true, Samples::Integer { allocated, signed, .. }) = (alike, untouched, first) {
        return match (allocated, signed) {
            (8, false) => VoxelType::U8,
            (8, true) => VoxelType::I8,
            (16, false) => VoxelType::U16,
            (16, true) => VoxelType::I16,
            (_, false) => VoxelType::U32,
            (_, true) => VoxelType::I32,
        };
    }
    let (mut lowest, mut highest, mut most_bits) = (f64::INFINITY, f64::NEG_INFINITY, 0);
    for slice in slices {
        let Samples::Integer { stored, signed, .. } = slice.samples else {
            return if slice.samples == Samples::Double { VoxelType::F64 } else { VoxelType::F32 };
        };
        if slice.slope.fract() != 0.0 || slice.intercept.fract() != 0.0 {
            return VoxelType::F32;
        }
        let span = f64::from(stored).exp2();
        let (low, high) = if signed { (-span / 2.0, span / 2.0 - 1.0) } else { (0.0, span - 1.0) };
        for end in [low, high].map(|v| v * slice.slope + slice.intercept) {
            (lowest, highest) = (lowest.min(end), highest.max(end));
        }
        most_bits = most_bits.max(stored);
    }
    let within = |low: f64, high: f64| lowest >= low && highest <= high;
    if within(f64::from(i16::MIN), f64::from(i16::MAX)) {
        VoxelType::I16
    } else if within(0.0, f64::from(u16::MAX)) {
        VoxelType::U16
    } else if !within(f64::from(i32::MIN), f64::from(i32::MAX)) {
        VoxelType::F64
    } else if most_bits <= 16 {
        VoxelType::I16
    } else {
        VoxelType::I32
    }
}

/// Room for a stack.
pub(super) struct Target {
    voxels: Voxels,
    per_slice: usize,
}

impl Target {
    /// Room for `count` voxels, which the caller has checked against the limits. Memory is touched only as slices come.
    pub(super) fn new(voxel_type: VoxelType, count: usize, per_slice: usize) -> Self {
        let voxels = match voxel_type {
            VoxelType::U8 => Voxels::U8(vec![0; count]),
            VoxelType::I8 => Voxels::I8(vec![0; count]),
            VoxelType::U16 => Voxels::U16(vec![0; count]),
            VoxelType::I16 => Voxels::I16(vec![0; count]),
            VoxelType::U32 => Voxels::U32(vec![0; count]),
            VoxelType::I32 => Voxels::I32(vec![0; count]),
            VoxelType::U64 => Voxels::U64(vec![0; count]),
            VoxelType::I64 => Voxels::I64(vec![0; count]),
            VoxelType::F32 => Voxels::F32(vec![0.0; count]),
            VoxelType::F64 => Voxels::F64(vec![0.0; count]),
        };
        Self { voxels, per_slice }
    }

    /// Writes slice `k`: `slope * stored + intercept`.
    pub(super) fn write(&mut self, k: usize, stored: &[f64], slope: f64, intercept: f64) {
        let value = |v: f64| v * slope + intercept;
        if let Voxels::I16(narrow) = &self.voxels {
            let fits = |&v: &f64| (f64::from(i16::MIN)..=f64::from(i16::MAX)).contains(&value(v));
            if !stored.iter().all(fits) {
                self.voxels = Voxels::I32(narrow.iter().map(|&v| i32::from(v)).collect());
            }
        }
        let range = k * self.per_slice..(k + 1) * self.per_slice;
        with_voxels!(&mut self.voxels, v => {
            for (voxel, &stored) in v[range].iter_mut().zip(stored) {
                *voxel = value(stored) as _;
            }
        });
    }

    pub(super) fn finish(self) -> Voxels {
        self.voxels
    }
}
