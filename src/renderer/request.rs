//! What is asked of the renderer and what it answers: plain data, free of GPU types.

use std::sync::Arc;
use std::time::Duration;

use serde::Serialize;
use thiserror::Error;

use crate::scene::Scene;
use crate::volume::VolumeId;

/// Which accessibility a picture may use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AoPolicy {
    /// Exactly what the scene asks for; it is computed first where it is missing.
    #[default]
    Exact,
    /// What is at hand: an earlier one of the same volume, or none. Nothing is computed.
    AtHand,
}

/// One picture of one scene.
#[derive(Clone, Debug)]
pub struct FrameRequest {
    /// What to draw; its volume must be resident.
    pub scene: Arc<Scene>,
    /// Pixels across, at least 1.
    pub width: u32,
    /// Pixels down, at least 1.
    pub height: u32,
    /// Which accessibility may be used.
    pub ao_policy: AoPolicy,
}

/// A finished picture.
#[derive(Clone, Debug)]
pub struct Frame {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// sRGB-encoded with straight alpha, 4 bytes a pixel, rows from the top.
    pub rgba: Vec<u8>,
    /// Where the time went.
    pub timings: StageTimings,
    /// What was done for ambient occlusion.
    pub ao: AoReport,
}

/// Wall-clock time of each stage of one job.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct StageTimings {
    /// Waiting for the render thread.
    pub queue: Duration,
    /// Ambient occlusion (0 when nothing had to be computed).
    pub ao: Duration,
    /// Ray casting.
    pub raycast: Duration,
    /// Bringing pixels back from the GPU.
    pub readback: Duration,
}

/// How the accessibility volume of a picture came about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AoUpdate {
    /// Ambient occlusion is off.
    Off,
    /// An earlier result was used.
    Cached,
    /// What an edit changed was computed, the rest taken from an earlier result.
    Incremental,
    /// Everything was computed.
    Full,
}

/// How the accessibility of a picture relates to what its scene asks for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AoState {
    /// Ambient occlusion is off.
    Off,
    /// It is what the scene asks for.
    Exact,
    /// It is older, or missing; what the scene asks for has not been computed yet.
    Refining,
}

/// Ambient-occlusion part of a picture's ledger.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AoReport {
    /// How it relates to what the scene asks for.
    pub state: AoState,
    /// What was done for this picture.
    pub update: AoUpdate,
    /// Number of the accessibility volume in the order of completion, from 1; 0 without one.
    pub version: u64,
    /// Bricks of 8^3 voxels that the volume has.
    pub bricks: u64,
    /// Bricks whose opacity was looked up again for this picture.
    pub bricks_classified: u64,
    /// Bricks whose accessibility was computed again for this picture.
    pub bricks_recomputed: u64,
    /// Time it took.
    pub elapsed: Duration,
}

/// Accessibility A (without `strength`) at every voxel centre.
#[derive(Clone, Debug)]
pub struct AccessibilityVolume {
    /// Samples along x (fastest), y, z.
    pub dims: [u32; 3],
    /// In [0, 1], x fastest.
    pub values: Vec<f32>,
    /// Index-space position of the first sample.
    pub first: [f64; 3],
    /// Index-space step between samples.
    pub step: [f64; 3],
    /// Where the time went (`raycast` is 0).
    pub timings: StageTimings,
}

/// The adapter in use and what it allows.
#[derive(Clone, Debug, Serialize)]
pub struct RendererInfo {
    /// Name of the adapter.
    pub adapter: String,
    /// `vulkan`, `metal`, `dx12`.
    pub backend: String,
    /// Driver name.
    pub driver: String,
    /// Driver version text.
    pub driver_info: String,
    /// The adapter computes on the CPU.
    pub software: bool,
    /// Volumes of more than 256 codes live in r16unorm textures (else in r32float, sampled by hand).
    pub texture_16bit_norm: bool,
    /// Longest volume axis the adapter takes.
    pub max_volume_axis: u32,
    /// Largest storage binding, bytes.
    pub max_storage_binding_bytes: u64,
    /// Largest single allocation, bytes.
    pub max_buffer_bytes: u64,
}

/// GPU memory in use, counted at every allocation.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct MemoryUse {
    /// What may be used at most.
    pub budget_bytes: u64,
    /// All of what follows.
    pub used_bytes: u64,
    /// Volumes and their gradients.
    pub volumes_bytes: u64,
    /// Finished accessibility volumes.
    pub ao_cache_bytes: u64,
    /// Levels and scratch of ambient occlusion.
    pub ao_scratch_bytes: u64,
}

impl MemoryUse {
    /// Tables, pictures and read-back buffers.
    pub fn other_bytes(&self) -> u64 {
        self.used_bytes.saturating_sub(self.volumes_bytes + self.ao_cache_bytes + self.ao_scratch_bytes)
    }
}

/// A volume on the GPU.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Residency {
    /// Bytes of its textures.
    pub gpu_bytes: u64,
}

/// Why a job failed. Only that job: the renderer goes on unless it is [`RenderError::Gone`].
#[derive(Clone, Debug, Error)]
pub enum RenderError {
    /// The volume is not resident.
    #[error("no volume `{0}`")]
    UnknownVolume(VolumeId),
    /// The job needs more GPU memory than there is.
    #[error("{what} needs {needed_bytes} bytes of GPU memory; the budget is {budget_bytes} and {} are in use", resident.iter().map(|r| r.1).sum::<u64>())]
    DoesNotFit {
        /// What was to be placed.
        what: String,
        /// Bytes it takes.
        needed_bytes: u64,
        /// Bytes allowed in all.
        budget_bytes: u64,
        /// Resident volumes and their bytes.
        resident: Vec<(VolumeId, u64)>,
    },
    /// An axis is longer than the adapter's 3D textures.
    #[error("the volume is {size} voxels long along {axis}; this adapter takes at most {limit}")]
    AxisTooLong {
        /// x, y or z.
        axis: char,
        /// Voxels along it.
        size: u32,
        /// Allowed.
        limit: u32,
    },
    /// Whoever asked does not want it any more.
    #[error("the job was called off")]
    Cancelled,
    /// Too many jobs are waiting.
    #[error("the renderer is busy; try again")]
    Busy,
    /// The render thread has ended.
    #[error("the renderer is gone")]
    Gone,
    /// No adapter, or not the kind asked for.
    #[error("{0}")]
    NoAdapter(String),
    /// The driver reported an error, or did not finish in time.
    #[error("graphics driver: {0}")]
    Device(String),
}
