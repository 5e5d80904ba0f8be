//! What OME-Zarr says about an image: its axes, its levels of detail and where they are in the world.
//!
//! After <https://ngff.openmicroscopy.org/0.4/> (Zarr 2) and <https://ngff.openmicroscopy.org/0.5/> (Zarr 3).

use serde_json::{Map, Value};

use super::array::MAX_AXES;
use super::json::{self, shown};
use crate::volume::VolumeError;
use crate::volume::error::excerpt;
use crate::volume::units::millimetres;

/// Most levels of an image.
const MAX_LEVELS: usize = 64;

/// Axes where nothing names them, before version 0.3.
const FIRST_AXES: [&str; 5] = ["t", "c", "z", "y", "x"];

/// An image at several levels of detail.
#[derive(Debug)]
pub(super) struct Multiscales {
    pub(super) axes: Vec<Axis>,
    pub(super) levels: Vec<Level>,
    /// Names of channels.
    pub(super) channels: Vec<Option<String>>,
    pub(super) name: Option<String>,
    pub(super) notes: Vec<String>,
}

/// An axis of all levels' arrays.
#[derive(Debug)]
pub(super) struct Axis {
    pub(super) kind: AxisKind,
    /// Millimetres in its unit of length.
    millimetres: f64,
    /// What is called so.
    name: String,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum AxisKind {
    X,
    Y,
    Z,
    Channel,
    Time,
    Other,
}

/// One level of detail.
#[derive(Debug)]
pub(super) struct Level {
    /// Key of its array's folder.
    pub(super) path: String,
    /// Between elements along each axis, in mm for those of space.
    pub(super) scale: Vec<f64>,
    /// Of the first element's centre.
    pub(super) translation: Vec<f64>,
}

/// The first image that a group's attributes describe; `None` if there is none.
///
/// # Errors
/// Names the attribute at fault.
pub(super) fn parse(attributes: &Map<String, Value>) -> Result<Option<Multiscales>, VolumeError> {
    let ome = attributes.get("ome").and_then(Value::as_object).unwrap_or(attributes);
    let Some(images) = ome.get("multiscales") else { return Ok(None) };
    let images = images.as_array().map(Vec::as_slice).unwrap_or_default();
    let Some(image) = images.first().and_then(Value::as_object) else {
        return Err(malformed("multiscales", "expected a list of at least one image"));
    };
    let datasets = image.get("datasets").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    if datasets.is_empty() || datasets.len() > MAX_LEVELS {
        let message = format!("{} levels; expected 1 to {MAX_LEVELS}", datasets.len());
        return Err(VolumeError::malformed("datasets", message));
    }
    let mut notes = Vec::new();
    if images.len() > 1 {
        notes.push(format!("Of {} images in the file the first is shown.", images.len()));
    }
    let axes = axes(image.get("axes"))?;
    let units = axes.iter().zip(units(image.get("axes")));
    let without_unit = units.filter(|(axis, unit)| axis.is_space() && unit.is_none_or(|u| millimetres(u).is_none()));
    if without_unit.count() > 0 {
        notes
            .push("The file does not say in what unit of length its distances are; they are taken as they are.".into());
    }
    let whole = image.get("coordinateTransformations");
    let levels: Result<Vec<Level>, _> = datasets.iter().map(|dataset| level(dataset, whole, &axes)).collect();
    let levels = levels?;
    if levels.iter().all(|level| level.scale.iter().all(|scale| *scale == 1.0)) && whole.is_none() {
        let said = datasets.iter().any(|dataset| dataset.get("coordinateTransformations").is_some());
        if !said {
            notes.push("The file does not say how far apart voxels are; taken as 1 along each axis.".into());
        }
    }
    let name = image.get("name").and_then(Value::as_str).map(str::to_owned);
    Ok(Some(Multiscales { axes, levels, channels: channels(ome), name, notes }))
}

impl Axis {
    fn is_space(&self) -> bool {
        matches!(self.kind, AxisKind::X | AxisKind::Y | AxisKind::Z)
    }
}

impl Multiscales {
    /// Which axes are x, y and z.
    ///
    /// # Errors
    /// Names `axes` if one of them is missing.
    pub(super) fn space(&self) -> Result<[usize; 3], VolumeError> {
        let mut space = [0; 3];
        for (place, (kind, name)) in space.iter_mut().zip([(AxisKind::X, "x"), (AxisKind::Y, "y"), (AxisKind::Z, "z")])
        {
            let mut found = (0..self.axes.len()).filter(|&axis| self.axes[axis].kind == kind);
            let axes: Vec<&str> = self.axes.iter().map(|axis| axis.name.as_str()).collect();
            let wrong = |what: &str| {
                let list = excerpt(&axes.join(", "));
                VolumeError::unsupported("axes", format!("{what} {name} among {list}; a volume has z, y and x"))
            };
            *place = found.next().ok_or_else(|| wrong("no axis"))?;
            if found.next().is_some() {
                return Err(wrong("more than one axis"));
            }
        }
        Ok(space)
    }
}

fn axes(value: Option<&Value>) -> Result<Vec<Axis>, VolumeError> {
    let Some(value) = value else {
        return Ok(FIRST_AXES.iter().map(|name| axis(name, None, None)).collect());
    };
    let list = value.as_array().filter(|list| list.len() <= MAX_AXES);
    let list = list.ok_or_else(|| VolumeError::malformed("axes", format!("expected a list of at most {MAX_AXES}")))?;
    let one = |value: &Value| match value {
        // Version 0.3 has names alone.
        Value::String(name) => Ok(axis(name, None, None)),
        Value::Object(object) => {
            let text = |key: &str| object.get(key).and_then(Value::as_str);
            let name = text("name").ok_or_else(|| malformed("axes", "an axis has no name"))?;
            Ok(axis(name, text("type"), text("unit")))
        }
        other => Err(VolumeError::malformed("axes", format!("{} is not an axis", shown(other)))),
    };
    list.iter().map(one).collect()
}

fn axis(name: &str, kind: Option<&str>, unit: Option<&str>) -> Axis {
    let kind = match (name.to_ascii_lowercase().as_str(), kind) {
        ("x", None | Some("space")) => AxisKind::X,
        ("y", None | Some("space")) => AxisKind::Y,
        ("z", None | Some("space")) => AxisKind::Z,
        (_, Some("channel")) | ("c", None) => AxisKind::Channel,
        (_, Some("time")) | ("t", None) => AxisKind::Time,
        _ => AxisKind::Other,
    };
    let millimetres = unit.and_then(millimetres).unwrap_or(1.0);
    Axis { kind, millimetres, name: name.to_owned() }
}

fn units(axes: Option<&Value>) -> impl Iterator<Item = Option<&str>> {
    let axes = axes.and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    axes.iter().map(|axis| axis.get("unit").and_then(Value::as_str)).chain(std::iter::repeat(None))
}

fn level(dataset: &Value, whole: Option<&Value>, axes: &[Axis]) -> Result<Level, VolumeError> {
    let path = dataset
        .get("path")
        .and_then(Value::as_str)
        .ok_or_else(|| malformed("datasets.path", "missing in a dataset"))?;
    let is_plain =
        |part: &str| !matches!(part, "" | "." | "..") && !part.contains(|c: char| c.is_control() || "\\:".contains(c));
    let path = path.strip_suffix('/').unwrap_or(path);
    if !path.split('/').all(is_plain) {
        let message = format!("{} is not a relative path without `..`", excerpt(path));
        return Err(VolumeError::malformed("datasets.path", message));
    }
    let mut level = Level { path: path.to_owned(), scale: vec![1.0; axes.len()], translation: vec![0.0; axes.len()] };
    // The level's own come first, then those of the whole image.
    for transformations in [dataset.get("coordinateTransformations"), whole].into_iter().flatten() {
        let list = transformations.as_array().map(Vec::as_slice).unwrap_or_default();
        for transformation in list {
            level.transform(transformation, axes.len())?;
        }
    }
    for (axis, factor) in axes.iter().map(|axis| axis.millimetres).enumerate() {
        level.scale[axis] *= factor;
        level.translation[axis] *= factor;
    }
    Ok(level)
}

impl Level {
    fn transform(&mut self, transformation: &Value, axes: usize) -> Result<(), VolumeError> {
        const FIELD: &str = "coordinateTransformations";
        match transformation.get("type").and_then(Value::as_str) {
            Some("identity") => {}
            Some("scale") if transformation.get("scale").is_some() => {
                for (axis, factor) in
                    json::numbers("coordinateTransformations.scale", transformation.get("scale"), axes)?
                        .iter()
                        .enumerate()
                {
                    if *factor <= 0.0 {
                        let message = format!("a scale of {factor}; expected more than 0");
                        return Err(VolumeError::malformed(FIELD, message));
                    }
                    self.scale[axis] *= factor;
                    self.translation[axis] *= factor;
                }
            }
            Some("translation") if transformation.get("translation").is_some() => {
                let offsets = json::numbers("translation", transformation.get("translation"), axes)?;
                for (axis, offset) in offsets.iter().enumerate() {
                    self.translation[axis] += offset;
                }
            }
            Some("scale" | "translation") => {
                return Err(VolumeError::unsupported(FIELD, "numbers in a file of their own are not read"));
            }
            other => {
                let name = excerpt(other.unwrap_or("nothing"));
                let message = format!("{name} is not read; expected scale, translation or identity");
                return Err(VolumeError::unsupported(FIELD, message));
            }
        }
        Ok(())
    }
}

fn channels(ome: &Map<String, Value>) -> Vec<Option<String>> {
    let list = ome.get("omero").and_then(|omero| omero.get("channels")).and_then(Value::as_array);
    let label = |channel: &Value| channel.get("label").and_then(Value::as_str).map(str::to_owned);
    list.map(|list| list.iter().map(label).collect()).unwrap_or_default()
}

fn malformed(field: &str, message: &str) -> VolumeError {
    VolumeError::malformed(field, message)
}
