//! NRRD ("nearly raw raster data"), versions 1 to 5, after <https://teem.sourceforge.net/nrrd/format.html>.
//!
//! Read are three-dimensional scalar volumes (a fourth axis of one sample may come first or last) of every integer
//! and floating-point type, in encodings `raw`, `gzip` and `ascii`, with the data attached to the header or in
//! one or more files beside it.
//!
//! Where the format leaves room:
//! - World space is the patient's left-posterior-superior. `right-anterior-superior` is turned by negating x and y,
//!   `left-anterior-superior` by negating y; every other space (`scanner-xyz`, `3D-right-handed`, none) is taken as it
//!   is.
//! - `space directions` win over `spacings`. Without either, and where a spacing is NaN, the spacing is 1.
//! - Data beyond the last voxel are ignored.
//! - `old min` and `old max` do not rescale values; `measurement frame` and `space units` mean nothing to a scalar.
//! - A field that is not in the format is an error: it may be a misspelt one that matters.

mod data;
mod fields;
mod geometry;
mod header;
mod write;

use std::io::BufRead;

pub use header::{ByteSkip, DataLocation, Encoding, Header, read_header};
pub use write::{attached_header, attached_header_without_space};

use super::input::Input;
use super::siblings::Siblings;
use super::{Limits, Shape, Volume, VolumeError, Voxels};

/// Reads a volume from the `length` bytes of a header with or without attached data; `None` if that is not known.
///
/// `siblings` is `None` for a header that did not come from a directory, which therefore must have its data attached.
///
/// # Errors
/// Names the header field at fault, or `data`. Sizes beyond `limits` are refused before anything is allocated.
fn read(
    reader: impl BufRead,
    length: impl Into<Option<u64>>,
    siblings: Option<Siblings>,
    limits: &Limits,
) -> Result<Volume, VolumeError> {
    let length = length.into();
    let mut source = reader.take(length.unwrap_or(u64::MAX));
    let (header, about) = header::read_with_about(&mut source)?;
    let count = limits.check("sizes", header.grid.dims, header.voxel_type)?;
    let mut voxels = Voxels::empty(header.voxel_type);
    match &header.data {
        DataLocation::Attached => {
            if length.is_none() && header.byte_skip == ByteSkip::AllButData {
                let message = "-1 in a compressed file; unpack it, or say how many bytes to skip";
                return Err(VolumeError::unsupported("byte skip", message));
            }
            data::append("data", &mut voxels, source, &header, count, limits)?;
        }
        DataLocation::Files(names) => {
            let siblings = siblings.ok_or_else(|| {
                VolumeError::unsupported(
                    "data file",
                    "the data are in another file: upload both in one zip or tar, or load the header by its path in \
                     the data directory",
                )
            })?;
            data::append_files(names, siblings, &mut voxels, &header, count, limits)?;
        }
    }
    Ok(Volume::new(header.grid, voxels)?.with_about(about))
}

pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let (siblings, limits) = (input.siblings, input.limits);
    let mut stream = input.open()?;
    let volume = read(&mut stream.reader, stream.length, siblings, limits)?;
    stream.finish("data")?;
    Ok(volume)
}

pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    read_header(&mut input.open()?.reader).map(|header| Shape::of(&header.grid, header.voxel_type))
}
