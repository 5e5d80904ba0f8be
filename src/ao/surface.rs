//! How open the surfaces of a result are: the measure that pictures are exposed by.

use std::ops::Range;

use super::build::DISPATCH_WORDS;
use super::levels::LevelLayout;
use super::params::SurfaceParams;
use super::stages::AoStages;
use crate::gpu::{Binding, Category, Gpu, GpuBuffer, GpuError, GpuTexture, Recorder};
use crate::volume::BRICK;

/// Bins over the square root of accessibility, 0 to 1.
const BINS: usize = 256;

/// Share of the surface that is at most as open as the reference.
const REFERENCE_QUANTILE: f64 = 0.8;

/// Counts accessibilities while a build goes on.
#[derive(Debug)]
pub(super) struct SurfaceHistogram {
    bins: GpuBuffer,
}

impl SurfaceHistogram {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let bins = BINS as u64 * 4;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        Ok(Self { bins: gpu.buffer("ao surface bins", Category::AoScratch, bins, usage)? })
    }

    /// Counts samples of the bricks `list`, a range of a work list. `window`: first slice and binding of level 0
    /// around them.
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        layout: &LevelLayout,
        window: (u32, Binding<'_>),
        (accessibility, bricks, list): (&GpuTexture, &GpuBuffer, Range<u32>),
    ) -> Result<(), GpuError> {
        let dims = accessibility.dims();
        let params = SurfaceParams {
            level: layout.info(window.0),
            dims,
            origin: layout.origin,
            bricks: dims.map(|n| n.div_ceil(BRICK)),
            first_brick: list.start,
        };
        let bindings = [
            (1, Binding::Texture(&accessibility.view)),
            (2, window.1),
            (3, Binding::Buffer(&bricks.raw)),
            (4, Binding::Buffer(&self.bins.raw)),
        ];
        // A workgroup for each brick.
        stages.surface.record(gpu, recorder, &params, &bindings, [4 * list.len() as u32, 4, 4])
    }

    /// Runs `recorder`, then says what accessibility four fifths of the surface do not exceed, in (0, 1], 1 without
    /// a surface; and the first word of each of the `dispatches`.
    pub(super) fn reference(
        &self,
        gpu: &Gpu,
        mut recorder: Recorder,
        dispatches: &GpuBuffer,
    ) -> Result<(f64, Vec<u32>), GpuError> {
        let (bins, counts) = (self.bins.bytes(), dispatches.bytes());
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let readback = gpu.buffer("ao read-back", Category::AoScratch, bins + counts, usage)?;
        recorder.encoder.copy_buffer_to_buffer(&self.bins.raw, 0, &readback.raw, 0, bins);
        recorder.encoder.copy_buffer_to_buffer(&dispatches.raw, 0, &readback.raw, bins, counts);
        recorder.run_and_read(gpu, &readback, bins + counts, |data| {
            let words: &[u32] = bytemuck::cast_slice(data);
            let (bins, dispatches) = words.split_at(BINS);
            let counts = dispatches.chunks(DISPATCH_WORDS as usize).map(|arguments| arguments[0]);
            (quantile(bins), counts.collect())
        })
    }
}

/// The accessibility at the quantile. Within a bin it is taken by the share of the bin that is needed, so that
/// exposure does not jump from bin to bin while opacities are edited.
fn quantile(bins: &[u32]) -> f64 {
    let total: f64 = bins.iter().map(|&bin| f64::from(bin)).sum();
    let wanted = REFERENCE_QUANTILE * total;
    let last = bins.len() as f64 - 1.0;
    let mut below = 0.0;
    for (at, &bin) in bins.iter().enumerate() {
        let bin = f64::from(bin);
        if bin > 0.0 && below + bin >= wanted {
            let root = (at as f64 - 0.5 + (wanted - below) / bin).clamp(0.5, last) / last;
            return root * root;
        }
        below += bin;
    }
    1.0
}
