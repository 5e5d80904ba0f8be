//! DICOM (PS3.3, PS3.5, PS3.10): a series of slices, or one file with several frames.
//!
//! A source is a zip or tar archive, a folder or one file. It is visited twice: once for the headers, which say what
//! belongs together and where it is, and once for the voxels, which go from each file straight to their place in the
//! volume. So memory holds the volume and one slice.
//!
//! Where the format leaves room:
//! - World space is the patient's, as DICOM has it: x to the left, y to the back, z to the head, in mm. Slices are in the
//!   order of their positions, never of their numbers or names.
//! - Values are `RescaleSlope * stored + RescaleIntercept` (or `DoseGridScaling`), of an integer type if both are whole.
//! - MONOCHROME1 is not inverted; colour, palettes and bitmaps are refused.
//! - Missing or uneven slices are noted, several at one position are refused.

mod dataset;
mod fields;
mod header;
mod image;
mod jpeg2000;
mod parser;
mod pixels;
mod rle;
mod series;
mod stack;
mod syntax;
mod target;

use image::{Image, Slice};
use parser::Parsed;
use series::{AllSeries, Series};
use target::Target;

use super::archive::Files;
use super::error::excerpt;
use super::input::Input;
use super::{About, Grid, Limits, Shape, Volume, VolumeError, VoxelType};

/// Most slices of all series together.
const MAX_SLICES: usize = 1 << 17;

/// Reads a volume from a zip, a tar, a folder or one DICOM file, of the series that is chosen.
///
/// # Errors
/// Names `series` if several are there and none is chosen, `archive` if that is damaged, the element at fault
/// otherwise. Sizes beyond the limits are refused before anything is allocated.
pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let (series, limits) = (input.choice.series.clone(), input.limits);
    load(Files::open(input)?, series.as_deref(), limits)
}

/// Dims and type of what [`read_input`] would read, without its voxels. A type `i16` may turn out to be `i32`.
///
/// # Errors
/// As [`read_input`], as far as headers go.
pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    let (series, limits) = (input.choice.series.clone(), input.limits);
    plan(&mut Files::open(input)?, series.as_deref(), limits).map(|plan| Shape::of(&plan.grid, plan.voxel_type))
}

/// What headers say: everything but the voxels.
struct Plan {
    slices: Vec<Slice>,
    grid: Grid,
    patient_axes: bool,
    voxel_type: VoxelType,
    voxel_count: usize,
    notes: Vec<String>,
}

fn plan(files: &mut Files, choice: Option<&str>, limits: &Limits) -> Result<Plan, VolumeError> {
    let mut notes = Vec::new();
    let all = scan(files, limits, &mut notes)?;
    let Series { mut slices, remarks, .. } = series::choose(all, choice, &mut notes)?;
    let (grid, patient_axes) = stack::stack(&mut slices, &mut notes)?;
    notes.extend(remarks.into_iter().map(str::to_owned));
    let voxel_type = target::voxel_type(&slices);
    let voxel_count = limits.check("dims", grid.dims, voxel_type)?;
    grid.check()?;
    Ok(Plan { slices, grid, patient_axes, voxel_type, voxel_count, notes })
}

/// Reads all headers.
fn scan(files: &mut Files, limits: &Limits, notes: &mut Vec<String>) -> Result<AllSeries, VolumeError> {
    let mut all = AllSeries::new();
    let (mut others, mut without_voxels, mut slices) = (0, 0, 0);
    files.visit(&mut |index, name, reader| {
        match parser::parse(reader).map_err(|error| in_file(error, name))? {
            None => others += 1,
            Some(Parsed { voxels: None, .. }) => without_voxels += 1,
            Some(parsed) => {
                slices += add(&mut all, &parsed, index, name, limits)?;
                if slices > MAX_SLICES {
                    let (needed, limit) = (slices as u128, MAX_SLICES as u64);
                    return Err(VolumeError::TooLarge { field: "archive".into(), unit: "slices", needed, limit });
                }
            }
        }
        Ok(())
    })?;
    if all.is_empty() && files.is_single() {
        return Err(if others > 0 {
            VolumeError::malformed("data", "not a DICOM file, nor a zip or tar of such")
        } else {
            VolumeError::malformed("PixelData", "missing; the file holds no picture")
        });
    }
    if all.is_empty() {
        let found = format!("{others} files are not DICOM, {without_voxels} are DICOM without PixelData");
        return Err(if files.is_folder() {
            VolumeError::malformed("path", format!("is not a file, and as a folder it has no DICOM pictures: {found}"))
        } else {
            VolumeError::malformed("archive", format!("no DICOM pictures are in it: {found}"))
        });
    }
    if others > 0 {
        notes.push(format!("Files that are not DICOM were passed over: {others}."));
    }
    if without_voxels > 0 {
        notes.push(format!("DICOM files without a picture were passed over: {without_voxels}."));
    }
    Ok(all)
}

/// Adds a file to its series; says how many slices it has.
fn add(all: &mut AllSeries, parsed: &Parsed, index: usize, name: &str, limits: &Limits) -> Result<usize, VolumeError> {
    let dataset = &parsed.dataset;
    let series = all.entry(dataset.text(0x0020_000E).unwrap_or_default()).or_default();
    if series.pictures == 0 {
        series.number = dataset.text(0x0020_0011);
        series.modality = dataset.text(0x0008_0060);
        series.description = dataset.text(0x0008_103E);
    }
    let mut slices = 1;
    match Image::new(parsed, index, limits) {
        Ok(mut image) => {
            slices = image.slices.len();
            series.slices.append(&mut image.slices);
            for remark in image.remarks {
                if !series.remarks.contains(&remark) {
                    series.remarks.push(remark);
                }
            }
        }
        Err(error) => {
            series.refusal.get_or_insert(in_file(error, name));
        }
    }
    series.pictures += slices;
    Ok(slices)
}

fn load(mut files: Files, choice: Option<&str>, limits: &Limits) -> Result<Volume, VolumeError> {
    let Plan { slices, grid, patient_axes, voxel_type, voxel_count, notes } = plan(&mut files, choice, limits)?;
    // Slices by file and frame, to find the place of what comes.
    let mut places: Vec<(usize, u32, usize)> = slices.iter().enumerate().map(|(k, s)| (s.file, s.frame, k)).collect();
    places.sort_unstable();
    let mut target = Target::new(voxel_type, voxel_count, voxel_count / slices.len());
    let mut about = About { patient_axes, notes, ..About::default() };
    files.visit(&mut |index, name, reader| {
        let start = places.partition_point(|&(file, ..)| file < index);
        if places.get(start).is_none_or(|&(file, ..)| file != index) {
            return Ok(());
        }
        let mut fill = || {
            let Some(mut parsed) = parser::parse(&mut *reader)? else {
                return Err(VolumeError::malformed("data", "the file has changed while it was read"));
            };
            let image = Image::new(&parsed, index, limits)?;
            if slices[0].file == index {
                header::keep(&parsed.dataset, &mut about);
            }
            let Some(voxels) = parsed.voxels.take() else {
                return Err(VolumeError::malformed("PixelData", "missing"));
            };
            pixels::each_frame(&image, voxels, &mut |frame, stored| {
                let place = places.get(start + frame as usize).filter(|place| (place.0, place.1) == (index, frame));
                if let Some(&(.., k)) = place {
                    target.write(k, stored, slices[k].slope, slices[k].intercept);
                }
                Ok(())
            })
        };
        fill().map_err(|error| in_file(error, name))
    })?;
    Ok(Volume::new(grid, target.finish())?.with_about(about))
}

/// Says in which of many files something is wrong.
fn in_file(error: VolumeError, name: &str) -> VolumeError {
    let at = |message: String| if name.is_empty() { message } else { format!("{message} (in {})", excerpt(name)) };
    match error {
        VolumeError::Malformed { field, message } => VolumeError::Malformed { field, message: at(message) },
        VolumeError::Unsupported { field, message } => VolumeError::Unsupported { field, message: at(message) },
        other => other,
    }
}
