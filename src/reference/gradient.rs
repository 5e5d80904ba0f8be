//! Gradients of the normalised value: the normals of SPAO's offset and of shading.

use glam::DVec3;

use super::field::{ValueField, per_voxel};

/// ∇v̂ in index space (per voxel step) by central differences at any index-space position:
/// (v̂(x + e) - v̂(x - e)) / 2, v̂ interpolated and clamped at the border.
pub fn central_difference(values: &ValueField, position: DVec3) -> DVec3 {
    let along = |e: DVec3| 0.5 * (values.trilinear(position + e) - values.trilinear(position - e));
    DVec3::new(along(DVec3::X), along(DVec3::Y), along(DVec3::Z))
}

/// n(x) of METHODS 2: -∇v̂, length limited to 1 and otherwise as it is, so that a weak gradient
/// means a weak offset (SPAO 1.3).
pub fn offset_normal(values: &ValueField, position: DVec3) -> DVec3 {
    (-central_difference(values, position)).clamp_length_max(1.0)
}

/// ∇v̂ in index space at every voxel, x fastest: what the ray caster interpolates.
pub fn voxel_gradients(values: &ValueField) -> Vec<DVec3> {
    per_voxel(values.dims, |voxel| {
        let [x, y, z] = voxel.map(i64::from);
        let along = |dx, dy, dz| 0.5 * (values.at([x + dx, y + dy, z + dz]) - values.at([x - dx, y - dy, z - dz]));
        DVec3::new(along(1, 0, 0), along(0, 1, 0), along(0, 0, 1))
    })
}
