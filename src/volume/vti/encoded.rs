//! From encoded bytes to plain ones: base64 and compressed blocks.

use std::io::{self, BufRead, Read};

use flate2::bufread::ZlibDecoder;

use crate::volume::voxels::data_error;
use crate::volume::{Endian, VolumeError};

/// What comes before the next tag.
pub(super) struct UntilTag<R> {
    inner: R,
    /// Bytes of the inner buffer that are known to come before the tag: no byte is looked at twice.
    clean: usize,
}

impl<R> UntilTag<R> {
    pub(super) fn new(inner: R) -> Self {
        Self { inner, clean: 0 }
    }
}

impl<R: BufRead> Read for UntilTag<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let got = self.fill_buf()?.read(out)?;
        self.consume(got);
        Ok(got)
    }
}

impl<R: BufRead> BufRead for UntilTag<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let bytes = self.inner.fill_buf()?;
        if self.clean == 0 {
            self.clean = bytes.iter().position(|b| *b == b'<').unwrap_or(bytes.len());
        }
        Ok(&bytes[..self.clean])
    }

    fn consume(&mut self, amount: usize) {
        self.clean -= amount;
        self.inner.consume(amount);
    }
}

/// Decodes base64. Padding ends a part and not the whole: the counts before the data are often encoded apart.
pub(super) struct Base64<R> {
    inner: R,
    decoded: [u8; 3],
    /// Bytes of `decoded` that are still to be given out.
    left: std::ops::Range<usize>,
}

impl<R: BufRead> Base64<R> {
    pub(super) fn new(inner: R) -> Self {
        Self { inner, decoded: [0; 3], left: 0..0 }
    }

    /// Decodes four characters, white space apart; false at the end.
    fn decode(&mut self) -> io::Result<bool> {
        let mut word = 0_u32;
        let (mut characters, mut padding) = (0, 0);
        while characters < 4 {
            let Some(&byte) = self.inner.fill_buf()?.first() else { break };
            self.inner.consume(1);
            let six = match byte {
                b'A'..=b'Z' => byte - b'A',
                b'a'..=b'z' => byte - b'a' + 26,
                b'0'..=b'9' => byte - b'0' + 52,
                b'+' => 62,
                b'/' => 63,
                b'=' if characters >= 2 => {
                    padding += 1;
                    0
                }
                _ if byte.is_ascii_whitespace() => continue,
                _ => return Err(io::Error::new(io::ErrorKind::InvalidData, "not base64")),
            };
            if padding > 0 && byte != b'=' {
                return Err(io::Error::new(io::ErrorKind::InvalidData, "base64 goes on after its padding"));
            }
            word = word << 6 | u32::from(six);
            characters += 1;
        }
        match characters {
            0 => Ok(false),
            4 => {
                let [_, a, b, c] = word.to_be_bytes();
                self.decoded = [a, b, c];
                self.left = 0..3 - padding;
                Ok(true)
            }
            _ => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

impl<R: BufRead> Read for Base64<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let mut written = 0;
        while written < out.len() {
            if self.left.is_empty() && !self.decode()? {
                break;
            }
            for at in self.left.by_ref().take(out.len() - written) {
                out[written] = self.decoded[at];
                written += 1;
            }
        }
        Ok(written)
    }
}

/// Numbers of `bytes` bytes, 4 or 8.
pub(super) fn read_counts(
    reader: &mut dyn BufRead,
    bytes: usize,
    endian: Endian,
    count: u64,
) -> Result<Vec<u64>, VolumeError> {
    let mut counts = Vec::new();
    for _ in 0..count {
        let mut number = [0; 8];
        reader.read_exact(&mut number[..bytes]).map_err(|error| match error.kind() {
            io::ErrorKind::UnexpectedEof => {
                VolumeError::malformed("DataArray", "truncated: the data end before their lengths do")
            }
            _ => data_error("DataArray", error),
        })?;
        if endian == Endian::Big {
            number[..bytes].reverse();
        }
        counts.push(u64::from_le_bytes(number));
    }
    Ok(counts)
}

/// Blocks of zlib data, each of which gives so many bytes, as one stream.
pub(super) struct Blocks<'a> {
    reader: &'a mut dyn BufRead,
    compressed_sizes: std::vec::IntoIter<u64>,
    /// Bytes that every block but the last gives.
    size: u64,
    last_size: u64,
    block: Vec<u8>,
    /// Bytes of `block` that were given out.
    given: usize,
}

/// No deflate stream expands by more than 1032:1.
const MAX_INFLATION: u64 = 1032;

/// Longest block: VTK writes 32 KiB, and others rarely more than 1 MiB.
const MAX_BLOCK_BYTES: u64 = 1 << 28;

/// Most blocks, whose sizes are kept.
const MAX_BLOCKS: u64 = 1 << 22;

impl<'a> Blocks<'a> {
    /// Reads the table of sizes; an error names `DataArray` if the blocks do not give `expected` bytes.
    pub(super) fn read(
        reader: &'a mut dyn BufRead,
        count_bytes: usize,
        endian: Endian,
        expected: u64,
    ) -> Result<Self, VolumeError> {
        let counts = read_counts(reader, count_bytes, endian, 3)?;
        let (blocks, size, partial) = (counts[0], counts[1], counts[2]);
        let last_size = if partial == 0 { size } else { partial };
        let total = u128::from(blocks.saturating_sub(1)) * u128::from(size) + u128::from(last_size);
        if blocks == 0 || total != u128::from(expected) || size == 0 || last_size > size {
            let message = format!(
                "{blocks} blocks of {size} bytes, the last of {last_size}; expected {expected} bytes by the extent and \
                 the type"
            );
            return Err(VolumeError::malformed("DataArray", message));
        }
        if size.min(expected) > MAX_BLOCK_BYTES {
            let message = format!("blocks of {size} bytes; expected at most {MAX_BLOCK_BYTES}");
            return Err(VolumeError::unsupported("DataArray", message));
        }
        if blocks > MAX_BLOCKS {
            let message = format!("{blocks} blocks; expected at most {MAX_BLOCKS}");
            return Err(VolumeError::unsupported("DataArray", message));
        }
        let compressed_sizes = read_counts(reader, count_bytes, endian, blocks)?.into_iter();
        Ok(Self { reader, compressed_sizes, size, last_size, block: Vec::new(), given: 0 })
    }

    /// Unpacks the next block; false after the last one.
    fn next_block(&mut self) -> io::Result<bool> {
        let Some(compressed) = self.compressed_sizes.next() else { return Ok(false) };
        let size = if self.compressed_sizes.len() == 0 { self.last_size } else { self.size };
        let wrong = |message: String| io::Error::new(io::ErrorKind::InvalidData, message);
        if compressed.saturating_mul(MAX_INFLATION) < size {
            return Err(wrong(format!("a block of {compressed} bytes cannot give {size}")));
        }
        self.block.clear();
        self.given = 0;
        let mut source = (&mut *self.reader).take(compressed);
        // One byte more than announced is enough to see that there is more; asking for it also checks the sum.
        let got = ZlibDecoder::new(&mut source).take(size + 1).read_to_end(&mut self.block)? as u64;
        if got != size {
            return Err(wrong(format!("a block gives not the {size} bytes that it should")));
        }
        io::copy(&mut source, &mut io::sink())?;
        Ok(true)
    }
}

impl Read for Blocks<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        while self.given == self.block.len() {
            if !self.next_block()? {
                return Ok(0);
            }
        }
        let got = (&self.block[self.given..]).read(out)?;
        self.given += got;
        Ok(got)
    }
}
