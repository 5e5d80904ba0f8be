//! Accessibility: plans and keys, and the GPU against its twin in `reference`.

mod analytic;
mod incremental;
mod key;
mod layouts;
mod plan;
mod raytraced;
mod spao;
mod support;
mod turns;
mod variants;
