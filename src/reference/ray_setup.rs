//! Rays through pixels, and the part of a ray on which the volume is visible.

use glam::DVec3;

use crate::scene::{RayBasis, Rendering};
use crate::volume::Grid;

/// A ray in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where t = 0: the eye, or a point of the eye plane in orthographic projection.
    pub origin: DVec3,
    /// Unit length, so that t is in world units.
    pub direction: DVec3,
}

/// The parameters `enter <= t < exit` along a ray; empty when `enter >= exit`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interval {
    /// First t inside.
    pub enter: f64,
    /// First t outside again.
    pub exit: f64,
}

impl Interval {
    /// Everything in front of the eye.
    pub const IN_FRONT: Self = Self { enter: 0.0, exit: f64::INFINITY };
    /// Nothing.
    const EMPTY: Self = Self { enter: f64::INFINITY, exit: f64::NEG_INFINITY };

    /// Whether no t is inside.
    pub fn is_empty(&self) -> bool {
        self.enter >= self.exit
    }

    /// Keeps where n·p + d >= 0, for p = `origin` + t `direction` in any space.
    pub fn clip_to_plane(self, origin: DVec3, direction: DVec3, normal: DVec3, d: f64) -> Self {
        self.keep_positive(normal.dot(origin) + d, normal.dot(direction))
    }

    /// Keeps what lies in the box, for p = `origin` + t `direction` in any space.
    pub fn clip_to_box(self, origin: DVec3, direction: DVec3, min: DVec3, max: DVec3) -> Self {
        (0..3).fold(self, |interval, a| {
            interval.keep_positive(origin[a] - min[a], direction[a]).keep_positive(max[a] - origin[a], -direction[a])
        })
    }

    /// Keeps where `height + slope * t` >= 0.
    fn keep_positive(self, height: f64, slope: f64) -> Self {
        if slope > 0.0 {
            Self { enter: self.enter.max(-height / slope), ..self }
        } else if slope < 0.0 {
            Self { exit: self.exit.min(-height / slope), ..self }
        } else if height >= 0.0 {
            self
        } else {
            Self::EMPTY
        }
    }
}

/// The ray through the centre of pixel (x, y), y counted from the top, in a picture of `width` x `height` pixels.
pub fn pixel_ray(basis: &RayBasis, x: u32, y: u32, width: u32, height: u32) -> Ray {
    let u = (f64::from(x) + 0.5) / f64::from(width) * 2.0 - 1.0;
    let v = 1.0 - (f64::from(y) + 0.5) / f64::from(height) * 2.0;
    Ray {
        origin: basis.origin + basis.origin_du * u + basis.origin_dv * v,
        direction: (basis.forward + basis.dir_du * u + basis.dir_dv * v).normalize(),
    }
}

/// Where along a world ray something may be seen: in front of the eye, in the volume's box, the clip box and
/// every clip plane's kept side.
pub fn visible_interval(ray: &Ray, grid: &Grid, rendering: &Rendering) -> Interval {
    let index_from_world = grid.index_from_world();
    // Not normalised, so that t stays in world units.
    let origin = index_from_world.transform_point3(ray.origin);
    let direction = index_from_world.transform_vector3(ray.direction);
    let mut interval = Interval::IN_FRONT.clip_to_box(origin, direction, DVec3::ZERO, grid.dims_vec());
    if let Some(clip) = &rendering.clip_box {
        interval = interval.clip_to_box(ray.origin, ray.direction, clip.min, clip.max);
    }
    for plane in &rendering.clip_planes {
        interval = interval.clip_to_plane(ray.origin, ray.direction, plane.normal, plane.d);
    }
    interval
}

/// Where a ray is sampled: at the multiples of `step` inside the interval, counted from t = 0, and at both its ends,
/// in ascending order. An end that is itself a multiple may come twice.
///
/// Counted from the eye plane and not from where the ray enters, so a clip box that is dragged moves the ends and no
/// other sample, and flat faces show no wood-grain. The interval must not be empty.
pub fn sample_places(interval: Interval, step: f64) -> impl Iterator<Item = f64> {
    let first = (interval.enter / step).floor();
    // Counted, because adding 1 to a huge number would not end.
    let count = ((interval.exit / step).ceil() - first) as u64;
    (0..=count).map(move |n| ((first + n as f64) * step).clamp(interval.enter, interval.exit))
}
