//! Shaders, the structs they share with Rust, and the memory and errors of the device.

mod adapter;
mod assemble;
mod memory;
mod shaders;
mod twins;
