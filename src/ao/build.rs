//! Computing one accessibility volume, slice of time by slice of time.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::ops::Range;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::plan::{SUBMISSION_COST, Step, WorkLists, sample_row_words};
use super::pyramid::Pyramid;
use super::raytraced::Tracer;
use super::stages::{AoStages, sample_format};
use super::surface::SurfaceHistogram;
use super::tiles::TileSet;
use crate::gpu::{Category, Gpu, GpuBuffer, GpuError, GpuTexture, Recorder};
use crate::scene::{AmbientOcclusion, AoMethod};
use crate::volume::Bricks;

/// How long the device may be kept before another scene gets its turn.
const SLICE_TIME: Duration = Duration::from_millis(60);

/// Room for lists and for the parameters of the passes of a submission.
const PARAMETER_BYTES: u64 = 256 << 10;

/// Words of the arguments of a dispatch, one of them unused.
pub(super) const DISPATCH_WORDS: u32 = 4;

/// What a build reads.
#[derive(Clone, Debug)]
pub struct AoSource {
    /// Stored values of the volume: code / 255 or code / 65535.
    pub values: Rc<GpuTexture>,
    /// Codes per stored value: 255 or 65535.
    pub code_scale: f32,
    /// The volume's highest code.
    pub max_code: u16,
    /// Opacity of every code over one smallest spacing, 65535 = 1.
    pub opacity_table: Rc<Vec<u16>>,
    /// What occurs in the volume's bricks.
    pub contents: Arc<Bricks>,
    /// Chebyshev distance in bricks to the next brick that is not empty; x fastest. Only rays need it: may be
    /// empty for other methods.
    pub brick_distance: Rc<Vec<u8>>,
}

impl AoSource {
    /// Longest component that the gradient of normalised values can have in each brick: half of what values differ by.
    pub(super) fn steepest(&self) -> Vec<f32> {
        let scale = 0.5 / f32::from(self.max_code).max(1.0);
        self.contents.ranges.iter().map(|[low, high]| scale * f32::from(high - low)).collect()
    }

    /// Normalised value per stored value.
    pub fn normalise(&self) -> f32 {
        if self.max_code == 0 { 0.0 } else { self.code_scale / f32::from(self.max_code) }
    }
}

/// A finished accessibility volume.
#[derive(Debug)]
pub struct Accessibility {
    /// A at voxel centres of the bricks that were wanted, 0 elsewhere: r16unorm, or r16float where that cannot be
    /// filtered.
    pub texture: Rc<GpuTexture>,
    /// Accessibility that four fifths of the surface do not exceed, in (0, 1].
    pub surface_reference: f64,
    /// Its number in the order of completion, from 1.
    pub version: u64,
}

/// Counted work of a build.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct AoWork {
    /// Bricks whose opacities were looked up.
    pub classified: u64,
    /// Tiles of other levels that were computed.
    pub tiles: u64,
    /// Bricks whose accessibility was computed.
    pub recomputed: u64,
    /// Some bricks were taken from an earlier result.
    pub incremental: bool,
}

/// How long one step of a profiled build took.
#[derive(Clone, Debug)]
pub struct StepTime {
    /// The step.
    pub step: Step,
    /// Wall-clock time from submission to completion.
    pub elapsed: Duration,
}

/// A build, or an update, under way. While it lives nobody else may use its pyramid.
#[derive(Debug)]
pub struct AoBuild {
    pub(super) source: AoSource,
    pub(super) settings: AmbientOcclusion,
    pub(super) dims: [u32; 3],
    pub(super) pyramid: Rc<RefCell<Pyramid>>,
    pub(super) wanted: TileSet,
    pub(super) work: WorkLists,
    pub(super) tracer: Option<Tracer>,
    /// Samples on their way to the target, where passes cannot write to it.
    pub(super) samples: Option<GpuBuffer>,
    pub(super) surface: SurfaceHistogram,
    pub(super) row_words: u32,
    pub(super) target: Rc<GpuTexture>,
    pub(super) base: Option<Rc<Accessibility>>,
    /// Entries of all work lists, level by level, then bricks, then the wanted ones.
    pub(super) candidates: GpuBuffer,
    /// Workgroups of every step, by its number: counted on the GPU.
    pub(super) dispatches: GpuBuffer,
    /// First layer of the slab that the windows hold.
    pub(super) windows_hold: Cell<Option<u32>>,
    steps: VecDeque<(u32, Step)>,
    all_steps: Vec<Step>,
    finished: Option<(Rc<Accessibility>, AoWork)>,
    /// Why a step was not done. Jobs share a build: none of them may go on with a hole in it.
    failure: Option<GpuError>,
}

impl AoBuild {
    /// Reserves all memory that the build takes beside its pyramid's. Bricks not in `wanted` get no accessibility.
    /// `eye`: layers of bricks (z) near this one come first.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`], also when a step cannot be made small enough for the adapter's bindings.
    pub fn new(
        gpu: &Gpu,
        stages: &AoStages,
        pyramid: Rc<RefCell<Pyramid>>,
        source: AoSource,
        settings: AmbientOcclusion,
        wanted: TileSet,
        eye: f64,
    ) -> Result<Self, GpuError> {
        let dims = source.values.dims();
        let sampled = stages.sampled && settings.method == AoMethod::Spao;
        let row_words = sample_row_words(dims);
        let slices = {
            let pyramid = pyramid.borrow();
            let cuts = pyramid.cuts(gpu, sampled, &settings);
            if settings.method == AoMethod::Raytraced { Some(1) } else { cuts.combined_layers().map(|l| 8 * l) }
        };
        let sample_bytes = u64::from(row_words) * 4 * u64::from(dims[1]) * u64::from(slices.unwrap_or(1).min(dims[2]));
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let samples =
            if sampled { None } else { Some(gpu.buffer("ao samples", Category::AoScratch, sample_bytes, storage)?) };
        let mut usage =
            wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC;
        if sampled {
            usage |= wgpu::TextureUsages::STORAGE_BINDING;
        }
        let target = gpu.texture_3d("accessibility", Category::AoCache, dims, sample_format(gpu), usage)?;
        let tracer =
            (settings.method == AoMethod::Raytraced).then(|| Tracer::new(gpu, &source, &settings)).transpose()?;
        let surface = SurfaceHistogram::new(gpu)?;
        if sampled {
            pyramid.borrow_mut().make_windows(gpu, &settings)?;
        }

        gpu.budget.check("ambient occlusion", PARAMETER_BYTES)?;

        // From here on the pyramid is on its way: nothing may fail that could have failed before.
        let update = pyramid.borrow_mut().begin(gpu, &source, &settings, &wanted);
        // Every ray is traced again, whatever has changed.
        let base = update.base.filter(|_| settings.method == AoMethod::Spao);
        let work = update.work;
        let mut steps = {
            let pyramid = pyramid.borrow();
            let cuts = pyramid.cuts(gpu, sampled, &settings);
            let refused = || {
                let largest = cuts.largest_binding;
                let bytes = pyramid.level_bytes().iter().sum();
                gpu.budget.out_of_memory(&format!("ambient occlusion, in bindings of at most {largest} bytes,"), bytes)
            };
            cuts.plan(&settings, &work).ok_or_else(refused)?
        };
        // A stable order: steps of levels are not touched.
        steps.sort_by_key(|step| match step {
            Step::Level { .. } => (0, 0),
            Step::Combine { layers, .. } => (1, (f64::from(layers.start + layers.end) * 0.5 - eye).abs() as u32),
            Step::Surface { .. } | Step::Trace(_) => (2, 0),
        });
        let lists = work.levels.iter().chain([&work.bricks, &work.wanted]);
        let candidates: Vec<u32> = lists.flatten().copied().collect();
        let candidates = gpu.storage_with("ao candidates", Category::AoScratch, bytemuck::cast_slice(&candidates))?;
        let dispatches = dispatches(gpu, &steps, &pyramid.borrow())?;
        Ok(Self {
            source,
            settings,
            dims,
            pyramid,
            wanted,
            work,
            tracer,
            samples,
            surface,
            row_words,
            target: Rc::new(target),
            base,
            candidates,
            dispatches,
            windows_hold: Cell::new(None),
            steps: (0..).zip(steps.clone()).collect(),
            all_steps: steps,
            finished: None,
            failure: None,
        })
    }

    /// Works for about one slice of time; true when done.
    ///
    /// # Errors
    /// [`GpuError::Device`] or [`GpuError::Lost`]; the build is then useless and answers the same from then on.
    pub fn advance(&mut self, gpu: &Gpu, stages: &AoStages) -> Result<bool, GpuError> {
        let begin = Instant::now();
        // Submitted piece by piece, because the cost of a step is not known before: looking at the clock in between
        // keeps a turn short, and waiting for each costs nothing beside what it computes.
        while begin.elapsed() < SLICE_TIME / 2 && !self.run(gpu, stages, SUBMISSION_COST)?.is_empty() {}
        Ok(self.steps.is_empty())
    }

    /// Runs the next step alone; true when done.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub fn step(&mut self, gpu: &Gpu, stages: &AoStages) -> Result<bool, GpuError> {
        self.run(gpu, stages, 0)?;
        Ok(self.steps.is_empty())
    }

    /// Runs what is left, one step at a time.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub fn run_profiled(&mut self, gpu: &Gpu, stages: &AoStages) -> Result<Vec<StepTime>, GpuError> {
        let mut times = Vec::new();
        loop {
            let begin = Instant::now();
            let Some(step) = self.run(gpu, stages, 0)?.pop() else { return Ok(times) };
            times.push(StepTime { step, elapsed: begin.elapsed() });
        }
    }

    /// True once a step has failed.
    pub fn has_failed(&self) -> bool {
        self.failure.is_some()
    }

    /// Runs the next step, and more while they are cheap; says which.
    fn run(&mut self, gpu: &Gpu, stages: &AoStages, cost: u64) -> Result<Vec<Step>, GpuError> {
        if let Some(error) = &self.failure {
            return Err(error.clone());
        }
        let mut run: Vec<(u32, Step)> = Vec::new();
        let mut sum = 0_u64;
        while let Some((number, step)) = self.next_step(|step, layouts| {
            let next = sum.saturating_add(step.cost(layouts));
            run.is_empty() || next <= cost
        }) {
            sum = sum.saturating_add(step.cost(&self.pyramid.borrow().layouts));
            run.push((number, step));
        }
        if run.is_empty() {
            return Ok(Vec::new());
        }
        let begin = Instant::now();
        let result = gpu.guarded("ambient occlusion", || {
            let mut recorder = Recorder::new(gpu, "ambient occlusion");
            if run[0].0 == 0 {
                self.record_begin(&mut recorder);
            }
            for (number, step) in &run {
                self.record(gpu, stages, &mut recorder, *number, step)?;
            }
            recorder.run(gpu)
        });
        if let Err(error) = result {
            self.failure = Some(error.clone());
            self.pyramid.borrow_mut().set_broken();
            return Err(error);
        }
        for (_, step) in &run {
            if let Step::Level { level, candidates, .. } = step {
                let list = &self.work.levels[*level as usize];
                self.pyramid.borrow_mut().settle(*level as usize, &list[span(candidates)]);
            }
            if let (Step::Trace(_), Some(tracer)) = (step, &mut self.tracer) {
                tracer.adapt(begin.elapsed(), SLICE_TIME / 4);
            }
        }
        Ok(run.into_iter().map(|(_, step)| step).collect())
    }

    /// Traces only some rows (counted through the slices), for measuring.
    pub fn keep_rows(&mut self, rows: Range<u32>) {
        for (_, step) in &mut self.steps {
            if let Step::Trace(all) = step {
                *all = rows.clone();
            }
        }
    }

    /// Share of the work that is done, in [0, 1]: of the rows where rays are traced, else of the steps.
    pub fn fraction(&self) -> f64 {
        let all_rows = f64::from(self.dims[1]) * f64::from(self.dims[2]);
        let traces = self.all_steps.iter().any(|step| matches!(step, Step::Trace(_)));
        let traced =
            self.steps.iter().find_map(|(_, step)| if let Step::Trace(rows) = step { Some(rows) } else { None });
        let left = match traced {
            Some(rows) => rows.len() as f64 / all_rows,
            // What comes after the rays takes no time beside them.
            None if traces => 0.0,
            None => self.steps.len() as f64 / self.all_steps.len().max(1) as f64,
        };
        1.0 - left
    }

    /// Bytes of every level of box means.
    pub fn level_bytes(&self) -> Vec<u64> {
        self.pyramid.borrow().level_bytes()
    }

    /// The accessibility as far as it has been computed, the rest as it was before, and how open its surfaces were
    /// before; `None` where nothing was there before.
    pub fn so_far(&self) -> Option<(Rc<GpuTexture>, f64)> {
        let begun = self.steps.front().is_some_and(|(number, _)| *number > 0);
        self.base.as_ref().filter(|_| begun).map(|base| (self.target.clone(), base.surface_reference))
    }

    /// The finished accessibility volume, to be known as `version`, and what was done for it; `None` before the last
    /// step is done. Later calls give the same.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub fn finish(&mut self, gpu: &Gpu, version: u64) -> Result<Option<(Rc<Accessibility>, AoWork)>, GpuError> {
        if !self.steps.is_empty() || self.failure.is_some() {
            return Ok(None);
        }
        if self.finished.is_none() {
            let (surface_reference, counts) = gpu.guarded("ambient occlusion", || {
                let mut recorder = Recorder::new(gpu, "ao surface");
                recorder.clear(&self.pyramid.borrow().changed);
                self.surface.reference(gpu, recorder, &self.dispatches)
            })?;
            let mut done = AoWork { incremental: self.base.is_some(), ..AoWork::default() };
            for (step, count) in self.all_steps.iter().zip(counts) {
                match step {
                    Step::Level { level: 0, candidates, .. } => {
                        // All of them have been done: an update has no other candidates there.
                        let tiles = &self.work.levels[0][span(candidates)];
                        done.classified += self.pyramid.borrow().bricks_in(tiles);
                    }
                    Step::Level { .. } => done.tiles += u64::from(count),
                    Step::Combine { .. } => done.recomputed += u64::from(count),
                    Step::Trace(_) => done.recomputed += self.wanted.count(),
                    Step::Surface { .. } => {}
                }
            }
            let texture = self.target.clone();
            let result = Rc::new(Accessibility { texture, surface_reference, version });
            self.pyramid.borrow_mut().finish(&result, &self.settings, &self.wanted);
            self.finished = Some((result, done));
        }
        Ok(self.finished.clone())
    }

    /// Takes the next step if `wished`.
    fn next_step(&mut self, wished: impl FnOnce(&Step, &[super::levels::LevelLayout]) -> bool) -> Option<(u32, Step)> {
        let (_, step) = self.steps.front()?;
        if !wished(step, &self.pyramid.borrow().layouts) {
            return None;
        }
        let (number, step) = self.steps.pop_front()?;
        let (Step::Trace(rows), Some(tracer)) = (&step, &self.tracer) else { return Some((number, step)) };
        let (now, later) = tracer.split(rows, self.dims[1]);
        if !later.is_empty() {
            self.steps.push_front((number, Step::Trace(later)));
        }
        Some((number, Step::Trace(now)))
    }
}

/// Range of a slice.
pub(super) fn span(range: &Range<u32>) -> Range<usize> {
    range.start as usize..range.end as usize
}

/// Arguments of the dispatches of all steps: no workgroups yet, and as many parts as a tile has.
fn dispatches(gpu: &Gpu, steps: &[Step], pyramid: &Pyramid) -> Result<GpuBuffer, GpuError> {
    let arguments: Vec<[u32; DISPATCH_WORDS as usize]> = steps
        .iter()
        .map(|step| match step {
            Step::Level { level, .. } => [0, pyramid.layouts[*level as usize].tile_parts(), 1, 0],
            _ => [0, 1, 1, 0],
        })
        .collect();
    let usage = wgpu::BufferUsages::STORAGE
        | wgpu::BufferUsages::INDIRECT
        | wgpu::BufferUsages::COPY_SRC
        | wgpu::BufferUsages::COPY_DST;
    gpu.buffer_with("ao dispatches", Category::AoScratch, bytemuck::cast_slice(&arguments), usage)
}
