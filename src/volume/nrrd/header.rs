//! From the text of a header to what it means.

use std::collections::BTreeMap;
use std::io::BufRead;

use super::fields::{Fields, MAX_DATA_FILES, is_list};
use super::geometry;
use crate::volume::error::excerpt;
use crate::volume::{About, Endian, Grid, VolumeError, VoxelType};

/// A valid header: everything but the voxels.
#[derive(Clone, Debug, PartialEq)]
pub struct Header {
    /// Number of voxels and where they are, in left-posterior-superior space if the header names a patient space.
    pub grid: Grid,
    /// Type of the voxels.
    pub voxel_type: VoxelType,
    /// Byte order of the data; of no meaning for [`Encoding::Ascii`].
    pub endian: Endian,
    /// How voxels became bytes.
    pub encoding: Encoding,
    /// Where the data are.
    pub data: DataLocation,
    /// Lines to skip at the beginning of the data, or of each file, before decompression.
    pub line_skip: u64,
    /// Bytes to skip then, after decompression.
    pub byte_skip: ByteSkip,
    /// Key/value pairs (`key:=value`), as they are in the header.
    pub metadata: BTreeMap<String, String>,
}

/// How voxels became bytes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum Encoding {
    Raw,
    Gzip,
    Ascii,
}

/// Where the data of a header are.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum DataLocation {
    /// After the header's empty line.
    Attached,
    /// In these files, each with an equal share of the voxels, relative to the header's directory.
    Files(Vec<String>),
}

/// What comes before the data of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteSkip {
    /// So many bytes.
    Bytes(u64),
    /// As much as leaves exactly the data at the end (`byte skip: -1`).
    AllButData,
}

/// Reads a header and leaves the reader at the attached data, if there are any.
///
/// # Errors
/// Names the field that is missing, malformed or not supported; `magic` or `header` where there is none.
pub fn read_header(reader: &mut impl BufRead) -> Result<Header, VolumeError> {
    read_with_about(reader).map(|(header, _)| header)
}

/// [`read_header`], with its fields as text.
pub(super) fn read_with_about(reader: &mut impl BufRead) -> Result<(Header, About), VolumeError> {
    let fields = Fields::read(reader)?;
    let about = about(&fields);
    let voxel_type = voxel_type(fields.require("type")?)?;
    let encoding = encoding(fields.require("encoding")?)?;
    let grid = geometry::grid(&fields)?;
    let data = data_location(&fields)?;
    if data == DataLocation::Attached && !fields.ended_by_empty_line {
        return Err(VolumeError::malformed("header", "no empty line before the data, and no `data file`"));
    }
    let header = Header {
        grid,
        voxel_type,
        endian: endian(&fields, voxel_type, encoding)?,
        encoding,
        data,
        line_skip: fields.get("line skip").map_or(Ok(0), |text| number("line skip", text))?,
        byte_skip: byte_skip(fields.get("byte skip").unwrap_or("0"), encoding)?,
        metadata: fields.metadata,
    };
    Ok((header, about))
}

/// What the header says besides, and that a scalar volume does not show.
fn about(fields: &Fields) -> About {
    let mut about = About { patient_axes: geometry::is_patient_space(fields), ..About::default() };
    for (name, value) in &fields.in_order {
        about.field(name, value);
    }
    about
}

/// A whole number that is not negative; an error names `field`.
pub(super) fn number<T: std::str::FromStr>(field: &str, text: &str) -> Result<T, VolumeError> {
    text.parse().map_err(|_| VolumeError::malformed(field, format!("{} is not a whole number >= 0", excerpt(text))))
}

fn voxel_type(text: &str) -> Result<VoxelType, VolumeError> {
    let words: Vec<String> = text.split_whitespace().map(str::to_ascii_lowercase).collect();
    Ok(match words.join(" ").as_str() {
        "signed char" | "int8" | "int8_t" => VoxelType::I8,
        "uchar" | "unsigned char" | "uint8" | "uint8_t" => VoxelType::U8,
        "short" | "short int" | "signed short" | "signed short int" | "int16" | "int16_t" => VoxelType::I16,
        "ushort" | "unsigned short" | "unsigned short int" | "uint16" | "uint16_t" => VoxelType::U16,
        "int" | "signed int" | "int32" | "int32_t" => VoxelType::I32,
        "uint" | "unsigned int" | "uint32" | "uint32_t" => VoxelType::U32,
        "longlong"
        | "long long"
        | "long long int"
        | "signed long long"
        | "signed long long int"
        | "int64"
        | "int64_t" => VoxelType::I64,
        "ulonglong" | "unsigned long long" | "unsigned long long int" | "uint64" | "uint64_t" => VoxelType::U64,
        "float" => VoxelType::F32,
        "double" => VoxelType::F64,
        "block" => {
            return Err(VolumeError::unsupported("type", "`block` is not a number; expected a scalar type"));
        }
        _ => {
            return Err(VolumeError::malformed("type", format!("{} is not a type of the format", excerpt(text))));
        }
    })
}

fn encoding(text: &str) -> Result<Encoding, VolumeError> {
    match text.to_ascii_lowercase().as_str() {
        "raw" => Ok(Encoding::Raw),
        "gz" | "gzip" => Ok(Encoding::Gzip),
        "txt" | "text" | "ascii" => Ok(Encoding::Ascii),
        name @ ("hex" | "bz2" | "bzip2" | "zrl") => {
            Err(VolumeError::unsupported("encoding", format!("`{name}` is not read; expected raw, gzip or ascii")))
        }
        _ => {
            let message = format!("{} is not an encoding; expected raw, gzip or ascii", excerpt(text));
            Err(VolumeError::malformed("encoding", message))
        }
    }
}

fn endian(fields: &Fields, voxel_type: VoxelType, encoding: Encoding) -> Result<Endian, VolumeError> {
    match fields.get("endian").map(str::to_ascii_lowercase).as_deref() {
        Some("little") => Ok(Endian::Little),
        Some("big") => Ok(Endian::Big),
        Some(text) => Err(VolumeError::malformed("endian", format!("{} is neither `little` nor `big`", excerpt(text)))),
        None if voxel_type.bytes() == 1 || encoding == Encoding::Ascii => Ok(Endian::Little),
        None => Err(VolumeError::malformed("endian", format!("missing; voxels of type {voxel_type} need it"))),
    }
}

fn byte_skip(text: &str, encoding: Encoding) -> Result<ByteSkip, VolumeError> {
    if text != "-1" {
        Ok(ByteSkip::Bytes(number("byte skip", text)?))
    } else if encoding == Encoding::Raw {
        Ok(ByteSkip::AllButData)
    } else {
        Err(VolumeError::malformed("byte skip", "-1 is for encoding raw only"))
    }
}

/// `data file` is a name, `LIST [subdim]` with names on the lines that follow, or `pattern%d min max step [subdim]`.
/// With `subdim` or without, the files follow each other as the bytes of one file would.
fn data_location(fields: &Fields) -> Result<DataLocation, VolumeError> {
    let Some(text) = fields.get("data file") else {
        return Ok(DataLocation::Attached);
    };
    let names = if is_list(text) {
        fields.listed_files.clone()
    } else {
        expand_pattern(text)?.unwrap_or_else(|| vec![text.to_owned()])
    };
    if names.iter().any(String::is_empty) || names.is_empty() {
        return Err(VolumeError::malformed("data file", "no file is named"));
    }
    Ok(DataLocation::Files(names))
}

/// The names that `slice%03d.raw 1 100 1` stands for; `None` if this is not such a pattern.
fn expand_pattern(text: &str) -> Result<Option<Vec<String>>, VolumeError> {
    let words: Vec<&str> = text.split_whitespace().collect();
    let [pattern, numbers @ ..] = words.as_slice() else {
        return Ok(None);
    };
    let Some((before, conversion)) = pattern.split_once('%') else {
        return Ok(None);
    };
    let digits = conversion.bytes().take_while(u8::is_ascii_digit).count();
    let (width, after) = conversion.split_at(digits);
    let numbers: Option<Vec<i64>> = numbers.iter().map(|n| n.parse().ok()).collect();
    let (Some([min, max, step, ..]), Some(after)) = (numbers.as_deref(), after.strip_prefix('d')) else {
        let message = format!("{} is not `name%d.raw min max step` with one %d", excerpt(text));
        return Err(VolumeError::malformed("data file", message));
    };
    let zeros = width.starts_with('0');
    let width = if width.is_empty() { 0 } else { number::<usize>("data file", width)? };
    let count = max.checked_sub(*min).and_then(|span| span.checked_div(*step)).filter(|steps| *steps >= 0);
    let steps = count.filter(|steps| *steps < MAX_DATA_FILES as i64 && width <= 32).ok_or_else(|| {
        let message = format!("{} does not name 1 to {MAX_DATA_FILES} files", excerpt(text));
        VolumeError::malformed("data file", message)
    })?;
    let name = |i: i64| {
        let n = min + i * step;
        if zeros { format!("{before}{n:0width$}{after}") } else { format!("{before}{n:width$}{after}") }
    };
    Ok(Some((0..=steps).map(name).collect()))
}
