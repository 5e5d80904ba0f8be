//! The section `rendering` of a scene document.

use glam::DVec3;
use serde_json::Number;

use super::check::{self, COORDINATE, Interval};
use super::shape::{RenderingShape, Triple};
use crate::scene::{ClipBox, ClipPlane, RenderMode, Rendering, Rgba, SceneError};

const MODES: [(&str, RenderMode); 1] = [("composite", RenderMode::Composite)];

/// Modes of the contract that do not exist yet.
const MODES_NOT_YET: [&str; 4] = ["maximum", "minimum", "average", "isosurface"];

/// Most clip planes: they are tested per ray, from a fixed-size table on the GPU.
pub const MAX_CLIP_PLANES: usize = 8;

pub(super) fn from_shape(shape: &RenderingShape) -> Result<Rendering, SceneError> {
    let default = Rendering::default();
    if shape.iso_value.is_some() {
        return Err(not_yet("rendering.iso_value"));
    }
    if shape.opacity_modulation.is_some() {
        return Err(not_yet("rendering.opacity_modulation"));
    }
    Ok(Rendering {
        mode: check::implemented_or("rendering.mode", shape.mode.as_deref(), (&MODES, &MODES_NOT_YET), default.mode)?,
        sampling_rate: check::number_or(
            "rendering.sampling_rate",
            shape.sampling_rate.as_ref(),
            Interval::Closed(0.1, 8.0),
            default.sampling_rate,
        )?,
        background: check::color(
            "rendering.background",
            shape.background.as_deref(),
            Rgba::from_hex,
            default.background,
        )?,
        clip_box: shape.clip_box.as_ref().map(clip_box).transpose()?,
        clip_planes: clip_planes(shape.clip_planes.as_deref().unwrap_or_default())?,
    })
}

pub(super) fn to_shape(rendering: &Rendering) -> RenderingShape {
    let plane = |plane: &ClipPlane| plane.normal.extend(plane.d).to_array().map(check::json_number);
    RenderingShape {
        mode: Some(check::name_of(rendering.mode, &MODES).to_owned()),
        iso_value: None,
        sampling_rate: Some(check::json_number(rendering.sampling_rate)),
        background: Some(rendering.background.to_hex()),
        clip_box: rendering.clip_box.map(|clip_box| [clip_box.min, clip_box.max].map(check::json_triple)),
        clip_planes: Some(rendering.clip_planes.iter().map(plane).collect()),
        opacity_modulation: None,
    }
}

fn not_yet(path: &str) -> SceneError {
    SceneError::not_implemented(path, "known, but this server does not implement it yet; available: null")
}

fn clip_box([min, max]: &[Triple; 2]) -> Result<ClipBox, SceneError> {
    let path = "rendering.clip_box";
    let min = check::vector(format_args!("{path}[0]"), min)?;
    let max = check::vector(format_args!("{path}[1]"), max)?;
    if min.cmplt(max).all() {
        Ok(ClipBox { min, max })
    } else {
        Err(SceneError::invalid(
            path,
            format!("expected [[min], [max]] with min < max on each axis, got {min} and {max}"),
        ))
    }
}

fn clip_planes(given: &[[Number; 4]]) -> Result<Vec<ClipPlane>, SceneError> {
    if given.len() > MAX_CLIP_PLANES {
        let message = format!("expected at most {MAX_CLIP_PLANES} planes, got {}", given.len());
        return Err(SceneError::invalid("rendering.clip_planes", message));
    }
    given.iter().enumerate().map(|(index, plane)| clip_plane(index, plane)).collect()
}

fn clip_plane(index: usize, given: &[Number; 4]) -> Result<ClipPlane, SceneError> {
    let mut plane = [0.0; 4];
    for (i, given) in given.iter().enumerate() {
        plane[i] = check::number(format_args!("rendering.clip_planes[{index}][{i}]"), given, COORDINATE)?;
    }
    let [x, y, z, d] = plane;
    let path = format!("rendering.clip_planes[{index}]");
    let normal = check::nonzero(&path, DVec3::new(x, y, z))?;
    let factor = check::unit_length_factor(normal);
    let (normal, d) = (normal * factor, d * factor);
    if d.abs() > check::MAX_COORDINATE {
        return Err(SceneError::invalid(path, "expected a plane [nx, ny, nz, d] nearer to the origin"));
    }
    Ok(ClipPlane { normal, d })
}
