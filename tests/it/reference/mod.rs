//! The f64 reference against closed forms and brute force, before anything is compared with it.

mod ao_raytraced;
mod ao_spao;
mod ao_surface;
mod box_mean;
mod fields;
mod mipmap;
mod ray_setup;
mod raycast;
mod raycast_geometry;
mod segment;
mod shading;
mod support;
