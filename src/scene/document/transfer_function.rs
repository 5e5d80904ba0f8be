//! The section `transfer_function` of a scene document.

use super::check::{self, Interval, POSITIVE};
use super::shape::{Object, PointShape, TransferFunctionShape};
use super::volume_facts::VolumeFacts;
use crate::scene::automatic::automatic_transfer_function;
use crate::scene::presets::{Preset, preset, presets};
use crate::scene::transfer_function::MAX_VALUE;
use crate::scene::{ControlPoint, Rgb, SceneError, TransferFunction};

/// Most control points: a limit on work and memory per edit that no hand-made transfer function reaches.
pub const MAX_POINTS: usize = 1024;

/// What a document says about the transfer function, checked, before the volume is known.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct TransferFunctionDocument {
    source: Source,
    opacity_unit_distance: Option<f64>,
}

#[derive(Clone, Debug, PartialEq)]
enum Source {
    /// Derived from the volume's histogram.
    Automatic,
    Preset(&'static Preset),
    Points(Vec<ControlPoint>),
}

impl TransferFunctionDocument {
    pub(super) fn from_shape(shape: &TransferFunctionShape) -> Result<Self, SceneError> {
        let source = match (&shape.preset, &shape.points) {
            (None, None) => Source::Automatic,
            (Some(id), None) => Source::Preset(known_preset(id)?),
            (None, Some(points)) => Source::Points(checked_points(points)?),
            (Some(_), Some(_)) => {
                return Err(SceneError::invalid("transfer_function", "expected either `points` or `preset`, got both"));
            }
        };
        let opacity_unit_distance = shape.opacity_unit_distance.as_ref();
        let opacity_unit_distance = opacity_unit_distance
            .map(|given| check::number("transfer_function.opacity_unit_distance", given, POSITIVE))
            .transpose()?;
        Ok(Self { source, opacity_unit_distance })
    }

    /// Fills in what depends on the volume.
    pub(super) fn complete(&self, facts: &VolumeFacts<'_>) -> TransferFunction {
        let completed = match &self.source {
            Source::Automatic => automatic_transfer_function(facts),
            Source::Preset(preset) => preset.transfer_function(facts.value_range),
            Source::Points(points) => TransferFunction { points: points.clone(), opacity_unit_distance: None },
        };
        let opacity_unit_distance = self.opacity_unit_distance.or(completed.opacity_unit_distance);
        TransferFunction { opacity_unit_distance, ..completed }
    }
}

pub(super) fn to_shape(transfer_function: &TransferFunction) -> TransferFunctionShape {
    let point = |p: &ControlPoint| {
        Object(PointShape {
            value: Some(check::json_number(p.value)),
            color: Some(p.color.to_hex()),
            opacity: Some(check::json_number(p.opacity)),
        })
    };
    TransferFunctionShape {
        preset: None,
        points: Some(transfer_function.points.iter().map(point).collect()),
        opacity_unit_distance: transfer_function.opacity_unit_distance.map(check::json_number),
    }
}

fn known_preset(id: &str) -> Result<&'static Preset, SceneError> {
    preset(id).ok_or_else(|| {
        let known: Vec<_> = presets().iter().map(|preset| preset.id).collect();
        let message = format!("expected one of: {}; got {id:?}", known.join(", "));
        SceneError::invalid("transfer_function.preset", message)
    })
}

fn checked_points(shapes: &[Object<PointShape>]) -> Result<Vec<ControlPoint>, SceneError> {
    if shapes.is_empty() || shapes.len() > MAX_POINTS {
        let message = format!("expected 1 to {MAX_POINTS} points, got {}", shapes.len());
        return Err(SceneError::invalid("transfer_function.points", message));
    }
    let mut points: Vec<ControlPoint> = Vec::with_capacity(shapes.len());
    for (index, Object(shape)) in shapes.iter().enumerate() {
        let point = checked_point(index, shape)?;
        let value_path = format_args!("transfer_function.points[{index}].value");
        if let Some(last) = points.last().filter(|last| last.value > point.value) {
            let message = format!("expected points sorted by value, got {} after {}", point.value, last.value);
            return Err(SceneError::invalid(value_path, message));
        }
        if index >= 2 && points[index - 2].value == point.value {
            let message = format!("expected at most two points (a step) at one value, got a third at {}", point.value);
            return Err(SceneError::invalid(value_path, message));
        }
        points.push(point);
    }
    Ok(points)
}

fn checked_point(index: usize, shape: &PointShape) -> Result<ControlPoint, SceneError> {
    let path = |field: &str| format!("transfer_function.points[{index}].{field}");
    let required = |field: &str| SceneError::invalid(path(field), "required in every point");
    let value = shape.value.as_ref().ok_or_else(|| required("value"))?;
    let color = shape.color.as_ref().ok_or_else(|| required("color"))?;
    let opacity = shape.opacity.as_ref().ok_or_else(|| required("opacity"))?;
    Ok(ControlPoint {
        value: check::number(path("value"), value, Interval::Closed(-MAX_VALUE, MAX_VALUE))?,
        color: check::color(path("color"), Some(color), Rgb::from_hex, Rgb::WHITE)?,
        opacity: check::number(path("opacity"), opacity, Interval::Closed(0.0, 1.0))?,
    })
}
