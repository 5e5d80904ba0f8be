//! The one thread that owns the wgpu device, and the handle everyone else holds.
//!
//! Architecture Invariant: the device never leaves the render thread, and its users hold only a
//! [`RenderHandle`]. Jobs go in through a bounded channel and each answers on its own one-shot.

mod handle;
mod jobs;
mod turns;

pub use handle::{RenderHandle, RenderThread};
pub use turns::Turns;
