//! The one integration binary: every test of the project.

mod ao;
mod api;
mod architecture;
mod cli;
mod clients;
mod container;
mod gpu;
mod house;
mod reference;
mod renderer;
mod scene;
mod sources;
mod stream;
mod support;
mod tidy;
mod tree;
mod volume;
