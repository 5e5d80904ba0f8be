//! What every GPU pass should compute, in f64 and plain loops: the oracle of the tests.
//!
//! A file here has the name of the shader it is the twin of. Nothing is shared with the shaders on purpose,
//! and the box means are not even computed from N-buffers, so that an error cannot hide in both.
//!
//! Architecture Invariant: knows `volume` and `scene` only, neither the GPU nor tokio nor HTTP. Arguments are
//! the program's own data, already valid; a wrong length is a bug and panics.

mod ao_raytraced;
mod ao_spao;
mod ao_surface;
mod box_mean;
mod field;
mod gradient;
mod mipmap;
mod ray_setup;
mod raycast;
mod segment;
mod shading;

pub use ao_raytraced::{RaytracedAo, fibonacci_directions};
pub use ao_spao::{LevelMeans, SpaoAo};
pub use ao_surface::surface_reference;
pub use box_mean::BoxMean;
pub use field::{OpacityField, ValueField};
pub use gradient::{central_difference, offset_normal, voxel_gradients};
pub use mipmap::{HybridMeans, MipPyramid};
pub use ray_setup::{Interval, Ray, pixel_ray, sample_places, visible_interval};
pub use raycast::{RaycastInput, Raycaster};
pub use segment::OpticalDepth;
pub use shading::{Exposure, Illumination, clearness, facing_normal, illuminate, openness};
