//! MetaImage, the format of ITK: `.mha` with its data, or `.mhd` with the name of a file of data.
//!
//! After <https://itk.org/Wiki/ITK/MetaIO/Documentation> and what ITK does:
//! - The world is the patient's left, posterior, superior. Rows of `TransformMatrix` are the directions of the axes.
//! - `AnatomicalOrientation` and `ElementToIntensityFunction...` change nothing.
//! - Spacing is `ElementSpacing`, else `ElementSize`, else 1. `DistanceUnits` other than millimetres are converted.

mod fields;
mod header;

use std::io::{BufRead, Read};

use flate2::bufread::{MultiGzDecoder, ZlibDecoder};

use header::{DataFile, Header};

use super::input::{Input, Stream, finish};
use super::voxels::data_error;
use super::{About, Limits, Shape, Volume, VolumeError, Voxels};

/// Bytes of a gzip stream, which some writers have instead of zlib.
const GZIP: [u8; 2] = [0x1f, 0x8b];

/// Whether a file begins with one of the fields that come first.
pub(super) fn magic(head: &[u8]) -> bool {
    ["ObjectType", "NDims", "Comment"].iter().any(|first| {
        let rest = head.strip_prefix(first.as_bytes()).map(<[u8]>::trim_ascii_start);
        rest.is_some_and(|rest| rest.starts_with(b"="))
    })
}

pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let (siblings, limits) = (input.siblings, input.limits);
    let mut stream = input.open()?;
    let (header, header_bytes) = Header::read(&mut stream.reader)?;
    let count = limits.check("DimSize", header.grid.dims, header.voxel_type)?;
    let mut voxels = Voxels::empty(header.voxel_type);
    match &header.data {
        DataFile::Local => {
            stream.length = stream.length.map(|length| length.saturating_sub(header_bytes));
            append(&mut voxels, stream, &header, count, limits)?;
        }
        DataFile::Beside(name) => {
            let field = "ElementDataFile";
            let siblings = siblings.ok_or_else(|| {
                VolumeError::unsupported(
                    field,
                    "the data are in another file: upload both in one zip or tar, or load the header by its path in \
                     the data directory",
                )
            })?;
            siblings.check(std::slice::from_ref(name), field)?;
            siblings.read(name, field, &mut |file| append(&mut voxels, file, &header, count, limits))?;
        }
    }
    let mut about = About { patient_axes: true, ..About::default() };
    header.describe(&mut about);
    Ok(Volume::new(header.grid, voxels)?.with_about(about))
}

pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    let (header, _) = Header::read(&mut input.open()?.reader)?;
    Ok(Shape::of(&header.grid, header.voxel_type))
}

/// Appends `count` voxels from where the data begin.
fn append(
    voxels: &mut Voxels,
    mut stream: Stream,
    header: &Header,
    count: usize,
    limits: &Limits,
) -> Result<(), VolumeError> {
    let field = "ElementDataFile";
    let expected = count as u64 * header.voxel_type.bytes();
    let skip = match header.skip {
        Some(skip) => skip,
        None => stream.length.and_then(|length| length.checked_sub(expected)).ok_or_else(|| {
            VolumeError::malformed("HeaderSize", format!("-1, but there are not the {expected} bytes of the voxels"))
        })?,
    };
    if skip > limits.max_bytes {
        let message = format!("{skip} bytes before the voxels are more than a volume may have");
        return Err(VolumeError::malformed("HeaderSize", message));
    }
    if !header.compressed && !header.ascii {
        stream.expect_bytes(field, skip, expected)?;
    }
    stream.skip("HeaderSize", skip)?;
    voxels.reserve(field, count)?;
    if header.ascii {
        voxels.append_ascii(field, &mut stream.reader, count)
    } else if header.compressed {
        let start = stream.reader.fill_buf().map_err(|e| data_error(field, e))?;
        let mut inflated: Box<dyn Read> = if start.starts_with(&GZIP) {
            Box::new(MultiGzDecoder::new(stream.reader))
        } else {
            Box::new(ZlibDecoder::new(stream.reader))
        };
        voxels.append(field, &mut inflated, count, header.endian)?;
        finish(&mut *inflated, field)
    } else {
        voxels.append(field, &mut stream.reader, count, header.endian)?;
        stream.finish(field)
    }
}
