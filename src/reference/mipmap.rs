//! Mip levels in place of exact box means, and box means on a mip level (`mipmap`, `hybrid` of METHODS 2).

use glam::DVec3;

use super::box_mean::BoxMean;
use super::field::OpacityField;

/// The field and its halved levels.
#[derive(Clone, Debug)]
pub struct MipPyramid {
    /// Level 0 is the field; each next one has half the size, rounded up, and the mean of 2³ cells in each of its own.
    pub levels: Vec<OpacityField>,
}

impl MipPyramid {
    /// Levels 0..=`highest`. Past a size of 1 the levels go on fading: their one cell stands for ever larger cubes.
    pub fn new(opacity: &OpacityField, highest: u32) -> Self {
        let mut levels = vec![opacity.clone()];
        for l in 0..highest as usize {
            levels.push(halved(&levels[l]));
        }
        Self { levels }
    }

    /// What stands for M_{2^level}(x): the trilinear look-up at x / 2^level, 0 outside.
    pub fn look_up(&self, position: DVec3, level: u32) -> f64 {
        self.levels[level as usize].trilinear(position / f64::from(1 << level))
    }
}

/// Mip look-ups up to level m, box means on the grid of level m beyond.
#[derive(Clone, Debug)]
pub struct HybridMeans {
    pyramid: MipPyramid,
    mip_levels: u32,
    /// Over mip level m.
    coarse: BoxMean,
}

impl HybridMeans {
    /// m = `mip_levels`.
    pub fn new(opacity: &OpacityField, mip_levels: u32) -> Self {
        let pyramid = MipPyramid::new(opacity, mip_levels);
        let coarse = BoxMean::new(&pyramid.levels[mip_levels as usize]);
        Self { pyramid, mip_levels, coarse }
    }

    /// What stands for M_{2^level}(x).
    pub fn look_up(&self, position: DVec3, level: u32) -> f64 {
        if level <= self.mip_levels {
            return self.pyramid.look_up(position, level);
        }
        let width = f64::from(1 << (level - self.mip_levels));
        self.coarse.mean(position / f64::from(1 << self.mip_levels), width)
    }
}

/// Means of 2³ cells; odd sizes are padded with 0, never with the edge (METHODS 1: outside, opacity is 0).
fn halved(fine: &OpacityField) -> OpacityField {
    OpacityField::from_fn(fine.dims.map(|n| n.div_ceil(2)), |voxel| {
        let [x, y, z] = voxel.map(|v| 2 * i64::from(v));
        let mut sum = 0.0;
        for child in 0..8 {
            sum += fine.at([x + (child & 1), y + (child >> 1 & 1), z + (child >> 2)]);
        }
        sum / 8.0
    })
}
