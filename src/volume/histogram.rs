//! How often each value occurs.

use rayon::prelude::*;

use super::sample::{Sample, with_voxels};
use super::{CodeMap, LoadWatch, Volume, VolumeError};

/// Counts of values in bins of equal width over the volume's value range.
#[derive(Clone, Debug, PartialEq)]
pub struct Histogram {
    /// Lowest and highest value of the volume, in the file's units: the outer edges of the first and last bin.
    pub range: [f64; 2],
    /// Voxels per bin; NaN is in none.
    pub counts: Vec<u64>,
}

/// Most bins of a histogram: more than the codes on the GPU could tell apart.
pub const MAX_BINS: u32 = 65536;

/// Voxels per task: many, because every task has its own counts.
const CHUNK: usize = 1 << 20;

impl Volume {
    /// Counts values, not codes, in `bins` bins.
    ///
    /// A value v of the range [lo, hi] belongs to bin floor((v - lo) · bins / (hi - lo)); hi itself, to the last bin.
    /// In a constant volume everything is in bin 0.
    ///
    /// # Errors
    /// Names `bins` unless it is 1 to [`MAX_BINS`].
    pub fn histogram(&self, bins: u32) -> Result<Histogram, VolumeError> {
        if !(1..=MAX_BINS).contains(&bins) {
            return Err(VolumeError::malformed("bins", format!("{bins} is not in 1 to {MAX_BINS}")));
        }
        self.count(bins, &LoadWatch::default())
    }

    /// [`Volume::histogram`] of a number of bins that is right; counts voxels as work.
    pub(super) fn count(&self, bins: u32, watch: &LoadWatch) -> Result<Histogram, VolumeError> {
        let counts = with_voxels!(&self.voxels, v => count(v, &self.code_map, bins as usize, watch))?;
        Ok(Histogram { range: self.code_map.value_range(), counts })
    }
}

fn count<T: Sample>(values: &[T], map: &CodeMap, bins: usize, watch: &LoadWatch) -> Result<Vec<u64>, VolumeError> {
    let count_chunk = |values: &[T]| {
        let mut counts = vec![0; bins];
        for value in values.iter().map(|v| v.to_f64()).filter(|v| !v.is_nan()) {
            counts[bin(value, map, bins)] += 1;
        }
        watch.step(values.len() as u64)?;
        Ok(counts)
    };
    let add = |mut sum: Vec<u64>, counts: Vec<u64>| {
        sum.iter_mut().zip(counts).for_each(|(sum, n)| *sum += n);
        Ok(sum)
    };
    values.par_chunks(CHUNK).map(count_chunk).try_reduce_with(add).unwrap_or_else(|| Ok(vec![0; bins]))
}

fn bin(value: f64, map: &CodeMap, bins: usize) -> usize {
    // Multiplied first: for integers the product is exact, so that bin edges are where they should be.
    let position = (value - map.lowest) * bins as f64 / (map.highest - map.lowest);
    // Not finite in a constant volume, and where a range of huge floats overflows.
    let position = if position.is_finite() { position } else { map.normalised(value) * bins as f64 };
    (position as usize).min(bins - 1)
}
