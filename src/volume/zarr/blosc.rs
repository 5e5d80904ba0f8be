//! Blosc 1, after <https://github.com/Blosc/c-blosc/blob/main/README_CHUNK_FORMAT.rst>: blocks whose bytes are
//! shuffled and packed.

use std::io;

use flate2::bufread::ZlibDecoder;

use super::codecs::{invalid, read_all};
use crate::volume::wrap::Wrapping;

const HEADER_BYTES: usize = 16;

/// Flags of a header.
const BYTES_SHUFFLED: u8 = 1;
const NOT_PACKED: u8 = 2;
const BITS_SHUFFLED: u8 = 4;
const NOT_SPLIT: u8 = 0x10;

/// Blocks of wider numbers, or of fewer of them, are not split into a part for each byte of a number.
const WIDEST_SPLIT: usize = 16;
const SHORTEST_SPLIT: usize = 128;

/// What the parts of a block are packed with.
#[derive(Clone, Copy)]
enum Packing {
    BloscLz,
    Lz4,
    Zlib,
    Zstd,
}

/// The bytes of a chunk, of which there may be no more than `most`.
pub(super) fn unpack(chunk: &[u8], most: u64) -> io::Result<Vec<u8>> {
    let (header, body) = chunk.split_first_chunk::<HEADER_BYTES>().ok_or(io::ErrorKind::UnexpectedEof)?;
    let [version, _, flags, number_bytes, ..] = *header;
    if version != 2 {
        return Err(invalid(&format!("blosc: version {version} of the format; expected 2")));
    }
    let size = number(header, 4).unwrap_or(0);
    let block_size = number(header, 8).unwrap_or(0);
    if size as u64 > most {
        return Err(invalid("unpacks to more than it should"));
    }
    if flags & NOT_PACKED != 0 {
        return body.get(..size).map(<[u8]>::to_vec).ok_or_else(|| io::ErrorKind::UnexpectedEof.into());
    }
    if size == 0 {
        return Ok(Vec::new());
    }
    if block_size == 0 || block_size > size {
        return Err(invalid(&format!("blosc: blocks of {block_size} bytes in a chunk of {size}")));
    }
    let packing = match flags >> 5 {
        0 => Packing::BloscLz,
        1 => Packing::Lz4,
        3 => Packing::Zlib,
        4 => Packing::Zstd,
        2 => return Err(invalid("blosc: snappy is not read; expected blosclz, lz4, zlib or zstd")),
        other => return Err(invalid(&format!("blosc: packing {other} is not known"))),
    };
    let number_bytes = usize::from(number_bytes).max(1);
    let mut out = vec![0; size];
    let mut shuffled = vec![0; block_size];
    for (index, block) in out.chunks_mut(block_size).enumerate() {
        let start = number(body, index * 4).unwrap_or(usize::MAX);
        let packed = chunk.get(start..).ok_or(io::ErrorKind::UnexpectedEof)?;
        let is_split = flags & NOT_SPLIT == 0
            && number_bytes <= WIDEST_SPLIT
            && block_size / number_bytes >= SHORTEST_SPLIT
            && block.len() == block_size;
        let parts = if is_split { number_bytes } else { 1 };
        let shuffled = &mut shuffled[..block.len()];
        unpack_parts(packed, packing, shuffled, parts)?;
        if flags & BYTES_SHUFFLED != 0 && number_bytes > 1 {
            unshuffle_bytes(shuffled, number_bytes, block);
        } else if flags & BITS_SHUFFLED != 0 {
            unshuffle_bits(shuffled, number_bytes, block);
        } else {
            block.copy_from_slice(shuffled);
        }
    }
    Ok(out)
}

/// A number of 32 bits.
fn number(bytes: &[u8], at: usize) -> Option<usize> {
    let bytes = bytes.get(at..)?.first_chunk()?;
    usize::try_from(u32::from_le_bytes(*bytes)).ok()
}

/// Fills a block from its parts of equal length, each after its packed length.
fn unpack_parts(mut packed: &[u8], packing: Packing, block: &mut [u8], parts: usize) -> io::Result<()> {
    let part_bytes = block.len() / parts;
    for part in block.chunks_mut(part_bytes.max(1)) {
        let length = number(packed, 0).ok_or(io::ErrorKind::UnexpectedEof)?;
        let bytes = packed.get(4..).and_then(|rest| rest.get(..length)).ok_or(io::ErrorKind::UnexpectedEof)?;
        packed = &packed[4 + length..];
        if length == part.len() {
            part.copy_from_slice(bytes);
            continue;
        }
        let got = match packing {
            Packing::BloscLz => blosclz(bytes, part).ok_or_else(|| invalid("blosc: damaged blosclz"))?,
            Packing::Lz4 => lz4_flex::block::decompress_into(bytes, part).map_err(|e| invalid(&e.to_string()))?,
            Packing::Zlib => copy(&read_all(ZlibDecoder::new(bytes), part.len() as u64)?, part),
            Packing::Zstd => copy(&read_all(Wrapping::Zstd.unwrap(bytes), part.len() as u64)?, part),
        };
        if got != part.len() {
            return Err(invalid(&format!("blosc: a block gives {got} bytes; expected {}", part.len())));
        }
    }
    Ok(())
}

/// Copies as many bytes as there are; there is room for them.
fn copy(from: &[u8], to: &mut [u8]) -> usize {
    to[..from.len()].copy_from_slice(from);
    from.len()
}

/// Unpacks a kind of LZ77: a byte below 32 is a run of literals, one above a match at a distance of up to 13 bits, or
/// of 16 more. `None` if it is damaged.
fn blosclz(packed: &[u8], out: &mut [u8]) -> Option<usize> {
    const FAR: usize = 31 << 8;
    const FARTHEST_SHORT: usize = 8191;
    let mut bytes = packed.iter().copied().map(usize::from);
    // The first byte is of literals in any case.
    let mut control = bytes.next()? & 31;
    let mut at = 0;
    loop {
        if control < 32 {
            for _ in 0..=control {
                *out.get_mut(at)? = bytes.next()? as u8;
                at += 1;
            }
        } else {
            let mut length = (control >> 5) + 2;
            if length == 9 {
                loop {
                    let more = bytes.next()?;
                    length += more;
                    if more < 255 {
                        break;
                    }
                }
            }
            let (high, low) = ((control & 31) << 8, bytes.next()?);
            let distance = if (high, low) == (FAR, 255) {
                (bytes.next()? << 8) + bytes.next()? + FARTHEST_SHORT + 1
            } else {
                high + low + 1
            };
            let start = at.checked_sub(distance)?;
            if length > out.len() - at {
                return None;
            }
            // Byte by byte: what is copied may be what was just written.
            for from in start..start + length {
                out[at] = out[from];
                at += 1;
            }
        }
        match bytes.next() {
            Some(next) => control = next,
            None => return Some(at),
        }
    }
}

/// From the first bytes of all numbers, then the second ones, and so on, to numbers.
fn unshuffle_bytes(shuffled: &[u8], number_bytes: usize, out: &mut [u8]) {
    let count = out.len() / number_bytes;
    for (i, number) in out.chunks_exact_mut(number_bytes).enumerate() {
        for (byte, plane) in number.iter_mut().zip(shuffled.chunks_exact(count)) {
            *byte = plane[i];
        }
    }
    let whole = count * number_bytes;
    out[whole..].copy_from_slice(&shuffled[whole..]);
}

/// The same for bits; numbers that do not fill bytes of bits are not shuffled.
fn unshuffle_bits(shuffled: &[u8], number_bytes: usize, out: &mut [u8]) {
    let count = out.len() / number_bytes;
    if !count.is_multiple_of(8) || count == 0 {
        out.copy_from_slice(shuffled);
        return;
    }
    let (whole, plane_bytes) = (count * number_bytes, count / 8);
    out[..whole].fill(0);
    for (plane, bits) in shuffled[..whole].chunks_exact(plane_bytes).enumerate() {
        let (byte, bit) = (plane / 8, plane % 8);
        for (eight, bits) in bits.iter().enumerate() {
            for i in 0..8 {
                out[(eight * 8 + i) * number_bytes + byte] |= (bits >> i & 1) << bit;
            }
        }
    }
    out[whole..].copy_from_slice(&shuffled[whole..]);
}
