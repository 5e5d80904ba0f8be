//! What occurs in every brick of voxels: what a ray caster needs in order to skip empty space, and ambient occlusion
//! in order to know what an edit of the transfer function touches.

use std::sync::Arc;

use rayon::prelude::*;

use super::sample::{Sample, with_voxels};
use super::{CodeMap, LoadWatch, Volume, VolumeError};

/// Edge of a brick, in voxels.
pub const BRICK: u32 = 8;

/// Voxels on every side of a brick that look-ups made while drawing it may reach: a sample's neighbours, a step to
/// where its accessibility is taken, and the neighbours of that.
const WIDE_APRON: usize = 3;

/// Codes are told apart in this many buckets.
const BUCKETS: u32 = 256;

/// A set of codes, by bucket.
pub type CodeSet = [u64; (BUCKETS / 64) as usize];

/// Contents of every brick, x fastest.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Bricks {
    /// Number of bricks along each axis; the last ones may stick out of the volume.
    pub dims: [u32; 3],
    /// Lowest and highest code, both inclusive, of a brick with one voxel more on every side, as far as the volume
    /// goes: trilinear interpolation at any position inside a brick reads no code outside its range.
    pub ranges: Vec<[u16; 2]>,
    /// The same with three voxels more.
    pub wide_ranges: Vec<[u16; 2]>,
    /// Codes that occur in a brick itself.
    pub codes: Vec<CodeSet>,
    /// A code's bucket is `code >> bucket_shift`.
    pub bucket_shift: u32,
}

impl Bricks {
    /// The buckets of the codes that fulfil `holds`, among `count` codes from 0.
    pub fn code_set(&self, count: usize, holds: impl Fn(usize) -> bool) -> CodeSet {
        let mut set = CodeSet::default();
        for code in (0..count).filter(|&code| holds(code)) {
            insert(&mut set, code >> self.bucket_shift);
        }
        set
    }

    /// Whether a code of the set's buckets may occur in a brick.
    pub fn any_of(&self, brick: usize, set: &CodeSet) -> bool {
        self.codes[brick].iter().zip(set).any(|(mine, theirs)| mine & theirs != 0)
    }
}

fn insert(set: &mut CodeSet, bucket: usize) {
    set[bucket / 64] |= 1 << (bucket % 64);
}

impl Volume {
    /// The contents of all bricks; found when first asked for, which takes a while.
    pub fn bricks(&self) -> Arc<Bricks> {
        let find = || self.find_bricks(&LoadWatch::default()).expect("nobody can call it off");
        self.bricks.get_or_init(|| Arc::new(find())).clone()
    }

    /// Finds the contents of all bricks now, and counts voxels as work.
    ///
    /// # Errors
    /// [`VolumeError::Cancelled`].
    pub(super) fn prepare_bricks(&self, watch: &LoadWatch) -> Result<(), VolumeError> {
        let bricks = Arc::new(self.find_bricks(watch)?);
        self.bricks.get_or_init(|| bricks);
        Ok(())
    }

    fn find_bricks(&self, watch: &LoadWatch) -> Result<Bricks, VolumeError> {
        let dims = self.grid.dims.map(|n| n.div_ceil(BRICK));
        let [bx, by, bz] = dims.map(|n| n as usize);
        let bucket_shift = (u32::from(self.code_map.max_code) / BUCKETS + 1).next_power_of_two().trailing_zeros();
        let row_voxels = self.grid.voxel_count() / (by * bz) as u64;
        let contents: Result<Vec<_>, VolumeError> = with_voxels!(&self.voxels, v => {
            let field = Field { dims: self.grid.dims.map(|n| n as usize), values: v, map: &self.code_map };
            (0..bx * by * bz)
                .into_par_iter()
                .map(|b| {
                    if b % bx == 0 {
                        watch.advance(row_voxels);
                    }
                    watch.check()?;
                    let first = [b % bx, b / bx % by, b / bx / by].map(|i| i * BRICK as usize);
                    Ok((field.range(first, 1), field.range(first, WIDE_APRON), field.codes(first, bucket_shift)))
                })
                .collect()
        });
        let (mut ranges, mut wide_ranges, mut codes) = (Vec::new(), Vec::new(), Vec::new());
        for (range, wide_range, set) in contents? {
            ranges.push(range);
            wide_ranges.push(wide_range);
            codes.push(set);
        }
        Ok(Bricks { dims, ranges, wide_ranges, codes, bucket_shift })
    }
}

struct Field<'a, T> {
    dims: [usize; 3],
    values: &'a [T],
    map: &'a CodeMap,
}

impl<T: Sample> Field<'_, T> {
    /// Rows of values of a brick with `apron` voxels more on every side.
    fn rows(&self, first: [usize; 3], apron: usize) -> impl Iterator<Item = &[T]> {
        let [x, y, z]: [_; 3] = std::array::from_fn(|a| {
            first[a].saturating_sub(apron)..(first[a] + BRICK as usize + apron).min(self.dims[a])
        });
        z.flat_map(move |k| y.clone().map(move |j| (k * self.dims[1] + j) * self.dims[0]))
            .map(move |row| &self.values[row + x.start..row + x.end])
    }

    /// Codes grow with values, so the ends of the range of values give the ends of the range of codes.
    fn range(&self, first: [usize; 3], apron: usize) -> [u16; 2] {
        let (mut lowest, mut highest) = (u16::MAX, 0);
        for row in self.rows(first, apron) {
            let (lo, hi) = self.row_range(row);
            lowest = lowest.min(lo);
            highest = highest.max(hi);
        }
        [lowest, highest]
    }

    fn codes(&self, first: [usize; 3], bucket_shift: u32) -> CodeSet {
        let mut set = CodeSet::default();
        for value in self.rows(first, 0).flatten() {
            insert(&mut set, usize::from(self.map.code_from_value(value.to_f64()) >> bucket_shift));
        }
        set
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
