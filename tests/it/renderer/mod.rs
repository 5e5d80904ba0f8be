//! Pictures: the ray caster against its twin, empty-space skipping, goldens, memory and errors.

mod probe;
mod support;
