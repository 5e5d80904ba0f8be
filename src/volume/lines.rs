//! Headers of lines.

use std::io::{BufRead, Read};

use super::VolumeError;
use super::voxels::data_error;

/// Bytes of a whole header.
const MAX_HEADER_BYTES: u64 = 1 << 20;

/// Bytes of one of its lines: some fields list whole processing histories.
const MAX_LINE_BYTES: u64 = 1 << 16;

/// The lines of a header, as long as it is not too long.
pub(super) struct Lines<'a, R> {
    reader: &'a mut R,
    left: u64,
}

impl<'a, R: BufRead> Lines<'a, R> {
    pub(super) fn new(reader: &'a mut R) -> Self {
        Self { reader, left: MAX_HEADER_BYTES }
    }

    /// Bytes of the lines so far, with their ends.
    pub(super) fn bytes(&self) -> u64 {
        MAX_HEADER_BYTES - self.left
    }

    /// The next line without its end; `None` at the end of the file.
    pub(super) fn next(&mut self) -> Result<Option<String>, VolumeError> {
        let mut line = Vec::new();
        let allowed = self.left.min(MAX_LINE_BYTES);
        // `Read::take` of the reference: the limit is the line's, the reader stays ours.
        let read = Read::take(&mut *self.reader, allowed)
            .read_until(b'\n', &mut line)
            .map_err(|e| data_error("header", e))? as u64;
        let ended = line.last() == Some(&b'\n');
        if !ended && read == allowed {
            let message = format!("longer than {MAX_HEADER_BYTES} bytes, or a line longer than {MAX_LINE_BYTES}");
            return Err(VolumeError::malformed("header", message));
        }
        self.left -= read;
        if read == 0 {
            return Ok(None);
        }
        // Headers are ASCII, but comments and descriptions come in any encoding.
        let text = String::from_utf8_lossy(&line);
        Ok(Some(text.trim_end_matches(['\n', '\r']).to_owned()))
    }
}
