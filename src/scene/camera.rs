//! The camera.

use glam::DVec3;

/// How depth becomes size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical field of view in degrees, in (0, 180).
    Perspective {
        /// Vertical field of view, degrees.
        fov_y_deg: f64,
    },
    /// Height of the picture in world units, positive.
    Orthographic {
        /// World height of the picture.
        height: f64,
    },
}

/// A camera in world space; `eye`, `target` differ and `up` is not parallel to the view.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Position.
    pub eye: DVec3,
    /// Point in the middle of the picture.
    pub target: DVec3,
    /// Direction that is up in the picture; any length but zero.
    pub up: DVec3,
    /// Perspective or orthographic.
    pub projection: Projection,
}

/// Rays of a picture: through pixel centre (u, v) in [-1, 1], v up, aspect applied to u by the caller:
/// origin = `origin + u * origin_du + v * origin_dv`, direction = `normalize(forward + u * dir_du + v * dir_dv)`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RayBasis {
    /// Ray origin at the picture's middle.
    pub origin: DVec3,
    /// Change of origin per u (right edge is u = 1); zero in perspective.
    pub origin_du: DVec3,
    /// Change of origin per v (upper edge is v = 1); zero in perspective.
    pub origin_dv: DVec3,
    /// Unit viewing direction.
    pub forward: DVec3,
    /// Change of direction per u; zero in orthographic projection.
    pub dir_du: DVec3,
    /// Change of direction per v; zero in orthographic projection.
    pub dir_dv: DVec3,
}

impl Camera {
    /// The rays of a picture of `width` x `height` pixels.
    pub fn ray_basis(&self, width: u32, height: u32) -> RayBasis {
        let aspect = f64::from(width) / f64::from(height);
        let forward = (self.target - self.eye).normalize();
        let right = forward.cross(self.up).normalize();
        let up = right.cross(forward);
        match self.projection {
            Projection::Perspective { fov_y_deg } => {
                let half = (fov_y_deg.to_radians() * 0.5).tan();
                RayBasis {
                    origin: self.eye,
                    origin_du: DVec3::ZERO,
                    origin_dv: DVec3::ZERO,
                    forward,
                    dir_du: right * half * aspect,
                    dir_dv: up * half,
                }
            }
            Projection::Orthographic { height } => RayBasis {
                origin: self.eye,
                origin_du: right * height * 0.5 * aspect,
                origin_dv: up * height * 0.5,
                forward,
                dir_du: DVec3::ZERO,
                dir_dv: DVec3::ZERO,
            },
        }
    }
}
