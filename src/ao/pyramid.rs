//! The levels of one volume on the GPU, kept from edit to edit, and what is known of them on the host.

use std::rc::{Rc, Weak};

use super::activity::Relations;
use super::build::{Accessibility, AoSource};
use super::levels::{LevelLayout, level_layouts};
use super::plan::{Cuts, WorkLists};
use super::tiles::{CLEAR, MOST_TILES, MUST, TileSet};
use crate::gpu::{Category, Gpu, GpuBuffer, GpuError, GpuTexture, Recorder};
use crate::scene::AmbientOcclusion;
use crate::volume::BRICK;

/// Levels of box means of one volume. What they hold is a pure function of the volume, an opacity table, settings and
/// the bricks that are wanted: an update from one table to the next ends with the same bits as a build from nothing,
/// which is the update from the table of zeros.
///
/// An update that is dropped half-way leaves the pyramid between two tables, with all that is needed to go on from
/// there to any other: `pending` says which tiles were not yet computed, and blocks that have changed stay marked
/// until everything that depends on them has been computed.
#[derive(Debug)]
pub struct Pyramid {
    pub(super) layouts: Vec<LevelLayout>,
    pub(super) levels: Vec<GpuBuffer>,
    /// A word for each block of all levels: it has changed since the last update that was finished.
    pub(super) changed: GpuBuffer,
    pub(super) first_flags: Vec<u32>,
    pub(super) list: GpuBuffer,
    pub(super) opacity_table: GpuBuffer,
    /// Longest component of the gradient of each brick.
    pub(super) steepest: GpuBuffer,
    /// Slices of the levels, where the texture unit can read them; made when first needed.
    pub(super) windows: Vec<GpuTexture>,
    pub(super) steepest_of_all: f64,
    dims: [u32; 3],
    /// Opacities that level 0 holds, but for the tiles that are pending.
    table: Vec<u16>,
    active: Vec<TileSet>,
    pending: Vec<TileSet>,
    /// Tiles that may be marked as changed by an update that was not finished.
    unsettled: Vec<TileSet>,
    result: Option<LastResult>,
    broken: bool,
}

/// The accessibility that the last finished update has made.
#[derive(Debug)]
struct LastResult {
    accessibility: Weak<Accessibility>,
    normal_factor: f64,
    wanted: TileSet,
}

/// What an update starts from and has to do.
#[derive(Debug)]
pub(super) struct Update {
    pub(super) work: WorkLists,
    /// Accessibility that bricks which are not computed again are taken from.
    pub(super) base: Option<Rc<Accessibility>>,
}

impl Pyramid {
    /// Levels of an invisible volume.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn new(gpu: &Gpu, source: &AoSource, settings: &AmbientOcclusion) -> Result<Self, GpuError> {
        let dims = source.values.dims();
        let layouts = level_layouts(dims, settings);
        let tiles: Vec<[u32; 3]> = layouts.iter().map(LevelLayout::tiles).collect();
        let count = |t: &[u32; 3]| t.iter().map(|&n| u64::from(n)).product::<u64>();
        let bricks = dims.map(|n| n.div_ceil(BRICK));
        let blocks: Vec<u64> = layouts.iter().map(|l| count(&l.blocks())).collect();
        let all: u64 = blocks.iter().sum();
        let longest = tiles.iter().map(count).max().unwrap_or(0).max(count(&bricks));
        let level_bytes: u64 = layouts.iter().map(LevelLayout::bytes).sum();
        let what = "ambient occlusion";
        if all > MOST_TILES {
            return Err(gpu.budget.out_of_memory(what, level_bytes));
        }
        gpu.budget.check(what, level_bytes + 4 * (all + longest))?;
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let buffer = |label: &str, bytes| gpu.buffer(label, Category::AoScratch, bytes, storage);
        let steepest = source.steepest();
        let first_flag = |level: usize| blocks[..level].iter().sum::<u64>() as u32;
        Ok(Self {
            levels: layouts.iter().map(|l| buffer("ao level", l.bytes())).collect::<Result<_, _>>()?,
            changed: buffer("ao changed blocks", 4 * all)?,
            first_flags: (0..tiles.len()).map(first_flag).collect(),
            list: buffer("ao work list", 4 * longest)?,
            opacity_table: buffer("ao opacity table", 2 * source.opacity_table.len().next_multiple_of(2) as u64)?,
            steepest: gpu.storage_with("ao steepest", Category::AoScratch, bytemuck::cast_slice(&steepest))?,
            steepest_of_all: steepest.iter().copied().fold(0.0, f32::max).into(),
            windows: Vec::new(),
            dims,
            table: vec![0; source.opacity_table.len()],
            active: tiles.iter().map(|&t| TileSet::empty(t)).collect(),
            pending: tiles.iter().map(|&t| TileSet::empty(t)).collect(),
            unsettled: tiles.iter().map(|&t| TileSet::empty(t)).collect(),
            layouts,
            result: None,
            broken: false,
        })
    }

    /// Bytes on the GPU.
    pub fn bytes(&self) -> u64 {
        let buffers = [&self.changed, &self.list, &self.opacity_table, &self.steepest];
        let buffers = self.levels.iter().chain(buffers).map(GpuBuffer::bytes).sum::<u64>();
        buffers + self.windows.iter().map(GpuTexture::bytes).sum::<u64>()
    }

    /// Bytes of every level.
    pub fn level_bytes(&self) -> Vec<u64> {
        self.levels.iter().map(GpuBuffer::bytes).collect()
    }

    /// The words of one level as they are, row after row with all padding.
    ///
    /// # Errors
    /// As [`Gpu::submit_and_read`].
    pub fn read_level(&self, gpu: &Gpu, level: usize) -> Result<Vec<u32>, GpuError> {
        let bytes = self.levels[level].bytes();
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let readback = gpu.buffer("ao level read-back", Category::AoScratch, bytes, usage)?;
        gpu.guarded("reading a level", || {
            let mut recorder = Recorder::new(gpu, "ao level read-back");
            recorder.copy(&self.levels[level], &readback, bytes);
            recorder.run_and_read(gpu, &readback, bytes, |data| bytemuck::cast_slice(data).to_vec())
        })
    }

    /// Makes the next update a build of everything, with the memory that is there.
    pub fn forget(&mut self) {
        for (pending, active) in self.pending.iter_mut().zip(&self.active) {
            pending.insert_all(active);
        }
        self.result = None;
    }

    /// Bricks of the volume in tiles of level 0.
    pub(super) fn bricks_in(&self, tiles: &[u32]) -> u64 {
        let (layout, [x, y, _]) = (&self.layouts[0], self.layouts[0].tiles());
        let bricks = |axis: usize, tile: u32| {
            let end = self.dims[axis].div_ceil(BRICK);
            let brick = |cell: u32| (cell.saturating_sub(layout.origin) / BRICK).min(end);
            u64::from(brick((tile + 1) * layout.tile[axis]) - brick(tile * layout.tile[axis]))
        };
        let index = |entry: &u32| entry & !(MUST | CLEAR);
        tiles.iter().map(index).map(|t| bricks(0, t % x) * bricks(1, t / x % y) * bricks(2, t / (x * y))).sum()
    }

    /// True once a step of an update has failed: what the levels hold is not known then.
    pub fn is_broken(&self) -> bool {
        self.broken
    }

    pub(super) fn set_broken(&mut self) {
        self.broken = true;
    }

    fn changed_codes(&self, source: &AoSource) -> crate::volume::CodeSet {
        let table = &source.opacity_table;
        source.contents.code_set(table.len(), |code| table[code] != self.table[code])
    }

    /// How far from a sample level 0 is looked up at most, in voxels.
    pub(super) fn half_offset(&self, settings: &AmbientOcclusion) -> f64 {
        settings.normal_factor * 0.5 * self.steepest_of_all
    }

    pub(super) fn cuts(&self, gpu: &Gpu, sampled: bool, settings: &AmbientOcclusion) -> Cuts<'_> {
        Cuts {
            dims: self.dims,
            layouts: &self.layouts,
            largest_binding: gpu.limits.max_storage_buffer_binding_size,
            sampled,
            half_offset: self.half_offset(settings),
        }
    }

    /// Makes the textures that levels are looked up in, unless they are there.
    pub(super) fn make_windows(&mut self, gpu: &Gpu, settings: &AmbientOcclusion) -> Result<(), GpuError> {
        let cuts = self.cuts(gpu, true, settings);
        let Some(layers) = cuts.combined_layers() else { return Ok(()) };
        let depths = (0..self.layouts.len()).map(|level| cuts.window_slices(level, layers));
        let mut dims: Vec<_> = self.layouts.iter().zip(depths).map(|(l, z)| [l.extent[0], l.extent[1], z]).collect();
        if layers == self.dims[2].div_ceil(BRICK) {
            dims = self.layouts.iter().map(|l| l.extent).collect();
        }
        if self.windows.iter().map(GpuTexture::dims).ne(dims.iter().copied()) {
            self.windows.clear();
            let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
            let format = wgpu::TextureFormat::R16Unorm;
            let window = |&dims| gpu.texture_3d("ao window", Category::AoScratch, dims, format, usage);
            self.windows = dims.iter().map(window).collect::<Result<_, _>>()?;
        }
        Ok(())
    }

    /// The windows hold whole levels: they are written as levels are, and never again.
    pub(super) fn is_mirrored(&self) -> bool {
        !self.windows.is_empty() && self.windows.iter().zip(&self.layouts).all(|(w, l)| w.dims() == l.extent)
    }

    /// Begins an update to `source` and `settings` with accessibility in the bricks `wanted`.
    pub(super) fn begin(
        &mut self,
        gpu: &Gpu,
        source: &AoSource,
        settings: &AmbientOcclusion,
        wanted: &TileSet,
    ) -> Update {
        let contents = &source.contents;
        let relations = Relations::new(self.dims, &self.layouts, self.half_offset(settings));
        let table = &source.opacity_table;
        let opaque = contents.code_set(table.len(), |code| table[code] > 0);
        let visible = TileSet::of(contents.dims, |brick| contents.any_of(brick, &opaque));
        let changed = self.changed_codes(source);
        let touched = TileSet::of(contents.dims, |brick| contents.any_of(brick, &changed));

        let active = relations.active(&visible, wanted);
        self.pending[0].insert_all(&relations.first_tiles(&touched));
        for (level, now) in active.iter().enumerate() {
            // Tiles that begin to hold something, and those that no longer do and become zero.
            self.pending[level].insert_all(&now.difference(&self.active[level]));
            self.unsettled[level].insert_all(&self.pending[level]);
        }
        relations.spread_changes(&active, &mut self.unsettled);
        self.active = active;
        self.table.clone_from(table);
        gpu.queue.write_buffer(&self.opacity_table.raw, 0, &even_words(table));

        let base = self.result.as_ref().filter(|r| r.normal_factor == settings.normal_factor);
        let base = base.and_then(|r| Some((r.accessibility.upgrade()?, r.wanted.clone())));
        let mut must = wanted.clone();
        let mut candidates = relations.bricks_of(&self.unsettled);
        candidates.keep_only(wanted);
        if let Some((_, before)) = &base {
            must = wanted.difference(before);
        }
        candidates.insert_all(&must);
        let all = |set: &TileSet| entries(set, set, set);
        let levels = (0..self.layouts.len()).map(|level| {
            let mut candidates = self.unsettled[level].clone();
            let mut alive = self.active[level].clone();
            alive.insert_all(&self.pending[level]);
            // A tile that nobody reads any more and that is zero already may still be marked.
            candidates.keep_only(&alive);
            entries(&candidates, &self.pending[level], &self.active[level])
        });
        let work =
            WorkLists { levels: levels.collect(), bricks: entries(&candidates, &must, wanted), wanted: all(wanted) };
        Update { work, base: base.map(|b| b.0) }
    }

    /// Layers of tiles of a level have been computed.
    pub(super) fn settle(&mut self, level: usize, candidates: &[u32]) {
        for &entry in candidates {
            self.pending[level].remove((entry & !(MUST | CLEAR)) as usize);
        }
    }

    /// The update is finished: nothing is marked as changed any more.
    pub(super) fn finish(&mut self, accessibility: &Rc<Accessibility>, settings: &AmbientOcclusion, wanted: &TileSet) {
        for set in &mut self.unsettled {
            *set = TileSet::empty(set.dims());
        }
        self.result = Some(LastResult {
            accessibility: Rc::downgrade(accessibility),
            normal_factor: settings.normal_factor,
            wanted: wanted.clone(),
        });
    }
}

/// The work list of `candidates`: those in `must` are done whatever has changed, those not in `alive` become zero.
fn entries(candidates: &TileSet, must: &TileSet, alive: &TileSet) -> Vec<u32> {
    let entry = |index: usize| {
        let flag = |set: bool, flag: u32| if set { flag } else { 0 };
        index as u32 | flag(must.has(index), MUST) | flag(!alive.has(index), CLEAR)
    };
    candidates.indices().map(entry).collect()
}

/// The bytes of a table, with one entry more where it needs one to fill its last word.
fn even_words(table: &[u16]) -> Vec<u8> {
    let mut bytes = bytemuck::cast_slice(table).to_vec();
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    bytes
}
