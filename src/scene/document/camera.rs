//! The section `camera` of a scene document.

use glam::DVec3;

use super::check::{self, Interval, POSITIVE};
use super::shape::CameraShape;
use crate::scene::framing::{DEFAULT_FOV_Y_DEG, framed_camera_with_fov, framed_height};
use crate::scene::{Camera, Projection, SceneError};
use crate::volume::Grid;

/// Sine of the smallest angle between `up` and the view: below it the picture's upright would be rounding noise.
const MIN_UP_SINE: f64 = 1e-6;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Perspective,
    Orthographic,
}

const KINDS: [(&str, Kind); 2] = [("perspective", Kind::Perspective), ("orthographic", Kind::Orthographic)];

/// What a document says about the camera, checked, before the volume is known. What is missing comes from the
/// camera that frames the volume.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct CameraDocument {
    eye: Option<DVec3>,
    target: Option<DVec3>,
    up: Option<DVec3>,
    kind: Kind,
    fov_y_deg: f64,
    height: Option<f64>,
}

impl CameraDocument {
    pub(super) fn from_shape(shape: &CameraShape) -> Result<Self, SceneError> {
        let vector = |path, given: Option<_>| given.map(|given| check::vector(path, given)).transpose();
        let up = vector("camera.up", shape.up.as_ref())?;
        Ok(Self {
            eye: vector("camera.eye", shape.eye.as_ref())?,
            target: vector("camera.target", shape.target.as_ref())?,
            up: up.map(|up| check::nonzero("camera.up", up)).transpose()?,
            kind: check::named_or("camera.projection", shape.projection.as_deref(), &KINDS, Kind::Perspective)?,
            fov_y_deg: check::number_or(
                "camera.fov_y_deg",
                shape.fov_y_deg.as_ref(),
                Interval::Open(0.0, 180.0),
                DEFAULT_FOV_Y_DEG,
            )?,
            height: shape.height.as_ref().map(|given| check::number("camera.height", given, POSITIVE)).transpose()?,
        })
    }

    /// Fills in what depends on the volume, and checks the vectors against each other.
    pub(super) fn complete(&self, grid: &Grid, aspect: f64) -> Result<Camera, SceneError> {
        let framed = framed_camera_with_fov(grid, aspect, self.fov_y_deg);
        let eye = self.eye.unwrap_or(framed.eye);
        let target = self.target.unwrap_or(framed.target);
        let view = view_direction(eye, target)?;
        let up = self.up.unwrap_or_else(|| default_up(view));
        if sine_between(view, up) < MIN_UP_SINE {
            return Err(SceneError::invalid("camera.up", "expected a direction that is not parallel to the view"));
        }
        let projection = match self.kind {
            Kind::Perspective => Projection::Perspective { fov_y_deg: self.fov_y_deg },
            Kind::Orthographic => {
                let height = self.height.unwrap_or_else(|| framed_height(grid, aspect, view, up));
                Projection::Orthographic { height: finite_coordinate(height)? }
            }
        };
        Ok(Camera { eye, target, up, projection })
    }
}

pub(super) fn to_shape(camera: &Camera) -> CameraShape {
    let (kind, fov_y_deg, height) = match camera.projection {
        Projection::Perspective { fov_y_deg } => (Kind::Perspective, fov_y_deg, None),
        Projection::Orthographic { height } => (Kind::Orthographic, DEFAULT_FOV_Y_DEG, Some(height)),
    };
    CameraShape {
        eye: Some(check::json_triple(camera.eye)),
        target: Some(check::json_triple(camera.target)),
        up: Some(check::json_triple(camera.up)),
        projection: Some(check::name_of(kind, &KINDS).to_owned()),
        fov_y_deg: Some(check::json_number(fov_y_deg)),
        height: height.map(check::json_number),
    }
}

/// Unit vector from eye to target.
fn view_direction(eye: DVec3, target: DVec3) -> Result<DVec3, SceneError> {
    for coordinate in eye.to_array().into_iter().chain(target.to_array()) {
        finite_coordinate(coordinate)?;
    }
    let view = check::nonzero("camera.target", target - eye)
        .map_err(|error| SceneError { message: "expected a point other than `eye`".into(), ..error })?;
    Ok(view.normalize())
}

/// Given coordinates are bounded already; framed ones are not if the volume or the field of view is absurd.
fn finite_coordinate(coordinate: f64) -> Result<f64, SceneError> {
    if coordinate.abs() <= check::MAX_COORDINATE {
        Ok(coordinate)
    } else {
        Err(SceneError::invalid("camera", "cannot frame this volume; give `eye`, `target` and `height`"))
    }
}

/// +z, or -y (a patient's front) for a view along z.
fn default_up(view: DVec3) -> DVec3 {
    if sine_between(view, DVec3::Z) < MIN_UP_SINE { -DVec3::Y } else { DVec3::Z }
}

/// Of the angle between a unit vector and a vector of any length but zero.
fn sine_between(unit: DVec3, vector: DVec3) -> f64 {
    unit.cross(vector.normalize()).length()
}
