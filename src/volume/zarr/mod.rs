//! Zarr 2 and 3: OME-Zarr images (versions 0.4 and 0.5), and plain arrays with three axes.
//!
//! A hierarchy is a folder, or a zip or tar archive of one. Memory holds the volume and one chunk: chunks go from the
//! store straight to their places, out of shards too.
//!
//! The decoders are our own, over the crates that unpack gzip, Zstandard and LZ4, because a chunk is hostile input: the
//! `zarrs` crate (0.23) unpacks gzip and Zstandard without a bound and Blosc by the length that a chunk claims.
//!
//! Where the formats leave room:
//! - World units are mm, as for patients: axes' units are turned into them. Where no unit is known, lengths are taken
//!   as they are.
//! - Of several levels of detail the finest within the limits is read, or the one that is chosen; of several channels
//!   the first, or the one that is chosen; of several time points the first. All are noted.
//! - What is in chunks that are not there has the fill value; without any chunk there is no volume.

mod array;
mod blosc;
mod chunks;
mod codecs;
mod json;
mod multiscales;
mod store;

use glam::DVec3;
use serde_json::{Map, Value};

use array::Array;
use chunks::Selection;
use multiscales::{Axis, AxisKind, Multiscales};
use store::Store;

use super::error::excerpt;
use super::input::{Choice, Input};
use super::{About, Grid, Limits, Shape, Volume, VolumeError, channels as choice_of_channels};

pub(super) use store::{is_zarr, is_zarr_folder};

/// Reads the volume.
///
/// # Errors
/// Names the attribute or field of the metadata at fault, `scale` or `channel` if there is no such, `chunk` if one is
/// damaged. Sizes beyond the limits are refused before anything is allocated.
pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let (choice, limits) = (input.choice.clone(), *input.limits);
    // Of an archive the bytes are counted already.
    let (watch, mut counts) = (input.watch, input.folder().is_some());
    let units = u64::from(counts);
    let mut store = Store::open(input)?;
    let Plan { array, selection, grid, about, .. } = Plan::new(&mut store, &choice, &limits)?;
    let voxels = chunks::read(&mut store, &array, &selection, &limits, |chunks| {
        let Some(watch) = watch else { return Ok(()) };
        if std::mem::take(&mut counts) {
            watch.expect(chunks);
        }
        watch.step(units)
    })?;
    Ok(Volume::new(grid, voxels)?.with_about(about))
}

/// Dims and type of the volume, without its chunks.
///
/// # Errors
/// As [`read_input`], as far as metadata go.
pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    let (choice, limits) = (input.choice.clone(), *input.limits);
    let plan = Plan::new(&mut Store::open(input)?, &choice, &limits)?;
    let (voxel_type, spacing) = (plan.array.stored.voxel_type(), plan.grid.spacing.to_array());
    Ok(Shape { dims: plan.grid.dims, voxel_type, spacing: plan.is_placed.then_some(spacing) })
}

/// What metadata say: everything but the voxels.
struct Plan {
    array: Array,
    selection: Selection,
    grid: Grid,
    /// Whether anything says where the grid is.
    is_placed: bool,
    about: About,
}

impl Plan {
    fn new(store: &mut Store, choice: &Choice, limits: &Limits) -> Result<Self, VolumeError> {
        let root = attributes(store, "")?;
        if let Some(image) = multiscales::parse(&root)? {
            return Self::of_image(store, "", image, choice, limits);
        }
        if let Some(array) = Array::read(store, "")? {
            return Self::of_array(array, choice, limits);
        }
        // What bioformats2raw writes: images are in folders with numbers.
        let ome = root.get("ome").and_then(Value::as_object).unwrap_or(&root);
        if ome.contains_key("bioformats2raw.layout")
            && let Some(mut image) = multiscales::parse(&attributes(store, "0/")?)?
        {
            image.notes.push("Of the images in the folder the first, `0`, is shown.".to_owned());
            return Self::of_image(store, "0/", image, choice, limits);
        }
        let advice = if ome.contains_key("plate") || ome.contains_key("well") {
            "missing; this is a plate or a well: name the folder of one image in it, such as `plate.zarr/A/1/0`"
        } else {
            "missing; neither an OME-Zarr image nor an array is at the root: name the folder of one"
        };
        Err(VolumeError::malformed("multiscales", advice))
    }

    fn of_image(
        store: &mut Store,
        folder: &str,
        image: Multiscales,
        choice: &Choice,
        limits: &Limits,
    ) -> Result<Self, VolumeError> {
        let space = image.space()?;
        let count = image.levels.len();
        let mut number = choice.scale.unwrap_or(0) as usize;
        let array = loop {
            let Some(level) = image.levels.get(number) else {
                let message = format!("{number} is not a level of this file; it has 0 to {}", count - 1);
                return Err(VolumeError::malformed("scale", message));
            };
            let path = format!("{folder}{}/", level.path);
            let Some(array) = Array::read(store, &path)? else {
                return Err(VolumeError::malformed(
                    "datasets.path",
                    format!("no array at {}", excerpt(path.trim_end_matches('/'))),
                ));
            };
            if array.shape.len() != image.axes.len() {
                let message = format!("{} axes are named, but the array has {:?}", image.axes.len(), array.shape);
                return Err(VolumeError::malformed("axes", message));
            }
            let fits = limits.check("shape", dims(&array, space)?, array.stored.voxel_type());
            match fits {
                Err(VolumeError::TooLarge { .. }) if choice.scale.is_none() && number + 1 < count => number += 1,
                Err(error) => return Err(error),
                Ok(_) => break array,
            }
        };
        let mut about = About { notes: image.notes.clone(), ..About::default() };
        if choice.scale.is_none() && number > 0 {
            about.note(format!(
                "Level {number} of 0 to {} is read, the finest one within the limits: choose another by its `scale`.",
                count - 1
            ));
        }
        let level = &image.levels[number];
        let steps = std::array::from_fn(|axis| DVec3::AXES[axis] * level.scale[space[axis]]);
        let origin = DVec3::from_array(space.map(|axis| level.translation[axis]));
        let dims = dims(&array, space)?;
        let grid = Grid::from_steps("coordinateTransformations", dims, steps, origin)?;
        let at = others(&array, &image, choice, &mut about.notes)?;
        about.technical_field("level", format!("{number} of 0 to {}", count - 1));
        let letters: Vec<&str> = image.axes.iter().map(Axis::letter).collect();
        about.technical_field("axes", letters.join(", "));
        keep_fields(&array, &mut about);
        if let Some(name) = &image.name {
            about.field("name", name);
        }
        Ok(Self { array, selection: Selection { space, at, dims }, grid, is_placed: true, about })
    }

    /// An array alone: its last three axes are z, y and x.
    fn of_array(array: Array, choice: &Choice, limits: &Limits) -> Result<Self, VolumeError> {
        for (field, chosen) in [("scale", choice.scale), ("channel", choice.channel)] {
            if chosen.is_some_and(|number| number > 0) {
                return Err(VolumeError::malformed(field, "this is an array alone, which has only one: 0"));
            }
        }
        let axes = array.shape.len();
        if axes < 3 || array.shape[..axes - 3].iter().any(|&size| size != 1) {
            let message = format!("{:?} has {axes} axes; expected three, (z, y, x)", array.shape);
            return Err(VolumeError::unsupported("shape", message));
        }
        let space = [axes - 1, axes - 2, axes - 3];
        let dims = dims(&array, space)?;
        limits.check("shape", dims, array.stored.voxel_type())?;
        let mut about = About::default();
        about.note("The file says nothing about distances between voxels: they are taken to be 1.");
        keep_fields(&array, &mut about);
        let selection = Selection { space, at: vec![0; axes], dims };
        Ok(Self { grid: Grid::axis_aligned(dims, DVec3::ONE), is_placed: false, array, selection, about })
    }
}

impl Axis {
    fn letter(&self) -> &'static str {
        match self.kind {
            AxisKind::X => "x",
            AxisKind::Y => "y",
            AxisKind::Z => "z",
            AxisKind::Channel => "c",
            AxisKind::Time => "t",
            AxisKind::Other => "?",
        }
    }
}

/// Attributes of a group or array, empty if it has none.
fn attributes(store: &mut Store, folder: &str) -> Result<Map<String, Value>, VolumeError> {
    if let Some(mut document) = json::read(store, &format!("{folder}zarr.json"))? {
        let attributes = document.remove("attributes");
        return Ok(attributes.and_then(|value| value.as_object().cloned()).unwrap_or_default());
    }
    Ok(json::read(store, &format!("{folder}.zattrs"))?.unwrap_or_default())
}

/// Voxels along x, y and z.
fn dims(array: &Array, space: [usize; 3]) -> Result<[u32; 3], VolumeError> {
    let mut dims = [0; 3];
    for (size, axis) in dims.iter_mut().zip(space) {
        let needed = array.shape[axis];
        *size = u32::try_from(needed).map_err(|_| VolumeError::TooLarge {
            field: "shape".to_owned(),
            unit: "voxels along an axis",
            needed: needed.into(),
            limit: u32::MAX.into(),
        })?;
    }
    Ok(dims)
}

/// Indices along the axes that are not of space.
fn others(
    array: &Array,
    image: &Multiscales,
    choice: &Choice,
    notes: &mut Vec<String>,
) -> Result<Vec<u64>, VolumeError> {
    let mut at = vec![0; array.shape.len()];
    let mut has_channels = false;
    for (index, axis) in image.axes.iter().enumerate() {
        let size = usize::try_from(array.shape[index]).unwrap_or(usize::MAX);
        match axis.kind {
            AxisKind::X | AxisKind::Y | AxisKind::Z => {}
            AxisKind::Channel if !has_channels => {
                has_channels = true;
                at[index] = choice_of_channels::choose(choice.channel, size, &image.channels, notes)? as u64;
            }
            AxisKind::Time => choice_of_channels::note_frames(size, notes),
            AxisKind::Channel | AxisKind::Other if size > 1 => {
                let message =
                    format!("axis {index} is neither of space nor time nor channels, and has {size} elements");
                return Err(VolumeError::unsupported("axes", message));
            }
            AxisKind::Channel | AxisKind::Other => {}
        }
    }
    if !has_channels {
        choice_of_channels::choose(choice.channel, 1, &[], notes)?;
    }
    Ok(at)
}

fn keep_fields(array: &Array, about: &mut About) {
    about.technical_field("zarr_format", array.version.to_string());
    about.technical_field("shape", format!("{:?}", array.shape));
    about.technical_field("chunks", format!("{:?}", array.chunk));
    if array.shard.is_some() {
        about.technical_field("shards", format!("{:?}", array.outer));
    }
    about.technical_field("data_type", format!("{:?}", array.stored));
    about.technical_field("codecs", array.chain.names());
}
