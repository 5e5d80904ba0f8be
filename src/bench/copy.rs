//! The yardstick: a buffer copied on the device. Ratios to it mean the same on a busy machine.

use std::time::{Duration, Instant};

use crate::gpu::{Category, Gpu, GpuError, Recorder};

/// Largest copy; longer ones are scaled up from it, so that the yardstick always fits.
const LARGEST_COPY: u64 = 64 << 20;

/// Time to copy `bytes` bytes from one buffer to another.
pub(super) fn copy_time(gpu: &Gpu, bytes: u64) -> Result<Duration, GpuError> {
    let size = bytes.clamp(4, LARGEST_COPY).next_multiple_of(4);
    let from = gpu.buffer("copy source", Category::Frame, size, wgpu::BufferUsages::COPY_SRC)?;
    let to = gpu.buffer("copy target", Category::Frame, size, wgpu::BufferUsages::COPY_DST)?;
    let copy = || {
        let begin = Instant::now();
        gpu.guarded("copy", || {
            let mut recorder = Recorder::new(gpu, "copy");
            recorder.copy(&from, &to, size);
            recorder.run(gpu)
        })?;
        Ok::<_, GpuError>(begin.elapsed())
    };
    // The first one also touches the pages for the first time.
    copy()?;
    let mut times = [copy()?, copy()?, copy()?];
    times.sort();
    Ok(times[1].mul_f64(bytes as f64 / size as f64))
}
