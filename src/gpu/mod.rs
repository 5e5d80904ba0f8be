//! The wgpu device and what every pass needs of it: shaders, pipelines, counted memory, waiting.
//!
//! Architecture Invariant: nothing here knows what is computed.

mod context;
mod memory;
mod pass;
mod shaders;
mod uniform;

pub use context::{Gpu, GpuError, GpuOptions, default_budget_bytes};
pub use memory::{Budget, Category, GpuBuffer, GpuTexture};
pub use pass::{Binding, ComputeStage, Recorder};
pub use shaders::{Assembled, ShaderError, assemble, assemble_from, stems};
pub use uniform::Uniform;
pub(crate) use uniform::uniform;
