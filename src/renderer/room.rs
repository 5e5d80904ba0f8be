//! What a volume takes on the GPU, known from its size alone.

use crate::ao::{Cuts, LevelLayout, level_layouts};
use crate::scene::AmbientOcclusion;
use crate::volume::BRICK;

/// Bytes of a voxel's gradient.
const GRADIENT_BYTES: u64 = 4;

/// Bytes of a voxel's accessibility.
const ACCESSIBILITY_BYTES: u64 = 2;

/// Bytes of a cell of a level in the texture that it is looked up in.
const CELL_BYTES: u64 = 2;

/// Bytes of a tile and the bricks in it, in lists and marks.
const TILE_BYTES: u64 = 48;

/// Bytes of tables of opacity and steepness, for as many codes as there may be.
const TABLE_BYTES: u64 = 1 << 18;

/// How far from a sample levels are looked up at most, in their windows: where opacity is steepest.
const HALF_OFFSET: f64 = 0.25;

/// One part in so many of the budget is left for pictures and what is read back.
const SHARE_FOR_PICTURES: u64 = 16;

/// GPU memory for one volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpuNeed {
    /// Bytes of its values and gradients.
    pub volume_bytes: u64,
    /// Bytes of one accessibility result and its pyramid, with the settings that scenes have by default.
    pub occlusion_bytes: u64,
    /// Bytes of the largest piece of a pyramid that must be bound at once.
    pub binding_bytes: u64,
}

impl GpuNeed {
    /// Of a volume of `dims` voxels that take `texel_bytes` each.
    pub fn of(dims: [u32; 3], texel_bytes: u64) -> Self {
        let voxels = product(dims);
        let layouts = level_layouts(dims, &AmbientOcclusion::default());
        let cuts = Cuts { dims, layouts: &layouts, largest_binding: 0, sampled: true, half_offset: HALF_OFFSET };
        let levels: u64 = layouts.iter().map(LevelLayout::bytes).sum();
        let tiles: u64 = layouts.iter().map(|layout| product(layout.tiles())).sum();
        let occlusion_bytes =
            [voxels * ACCESSIBILITY_BYTES, levels, window_bytes(&cuts), TILE_BYTES * tiles, TABLE_BYTES];
        Self {
            volume_bytes: voxels.saturating_mul(texel_bytes + GRADIENT_BYTES),
            occlusion_bytes: occlusion_bytes.into_iter().fold(0, u64::saturating_add),
            binding_bytes: (0..layouts.len()).map(|level| piece_bytes(&cuts, level)).max().unwrap_or(0),
        }
    }

    /// Whether there is room for the volume and for working with it, if nothing else is there: under a budget, on an
    /// adapter that binds so many bytes at once.
    pub fn fits(self, budget_bytes: u64, largest_binding: u64) -> bool {
        let room = budget_bytes - budget_bytes / SHARE_FOR_PICTURES;
        self.volume_bytes.saturating_add(self.occlusion_bytes) <= room && self.binding_bytes <= largest_binding
    }
}

fn product(n: [u32; 3]) -> u64 {
    n.iter().map(|&n| u64::from(n)).product()
}

/// Textures of all levels, or of as many of their slices as are looked up at once.
fn window_bytes(cuts: &Cuts) -> u64 {
    let layers = cuts.combined_layers().unwrap_or(1);
    let whole = layers == cuts.dims[2].div_ceil(BRICK);
    let texels = |(level, layout): (usize, &LevelLayout)| {
        let [x, y, z] = layout.extent;
        product([x, y, if whole { z } else { cuts.window_slices(level, layers) }])
    };
    CELL_BYTES * cuts.layouts.iter().enumerate().map(texels).sum::<u64>()
}

/// The smallest piece of a level that can be computed, or what it is computed from if that is larger.
fn piece_bytes(cuts: &Cuts, level: usize) -> u64 {
    let layout = &cuts.layouts[level];
    // One layer of tiles, in the middle, where nothing is cut off.
    let middle = layout.tiles()[2] / 2;
    let layers = middle..middle + 1;
    let target = layout.slices_of(&layers).len() as u64 * layout.slice_bytes();
    let sources = if level == 0 { Vec::new() } else { cuts.source_slices(level, &layers) };
    let source = |slices: std::ops::Range<u32>| slices.len() as u64 * cuts.layouts[level - 1].slice_bytes();
    sources.into_iter().map(source).fold(target, u64::max)
}
