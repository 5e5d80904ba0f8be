//! Cameras that show a whole volume.

use glam::DVec3;

use super::{Camera, Projection};
use crate::volume::Grid;

/// Vertical field of view of a camera that does not say one, in degrees.
pub const DEFAULT_FOV_Y_DEG: f64 = 40.0;

/// Share of the picture that the volume's box may fill.
const FILL: f64 = 0.97;

/// How far the eye is turned from straight ahead towards +x, and raised, in degrees. In patient coordinates
/// (+x left, +y back, +z up) a head looks at the viewer, past his shoulder.
const AZIMUTH_DEG: f64 = 27.0;
const ELEVATION_DEG: f64 = 10.0;

/// A volume thinner than this, relative to its second thinnest extent, is a sheet and seen from its flat side.
const SHEET: f64 = 0.05;

/// The perspective camera that shows a whole volume in a picture of the given aspect (width / height).
pub fn framed_camera(grid: &Grid, aspect: f64) -> Camera {
    framed_camera_with_fov(grid, aspect, DEFAULT_FOV_Y_DEG)
}

/// The same with another vertical field of view, in (0, 180) degrees.
pub fn framed_camera_with_fov(grid: &Grid, aspect: f64, fov_y_deg: f64) -> Camera {
    let target = grid.center();
    let backward = direction_to_eye(grid);
    let up = DVec3::Z;
    let half_height = (fov_y_deg.to_radians() * 0.5).tan() * FILL;
    // The nearest eye from which no corner is outside of the picture.
    let distance = corners_in_view(grid, -backward, up)
        .map(|corner| (corner.x.abs() / aspect).max(corner.y.abs()) / half_height - corner.z)
        .fold(0.0, f64::max);
    let eye = target + backward * distance;
    Camera { eye, target, up, projection: Projection::Perspective { fov_y_deg } }
}

/// Height of the orthographic picture that shows a whole volume, looked at along `view` (any length but zero).
pub fn framed_height(grid: &Grid, aspect: f64, view: DVec3, up: DVec3) -> f64 {
    let half_height =
        corners_in_view(grid, view, up).map(|corner| (corner.x.abs() / aspect).max(corner.y.abs())).fold(0.0, f64::max);
    2.0 * half_height / FILL
}

/// The volume's corners relative to its middle: x to the right, y upwards, z away from the eye.
fn corners_in_view(grid: &Grid, view: DVec3, up: DVec3) -> impl Iterator<Item = DVec3> {
    let forward = view.normalize();
    let right = forward.cross(up.normalize()).normalize();
    let up = right.cross(forward);
    let center = grid.center();
    grid.corners().into_iter().map(move |corner| {
        let corner = corner - center;
        DVec3::new(corner.dot(right), corner.dot(up), corner.dot(forward))
    })
}

/// Unit vector from the volume's middle towards the eye; never parallel to z.
fn direction_to_eye(grid: &Grid) -> DVec3 {
    let (azimuth, elevation) = (AZIMUTH_DEG.to_radians(), ELEVATION_DEG.to_radians());
    let from_front = DVec3::new(azimuth.sin() * elevation.cos(), -azimuth.cos() * elevation.cos(), elevation.sin());

    let extent = (grid.dims_vec() * grid.spacing).to_array();
    let mut axes = [0, 1, 2];
    axes.sort_by(|&a, &b| extent[a].total_cmp(&extent[b]));
    if extent[axes[0]] >= SHEET * extent[axes[1]] {
        return from_front;
    }
    // The sheet's normal, not the axis itself: an oblique grid's axes need not be perpendicular.
    let normal = grid.direction[axes[1]].cross(grid.direction[axes[2]]).normalize();
    let towards_front = if normal.dot(from_front) < 0.0 { -normal } else { normal };
    (towards_front + from_front * 0.5).normalize()
}
