//! Where the cells of every level of box means lie. One description serves all three structures of METHODS 2.
//!
//! Level l is a grid whose cells are `2^shift` voxels wide, with windows of `width` cells. Stored cell c is the mean
//! over grid cells [c - origin, c - origin + width): cells 0, 1 and the last two lie wholly outside the volume and are
//! zero, and M at index-space position x is the trilinear interpolation at
//! `x / 2^shift + origin - width / 2`, exactly where windows begin at every voxel (METHODS 1).

use super::params::LevelInfo;
use crate::scene::{AmbientOcclusion, AoMethod};
use crate::volume::BRICK;

/// Rows begin at multiples of 64 words, 256 bytes, so that they can be copied to textures.
const ROW_ALIGNMENT_WORDS: u32 = 64;

/// Windows of more cells than this begin at every second cell only. Between them M is interpolated, which is off by
/// less than a quarter of the step over the window, 1/128, at the edge of a half-space, and by far less elsewhere.
const LARGEST_WIDTH: u32 = 32;

/// Cells before the volume in level 0: a whole brick, so that no brick lies in two tiles.
const FIRST_ORIGIN: u32 = BRICK;

/// Cells of a tile along x: a CPU adapter computes eight neighbours along x at once, and each computes two words.
const TILE_WIDTH: u32 = 32;

/// Fewest cells of a tile along y and z.
const TILE_HEIGHT: u32 = 8;

/// Cells along x, y, z that share a mark of having changed: the smallest tile. Tiles of coarse levels are larger, but
/// what a small edit changes is not.
const BLOCK: [u32; 3] = [TILE_WIDTH, TILE_HEIGHT, TILE_HEIGHT];

/// Layout of one level in its buffer, and how it is made from the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelLayout {
    /// Cells of the grid are 2^shift voxels wide.
    pub shift: u32,
    /// Window width in cells; a power of two.
    pub width: u32,
    /// Stored cell whose window begins where the volume does.
    pub origin: u32,
    /// Stored cells along x, y, z.
    pub extent: [u32; 3],
    /// Words (two cells each) between rows.
    pub row_words: u32,
    /// Words between slices.
    pub slice_words: u32,
    /// Cells of a tile, the piece that is computed at once, along x, y, z.
    pub tile: [u32; 3],
    /// What this level is the mean of; level 0 is of nothing.
    pub source: Option<LevelSource>,
}

/// Which cells of the level before a cell is the mean of: along each axis cells `scale * c + offset` and
/// `scale * c + offset + distance`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LevelSource {
    /// Cells of the level before to one of this: 1 or 2.
    pub scale: u32,
    /// Negative, or 0.
    pub offset: i32,
    /// Width of a window of the level before.
    pub distance: u32,
}

impl LevelLayout {
    fn first(dims: [u32; 3]) -> Self {
        Self::new(dims, 0, 1, FIRST_ORIGIN, TILE_HEIGHT, None)
    }

    /// Windows of twice the width, beginning at every cell.
    fn doubled(&self, dims: [u32; 3]) -> Self {
        let distance = self.width;
        let source = LevelSource { scale: 1, offset: -(distance as i32), distance };
        // Cells of a tile share what they read in pairs that lie `distance` apart.
        let tile = TILE_HEIGHT.max(2 * distance);
        Self::new(dims, self.shift, 2 * distance, self.origin + distance, tile, Some(source))
    }

    /// Windows of twice the width in voxels, beginning at every second cell.
    fn halved(&self, dims: [u32; 3]) -> Self {
        let distance = self.width;
        // Even, so that a mean of neighbours is one of the two halves of a word; and more than the window, so that
        // the first cells are zero.
        let origin = ((self.origin + distance).div_ceil(2) + 2).next_multiple_of(2);
        let source = LevelSource { scale: 2, offset: self.origin as i32 - 2 * origin as i32, distance };
        Self::new(dims, self.shift + 1, distance, origin, TILE_HEIGHT.max(distance), Some(source))
    }

    fn new(dims: [u32; 3], shift: u32, width: u32, origin: u32, height: u32, source: Option<LevelSource>) -> Self {
        // Two cells of rim: the last word of a row has no other.
        let extent = dims.map(|n| n.div_ceil(1 << shift) + origin + 2);
        let row_words = extent[0].div_ceil(2).next_multiple_of(ROW_ALIGNMENT_WORDS);
        // One row more than stored: a look-up at the last cell also touches its neighbour.
        let slice_words = row_words * (extent[1] + 1);
        let tile = [TILE_WIDTH, height, height];
        Self { shift, width, origin, extent, row_words, slice_words, tile, source }
    }

    /// Made from blocks of the level before that do not overlap.
    pub(super) fn is_mip_level(&self) -> bool {
        self.source.is_some_and(|source| source.distance == 1 && source.scale == 2)
    }

    /// Bytes between slices.
    pub fn slice_bytes(&self) -> u64 {
        u64::from(self.slice_words) * 4
    }

    /// Bytes of the whole level.
    pub fn bytes(&self) -> u64 {
        self.slice_bytes() * u64::from(self.extent[2])
    }

    /// Tiles along x, y, z.
    pub fn tiles(&self) -> [u32; 3] {
        std::array::from_fn(|axis| self.extent[axis].div_ceil(self.tile[axis]))
    }

    /// Blocks that are marked as changed, along x, y, z.
    pub(super) fn blocks(&self) -> [u32; 3] {
        std::array::from_fn(|axis| self.extent[axis].div_ceil(BLOCK[axis]))
    }

    /// Cells of a tile.
    pub fn tile_cells(&self) -> u64 {
        self.tile.iter().map(|&n| u64::from(n)).product()
    }

    /// Workgroups that compute a tile of this level.
    pub(super) fn tile_parts(&self) -> u32 {
        (self.tile[1] / TILE_HEIGHT) * (self.tile[2] / TILE_HEIGHT)
    }

    /// Slices of layers of tiles.
    pub fn slices_of(&self, layers: &std::ops::Range<u32>) -> std::ops::Range<u32> {
        layers.start * self.tile[2]..(layers.end * self.tile[2]).min(self.extent[2])
    }

    /// Cells from an index-space position, divided by the size of a cell, to where it is looked up.
    pub fn lookup_offset(&self) -> f64 {
        f64::from(self.origin) - 0.5 * f64::from(self.width)
    }

    /// The shader's view of the level, through a binding that starts at `first_slice`.
    pub fn info(&self, first_slice: u32) -> LevelInfo {
        LevelInfo {
            extent: self.extent,
            row_words: self.row_words,
            slice_words: self.slice_words,
            first_slice,
            inverse_scale: 1.0 / (1_u32 << self.shift) as f32,
            lookup_offset: self.lookup_offset() as f32,
        }
    }

    /// Cells along `axis` that a look-up at positions in [low, high] touches; never empty, within the level.
    pub fn cells_around(&self, axis: usize, low: f64, high: f64) -> std::ops::Range<u32> {
        let last = self.extent[axis] - 1;
        let cell = |x: f64| x / f64::from(1_u32 << self.shift) + self.lookup_offset();
        // Slack on either side for the shader's rounding.
        let first = (cell(low) - 0.01).floor().clamp(0.0, f64::from(last)) as u32;
        let end = ((cell(high) + 0.01).floor() + 2.0).clamp(1.0, f64::from(last + 1)) as u32;
        first..end.max(first + 1)
    }

    /// Cells along `axis` of the level before, whose layout is `before`, that the cells `cells` are made from.
    pub fn source_cells(&self, before: &LevelLayout, axis: usize, cells: std::ops::Range<u32>) -> std::ops::Range<u32> {
        let Some(source) = self.source else { return 0..0 };
        let (scale, offset) = (i64::from(source.scale), i64::from(source.offset));
        let last = i64::from(before.extent[axis]) - 1;
        let low = (scale * i64::from(cells.start) + offset).clamp(0, last);
        let high = (scale * (i64::from(cells.end) - 1) + offset + i64::from(source.distance)).clamp(low, last);
        low as u32..high as u32 + 1
    }

    /// Slices of the level before that layers of tiles are made from: those before, in and behind the middle of the
    /// windows, for a level whose windows overlap.
    pub fn source_slices(&self, before: &LevelLayout, layers: &std::ops::Range<u32>) -> [std::ops::Range<u32>; 3] {
        let source = self.source.unwrap_or(LevelSource { scale: 1, offset: 0, distance: 0 });
        let (scale, distance) = (i64::from(source.scale), i64::from(source.distance));
        let (shift, last) = (distance / scale, i64::from(before.extent[2]) - 1);
        // An invocation computes two slices that lie `shift` apart, and counts from the first.
        let first = i64::from(layers.start * self.tile[2]);
        let end = i64::from(layers.end * self.tile[2]) - shift;
        [-shift, 0, shift].map(|by| {
            let slice = |z: i64| (scale * (z + by) + i64::from(source.offset) + distance).clamp(0, last) as u32;
            slice(first)..slice(end - 1) + 1
        })
    }
}

/// Layouts of levels 0..=L for the given settings. The reference needs only level 0.
pub fn level_layouts(dims: [u32; 3], settings: &AmbientOcclusion) -> Vec<LevelLayout> {
    let levels = match settings.method {
        AoMethod::Off => return Vec::new(),
        AoMethod::Raytraced => 0,
        AoMethod::Spao => settings.levels,
    };
    let mut layouts = vec![LevelLayout::first(dims)];
    for level in 1..=levels {
        let before = layouts[level as usize - 1];
        let halve = level <= settings.halved_levels() || before.width == LARGEST_WIDTH;
        layouts.push(if halve { before.halved(dims) } else { before.doubled(dims) });
    }
    layouts
}
