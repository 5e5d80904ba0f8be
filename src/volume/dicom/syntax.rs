//! Transfer syntaxes (PS3.5 section 10): how a data set and its voxels became bytes.

use crate::volume::error::excerpt;
use crate::volume::{Endian, VolumeError};

/// How a file's data set is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Syntax {
    /// Whether each element says its representation.
    pub(super) explicit: bool,
    /// Byte order of numbers.
    pub(super) endian: Endian,
    /// Whether all after the meta information is deflated.
    pub(super) deflated: bool,
    /// What the voxels are packed with.
    pub(super) packing: Packing,
}

/// What voxels are packed with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Packing {
    /// Nothing, all frames one after the other.
    Native,
    /// Nothing, each frame in a fragment.
    Encapsulated,
    /// RLE Lossless.
    Rle,
    /// JPEG, lossless or not.
    Jpeg,
    /// JPEG 2000, lossless or not.
    Jpeg2000,
    /// Something that is not read, by its name.
    NotRead(&'static str),
}

/// Of a file without meta information, or a data set within one.
pub(super) const fn plain(explicit: bool, endian: Endian) -> Syntax {
    Syntax { explicit, endian, deflated: false, packing: Packing::Native }
}

/// The syntax of a `TransferSyntaxUID`.
///
/// # Errors
/// Unsupported `TransferSyntaxUID` if the data set itself cannot be read; voxels that cannot are the matter of
/// whoever wants them.
pub(super) fn from_uid(uid: &str) -> Result<Syntax, VolumeError> {
    let little = plain(true, Endian::Little);
    let packed = |packing| Syntax { packing, ..little };
    Ok(match uid {
        "1.2.840.10008.1.2" => plain(false, Endian::Little),
        "1.2.840.10008.1.2.1" => little,
        "1.2.840.10008.1.2.1.99" => Syntax { deflated: true, ..little },
        "1.2.840.10008.1.2.2" => plain(true, Endian::Big),
        "1.2.840.10008.1.2.1.98" => packed(Packing::Encapsulated),
        "1.2.840.10008.1.2.5" => packed(Packing::Rle),
        "1.2.840.10008.1.2.4.50" | "1.2.840.10008.1.2.4.51" | "1.2.840.10008.1.2.4.57" | "1.2.840.10008.1.2.4.70" => {
            packed(Packing::Jpeg)
        }
        "1.2.840.10008.1.2.4.80" | "1.2.840.10008.1.2.4.81" => packed(Packing::NotRead("JPEG-LS")),
        "1.2.840.10008.1.2.4.90" | "1.2.840.10008.1.2.4.91" => packed(Packing::Jpeg2000),
        "1.2.840.10008.1.2.4.92" | "1.2.840.10008.1.2.4.93" => packed(Packing::NotRead("JPEG 2000 part 2")),
        "1.2.840.10008.1.2.4.201" | "1.2.840.10008.1.2.4.202" | "1.2.840.10008.1.2.4.203" => {
            packed(Packing::NotRead("High-Throughput JPEG 2000"))
        }
        "1.2.840.10008.1.2.4.110" | "1.2.840.10008.1.2.4.111" | "1.2.840.10008.1.2.4.112" => {
            packed(Packing::NotRead("JPEG XL"))
        }
        _ if uid.starts_with("1.2.840.10008.1.2.4.10") => packed(Packing::NotRead("video")),
        _ => {
            let message = format!("{} is not read; {EXPECTED}", excerpt(uid));
            return Err(VolumeError::unsupported("TransferSyntaxUID", message));
        }
    })
}

/// What is read, for messages.
pub(super) const EXPECTED: &str = "expected uncompressed voxels, RLE, JPEG (baseline or lossless) or JPEG 2000";
