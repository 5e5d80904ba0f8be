//! Which pages are the volume, in what order, and how far apart.

use std::collections::BTreeMap;

use glam::DVec3;

use super::imagej::{self, ImageJ};
use super::ome::{self, Ome, TiffData};
use super::pages::Pages;
use crate::volume::channels::{choose as choose_channel, note_frames};
use crate::volume::error::excerpt;
use crate::volume::{Grid, VolumeError};

/// A volume's pages and place.
pub(super) struct Layout {
    pub(super) grid: Grid,
    /// Whether the file says how far apart voxels are.
    pub(super) is_placed: bool,
    /// Pages from the first slice to the last.
    pub(super) planes: Vec<usize>,
    pub(super) notes: Vec<String>,
    /// What the description says of order and distances, without its free text.
    pub(super) technical: Vec<(&'static str, String)>,
}

impl Layout {
    /// From the description, of OME or ImageJ; a plain file's pages are slices.
    pub(super) fn new(pages: &Pages, channel: Option<u32>) -> Result<Self, VolumeError> {
        let description = pages.description.as_deref().unwrap_or_default();
        let mut layout = if let Some(ome) = ome::parse(description)? {
            of_ome(&ome, pages, channel)?
        } else if let Some(imagej) = imagej::parse(description) {
            of_imagej(&imagej, pages, channel)?
        } else {
            plain(pages, channel)?
        };
        if pages.inverted {
            layout.notes.push("Low values are meant to be bright (WhiteIsZero): values are inverted.".into());
        }
        Ok(layout)
    }
}

fn grid(pages: &Pages, slices: usize, spacing: DVec3) -> Result<Grid, VolumeError> {
    let slices = u32::try_from(slices).map_err(|_| VolumeError::malformed("pages", "too many"))?;
    Ok(Grid::axis_aligned([pages.size[0], pages.size[1], slices], spacing))
}

fn plain(pages: &Pages, channel: Option<u32>) -> Result<Layout, VolumeError> {
    choose_channel(channel, 1, &[], &mut Vec::new())?;
    let note = "The file does not say how far apart voxels are; taken as 1 along each axis.";
    Ok(Layout {
        grid: grid(pages, pages.len(), DVec3::ONE)?,
        is_placed: false,
        planes: (0..pages.len()).collect(),
        notes: vec![note.into()],
        technical: Vec::new(),
    })
}

fn of_imagej(imagej: &ImageJ, pages: &Pages, channel: Option<u32>) -> Result<Layout, VolumeError> {
    let ImageJ { channels, slices, frames, .. } = *imagej;
    let expected = channels.saturating_mul(slices).saturating_mul(frames);
    let images = imagej.images.unwrap_or(expected);
    // A plain stack of `images` may not say that they are slices.
    let slices = if expected == 1 { images } else { slices };
    let expected = expected.max(images);
    if pages.len() != expected || slices == 0 || channels == 0 || frames == 0 {
        let message = format!(
            "ImageJ describes {expected} pictures, but there are {} pages{}",
            pages.len(),
            if pages.len() == 1 { " (stacks beyond 4 GiB, without pages, are not read: save as OME-TIFF)" } else { "" }
        );
        return Err(VolumeError::malformed("description", message));
    }
    let mut notes = Vec::new();
    let channel = choose_channel(channel, channels, &[], &mut notes)?;
    note_frames(frames, &mut notes);
    let scale = imagej.millimetres.unwrap_or(1.0);
    // The resolution is in pixels per unit of length.
    let [x, y] = pages.resolution.map(|resolution| resolution.map_or(1.0, f64::recip));
    let z = imagej.spacing.unwrap_or_else(|| {
        notes.push("The file does not say how far apart slices are; taken as far as voxels along x.".into());
        x
    });
    let spacing = DVec3::new(x, y, z) * scale;
    // Channels are fastest, then slices, then frames.
    let planes = (0..slices).map(|k| k * channels + channel).collect();
    let technical = vec![
        ("channels", channels.to_string()),
        ("slices", slices.to_string()),
        ("frames", frames.to_string()),
        ("spacing in mm", format!("{x}, {y}, {z}", x = spacing.x, y = spacing.y, z = spacing.z)),
    ];
    Ok(Layout { grid: grid(pages, slices, spacing)?, is_placed: true, planes, notes, technical })
}

fn of_ome(ome: &Ome, pages: &Pages, channel: Option<u32>) -> Result<Layout, VolumeError> {
    let [slices, channels, frames] = ome.sizes;
    if ome.sizes.contains(&0) {
        return Err(malformed("a size is 0".into()));
    }
    let mut notes = Vec::new();
    if ome.more_images > 0 {
        notes.push(format!("Of {} images in the file the first is shown.", ome.more_images + 1));
    }
    let channel = choose_channel(channel, channels, &ome.channels, &mut notes)?;
    note_frames(frames, &mut notes);
    let planes = pages_of(ome, channel, pages.len())?;
    let [x, y, z] = ome.lengths;
    if x.is_none() || z.is_none() {
        notes.push("The file does not say how far apart voxels are along every axis; the rest is guessed.".into());
    }
    let x = x.or(y).unwrap_or(1.0);
    let spacing = DVec3::new(x, y.unwrap_or(x), z.unwrap_or(x));
    let technical = vec![
        // Checked to be an order of axes.
        ("DimensionOrder", ome.order.clone()),
        ("SizeZ", slices.to_string()),
        ("SizeC", channels.to_string()),
        ("SizeT", frames.to_string()),
        ("PhysicalSize in mm", format!("{x}, {y}, {z}", x = spacing.x, y = spacing.y, z = spacing.z)),
    ];
    Ok(Layout { grid: grid(pages, slices, spacing)?, is_placed: true, planes, notes, technical })
}

/// The pages that hold the slices of a channel at the first time point.
fn pages_of(ome: &Ome, channel: usize, pages: usize) -> Result<Vec<usize>, VolumeError> {
    let strides = strides(&ome.order, ome.sizes)?;
    let number = |plane: [usize; 3]| {
        let steps = (0..3).map(|axis| strides[axis].saturating_mul(plane[axis]));
        steps.fold(0, usize::saturating_add)
    };
    let mut data: BTreeMap<usize, &TiffData> = ome.data.iter().map(|data| (number(data.first), data)).collect();
    let whole = TiffData { page: None, first: [0; 3], planes: None };
    if data.is_empty() {
        data.insert(0, &whole);
    }
    let page = |z: usize| {
        let wanted = number([z, channel, 0]);
        let (first, data) = data.range(..=wanted).next_back()?;
        // A page alone is one plane; without a page it is all that follow.
        let planes = data.planes.unwrap_or(if data.page.is_some() { 1 } else { usize::MAX });
        let ahead = wanted - first;
        let page = data.page.unwrap_or(0).saturating_add(ahead);
        (ahead < planes && page < pages).then_some(page)
    };
    let missing = |z: usize| {
        malformed(format!("the page of slice {z}, channel {channel} is not in this file, which has {pages} pages"))
    };
    (0..ome.sizes[0]).map(|z| page(z).ok_or_else(|| missing(z))).collect()
}

/// How many planes apart neighbours in z, c and t are.
fn strides(order: &str, sizes: [usize; 3]) -> Result<[usize; 3], VolumeError> {
    let mut strides = [0; 3];
    let mut stride = 1_usize;
    for axis in order.chars().skip(2) {
        let axis = "ZCT".find(axis).filter(|&axis| strides[axis] == 0);
        let axis = axis.ok_or_else(|| malformed(format!("{} is not an order such as XYZCT", excerpt(order))))?;
        strides[axis] = stride;
        stride = stride.saturating_mul(sizes[axis]);
    }
    if strides.contains(&0) {
        return Err(malformed(format!("{} is not an order such as XYZCT", excerpt(order))));
    }
    Ok(strides)
}

fn malformed(message: String) -> VolumeError {
    VolumeError::malformed("description", format!("OME-XML: {message}"))
}
