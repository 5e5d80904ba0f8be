//! What a volume takes on the GPU, known from its size alone.

use crate::ao::{LevelLayout, level_layouts};
use crate::scene::AmbientOcclusion;

/// Bytes of a voxel's gradient.
const GRADIENT_BYTES: u64 = 4;

/// Bytes of a voxel's accessibility.
const ACCESSIBILITY_BYTES: u64 = 2;

/// Bytes of a cell of a level, in its buffer and in the texture that it is looked up in.
const CELL_BYTES: u64 = 2;

/// Most bytes of textures for slices of levels; what does not fit is copied piece by piece.
const MOST_WINDOW_BYTES: u64 = 320 << 20;

/// Bytes of a tile in lists and marks.
const TILE_BYTES: u64 = 16;

/// One part in so many of the budget is left for pictures, tables and what is read back.
const SHARE_FOR_PICTURES: u64 = 16;

/// GPU memory for one volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GpuNeed {
    /// Bytes of its values and gradients.
    pub volume_bytes: u64,
    /// Bytes of one accessibility result and its pyramid, with the settings that scenes have by default.
    pub occlusion_bytes: u64,
}

impl GpuNeed {
    /// Of a volume of `dims` voxels that take `texel_bytes` each.
    pub fn of(dims: [u32; 3], texel_bytes: u64) -> Self {
        let voxels: u64 = dims.iter().map(|&n| u64::from(n)).product();
        let layouts = level_layouts(dims, &AmbientOcclusion::default());
        let levels: u64 = layouts.iter().map(LevelLayout::bytes).sum();
        let cells = |layout: &LevelLayout| layout.extent.iter().map(|&n| u64::from(n)).product::<u64>();
        let windows = (CELL_BYTES * layouts.iter().map(cells).sum::<u64>()).min(MOST_WINDOW_BYTES);
        let tiles: u64 =
            layouts.iter().map(|layout| layout.tiles().iter().map(|&n| u64::from(n)).product::<u64>()).sum();
        Self {
            volume_bytes: voxels.saturating_mul(texel_bytes + GRADIENT_BYTES),
            occlusion_bytes: voxels.saturating_mul(ACCESSIBILITY_BYTES) + levels + windows + TILE_BYTES * tiles,
        }
    }

    /// Whether a budget has room for the volume and for working with it, if nothing else is there.
    pub fn fits(self, budget_bytes: u64) -> bool {
        let room = budget_bytes - budget_bytes / SHARE_FOR_PICTURES;
        self.volume_bytes.saturating_add(self.occlusion_bytes) <= room
    }
}
