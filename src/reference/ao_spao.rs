//! Smooth probabilistic ambient occlusion (METHODS 2; SPAO 1.2.2 and 1.3).

use glam::DVec3;

use super::box_mean::BoxMean;
use super::field::{OpacityField, ValueField, at_voxel_centres};
use super::gradient::offset_normal;
use super::mipmap::{HybridMeans, MipPyramid};
use crate::scene::{AmbientOcclusion, AoStructure};

/// What M_{2^l}(x) is looked up in.
#[derive(Clone, Debug)]
pub enum LevelMeans {
    /// Exact box means, which is what interpolated, centred N-buffers give.
    NBuffer(BoxMean),
    /// Mip levels.
    Mipmap(MipPyramid),
    /// Mip levels, then box means on the last of them.
    Hybrid(HybridMeans),
}

impl LevelMeans {
    /// The structure that `settings` names, for levels 0..=`settings.levels`.
    pub fn new(opacity: &OpacityField, settings: &AmbientOcclusion) -> Self {
        match settings.structure {
            AoStructure::NBuffer => Self::NBuffer(BoxMean::new(opacity)),
            AoStructure::Mipmap => Self::Mipmap(MipPyramid::new(opacity, settings.levels)),
            AoStructure::Hybrid => Self::Hybrid(HybridMeans::new(opacity, settings.mip_levels)),
        }
    }

    /// Mean opacity of the cube of width 2^level about an index-space position.
    pub fn look_up(&self, position: DVec3, level: u32) -> f64 {
        match self {
            Self::NBuffer(means) => means.mean(position, f64::from(1 << level)),
            Self::Mipmap(pyramid) => pyramid.look_up(position, level),
            Self::Hybrid(means) => means.look_up(position, level),
        }
    }
}

/// Accessibility by shells of cubes about a point.
#[derive(Clone, Debug)]
pub struct SpaoAo<'a> {
    values: &'a ValueField,
    means: LevelMeans,
    levels: u32,
    normal_factor: f64,
}

impl<'a> SpaoAo<'a> {
    /// `opacity` and `values` are of the same volume; of `settings`, `structure`, `levels`, `mip_levels` and
    /// `normal_factor` count.
    pub fn new(opacity: &OpacityField, values: &'a ValueField, settings: &AmbientOcclusion) -> Self {
        assert_eq!(opacity.dims, values.dims, "opacity and values of one volume");
        let means = LevelMeans::new(opacity, settings);
        Self { values, means, levels: settings.levels, normal_factor: settings.normal_factor }
    }

    /// A(x) in [0, 1] at an index-space position.
    pub fn accessibility(&self, position: DVec3) -> f64 {
        let offset_per_width = offset_normal(self.values, position) * self.normal_factor * 0.5;
        // x_l = x + n f 2^l / 2: the cube of each level is moved on its own, so a shell's cut-out
        // need not lie in the middle of its cube (SPAO figure 1.7).
        let mean = |l: u32| self.means.look_up(position + offset_per_width * f64::from(1 << l), l);
        let mut inner = mean(0);
        let mut accessibility = 1.0;
        for l in 1..=self.levels {
            let outer = mean(l);
            let shell = ((8.0 * outer - inner) / 7.0).clamp(0.0, 1.0);
            accessibility *= 1.0 - shell;
            inner = outer;
        }
        accessibility
    }

    /// A at every voxel centre, x fastest.
    pub fn at_voxel_centres(&self) -> Vec<f64> {
        at_voxel_centres(self.values.dims, |centre| self.accessibility(centre))
    }
}
