//! Ambient occlusion: from opacity to an accessibility volume, in slices.
//!
//! Architecture Invariant: a result is a pure function of its [`AoKey`]; nothing else may influence it.

mod activity;
mod build;
mod cache;
mod levels;
mod params;
mod plan;
mod pyramid;
mod raytraced;
mod record;
mod stages;
mod surface;
mod tiles;

pub use build::{Accessibility, AoBuild, AoSource, AoWork, StepTime};
pub use cache::{AoCache, AoKey};
pub use levels::{LevelLayout, LevelSource, level_layouts};
pub use params::{
    ClassifyParams, CollectBricksParams, CollectParams, LevelBlocks, LevelInfo, MAX_LEVELS, MipmapParams,
    NBufferParams, RaytracedParams, SpaoParams, SurfaceParams,
};
pub use plan::{Cuts, Step, WorkLists};
pub use pyramid::Pyramid;
pub use stages::AoStages;
pub use tiles::TileSet;
