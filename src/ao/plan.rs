//! The work of one build or update as a list of steps, each of bounded size.

use std::ops::Range;

use super::levels::LevelLayout;
use crate::scene::{AmbientOcclusion, AoMethod, Radius};
use crate::volume::BRICK;

/// Cells of the largest step: a fraction of a second even on two CPU cores, so that another scene never waits longer
/// for its turn.
const STEP_CELLS: u64 = 4 << 20;

/// Samples of the largest step, likewise: each takes look-ups in all levels.
const STEP_SAMPLES: u64 = 2 << 20;

/// Most entries of a list that one dispatch takes: a workgroup each.
const MOST_WORKGROUPS: u64 = 65_535;

/// What a look-up in all levels costs beside a cell of a level.
const SAMPLE_COST: u64 = 8;

/// Bytes of the textures that hold the slices of all levels around some samples.
const WINDOW_BYTES: u64 = 320 << 20;

/// Where the layers of tiles that one step covers lie, and which entries of the work lists are in them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Tiles of a level.
    Level {
        /// Which.
        level: u32,
        /// Layers (z) of tiles.
        layers: Range<u32>,
        /// Candidates of the level.
        candidates: Range<u32>,
    },
    /// Accessibility of bricks.
    Combine {
        /// Layers (z) of bricks.
        layers: Range<u32>,
        /// Candidates among bricks.
        candidates: Range<u32>,
    },
    /// Counting how open surfaces are, brick by brick.
    Surface {
        /// Layers (z) of bricks.
        layers: Range<u32>,
        /// Bricks with accessibility.
        bricks: Range<u32>,
    },
    /// Ray-traced accessibility of rows (counted through the slices) of the volume; cut up as it runs, since
    /// the cost of a row is only known once one has been traced.
    Trace(Range<u32>),
}

/// What there is to do: indices of tiles and bricks in ascending order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct WorkLists {
    /// Of each level.
    pub levels: Vec<Vec<u32>>,
    /// Bricks whose accessibility may have to be computed.
    pub bricks: Vec<u32>,
    /// Bricks that have accessibility in the end.
    pub wanted: Vec<u32>,
}

/// How the levels of a volume are cut up to fit the adapter.
#[derive(Clone, Copy, Debug)]
pub struct Cuts<'a> {
    /// Voxels along x, y, z.
    pub dims: [u32; 3],
    /// Layouts of all levels.
    pub layouts: &'a [LevelLayout],
    /// Most bytes of one binding.
    pub largest_binding: u64,
    /// Levels are looked up in textures and not in their buffers.
    pub sampled: bool,
    /// How far from a sample level 0 is looked up at most, in voxels; twice as far with every level.
    pub half_offset: f64,
}

impl Cuts<'_> {
    /// Steps of an update in order. `None` when a step cannot be made small enough for the adapter.
    pub fn plan(&self, settings: &AmbientOcclusion, work: &WorkLists) -> Option<Vec<Step>> {
        let mut steps = Vec::new();
        for (level, (layout, candidates)) in (0..).zip(self.layouts.iter().zip(&work.levels)) {
            let [x, y, _] = layout.tiles();
            let tile_cells = layout.tile_cells();
            let most = (STEP_CELLS / tile_cells).clamp(1, MOST_WORKGROUPS);
            let fits = |layers: &Range<u32>| self.level_fits(level as usize, layers);
            let pieces = pieces(candidates, x * y, u32::MAX, most, fits)?;
            steps.extend(pieces.into_iter().map(|(layers, candidates)| Step::Level { level, layers, candidates }));
        }
        let [x, y, _] = self.dims.map(|n| n.div_ceil(BRICK));
        let most = (STEP_SAMPLES / u64::from(BRICK).pow(3)).clamp(1, MOST_WORKGROUPS);
        if settings.method == AoMethod::Raytraced {
            steps.push(Step::Trace(0..self.dims[1] * self.dims[2]));
            if self.sample_bytes(1) > self.largest_binding || !self.trace_fits(settings) {
                return None;
            }
        } else {
            let thickness = self.combined_layers()?;
            let pieces = pieces(&work.bricks, x * y, thickness, most, |_| true)?;
            steps.extend(pieces.into_iter().map(|(layers, candidates)| Step::Combine { layers, candidates }));
        }
        let pieces = pieces(&work.wanted, x * y, u32::MAX, MOST_WORKGROUPS, |layers| {
            let slices = self.surface_slices(layers);
            slices.len() as u64 * self.layouts[0].slice_bytes() <= self.largest_binding
        })?;
        steps.extend(pieces.into_iter().map(|(layers, bricks)| Step::Surface { layers, bricks }));
        Some(steps)
    }

    /// Layers of bricks that are combined at once; `None` when not even one can be.
    pub fn combined_layers(&self) -> Option<u32> {
        let layers = self.dims[2].div_ceil(BRICK);
        let samples = u64::from(self.dims[0]) * u64::from(self.dims[1]) * u64::from(BRICK);
        // Textures that hold whole levels are written once, whatever the size of a step.
        let wished = if self.sampled { layers } else { u32::try_from(2 * STEP_SAMPLES / samples).unwrap_or(u32::MAX) };
        let wished = wished.clamp(1, layers);
        // Halving, so that a thickness that fits is found wherever one layer does.
        let mut thickness = Some(wished);
        while let Some(layers) = thickness {
            if self.combine_fits(layers) || (layers == 1 && self.fits_at_all()) {
                return Some(layers);
            }
            thickness = Some(layers / 2).filter(|&t| t > 0);
        }
        None
    }

    fn fits_at_all(&self) -> bool {
        self.sampled
    }

    fn combine_fits(&self, layers: u32) -> bool {
        let windows = (0..self.layouts.len()).map(|level| self.window_slices(level, layers));
        let fits = if self.sampled {
            let texels = |(layout, slices): (&LevelLayout, u32)| {
                2 * u64::from(layout.extent[0]) * u64::from(layout.extent[1]) * u64::from(slices)
            };
            self.layouts.iter().zip(windows).map(texels).sum::<u64>() <= WINDOW_BYTES
        } else {
            let bytes = |(layout, slices): (&LevelLayout, u32)| layout.slice_bytes() * u64::from(slices);
            self.layouts.iter().zip(windows).all(|window| bytes(window) <= self.largest_binding)
        };
        fits && (self.sampled || self.sample_bytes(BRICK * layers) <= self.largest_binding)
    }

    /// The slab of layers of bricks that is combined from one set of windows, of those that `layers` are in.
    pub fn slab(&self, layers: &Range<u32>) -> Option<Range<u32>> {
        let thickness = self.combined_layers()?;
        let start = layers.start / thickness * thickness;
        Some(start..(start + thickness).min(self.dims[2].div_ceil(BRICK)))
    }

    /// Most slices of a level that combining `layers` layers of bricks looks up.
    pub fn window_slices(&self, level: usize, layers: u32) -> u32 {
        let all = self.dims[2].div_ceil(BRICK);
        let windows = (0..all).step_by(layers as usize);
        let slices = windows.map(|z| self.window(level, &(z..(z + layers).min(all))).len() as u32);
        slices.max().unwrap_or(1)
    }

    /// Slices of a level that combining the bricks of `layers` looks up.
    pub fn window(&self, level: usize, layers: &Range<u32>) -> Range<u32> {
        let slices = layers.start * BRICK..(layers.end * BRICK).min(self.dims[2]);
        let reach = self.half_offset * f64::from(1_u32 << level);
        let (low, high) = (f64::from(slices.start) + 0.5 - reach, f64::from(slices.end) - 0.5 + reach);
        self.layouts[level].cells_around(2, low, high)
    }

    /// Slices of level 0 around the voxels of `layers` of bricks.
    pub fn surface_slices(&self, layers: &Range<u32>) -> Range<u32> {
        let origin = self.layouts[0].origin;
        origin + layers.start * BRICK - 1..origin + (layers.end * BRICK).min(self.dims[2]) + 1
    }

    /// The pieces of the level before that `layers` of tiles of a level are made from: slices of each binding.
    pub fn source_slices(&self, level: usize, layers: &Range<u32>) -> Vec<Range<u32>> {
        let (layout, before) = (&self.layouts[level], &self.layouts[level - 1]);
        if layout.is_mip_level() {
            return vec![layout.source_cells(before, 2, layout.slices_of(layers))];
        }
        layout.source_slices(before, layers).to_vec()
    }

    /// Bytes of a buffer of samples.
    pub fn sample_bytes(&self, slices: u32) -> u64 {
        4 * u64::from(sample_row_words(self.dims)) * u64::from(self.dims[1]) * u64::from(slices)
    }

    fn level_fits(&self, level: usize, layers: &Range<u32>) -> bool {
        let bytes = |level: usize, slices: Range<u32>| slices.len() as u64 * self.layouts[level].slice_bytes();
        let target = bytes(level, self.layouts[level].slices_of(layers));
        let sources = if level == 0 { Vec::new() } else { self.source_slices(level, layers) };
        let largest = sources.into_iter().map(|slices| bytes(level - 1, slices)).fold(target, u64::max);
        largest <= self.largest_binding
    }

    fn trace_fits(&self, settings: &AmbientOcclusion) -> bool {
        let middle = self.dims[2] / 2 * self.dims[1];
        let slices = trace_window(self.dims, &(middle..middle + 1), settings, &self.layouts[0]).len() as u64;
        slices * self.layouts[0].slice_bytes() <= self.largest_binding
    }
}

impl Step {
    /// Cells of levels that take about as long.
    pub(super) fn cost(&self, layouts: &[LevelLayout]) -> u64 {
        let brick = u64::from(BRICK).pow(3);
        match self {
            Self::Level { level, candidates, .. } => candidates.len() as u64 * layouts[*level as usize].tile_cells(),
            Self::Combine { candidates, .. } => candidates.len() as u64 * brick * SAMPLE_COST,
            Self::Surface { bricks, .. } => bricks.len() as u64 * brick,
            // As long as a turn, always.
            Self::Trace(_) => u64::MAX,
        }
    }
}

/// What runs in one submission together: a step's cost is known only roughly.
pub(super) const SUBMISSION_COST: u64 = STEP_CELLS;

/// Cuts ascending indices into pieces of whole layers, of `layer` indices each, as long as a piece has at most
/// `thickness` layers and `most` indices and `fits`; a layer of more than `most` indices is cut too. `None` where
/// not even one layer fits.
fn pieces(
    indices: &[u32],
    layer: u32,
    thickness: u32,
    most: u64,
    fits: impl Fn(&Range<u32>) -> bool,
) -> Option<Vec<(Range<u32>, Range<u32>)>> {
    let mut pieces = Vec::new();
    let mut start = 0;
    while start < indices.len() {
        let first = index(indices[start]) / layer;
        // Slabs of a given thickness begin at its multiples, so that buffers made for them always fit.
        let limit = if thickness == u32::MAX { u32::MAX } else { (first / thickness + 1) * thickness };
        if !fits(&(first..first + 1)) {
            return None;
        }
        let mut end = start;
        let mut layers = first..first + 1;
        while end < indices.len() && ((end - start) as u64) < most {
            let wider = first..index(indices[end]) / layer + 1;
            if wider.end > limit || (wider != layers && !fits(&wider)) {
                break;
            }
            layers = wider;
            end += 1;
        }
        pieces.push((layers, start as u32..end as u32));
        start = end;
    }
    Some(pieces)
}

/// The place of an entry of a work list.
fn index(entry: u32) -> u32 {
    entry & !(super::tiles::MUST | super::tiles::CLEAR)
}

/// Words, two samples each, between rows of the buffer of samples: rows of a buffer that is copied to a texture
/// begin at multiples of 256 bytes.
pub(super) fn sample_row_words(dims: [u32; 3]) -> u32 {
    dims[0].div_ceil(2).next_multiple_of(64)
}

/// Slices of level 0 that rays from `rows` can meet.
pub(super) fn trace_window(
    dims: [u32; 3],
    rows: &Range<u32>,
    settings: &AmbientOcclusion,
    layout: &LevelLayout,
) -> Range<u32> {
    let reach = reach_in_voxels(settings).unwrap_or(f64::from(dims[2]));
    let (first, last) = (rows.start / dims[1], (rows.end - 1) / dims[1]);
    layout.cells_around(2, f64::from(first) + 0.5 - reach, f64::from(last) + 0.5 + reach)
}

/// Max-norm distance at which reference rays end; `None`: at the volume's border (METHODS 3).
pub(super) fn reach_in_voxels(settings: &AmbientOcclusion) -> Option<f64> {
    match settings.radius {
        Radius::SameAsLevels => Some(f64::from(1_u32 << settings.levels) * 0.5),
        Radius::Voxels(reach) => Some(reach),
        Radius::Unlimited => None,
    }
}
