//! Which tiles of the levels hold anything that somebody reads, and which may change with an edit. All of it
//! follows from the volume, the opacities and the settings, so that an update ends where a build from nothing does.

use super::levels::LevelLayout;
use super::tiles::{Spans, TileSet, inverted};
use crate::volume::BRICK;

/// The relations between the tiles of one volume's levels and the bricks of its accessibility.
#[derive(Clone, Debug)]
pub(super) struct Relations {
    /// Of each level but the first: for each tile, the tiles of the level before that it is made from.
    sources: Vec<[Spans; 3]>,
    /// Of each level: for each brick, the tiles that its look-ups may meet.
    lookups: Vec<[Spans; 3]>,
    /// For each tile of level 0, the bricks in it.
    first: [Spans; 3],
    tiles: Vec<[u32; 3]>,
    bricks: [u32; 3],
}

impl Relations {
    /// `half_offset`: how far from a sample level 0 is looked up at most, in voxels; twice as far with every level.
    pub(super) fn new(dims: [u32; 3], layouts: &[LevelLayout], half_offset: f64) -> Self {
        let bricks = dims.map(|n| n.div_ceil(BRICK));
        let sources = layouts.windows(2).map(|pair| {
            std::array::from_fn(|axis| {
                let edge = pair[1].tile[axis];
                let tile = |t: u32| t * edge..((t + 1) * edge).min(pair[1].extent[axis]);
                let cells = |t: u32| pair[1].source_cells(&pair[0], axis, tile(t));
                (0..pair[1].tiles()[axis]).map(|t| tiles_of(&cells(t), pair[0].tile[axis])).collect()
            })
        });
        let lookups = (0..).zip(layouts).map(|(level, layout): (u32, _)| {
            let reach = half_offset * f64::from(1_u32 << level);
            std::array::from_fn(|axis| {
                let voxels = |b: u32| (f64::from(b * BRICK) + 0.5, f64::from(((b + 1) * BRICK).min(dims[axis])) - 0.5);
                let cells = |(low, high): (f64, f64)| layout.cells_around(axis, low - reach, high + reach);
                (0..bricks[axis]).map(|b| tiles_of(&cells(voxels(b)), layout.tile[axis])).collect()
            })
        });
        let first = std::array::from_fn(|axis| {
            // The first brick begins at cell `origin`.
            let brick = |cell: u32| (cell.saturating_sub(layouts[0].origin) / BRICK).min(bricks[axis]);
            let edge = layouts[0].tile[axis];
            (0..layouts[0].tiles()[axis]).map(|t| brick(t * edge)..brick((t + 1) * edge)).collect()
        });
        Self {
            first,
            sources: sources.collect(),
            lookups: lookups.collect(),
            tiles: layouts.iter().map(LevelLayout::tiles).collect(),
            bricks,
        }
    }

    /// Tiles of every level that may hold anything but zero and are read on the way to the accessibility of the
    /// bricks `wanted`. `visible`: bricks with a voxel that is not fully transparent.
    pub(super) fn active(&self, visible: &TileSet, wanted: &TileSet) -> Vec<TileSet> {
        let mut active = vec![self.first_tiles(visible)];
        for sources in &self.sources {
            active.push(active[active.len() - 1].spread(sources));
        }
        let mut read_by_next: Option<TileSet> = None;
        // Level 0 is small and also read by others: all of it is kept.
        for level in (1..active.len()).rev() {
            let tiles = self.tiles[level];
            let back: [Spans; 3] = std::array::from_fn(|axis| inverted(&self.lookups[level][axis], tiles[axis]));
            let mut read = wanted.spread(&back);
            if let Some(by_next) = read_by_next {
                read.insert_all(&by_next);
            }
            active[level].keep_only(&read);
            let before = self.tiles[level - 1];
            let back: [Spans; 3] = std::array::from_fn(|axis| inverted(&self.sources[level - 1][axis], before[axis]));
            read_by_next = Some(active[level].spread(&back));
        }
        active
    }

    /// Tiles of level 0 that hold a brick of a set.
    pub(super) fn first_tiles(&self, bricks: &TileSet) -> TileSet {
        bricks.spread(&self.first)
    }

    /// Adds to `changing`, tiles that may change of each level, what may change because of them.
    pub(super) fn spread_changes(&self, active: &[TileSet], changing: &mut [TileSet]) {
        for level in 1..changing.len() {
            let mut more = changing[level - 1].spread(&self.sources[level - 1]);
            more.keep_only(&active[level]);
            changing[level].insert_all(&more);
        }
    }

    /// Bricks of which a look-up may meet a tile of `changing`.
    pub(super) fn bricks_of(&self, changing: &[TileSet]) -> TileSet {
        let mut bricks = TileSet::empty(self.bricks);
        for (tiles, lookups) in changing.iter().zip(&self.lookups) {
            bricks.insert_all(&tiles.spread(lookups));
        }
        bricks
    }
}

fn tiles_of(cells: &std::ops::Range<u32>, tile: u32) -> std::ops::Range<u32> {
    cells.start / tile..cells.end.div_ceil(tile)
}
