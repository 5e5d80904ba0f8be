//! Ambient occlusion: from opacity to an accessibility volume, in slices.
//!
//! Architecture Invariant: a result is a pure function of its [`AoKey`]; nothing else may influence it.

mod build;
mod cache;
mod levels;
mod params;
mod plan;
mod raytraced;
mod stages;
mod surface;

pub use build::{Accessibility, AoBuild, AoSource, StepTime};
pub use cache::{AoCache, AoKey};
pub use levels::{LevelLayout, level_layouts};
pub use params::{
    ClassifyParams, LevelInfo, MAX_LEVELS, MipmapParams, NBufferParams, RaytracedParams, SpaoParams, SurfaceParams,
};
pub use plan::{Step, plan};
pub use stages::AoStages;
