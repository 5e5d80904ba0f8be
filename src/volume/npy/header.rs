//! The header of an array: magic, version, and a Python dictionary as text.

use std::io::{BufRead, Read};

use crate::volume::error::excerpt;
use crate::volume::stored::Stored;
use crate::volume::voxels::data_error;
use crate::volume::{Endian, VolumeError};

pub(super) const MAGIC: &[u8] = b"\x93NUMPY";

/// Longest dictionary: three entries of an array of numbers take about a hundred bytes.
const MAX_DICTIONARY: u64 = 1 << 16;

/// What a header says.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Header {
    /// Type as NumPy writes it.
    pub(super) descr: String,
    pub(super) stored: Stored,
    pub(super) endian: Endian,
    /// The first index runs fastest in the file, and not the last.
    pub(super) fortran_order: bool,
    pub(super) shape: Vec<u64>,
    /// Bytes before the data.
    pub(super) bytes: u64,
}

impl Header {
    /// Reads a header and leaves the reader at the data.
    ///
    /// # Errors
    /// Names `magic`, `version`, `header`, `descr`, `fortran_order` or `shape`.
    pub(super) fn read(reader: &mut dyn BufRead) -> Result<Self, VolumeError> {
        let preamble = take(reader, 8)?;
        if !preamble.starts_with(MAGIC) {
            return Err(VolumeError::malformed("magic", "not a NumPy array: it does not begin with \\x93NUMPY"));
        }
        let length_bytes = match preamble[6] {
            1 => 2,
            2 | 3 => 4,
            other => return Err(VolumeError::unsupported("version", format!("{other}; expected 1, 2 or 3"))),
        };
        let mut length = [0; 8];
        length[..length_bytes].copy_from_slice(&take(reader, length_bytes as u64)?);
        let length = u64::from_le_bytes(length);
        if length > MAX_DICTIONARY {
            let message = format!("{length} bytes long; expected at most {MAX_DICTIONARY}");
            return Err(VolumeError::malformed("header", message));
        }
        let text = take(reader, length)?;
        let dictionary = Dictionary::parse(&String::from_utf8_lossy(&text))?;
        let (stored, endian) = number_type(&dictionary.descr)?;
        Ok(Self {
            descr: dictionary.descr,
            stored,
            endian,
            fortran_order: dictionary.fortran_order,
            shape: dictionary.shape,
            bytes: 8 + length_bytes as u64 + length,
        })
    }

    /// Voxels along x, y and z.
    pub(super) fn dims(&self) -> Result<[u32; 3], VolumeError> {
        let mut shape = self.shape.as_slice();
        while let [1, rest @ ..] = shape
            && rest.len() >= 3
        {
            shape = rest;
        }
        while let [rest @ .., 1] = shape
            && rest.len() >= 3
        {
            shape = rest;
        }
        let [z, y, x] = *shape else {
            let message = format!("{:?} has {} axes; expected three, (z, y, x)", self.shape, self.shape.len());
            return Err(VolumeError::unsupported("shape", message));
        };
        let mut dims = [0; 3];
        for (n, size) in dims.iter_mut().zip([x, y, z]) {
            *n = u32::try_from(size).map_err(|_| VolumeError::TooLarge {
                field: "shape".to_owned(),
                unit: "voxels along an axis",
                needed: size.into(),
                limit: u32::MAX.into(),
            })?;
        }
        Ok(dims)
    }
}

fn take(reader: &mut dyn BufRead, count: u64) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    reader.take(count).read_to_end(&mut bytes).map_err(|e| data_error("header", e))?;
    if (bytes.len() as u64) < count {
        return Err(VolumeError::malformed("header", "truncated: the file ends inside of it"));
    }
    Ok(bytes)
}

fn number_type(descr: &str) -> Result<(Stored, Endian), VolumeError> {
    Stored::from_descr(descr).ok_or_else(|| {
        let message = format!(
            "{} is not read; expected bool, integers of 8 to 64 bits, float16, float32 or float64",
            excerpt(descr)
        );
        VolumeError::unsupported("descr", message)
    })
}

/// `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 4, 5), }`
struct Dictionary {
    descr: String,
    fortran_order: bool,
    shape: Vec<u64>,
}

impl Dictionary {
    fn parse(text: &str) -> Result<Self, VolumeError> {
        let wrong =
            || VolumeError::malformed("header", format!("{} is not a dictionary of an array", excerpt(text.trim())));
        let mut rest = text.trim().strip_prefix('{').ok_or_else(wrong)?.trim_start();
        let (mut descr, mut fortran_order, mut shape) = (None, None, None);
        while !rest.starts_with('}') {
            let (key, after) = quoted(rest).ok_or_else(wrong)?;
            let value = after.trim_start().strip_prefix(':').ok_or_else(wrong)?.trim_start();
            rest = match key {
                "descr" => {
                    if value.starts_with(['[', '(']) {
                        let message = "records of several values; expected one number per voxel";
                        return Err(VolumeError::unsupported("descr", message));
                    }
                    let (value, after) = quoted(value).ok_or_else(wrong)?;
                    descr = Some(value.to_owned());
                    after
                }
                "fortran_order" => {
                    let (value, after) = boolean(value).ok_or_else(wrong)?;
                    fortran_order = Some(value);
                    after
                }
                "shape" => {
                    let (value, after) = tuple(value).ok_or_else(wrong)?;
                    shape = Some(value);
                    after
                }
                _ => return Err(wrong()),
            }
            .trim_start();
            rest = match rest.strip_prefix(',') {
                Some(after) => after.trim_start(),
                None if rest.starts_with('}') => rest,
                None => return Err(wrong()),
            };
        }
        let missing = |field| VolumeError::malformed(field, "missing in the header");
        Ok(Self {
            descr: descr.ok_or_else(|| missing("descr"))?,
            fortran_order: fortran_order.ok_or_else(|| missing("fortran_order"))?,
            shape: shape.ok_or_else(|| missing("shape"))?,
        })
    }
}

/// A string and what follows it.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| matches!(c, '\'' | '"'))?;
    text[1..].split_once(quote)
}

fn boolean(text: &str) -> Option<(bool, &str)> {
    let (value, word) = if text.starts_with("True") { (true, "True") } else { (false, "False") };
    Some((value, text.strip_prefix(word)?))
}

/// Whole numbers in brackets; Python 2 wrote `3L`.
fn tuple(text: &str) -> Option<(Vec<u64>, &str)> {
    let (inside, after) = text.strip_prefix('(')?.split_once(')')?;
    let inside = inside.trim();
    let inside = inside.strip_suffix(',').unwrap_or(inside);
    let numbers = inside.split(',').filter(|n| !n.trim().is_empty()).take(33);
    let numbers: Option<Vec<u64>> = numbers.map(|n| n.trim().trim_end_matches('L').parse().ok()).collect();
    Some((numbers?, after))
}
