//! A volume-rendering server whose ambient occlusion survives a transfer-function edit.
//!
//! `ARCHITECTURE.md` is the map: what each module does, and which may use which.

pub mod ao;
pub mod api;
pub mod app;
pub mod array_file;
pub mod bench;
pub mod cli;
pub mod config;
pub mod encode;
pub mod error;
pub mod gpu;
pub mod reference;
pub mod render_thread;
pub mod renderer;
pub mod scene;
pub mod selftest;
pub mod session;
pub mod sources;
pub mod telemetry;
pub mod volume;
