//! Where the cells of every level of box means lie. One description serves all three structures of METHODS 2.
//!
//! Level l is a grid whose cells are `2^shift` voxels wide, with windows of `width = 2^(l - shift)` cells.
//! Stored cell c is the mean over grid cells [c - width, c): so cells 0 and `extent - 1` lie wholly outside
//! the volume and are zero, and M at index-space position x is the trilinear interpolation at
//! `x / 2^shift + width / 2`, exactly (METHODS 1).

use super::params::LevelInfo;
use crate::scene::{AmbientOcclusion, AoMethod, AoStructure};

/// Words between slices are a multiple of this, so that a binding may start at any slice
/// (256 bytes: the strictest offset alignment that adapters ask for).
const SLICE_ALIGNMENT_WORDS: u32 = 64;

/// Layout of one level in its buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelLayout {
    /// Cells of the grid are 2^shift voxels wide.
    pub shift: u32,
    /// Window width in cells; a power of two.
    pub width: u32,
    /// Stored cells along x, y, z.
    pub extent: [u32; 3],
    /// Words (two cells each) between rows.
    pub row_words: u32,
    /// Words between slices.
    pub slice_words: u32,
}

impl LevelLayout {
    fn new(dims: [u32; 3], shift: u32, width: u32) -> Self {
        let extent = dims.map(|n| n.div_ceil(1 << shift) + width + 1);
        let row_words = extent[0].div_ceil(2);
        // One row more than stored, and one word: a look-up at the last cell also touches its neighbour.
        let slice_words = (row_words * (extent[1] + 1)).next_multiple_of(SLICE_ALIGNMENT_WORDS);
        Self { shift, width, extent, row_words, slice_words }
    }

    /// Bytes between slices.
    pub fn slice_bytes(&self) -> u64 {
        u64::from(self.slice_words) * 4
    }

    /// Bytes of the whole level.
    pub fn bytes(&self) -> u64 {
        self.slice_bytes() * u64::from(self.extent[2])
    }

    /// The shader's view of the level, through a binding that starts at `first_slice`.
    pub fn info(&self, first_slice: u32) -> LevelInfo {
        LevelInfo {
            extent: self.extent,
            row_words: self.row_words,
            slice_words: self.slice_words,
            first_slice,
            inverse_scale: 1.0 / (1_u32 << self.shift) as f32,
            width: self.width as f32,
        }
    }

    /// Slices that a look-up at index-space z in [low, high] touches; never empty, within the level.
    pub fn slices_around(&self, low: f64, high: f64) -> std::ops::Range<u32> {
        let last = self.extent[2] - 1;
        let cell = |z: f64| z / f64::from(1_u32 << self.shift) + 0.5 * f64::from(self.width);
        // A cell of slack on either side for the shader's rounding.
        let first = (cell(low).floor() - 1.0).clamp(0.0, f64::from(last)) as u32;
        let end = (cell(high).floor() + 3.0).clamp(1.0, f64::from(last + 1)) as u32;
        first..end.max(first + 1)
    }
}

/// Layouts of levels 0..=L for the given settings. The reference needs only level 0.
pub fn level_layouts(dims: [u32; 3], settings: &AmbientOcclusion) -> Vec<LevelLayout> {
    let levels = match settings.method {
        AoMethod::Off => return Vec::new(),
        AoMethod::Raytraced => 0,
        AoMethod::Spao => settings.levels,
    };
    let halved = mip_levels(settings);
    (0..=levels)
        .map(|level| {
            let shift = level.min(halved);
            LevelLayout::new(dims, shift, 1 << (level - shift))
        })
        .collect()
}

/// Levels that are made by halving: m of METHODS 2.
pub(super) fn mip_levels(settings: &AmbientOcclusion) -> u32 {
    match settings.structure {
        AoStructure::NBuffer => 0,
        AoStructure::Mipmap => settings.levels,
        AoStructure::Hybrid => settings.mip_levels,
    }
}
