//! Pictures of scenes: resident volumes, occupancy, ambient occlusion on demand, ray casting.
//!
//! Architecture Invariant: work comes as jobs that are advanced one slice of time at a time, so that
//! whoever owns the [`Renderer`] can take turns.

mod exposure;
mod jobs;
mod occlusion;
mod occupancy;
mod raycast;
mod request;
mod resident;
mod room;
mod volumes;
mod work;

pub use exposure::{Exposure, exposure};
pub use jobs::{AccessibilityJob, FrameJob, PrepareJob};
pub use occlusion::Coverage;
pub use occupancy::brick_distance;
pub use raycast::{GradientParams, Light, RaycastParams};
pub use request::{
    AccessibilityVolume, AoPolicy, AoReport, AoState, AoUpdate, Frame, FrameRequest, MemoryUse, RenderError,
    RendererInfo, Residency, StageTimings,
};
pub use room::GpuNeed;
pub use volumes::UploadJob;
pub use work::{Renderer, Turn};
