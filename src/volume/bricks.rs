//! Which codes can occur in a brick of voxels: what a ray caster needs in order to skip empty space.

use rayon::prelude::*;

use super::sample::{Sample, with_voxels};
use super::{CodeMap, Volume};

/// Lowest and highest code of every brick, x fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BrickRanges {
    /// Number of bricks along each axis; the last ones may stick out of the volume.
    pub dims: [u32; 3],
    /// `[lowest, highest]` code, inclusive.
    pub ranges: Vec<[u16; 2]>,
}

impl Volume {
    /// Code ranges of bricks of `brick`³ voxels (0 counts as 1), each with one voxel more on every side, as far as
    /// the volume goes: trilinear interpolation at any position inside a brick reads no code outside its range.
    pub fn brick_ranges(&self, brick: u32) -> BrickRanges {
        let brick = brick.max(1);
        let dims = self.grid.dims.map(|n| n.div_ceil(brick));
        let [bx, by, bz] = dims.map(|n| n as usize);
        let ranges = with_voxels!(&self.voxels, v => {
            let field = Field { dims: self.grid.dims.map(|n| n as usize), values: v, map: &self.code_map };
            let brick = brick as usize;
            (0..bx * by * bz)
                .into_par_iter()
                .map(|b| field.range([b % bx, b / bx % by, b / bx / by].map(|i| i * brick), brick))
                .collect()
        });
        BrickRanges { dims, ranges }
    }
}

struct Field<'a, T> {
    dims: [usize; 3],
    values: &'a [T],
    map: &'a CodeMap,
}

impl<T: Sample> Field<'_, T> {
    /// Codes grow with values, so the ends of the range of values give the ends of the range of codes.
    fn range(&self, first: [usize; 3], brick: usize) -> [u16; 2] {
        let [x, y, z]: [_; 3] = std::array::from_fn(|a| {
            first[a].saturating_sub(1)..first[a].saturating_add(brick).saturating_add(1).min(self.dims[a])
        });
        let (mut lowest, mut highest) = (u16::MAX, 0);
        for k in z {
            for j in y.clone() {
                let row = (k * self.dims[1] + j) * self.dims[0];
                let (lo, hi) = self.row_range(&self.values[row + x.start..row + x.end]);
                lowest = lowest.min(lo);
                highest = highest.max(hi);
            }
        }
        [lowest, highest]
    }

    fn row_range(&self, row: &[T]) -> (u16, u16) {
        let (mut lo, mut hi) = (row[0], row[0]);
        let mut has_nan = false;
        for &v in row {
            // Written so that a first value of NaN is replaced by any other.
            if v < lo || lo.to_f64().is_nan() {
                lo = v;
            }
            if v > hi || hi.to_f64().is_nan() {
                hi = v;
            }
            has_nan |= v.to_f64().is_nan();
        }
        let lowest = if has_nan { 0 } else { self.map.code_from_value(lo.to_f64()) };
        (lowest, self.map.code_from_value(hi.to_f64()))
    }
}
