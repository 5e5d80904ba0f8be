//! A sphere on a plane: ambient occlusion on the plane is known in closed form.

use glam::DVec3;

use super::{coverage, dims_vec, voxel_centre};

/// Where the sphere and the plane are, in index space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Geometry {
    /// Everything with z below this is solid; a whole number, so that the plane is sharp.
    pub plane_z: f64,
    /// Centre of the sphere, above the middle of the plane.
    pub centre: DVec3,
    /// Radius of the sphere, which touches the plane.
    pub radius: f64,
}

/// A plane at a quarter of the height, and a sphere of a quarter of the shortest axis' radius.
pub fn geometry(dims: [u32; 3]) -> Geometry {
    let size = dims_vec(dims);
    let plane_z = (0.25 * size.z).floor();
    let radius = 0.25 * size.min_element();
    Geometry { plane_z, centre: DVec3::new(0.5 * size.x, 0.5 * size.y, plane_z + radius), radius }
}

/// 255 inside either, antialiased.
pub(super) fn voxel(dims: [u32; 3]) -> impl Fn([u32; 3]) -> u8 + Sync {
    let Geometry { plane_z, centre, radius } = geometry(dims);
    move |voxel| {
        let p = voxel_centre(voxel);
        coverage((p.distance(centre) - radius).min(p.z - plane_z))
    }
}
