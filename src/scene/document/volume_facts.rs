//! What a scene's defaults need to know about its volume.

use crate::volume::{CodeMap, Grid, VolumeId};

/// Counts of values in bins of equal width.
#[derive(Clone, Copy, Debug)]
pub struct HistogramView<'a> {
    /// Voxels per bin, lowest values first.
    pub counts: &'a [u64],
    /// Lower edge of the first bin and upper edge of the last.
    pub range: [f64; 2],
}

impl HistogramView<'_> {
    /// The value in the middle of a bin.
    pub fn center(&self, bin: usize) -> f64 {
        self.value_at((bin as f64 + 0.5) / self.counts.len() as f64)
    }

    /// The value at a fraction of the range.
    pub(in crate::scene) fn value_at(&self, fraction: f64) -> f64 {
        // Not low + fraction * (high - low): the difference of two finite numbers can overflow.
        self.range[0] * (1.0 - fraction) + self.range[1] * fraction
    }
}

/// What a scene's defaults need to know about its volume.
#[derive(Clone, Copy, Debug)]
pub struct VolumeFacts<'a> {
    /// The volume's name.
    pub id: &'a VolumeId,
    /// Where its voxels are.
    pub grid: &'a Grid,
    /// Lowest and highest value, finite.
    pub value_range: [f64; 2],
    /// How values become codes.
    pub code_map: &'a CodeMap,
    /// Distribution of the values; any number of bins, 256 or more are best.
    pub histogram: HistogramView<'a>,
    /// The voxels were loaded as integers.
    pub integer: bool,
}
