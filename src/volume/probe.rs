//! The value at one place.

use glam::DVec3;

use super::Volume;

/// Weights below this are rounding.
const SMALLEST_WEIGHT: f64 = 1e-9;

/// What a volume has at a position inside it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Probe {
    /// The voxel whose cell the position is in, which is the nearest one.
    pub index: [u32; 3],
    /// Its value as loaded; may be NaN.
    pub value: f64,
    /// Trilinear between voxel centres; beyond the outermost ones, the outermost ones go on. NaN where one of the voxels
    /// that it lies between is.
    pub interpolated: f64,
}

impl Volume {
    /// What is at an index-space position (voxel (0, 0, 0) fills [0, 1]³); `None` outside the volume.
    pub fn probe(&self, position: DVec3) -> Option<Probe> {
        let dims = self.grid.dims_vec();
        // Not `<` and `>`: NaN must be outside.
        if !(position.cmpge(DVec3::ZERO) & position.cmple(dims)).all() {
            return None;
        }
        let last = self.grid.dims.map(|n| n - 1);
        let position = position.to_array();
        // The outer faces belong to the last voxels.
        let index = std::array::from_fn(|a| (position[a].floor() as u32).min(last[a]));
        let below = std::array::from_fn(|a| (position[a] - 0.5).clamp(0.0, f64::from(last[a])));
        Some(Probe { index, value: self.raw_value(index), interpolated: self.interpolated(below) })
    }

    /// As loaded, NaN included.
    fn raw_value(&self, [i, j, k]: [u32; 3]) -> f64 {
        let [nx, ny, _] = self.grid.dims.map(|n| n as usize);
        self.voxels.value((k as usize * ny + j as usize) * nx + i as usize)
    }

    /// Between voxels, at a position in which voxel centres are whole numbers.
    fn interpolated(&self, at: [f64; 3]) -> f64 {
        let mut sum = 0.0;
        for corner in 0..8 {
            let mut weight = 1.0;
            let index = std::array::from_fn(|a| {
                let upper = corner >> a & 1 == 1;
                let fraction = at[a].fract();
                weight *= if upper { fraction } else { 1.0 - fraction };
                at[a].floor() as u32 + u32::from(upper)
            });
            // Voxels without weight may not even exist; and at a centre, rounding must not reach for a NaN beside it.
            if weight > SMALLEST_WEIGHT {
                sum += weight * self.raw_value(index);
            }
        }
        sum
    }
}
