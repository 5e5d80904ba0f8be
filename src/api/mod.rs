//! The HTTP interface: routes, request reading, error bodies.
//!
//! Architecture Invariant: handlers hold no state of their own and do no work that takes milliseconds:
//! pixels, files and voxels are handled on the blocking pool, pictures are made by the render thread.

mod ao;
mod auth;
mod envelope;
mod extract;
mod files;
mod frames;
mod loads;
mod metrics;
mod openapi;
mod pages;
mod presets;
mod router;
mod scenes;
mod server;
mod state;
mod stream;
mod uploads;
mod viewer;
mod volumes;
mod voxels;

pub use auth::ApiKeys;
pub use openapi::{OPENAPI, document};
pub use router::{route_table, router, with_middleware};
pub use state::{AppState, InFlight, Lifecycle, Phase, Shared};
pub use stream::Quality;
