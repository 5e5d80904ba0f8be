//! What one file says about its picture, or its pictures if it has several frames.

use glam::DVec3;

use super::dataset::Dataset;
use super::fields::Tag;
use super::parser::{DOUBLE_PIXEL_DATA, FLOAT_PIXEL_DATA, PIXEL_DATA, Parsed};
use super::syntax::{EXPECTED, Packing, Syntax};
use crate::volume::error::excerpt;
use crate::volume::{Limits, VolumeError};

const PLANE_POSITION: Tag = 0x0020_9113;
const PLANE_ORIENTATION: Tag = 0x0020_9116;
const PIXEL_MEASURES: Tag = 0x0028_9110;
const PIXEL_VALUES: Tag = 0x0028_9145;
const SHARED_GROUPS: Tag = 0x5200_9229;
const PER_FRAME_GROUPS: Tag = 0x5200_9230;

/// A file with voxels.
#[derive(Clone, Debug)]
pub(super) struct Image {
    pub(super) layout: Layout,
    /// Pictures in the file.
    pub(super) frames: u32,
    /// One per frame.
    pub(super) slices: Vec<Slice>,
    /// What to tell about its values.
    pub(super) remarks: Vec<&'static str>,
}

/// How the voxels of a frame are stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Layout {
    pub(super) columns: u16,
    pub(super) rows: u16,
    pub(super) samples: Samples,
    pub(super) syntax: Syntax,
}

/// How a voxel is stored.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Samples {
    /// `stored` bits, the highest of them `high`, of `allocated` ones.
    Integer { allocated: u16, stored: u16, high: u16, signed: bool },
    /// In 32 bits.
    Float,
    /// In 64 bits.
    Double,
}

impl Samples {
    /// Bits of a voxel in the file; whole bytes.
    pub(super) fn bits(self) -> u16 {
        match self {
            Self::Integer { allocated, .. } => allocated,
            Self::Float => 32,
            Self::Double => 64,
        }
    }

    pub(super) fn bytes(self) -> usize {
        usize::from(self.bits() / 8)
    }
}

impl Layout {
    pub(super) fn frame_bytes(&self) -> usize {
        self.pixels() * self.samples.bytes()
    }

    pub(super) fn pixels(&self) -> usize {
        usize::from(self.columns) * usize::from(self.rows)
    }
}

/// One picture, and where it is.
#[derive(Clone, Debug)]
pub(super) struct Slice {
    /// Number of its file, and of the frame in it.
    pub(super) file: usize,
    pub(super) frame: u32,
    /// Columns and rows.
    pub(super) size: [u16; 2],
    pub(super) samples: Samples,
    /// Of the centre of the first voxel.
    pub(super) position: Option<DVec3>,
    /// Unit vectors along a row (increasing column) and a column (increasing row).
    pub(super) orientation: Option<[DVec3; 2]>,
    /// Between voxels along a row and along a column.
    pub(super) spacing: Option<[f64; 2]>,
    /// Between slices, if the file says it.
    pub(super) thickness: Option<f64>,
    /// Value = slope * stored + intercept.
    pub(super) slope: f64,
    pub(super) intercept: f64,
}

impl Image {
    /// What a parsed file says about its voxels; those of a colour picture or in a packing that is not read are an
    /// error that leaves the other files readable.
    ///
    /// # Errors
    /// Names the element that is missing, malformed or not supported.
    pub(super) fn new(parsed: &Parsed, file: usize, limits: &Limits) -> Result<Self, VolumeError> {
        let dataset = &parsed.dataset;
        let pixel_tag = parsed.voxels.as_ref().map_or(PIXEL_DATA, |voxels| voxels.tag);
        check_grey(dataset)?;
        if let Packing::NotRead(name) = parsed.syntax.packing {
            let message = format!("voxels packed with {name} are not read; {EXPECTED}");
            return Err(VolumeError::unsupported("TransferSyntaxUID", message));
        }
        let (rows, columns) = (dataset.require_short(0x0028_0010)?, dataset.require_short(0x0028_0011)?);
        if rows == 0 || columns == 0 {
            return Err(VolumeError::malformed("Rows", format!("a picture of {columns} x {rows} voxels")));
        }
        let samples = samples(dataset, pixel_tag)?;
        let frames = frame_count(dataset, limits)?;
        let layout = Layout { columns, rows, samples, syntax: parsed.syntax };
        let offsets = dataset.numbers(0x3004_000C)?;
        let slice = |frame| slice(dataset, file, frame, layout, offsets.as_deref());
        let slices = (0..frames).map(slice).collect::<Result<_, _>>()?;
        Ok(Self { layout, frames, slices, remarks: remarks(dataset) })
    }
}

fn check_grey(dataset: &Dataset) -> Result<(), VolumeError> {
    let interpretation = dataset.text(0x0028_0004).unwrap_or_else(|| "MONOCHROME2".into());
    let samples = dataset.short(0x0028_0002).unwrap_or(1);
    if interpretation.starts_with("MONOCHROME") && samples == 1 {
        return Ok(());
    }
    let message =
        format!("{} is a colour picture; expected one of grey values (MONOCHROME2)", excerpt(&interpretation));
    Err(VolumeError::unsupported("PhotometricInterpretation", message))
}

fn samples(dataset: &Dataset, pixel_tag: Tag) -> Result<Samples, VolumeError> {
    match pixel_tag {
        FLOAT_PIXEL_DATA => return Ok(Samples::Float),
        DOUBLE_PIXEL_DATA => return Ok(Samples::Double),
        _ => {}
    }
    let allocated = dataset.require_short(0x0028_0100)?;
    let stored = dataset.short(0x0028_0101).unwrap_or(allocated);
    let high = dataset.short(0x0028_0102).unwrap_or(stored.saturating_sub(1));
    if !matches!(allocated, 8 | 16 | 32) {
        let message = format!("voxels of {allocated} bits are not read; expected 8, 16 or 32");
        return Err(VolumeError::unsupported("BitsAllocated", message));
    }
    if stored == 0 || stored > allocated || high >= allocated || high + 1 < stored {
        let message = format!("{stored} bits below bit {high} do not fit into {allocated}");
        return Err(VolumeError::malformed("BitsStored", message));
    }
    Ok(Samples::Integer { allocated, stored, high, signed: dataset.short(0x0028_0103) == Some(1) })
}

fn frame_count(dataset: &Dataset, limits: &Limits) -> Result<u32, VolumeError> {
    let Some(text) = dataset.text(0x0028_0008) else {
        return Ok(1);
    };
    let frames: u32 = text.parse().ok().filter(|&frames| frames > 0).ok_or_else(|| {
        VolumeError::malformed("NumberOfFrames", format!("{} is not a whole number above 0", excerpt(&text)))
    })?;
    if frames > limits.max_axis {
        let (needed, limit) = (u128::from(frames), u64::from(limits.max_axis));
        return Err(VolumeError::TooLarge { field: "NumberOfFrames".into(), unit: "frames", needed, limit });
    }
    Ok(frames)
}

/// Of many frames, each may say its own, or all share what is said, or the file says it as files of one frame do.
struct Groups<'d> {
    own: Option<&'d Dataset>,
    shared: Option<&'d Dataset>,
    file: &'d Dataset,
}

impl Groups<'_> {
    fn array<const N: usize>(&self, group: Tag, tag: Tag) -> Result<Option<[f64; N]>, VolumeError> {
        for groups in [self.own, self.shared].into_iter().flatten() {
            if let Some(array) = groups.items(group).first().map_or(Ok(None), |item| item.array(tag))? {
                return Ok(Some(array));
            }
        }
        self.file.array(tag)
    }

    fn number(&self, group: Tag, tag: Tag) -> Result<Option<f64>, VolumeError> {
        Ok(self.array::<1>(group, tag)?.map(|[number]| number))
    }
}

fn slice(
    dataset: &Dataset,
    file: usize,
    frame: u32,
    layout: Layout,
    dose_offsets: Option<&[f64]>,
) -> Result<Slice, VolumeError> {
    let own = dataset.items(PER_FRAME_GROUPS).get(frame as usize);
    let groups = Groups { own, shared: dataset.items(SHARED_GROUPS).first(), file: dataset };
    let position = groups.array::<3>(PLANE_POSITION, 0x0020_0032)?.map(DVec3::from_array);
    let orientation = groups.array::<6>(PLANE_ORIENTATION, 0x0020_0037)?.map(unit_vectors).transpose()?;
    let position = match (dose_offsets, position, orientation) {
        // A dose: offsets along the normal.
        (Some(offsets), Some(position), Some([row, column])) => {
            offsets.get(frame as usize).map(|offset| position + row.cross(column) * *offset)
        }
        // Frames in one file that share one position have none of their own.
        _ if frame > 0 && own.is_none_or(|own| own.items(PLANE_POSITION).is_empty()) => None,
        _ => position,
    };
    let spacing = groups.array::<2>(PIXEL_MEASURES, 0x0028_0030)?.map(|[down, across]| [across, down]);
    let between = groups.number(PIXEL_MEASURES, 0x0018_0088)?;
    let thickness = between.or(groups.number(PIXEL_MEASURES, 0x0018_0050)?);
    let slope = groups.number(PIXEL_VALUES, 0x0028_1053)?.or(first(dataset, 0x3004_000E)?).unwrap_or(1.0);
    let intercept = groups.number(PIXEL_VALUES, 0x0028_1052)?.unwrap_or(0.0);
    if slope == 0.0 {
        return Err(VolumeError::malformed("RescaleSlope", "0 makes all values equal"));
    }
    Ok(Slice {
        file,
        frame,
        size: [layout.columns, layout.rows],
        samples: layout.samples,
        position,
        orientation,
        spacing,
        thickness: thickness.map(f64::abs).filter(|&length| length > 0.0),
        slope,
        intercept,
    })
}

fn first(dataset: &Dataset, tag: Tag) -> Result<Option<f64>, VolumeError> {
    Ok(dataset.numbers(tag)?.and_then(|numbers| numbers.first().copied()))
}

/// Cosines in a file have few digits: made of unit length again.
fn unit_vectors([a, b, c, d, e, f]: [f64; 6]) -> Result<[DVec3; 2], VolumeError> {
    let (row, column) = (DVec3::new(a, b, c), DVec3::new(d, e, f));
    let is_unit = |v: DVec3| (v.length() - 1.0).abs() < 1e-2;
    if is_unit(row) && is_unit(column) && row.dot(column).abs() < 1e-2 {
        Ok([row.normalize(), column.normalize()])
    } else {
        let message = format!("{row} and {column} are not two unit vectors at a right angle");
        Err(VolumeError::malformed("ImageOrientationPatient", message))
    }
}

fn remarks(dataset: &Dataset) -> Vec<&'static str> {
    let mut remarks = Vec::new();
    if dataset.text(0x0028_0004).as_deref() == Some("MONOCHROME1") {
        remarks.push("Low values are meant to be shown bright (MONOCHROME1); values are not inverted.");
    }
    if !dataset.items(0x0028_3000).is_empty() {
        remarks.push("A table of values (ModalityLUTSequence) is not applied; values are as stored.");
    }
    if dataset.text(0x0028_2110).as_deref() == Some("01") {
        remarks.push("The pictures have been compressed with loss.");
    }
    remarks
}
