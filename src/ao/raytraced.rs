//! The ray-traced reference (METHODS 3): rows of samples, as many at a time as fit a slice of time.

use std::ops::Range;
use std::time::Duration;

use super::build::AoSource;
use super::levels::LevelLayout;
use super::params::RaytracedParams;
use super::plan::{reach_in_voxels, trace_window};
use super::stages::AoStages;
use crate::gpu::{Binding, Category, Gpu, GpuBuffer, GpuError, Recorder};
use crate::scene::AmbientOcclusion;

/// Most rays of one dispatch, unless a single row has more: after empty space, dispatches are long, and the next one
/// may meet something. Enough to keep any adapter busy for longer than a submission takes.
const MOST_RAYS: u64 = 1 << 23;

/// What tracing needs beside level 0.
#[derive(Debug)]
pub(super) struct Tracer {
    settings: AmbientOcclusion,
    source: AoSource,
    directions: GpuBuffer,
    brick_distance: GpuBuffer,
    /// Rows that one dispatch traces; follows the time they take.
    rows_per_dispatch: u32,
}

impl Tracer {
    pub(super) fn new(gpu: &Gpu, source: &AoSource, settings: &AmbientOcclusion) -> Result<Self, GpuError> {
        let directions = fibonacci_sphere(settings.rays);
        Ok(Self {
            settings: *settings,
            source: source.clone(),
            directions: gpu.storage_with("ao directions", Category::AoScratch, bytemuck::cast_slice(&directions))?,
            brick_distance: gpu.storage_with("ao brick distance", Category::AoScratch, &source.brick_distance)?,
            rows_per_dispatch: 1,
        })
    }

    /// Rows to trace now, all of one slice, and the rest.
    pub(super) fn split(&self, rows: &Range<u32>, rows_per_slice: u32) -> (Range<u32>, Range<u32>) {
        let slice_end = (rows.start / rows_per_slice + 1) * rows_per_slice;
        let end = rows.end.min(slice_end).min(rows.start + self.rows_per_dispatch);
        (rows.start..end, end..rows.end)
    }

    /// Takes more rows at a time while dispatches are short, fewer when they are long.
    pub(super) fn adapt(&mut self, elapsed: Duration, target: Duration) {
        if elapsed < target / 2 {
            let row = u64::from(self.source.values.dims()[0]) * u64::from(self.settings.rays);
            let most = u32::try_from(MOST_RAYS / row).unwrap_or(u32::MAX).max(1);
            self.rows_per_dispatch = self.rows_per_dispatch.saturating_mul(2).min(most);
        } else if elapsed > target {
            let share = target.as_secs_f64() / elapsed.as_secs_f64();
            self.rows_per_dispatch = ((f64::from(self.rows_per_dispatch) * share) as u32).max(1);
        }
    }

    #[allow(clippy::too_many_arguments, reason = "the build's parts, borrowed one by one")]
    pub(super) fn record(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        level: (&LevelLayout, &GpuBuffer),
        rows: Range<u32>,
        samples: &GpuBuffer,
        row_words: u32,
    ) -> Result<(), GpuError> {
        let (layout, buffer) = level;
        let dims = self.source.values.dims();
        let window = trace_window(dims, &rows, &self.settings, layout);
        let params = RaytracedParams {
            level: layout.info(window.start),
            dims,
            first_row: rows.start,
            bricks: self.source.contents.dims,
            row_count: rows.end - rows.start,
            row_words,
            first_output_row: rows.start,
            ray_count: self.settings.rays,
            hemisphere: u32::from(self.settings.normal_factor != 0.0),
            reach: reach_in_voxels(&self.settings).unwrap_or(1e9) as f32,
            normalise: self.source.normalise(),
            _padding: [0; 2],
        };
        let bytes = layout.slice_bytes();
        let window = Binding::Slice(&buffer.raw, u64::from(window.start) * bytes, window.len() as u64 * bytes);
        let bindings = [
            (1, Binding::Texture(&self.source.values.view)),
            (2, Binding::Buffer(&samples.raw)),
            (3, window),
            (4, Binding::Buffer(&self.directions.raw)),
            (5, Binding::Buffer(&self.brick_distance.raw)),
        ];
        let size = [dims[0].div_ceil(2), params.row_count, 1];
        stages.raytraced.record(gpu, recorder, &params, &bindings, size)
    }
}

/// `count` nearly equal-area directions (METHODS 3): z = 1 - (2i + 1) / count, azimuth i times the golden angle.
fn fibonacci_sphere(count: u32) -> Vec<[f32; 4]> {
    let golden_angle = std::f64::consts::PI * (3.0 - 5.0_f64.sqrt());
    (0..count)
        .map(|i| {
            let z = 1.0 - (2.0 * f64::from(i) + 1.0) / f64::from(count);
            let (sin, cos) = (f64::from(i) * golden_angle).sin_cos();
            let radius = (1.0 - z * z).sqrt();
            [(radius * cos) as f32, (radius * sin) as f32, z as f32, 0.0]
        })
        .collect()
}
