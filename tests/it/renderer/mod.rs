//! Pictures: the ray caster against its twin, empty-space skipping, goldens, memory and errors.

mod exposure;
mod formats;
mod goldens;
mod head;
mod memory;
mod orientation;
mod pictures;
mod room;
mod skipping;
mod support;
