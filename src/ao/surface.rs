//! How open the surfaces of a result are: the measure that pictures are exposed by.

use super::levels::LevelLayout;
use super::params::SurfaceParams;
use super::stages::AoStages;
use crate::gpu::{Binding, Category, Gpu, GpuBuffer, GpuError, Recorder};

/// Bins over the square root of accessibility, 0 to 1.
const BINS: usize = 256;

/// Share of the surface that is at most as open as the reference.
const REFERENCE_QUANTILE: f64 = 0.8;

/// Counts accessibilities while a build goes on.
#[derive(Debug)]
pub(super) struct SurfaceHistogram {
    bins: GpuBuffer,
    readback: GpuBuffer,
}

impl SurfaceHistogram {
    pub(super) fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let bins = BINS as u64 * 4;
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
        let readback = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        Ok(Self {
            bins: gpu.buffer("ao surface bins", Category::AoScratch, bins, usage)?,
            readback: gpu.buffer("ao surface read-back", Category::AoScratch, bins, readback)?,
        })
    }

    /// Counts `rows` of samples. `level` is level 0 and a binding of its slices around the rows.
    #[allow(clippy::too_many_arguments, reason = "the build's parts, borrowed one by one")]
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        dims: [u32; 3],
        rows: std::ops::Range<u32>,
        level: (&LevelLayout, u32, Binding<'_>),
        samples: (&GpuBuffer, u32),
    ) -> Result<(), GpuError> {
        let (layout, first_slice, window) = level;
        let params = SurfaceParams {
            level: layout.info(first_slice),
            dims,
            first_row: rows.start,
            row_count: rows.end - rows.start,
            row_words: samples.1,
            _padding: [0; 2],
        };
        let bindings = [(1, Binding::Buffer(&samples.0.raw)), (2, window), (3, Binding::Buffer(&self.bins.raw))];
        let size = [dims[0].div_ceil(2), params.row_count, 1];
        stages.surface.record(gpu, recorder, &params, &bindings, size)
    }

    /// The accessibility that four fifths of the surface do not exceed, in (0, 1]; 1 without a surface.
    pub(super) fn reference(&self, gpu: &Gpu) -> Result<f64, GpuError> {
        let mut recorder = Recorder::new(gpu, "ao surface");
        let bytes = self.readback.bytes();
        recorder.copy(&self.bins, &self.readback, bytes);
        recorder.run_and_read(gpu, &self.readback, bytes, |data| quantile(bytemuck::cast_slice(data)))
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
