//! Computing one accessibility volume, slice of time by slice of time.

use std::collections::VecDeque;
use std::rc::Rc;
use std::time::{Duration, Instant};

use super::levels::{LevelLayout, level_layouts};
use super::params::{ClassifyParams, LevelInfo, MAX_LEVELS, MipmapParams, NBufferParams, SpaoParams};
use super::plan::{Step, combine_window, plan, sample_row_words};
use super::raytraced::Tracer;
use super::stages::{AoStages, sample_format};
use super::surface::SurfaceHistogram;
use crate::gpu::{Binding, Category, Gpu, GpuBuffer, GpuError, GpuTexture, Recorder};
use crate::scene::{AmbientOcclusion, AoMethod};

/// How long the device may be kept before another scene gets its turn.
const SLICE_TIME: Duration = Duration::from_millis(60);

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
    /// Chebyshev distance in bricks of 8^3 to the next brick that is not empty; x fastest. Only rays need it: may be
    /// empty for other methods.
    pub brick_distance: Rc<Vec<u8>>,
    /// Bricks along x, y, z.
    pub bricks: [u32; 3],
}

/// A finished accessibility volume.
#[derive(Debug)]
pub struct Accessibility {
    /// A at voxel centres: r16unorm, or r16float where that cannot be filtered.
    pub texture: GpuTexture,
    /// Accessibility that four fifths of the surface do not exceed, in (0, 1].
    pub surface_reference: f64,
    /// Its number in the order of completion, from 1.
    pub version: u64,
}

/// How long one step of a profiled build took.
#[derive(Clone, Debug)]
pub struct StepTime {
    /// The step.
    pub step: Step,
    /// Wall-clock time from submission to completion.
    pub elapsed: Duration,
}

/// A build under way.
#[derive(Debug)]
pub struct AoBuild {
    source: AoSource,
    settings: AmbientOcclusion,
    dims: [u32; 3],
    layouts: Vec<LevelLayout>,
    levels: Vec<GpuBuffer>,
    opacity_table: GpuBuffer,
    tracer: Option<Tracer>,
    samples: GpuBuffer,
    surface: SurfaceHistogram,
    row_words: u32,
    target: Option<GpuTexture>,
    steps: VecDeque<Step>,
    step_count: usize,
    /// Why a step was not done. Jobs share a build: none of them may go on with a hole in it.
    failure: Option<GpuError>,
}

impl AoBuild {
    /// Reserves all memory that the build takes.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`], also when a step cannot be made small enough for the adapter's bindings.
    pub fn new(gpu: &Gpu, source: AoSource, settings: AmbientOcclusion) -> Result<Self, GpuError> {
        let dims = source.values.dims();
        let layouts = level_layouts(dims, &settings);
        let what = "ambient occlusion";
        let level_bytes: u64 = layouts.iter().map(LevelLayout::bytes).sum();
        let largest = gpu.limits.max_storage_buffer_binding_size;
        let steps = plan(dims, &settings, &layouts, largest).ok_or_else(|| {
            let what = format!("{what}, in bindings of at most {largest} bytes,");
            gpu.budget.out_of_memory(&what, level_bytes)
        })?;
        let row_words = sample_row_words(dims);
        let slices = steps.iter().map(|s| if let Step::Combine(r) = s { r.end - r.start } else { 1 }).max();
        let sample_bytes = u64::from(row_words) * 4 * u64::from(dims[1]) * u64::from(slices.unwrap_or(1));
        let voxels: u64 = dims.iter().map(|&n| u64::from(n)).product();
        gpu.budget.check(what, level_bytes + sample_bytes + 2 * voxels)?;
        let storage = wgpu::BufferUsages::STORAGE;
        let levels = (0..)
            .zip(&layouts)
            .map(|(l, layout)| gpu.buffer(&format!("ao level {l}"), Category::AoScratch, layout.bytes(), storage))
            .collect::<Result<Vec<_>, _>>()?;
        let samples =
            gpu.buffer("ao samples", Category::AoScratch, sample_bytes, storage | wgpu::BufferUsages::COPY_SRC)?;
        let usage =
            wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST | wgpu::TextureUsages::COPY_SRC;
        let target = gpu.texture_3d("accessibility", Category::AoCache, dims, sample_format(gpu), usage)?;
        let table = bytemuck::cast_slice(&source.opacity_table);
        let opacity_table = gpu.storage_with("ao opacity table", Category::AoScratch, table)?;
        let tracer =
            (settings.method == AoMethod::Raytraced).then(|| Tracer::new(gpu, &source, &settings)).transpose()?;
        let step_count = steps.len();
        Ok(Self {
            source,
            settings,
            dims,
            layouts,
            levels,
            opacity_table,
            tracer,
            samples,
            surface: SurfaceHistogram::new(gpu)?,
            row_words,
            target: Some(target),
            steps: steps.into(),
            step_count,
            failure: None,
        })
    }

    /// Works for about one slice of time; true when done.
    ///
    /// # Errors
    /// [`GpuError::Device`] or [`GpuError::Lost`]; the build is then useless and answers the same from then on.
    pub fn advance(&mut self, gpu: &Gpu, stages: &AoStages) -> Result<bool, GpuError> {
        let begin = Instant::now();
        // Submitted one by one, because the cost of a step is not known before: looking at the clock in between
        // keeps a turn short, and waiting for each costs nothing beside what it computes.
        while begin.elapsed() < SLICE_TIME / 2 && self.run_step(gpu, stages)?.is_some() {}
        Ok(self.steps.is_empty())
    }

    /// Runs what is left, one step at a time.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub fn run_profiled(&mut self, gpu: &Gpu, stages: &AoStages) -> Result<Vec<StepTime>, GpuError> {
        let mut times = Vec::new();
        while let Some(time) = self.run_step(gpu, stages)? {
            times.push(time);
        }
        Ok(times)
    }

    /// True once a step has failed.
    pub fn has_failed(&self) -> bool {
        self.failure.is_some()
    }

    /// Runs the next step; `None` when there is none left.
    fn run_step(&mut self, gpu: &Gpu, stages: &AoStages) -> Result<Option<StepTime>, GpuError> {
        if let Some(error) = &self.failure {
            return Err(error.clone());
        }
        let Some(step) = self.next_step() else { return Ok(None) };
        let begin = Instant::now();
        let result = gpu.guarded("ambient occlusion", || {
            let mut recorder = Recorder::new(gpu, "ambient occlusion");
            self.record(gpu, stages, &mut recorder, &step)?;
            recorder.run(gpu)
        });
        if let Err(error) = result {
            self.failure = Some(error.clone());
            return Err(error);
        }
        let elapsed = begin.elapsed();
        if let (Step::Trace(_), Some(tracer)) = (&step, &mut self.tracer) {
            tracer.adapt(elapsed, SLICE_TIME / 4);
        }
        Ok(Some(StepTime { step, elapsed }))
    }

    /// Traces only some rows (counted through the slices), for measuring.
    pub fn keep_rows(&mut self, rows: std::ops::Range<u32>) {
        for step in &mut self.steps {
            if let Step::Trace(all) = step {
                *all = rows.clone();
            }
        }
    }

    /// Share of the work that is done, in [0, 1]: of the rows where rays are traced, else of the steps.
    pub fn fraction(&self) -> f64 {
        let all_rows = f64::from(self.dims[1]) * f64::from(self.dims[2]);
        let left = match self.steps.back() {
            Some(Step::Trace(rows)) => rows.len() as f64 / all_rows,
            _ => self.steps.len() as f64 / self.step_count.max(1) as f64,
        };
        1.0 - left
    }

    /// Bytes of every level of box means.
    pub fn level_bytes(&self) -> Vec<u64> {
        self.levels.iter().map(GpuBuffer::bytes).collect()
    }

    /// The finished accessibility volume, once, to be known as `version`; `None` before the last step is done.
    ///
    /// # Errors
    /// As [`Self::advance`].
    pub fn finish(&mut self, gpu: &Gpu, version: u64) -> Result<Option<Accessibility>, GpuError> {
        if !self.steps.is_empty() {
            return Ok(None);
        }
        let Some(texture) = self.target.take() else { return Ok(None) };
        let surface_reference = gpu.guarded("ambient occlusion", || self.surface.reference(gpu))?;
        Ok(Some(Accessibility { texture, surface_reference, version }))
    }

    fn next_step(&mut self) -> Option<Step> {
        let step = self.steps.pop_front()?;
        let (Step::Trace(rows), Some(tracer)) = (&step, &self.tracer) else { return Some(step) };
        let (now, later) = tracer.split(rows, self.dims[1]);
        if !later.is_empty() {
            self.steps.push_front(Step::Trace(later));
        }
        Some(Step::Trace(now))
    }

    fn record(&self, gpu: &Gpu, stages: &AoStages, recorder: &mut Recorder, step: &Step) -> Result<(), GpuError> {
        match step {
            Step::Classify(slices) => self.record_classify(gpu, stages, recorder, slices.clone()),
            Step::Mipmap(level, slices) => self.record_mipmap(gpu, stages, recorder, *level as usize, slices.clone()),
            Step::NBuffer(level, slices) => self.record_nbuffer(gpu, stages, recorder, *level as usize, slices.clone()),
            Step::Combine(slices) => self.record_combine(gpu, stages, recorder, slices.clone()),
            Step::Trace(rows) => {
                let Some(tracer) = &self.tracer else { return Ok(()) };
                let level = (&self.layouts[0], &self.levels[0]);
                tracer.record(gpu, stages, recorder, level, rows.clone(), &self.samples, self.row_words)?;
                let origin = wgpu::Origin3d { x: 0, y: rows.start % self.dims[1], z: rows.start / self.dims[1] };
                self.copy_samples(recorder, origin, rows.end - rows.start, 1);
                self.record_surface(gpu, stages, recorder, rows.clone())
            }
        }
    }

    fn record_classify(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        slices: std::ops::Range<u32>,
    ) -> Result<(), GpuError> {
        let layout = &self.layouts[0];
        let params = ClassifyParams {
            level: layout.info(slices.start),
            dims: self.dims,
            first_slice: slices.start,
            slice_count: slices.end - slices.start,
            code_scale: self.source.code_scale,
            _padding: [0; 2],
        };
        let bindings = [
            (1, Binding::Texture(&self.source.values.view)),
            (2, Binding::Buffer(&self.opacity_table.raw)),
            (3, self.window(0, slices)),
        ];
        stages.classify.record(gpu, recorder, &params, &bindings, invocations(layout, params.slice_count))
    }

    fn record_mipmap(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        level: usize,
        slices: std::ops::Range<u32>,
    ) -> Result<(), GpuError> {
        let (source, target) = (&self.layouts[level - 1], &self.layouts[level]);
        let last = source.extent[2] - 1;
        let from = (2 * slices.start).saturating_sub(1).min(last)..(2 * slices.end - 1).clamp(1, last + 1);
        let from = from.start..from.end.max(from.start + 1);
        let params = MipmapParams {
            source: source.info(from.start),
            target_level: target.info(slices.start),
            first_slice: slices.start,
            slice_count: slices.end - slices.start,
            _padding: [0; 2],
        };
        let bindings = [(1, self.window(level - 1, from)), (2, self.window(level, slices))];
        stages.mipmap_level.record(gpu, recorder, &params, &bindings, invocations(target, params.slice_count))
    }

    fn record_nbuffer(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        level: usize,
        slices: std::ops::Range<u32>,
    ) -> Result<(), GpuError> {
        let (source, target) = (&self.layouts[level - 1], &self.layouts[level]);
        let shift = target.width / 2;
        let last = source.extent[2] - 1;
        let start = slices.start.saturating_sub(shift).min(last);
        let from = start..slices.end.clamp(start + 1, last + 1);
        let params = NBufferParams {
            source: source.info(from.start),
            target_level: target.info(slices.start),
            first_slice: slices.start,
            slice_count: slices.end - slices.start,
            shift_log2: shift.ilog2(),
            _padding: 0,
        };
        let bindings = [(1, self.window(level - 1, from)), (2, self.window(level, slices))];
        let stage = if shift == 1 { &stages.nbuffer_first_level } else { &stages.nbuffer_level };
        // An invocation makes 4 words x 4 rows; blocks that stick out are whole.
        let stride = (shift / 2).max(1);
        let words = target.extent[0].div_ceil(2).div_ceil(4 * stride) * stride;
        let rows = target.extent[1].div_ceil(4 * shift) * shift;
        stage.record(gpu, recorder, &params, &bindings, [words, rows, params.slice_count])
    }

    fn record_combine(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        slices: std::ops::Range<u32>,
    ) -> Result<(), GpuError> {
        let mut infos = [<LevelInfo as bytemuck::Zeroable>::zeroed(); MAX_LEVELS];
        let mut bindings =
            vec![(1, Binding::Texture(&self.source.values.view)), (2, Binding::Buffer(&self.samples.raw))];
        for (level, layout) in (0_u32..).zip(&self.layouts) {
            let window = combine_window(&slices, &self.settings, level, layout);
            infos[level as usize] = layout.info(window.start);
            bindings.push((10 + level, self.window(level as usize, window)));
        }
        let params = SpaoParams {
            levels: infos,
            dims: self.dims,
            first_slice: slices.start,
            slice_count: slices.end - slices.start,
            row_words: self.row_words,
            normalise: normalise(&self.source),
            normal_factor: self.settings.normal_factor as f32,
        };
        let stage = stages.spao(gpu, self.settings.levels, self.settings.normal_factor)?;
        let size = [self.dims[0].div_ceil(2), self.dims[1], params.slice_count];
        stage.record(gpu, recorder, &params, &bindings, size)?;
        let origin = wgpu::Origin3d { x: 0, y: 0, z: slices.start };
        self.copy_samples(recorder, origin, self.dims[1], params.slice_count);
        self.record_surface(gpu, stages, recorder, slices.start * self.dims[1]..slices.end * self.dims[1])
    }

    /// Counts the samples of some rows, which have just been computed.
    fn record_surface(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        rows: std::ops::Range<u32>,
    ) -> Result<(), GpuError> {
        // Cell c of level 0 holds voxel c - 1, and both neighbours are read.
        let slices = rows.start / self.dims[1]..(rows.end - 1) / self.dims[1] + 3;
        let level = (&self.layouts[0], slices.start, self.window(0, slices));
        self.surface.record(gpu, stages, recorder, self.dims, rows, level, (&self.samples, self.row_words))
    }

    /// The slices of a level as a binding.
    fn window(&self, level: usize, slices: std::ops::Range<u32>) -> Binding<'_> {
        let bytes = self.layouts[level].slice_bytes();
        Binding::Slice(&self.levels[level].raw, u64::from(slices.start) * bytes, slices.len() as u64 * bytes)
    }

    fn copy_samples(&self, recorder: &mut Recorder, origin: wgpu::Origin3d, rows: u32, slices: u32) {
        let Some(target) = &self.target else { return };
        recorder.encoder.copy_buffer_to_texture(
            wgpu::TexelCopyBufferInfo {
                buffer: &self.samples.raw,
                layout: wgpu::TexelCopyBufferLayout {
                    offset: 0,
                    bytes_per_row: Some(self.row_words * 4),
                    rows_per_image: Some(rows),
                },
            },
            wgpu::TexelCopyTextureInfo { texture: &target.raw, mip_level: 0, origin, aspect: wgpu::TextureAspect::All },
            wgpu::Extent3d { width: self.dims[0], height: rows, depth_or_array_layers: slices },
        );
    }
}

/// Normalised value per stored value.
pub(super) fn normalise(source: &AoSource) -> f32 {
    if source.max_code == 0 { 0.0 } else { source.code_scale / f32::from(source.max_code) }
}

fn invocations(target: &LevelLayout, slices: u32) -> [u32; 3] {
    [target.extent[0].div_ceil(2), target.extent[1], slices]
}
