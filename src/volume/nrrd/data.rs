//! From encoded bytes to voxels.

use std::io::{self, BufRead, Read, Take};

use flate2::bufread::MultiGzDecoder;

use super::{ByteSkip, Encoding, Header};
use crate::volume::siblings::Siblings;
use crate::volume::voxels::data_error;
use crate::volume::{Limits, VolumeError, Voxels};

/// No deflate stream expands by more than 1032:1.
const MAX_INFLATION: u64 = 1032;

/// Appends equal shares of the voxels from each file.
pub(super) fn append_files(
    names: &[String],
    siblings: Siblings,
    voxels: &mut Voxels,
    header: &Header,
    count: usize,
    limits: &Limits,
) -> Result<(), VolumeError> {
    if !count.is_multiple_of(names.len()) {
        let message = format!("{count} voxels do not divide into {} files", names.len());
        return Err(VolumeError::malformed("data file", message));
    }
    // All of them before the first is read: a missing one is found early.
    siblings.check(names, "data file")?;
    let share = count / names.len();
    names.iter().try_for_each(|name| {
        siblings.read(name, "data file", &mut |mut stream| {
            let length = stream.length.unwrap_or(u64::MAX);
            append("data file", voxels, (&mut stream.reader).take(length), header, share, limits)?;
            stream.finish("data file")
        })
    })
}

/// Appends `count` voxels from a source that holds them after the header's skips; `field` is what errors name.
pub(super) fn append<R: BufRead>(
    field: &str,
    voxels: &mut Voxels,
    mut source: Take<R>,
    header: &Header,
    count: usize,
    limits: &Limits,
) -> Result<(), VolumeError> {
    let expected = count as u64 * header.voxel_type.bytes();
    for _ in 0..header.line_skip {
        if source.skip_until(b'\n').map_err(|e| data_error(field, e))? == 0 {
            return Err(VolumeError::malformed("line skip", "more lines than there are"));
        }
    }
    let skip = match header.byte_skip {
        ByteSkip::Bytes(skip) => skip,
        ByteSkip::AllButData => source.limit().saturating_sub(expected),
    };
    // What compressed data to skip cost does not show in the size of the file.
    if header.encoding == Encoding::Gzip && skip > limits.max_bytes {
        return Err(VolumeError::TooLarge {
            field: "byte skip".to_owned(),
            unit: "bytes",
            needed: u128::from(skip),
            limit: limits.max_bytes,
        });
    }
    let most = match header.encoding {
        Encoding::Raw => source.limit(),
        Encoding::Gzip => source.limit().saturating_mul(MAX_INFLATION),
        // A digit and a separator each, but none after the last.
        Encoding::Ascii => source.limit().div_ceil(2).saturating_mul(header.voxel_type.bytes()),
    };
    if most.saturating_sub(skip) < expected {
        let got = most.saturating_sub(skip);
        let message = format!("truncated: expected {expected} bytes of voxels, got at most {got}");
        return Err(VolumeError::malformed(field, message));
    }
    voxels.reserve(field, count)?;
    match header.encoding {
        Encoding::Raw => {
            skip_bytes(&mut source, skip)?;
            voxels.append(field, &mut source, count, header.endian)
        }
        Encoding::Gzip => {
            let mut inflated = MultiGzDecoder::new(source);
            skip_bytes(&mut inflated, skip)?;
            voxels.append(field, &mut inflated, count, header.endian)?;
            // Asks for one byte more, because the checksum comes after the last.
            match inflated.read(&mut [0]) {
                Err(e) if e.kind() != io::ErrorKind::UnexpectedEof => Err(data_error(field, e)),
                Err(_) => Err(VolumeError::malformed(field, "truncated: the gzip checksum is missing")),
                Ok(_) => Ok(()),
            }
        }
        Encoding::Ascii => {
            skip_bytes(&mut source, skip)?;
            voxels.append_ascii(field, &mut source, count)
        }
    }
}

fn skip_bytes(reader: &mut impl Read, skip: u64) -> Result<(), VolumeError> {
    let skipped = io::copy(&mut reader.take(skip), &mut io::sink()).map_err(|e| data_error("byte skip", e))?;
    if skipped == skip {
        Ok(())
    } else {
        Err(VolumeError::malformed("byte skip", format!("{skip} bytes, but there are {skipped}")))
    }
}
