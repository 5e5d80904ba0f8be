//! NIfTI-1 and NIfTI-2 in one file, after <https://nifti.nimh.nih.gov> (`nifti1.h`, `nifti2.h`).
//!
//! Read are three-dimensional volumes of every integer type and of `f32` and `f64`, in either byte order. Where the
//! format leaves room, nibabel decides:
//! - The sform wins over the qform, and without both the volume is centred, its first axis running to the left.
//! - A slope of 0, or one that is not finite, means that stored numbers are the values.
//! - A distance that is negative or 0 in `pixdim` counts as its absolute value, or as 1.
//!
//! Other than nibabel, metres and micrometres become millimetres, and the file's world (right, anterior, superior)
//! becomes left, posterior, superior.

mod geometry;
mod header;

use header::Header;

use super::input::Input;
use super::{About, Shape, Volume, VolumeError, Voxels};

/// Whether a file begins like a NIfTI header of either version, or like one of its predecessor.
pub(super) fn magic(head: &[u8]) -> bool {
    let at = |offset: usize, magic: &[u8]| head.get(offset..).is_some_and(|rest| rest.starts_with(magic));
    at(344, b"n+1\0") || at(344, b"ni1\0") || at(4, b"n+2\0") || at(4, b"ni2\0")
}

pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let limits = input.limits;
    let mut stream = input.open()?;
    let header = Header::read(&mut stream.reader)?;
    let (stored, scaling) = (header.stored_type, header.scaling);
    let voxel_type = scaling.result_type(stored);
    let count = limits.check("dim", header.dims, voxel_type)?;
    let mut about = About::default();
    header.describe(&mut about);
    let grid = geometry::grid(&header, &mut about)?;
    let skip = header.vox_offset - header.bytes;
    if skip > limits.max_bytes {
        let message = format!("{} bytes before the voxels are more than a volume may have", header.vox_offset);
        return Err(VolumeError::malformed("vox_offset", message));
    }
    stream.expect_bytes("data", header.vox_offset, count as u64 * stored.bytes())?;
    stream.skip("vox_offset", skip)?;
    let mut voxels = Voxels::empty(voxel_type);
    voxels.reserve("dim", count)?;
    scaling.append(&mut voxels, "data", &mut stream.reader, count, stored, header.endian)?;
    stream.finish("data")?;
    Ok(Volume::new(grid, voxels)?.with_about(about))
}

pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    let header = Header::read(&mut input.open()?.reader)?;
    let grid = geometry::grid(&header, &mut About::default())?;
    Ok(Shape::of(&grid, header.scaling.result_type(header.stored_type)))
}
