//! Voxels written as text.

use std::io::{BufRead, Read};

use super::error::excerpt;
use super::sample::{Sample, with_voxels};
use super::voxels::data_error;
use super::{VolumeError, Voxels};

/// Longest number: an `f64` may be written out in full.
const MAX_NUMBER_BYTES: usize = 2048;

impl Voxels {
    /// Reads exactly `count` more voxels written as numbers; an error names `field` if there are fewer, or if one is
    /// not of the type.
    pub(super) fn append_ascii(
        &mut self,
        field: &str,
        reader: &mut dyn BufRead,
        count: usize,
    ) -> Result<(), VolumeError> {
        with_voxels!(self, v => append(v, field, reader, count))
    }
}

/// Numbers with white space or commas between them.
fn append<T: Sample>(out: &mut Vec<T>, field: &str, reader: &mut dyn BufRead, count: usize) -> Result<(), VolumeError> {
    let separates = |byte: u8| byte.is_ascii_whitespace() || byte == b',';
    let mut bytes = reader.bytes();
    let mut number = String::new();
    let mut done = 0;
    while done < count {
        let byte = bytes.next().transpose().map_err(|e| data_error(field, e))?;
        match byte {
            Some(byte) if !separates(byte) => {
                number.push(char::from(byte));
                if number.len() > MAX_NUMBER_BYTES {
                    return Err(VolumeError::malformed(field, format!("{} is not a number", excerpt(&number))));
                }
            }
            None if number.is_empty() => {
                return Err(VolumeError::malformed(field, format!("truncated: expected {count} numbers, got {done}")));
            }
            _ if number.is_empty() => {}
            _ => {
                let value = number.parse().map_err(|_| {
                    let message = format!("{} at index {done} is not a value of the type", excerpt(&number));
                    VolumeError::malformed(field, message)
                })?;
                out.push(value);
                number.clear();
                done += 1;
            }
        }
    }
    Ok(())
}
