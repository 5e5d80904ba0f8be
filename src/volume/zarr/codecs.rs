//! The codecs between a chunk's numbers and its bytes.

use std::io::{self, Read};

use flate2::bufread::{MultiGzDecoder, ZlibDecoder};
use serde_json::{Map, Value};

use super::array::{Shard, named};
use super::blosc;
use super::json::{self, shown};
use crate::volume::error::excerpt;
use crate::volume::stored::Stored;
use crate::volume::voxels::data_error;
use crate::volume::wrap::Wrapping;
use crate::volume::{Endian, VolumeError};

/// Most codecs of a chunk.
const MAX_CODECS: usize = 16;

/// What packing may add to numbers that cannot be packed, besides as much again.
pub(super) const PACKING_BYTES: u64 = 4096;

/// How a chunk became bytes.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Chain {
    /// Byte order of the numbers.
    pub(super) endian: Endian,
    /// The array's axis that is the first of the stored chunk, the second, and so on; the last runs fastest.
    pub(super) order: Vec<usize>,
    /// From numbers to what is stored.
    packing: Vec<Packing>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Packing {
    Gzip,
    Zlib,
    Zstd,
    Blosc,
    /// A block of LZ4 after its unpacked length, as numcodecs writes it.
    Lz4,
    Crc32c,
}

impl Packing {
    fn from_name(name: &str) -> Option<Self> {
        Some(match name.strip_prefix("numcodecs.").unwrap_or(name) {
            "gzip" => Self::Gzip,
            "zlib" => Self::Zlib,
            "zstd" => Self::Zstd,
            "blosc" => Self::Blosc,
            "lz4" => Self::Lz4,
            "crc32c" => Self::Crc32c,
            _ => return None,
        })
    }

    fn name(self) -> &'static str {
        match self {
            Self::Gzip => "gzip",
            Self::Zlib => "zlib",
            Self::Zstd => "zstd",
            Self::Blosc => "blosc",
            Self::Lz4 => "lz4",
            Self::Crc32c => "crc32c",
        }
    }
}

/// All codecs of a Zarr 3 array.
pub(super) struct Codecs {
    pub(super) chain: Chain,
    /// Chunks within shards, if there are shards.
    pub(super) chunk: Option<Vec<u64>>,
    pub(super) shard: Option<Shard>,
}

/// The codecs of a `.zarray`.
pub(super) fn of_zarr_2(document: &Map<String, Value>, axes: usize, endian: Endian) -> Result<Chain, VolumeError> {
    let order = match document.get("order").and_then(Value::as_str) {
        None | Some("C") => (0..axes).collect(),
        Some("F") => (0..axes).rev().collect(),
        Some(other) => return Err(VolumeError::malformed("order", format!("{} is not C or F", excerpt(other)))),
    };
    let mut packing = Vec::new();
    let filters = document.get("filters").and_then(Value::as_array).map(Vec::as_slice).unwrap_or_default();
    let compressor = document.get("compressor").filter(|compressor| !compressor.is_null());
    if filters.len() > MAX_CODECS {
        return Err(VolumeError::unsupported("filters", format!("more than {MAX_CODECS}")));
    }
    for (field, codec) in filters.iter().map(|filter| ("filters", filter)).chain(compressor.map(|c| ("compressor", c)))
    {
        let id = codec.get("id").and_then(Value::as_str).unwrap_or_default();
        packing.push(Packing::from_name(id).ok_or_else(|| unknown(field, id))?);
    }
    Ok(Chain { endian, order, packing })
}

/// The codecs of a `zarr.json`: transpositions, then bytes or shards, then packing.
pub(super) fn of_zarr_3(codecs: Option<&Value>, axes: usize, stored: Stored) -> Result<Codecs, VolumeError> {
    let codecs = list("codecs", codecs)?;
    let mut order: Vec<usize> = (0..axes).collect();
    let (mut endian, mut sharded, mut packing) = (None, None, Vec::new());
    for codec in codecs {
        let (name, configuration) = named("codecs", Some(codec))?;
        let done = endian.is_some() || sharded.is_some();
        match name.as_str() {
            "transpose" if !done => order = transposed(&order, configuration.get("order"))?,
            "bytes" | "endian" if !done => endian = Some(byte_order(configuration.get("endian"), stored.bytes())?),
            "sharding_indexed" if !done => sharded = Some(shards(&configuration, axes, stored)?),
            "transpose" | "bytes" | "endian" | "sharding_indexed" => {
                return Err(VolumeError::malformed("codecs", format!("`{name}` is not where it may be")));
            }
            _ => {
                let codec = Packing::from_name(&name).ok_or_else(|| unknown("codecs", &name))?;
                if endian.is_none() {
                    let message = format!("`{name}` of whole shards, or before `bytes`, is not read");
                    return Err(VolumeError::unsupported("codecs", message));
                }
                packing.push(codec);
            }
        }
    }
    match (endian, sharded) {
        (Some(endian), None) => Ok(Codecs { chain: Chain { endian, order, packing }, chunk: None, shard: None }),
        (None, Some(sharded)) if order.iter().copied().eq(0..axes) => Ok(sharded),
        (None, Some(_)) => Err(VolumeError::unsupported("codecs", "shards that are transposed are not read")),
        _ => Err(VolumeError::malformed("codecs", "neither bytes nor sharding_indexed is among them")),
    }
}

fn shards(configuration: &Map<String, Value>, axes: usize, stored: Stored) -> Result<Codecs, VolumeError> {
    let chunk = json::sizes("chunk_shape", configuration.get("chunk_shape"), super::array::MAX_AXES)?;
    let inner = list("codecs", configuration.get("codecs"))?;
    if inner.iter().any(|codec| named("codecs", Some(codec)).is_ok_and(|(name, _)| name == "sharding_indexed")) {
        return Err(VolumeError::unsupported("codecs", "shards within shards are not read"));
    }
    let chain = of_zarr_3(configuration.get("codecs"), axes, stored)?.chain;
    let index_at_start = match configuration.get("index_location").and_then(Value::as_str) {
        None | Some("end") => false,
        Some("start") => true,
        Some(other) => {
            return Err(VolumeError::malformed("index_location", format!("{} is not start or end", excerpt(other))));
        }
    };
    let index = of_index(configuration.get("index_codecs"))?;
    let shard = Shard { index_at_start, ..index };
    Ok(Codecs { chain, chunk: Some(chunk), shard: Some(shard) })
}

/// The index of a shard has a size that is known: its codecs are bytes, and perhaps a checksum.
fn of_index(codecs: Option<&Value>) -> Result<Shard, VolumeError> {
    let (mut index_endian, mut index_has_sum) = (None, false);
    for codec in list("index_codecs", codecs)? {
        let (name, configuration) = named("index_codecs", Some(codec))?;
        match name.as_str() {
            "bytes" if index_endian.is_none() => index_endian = Some(byte_order(configuration.get("endian"), 8)?),
            "crc32c" if index_endian.is_some() && !index_has_sum => index_has_sum = true,
            _ => return Err(unknown("index_codecs", &name)),
        }
    }
    let index_endian = index_endian.ok_or_else(|| VolumeError::malformed("index_codecs", "without bytes"))?;
    Ok(Shard { index_at_start: false, index_endian, index_has_sum })
}

fn list<'v>(field: &str, codecs: Option<&'v Value>) -> Result<&'v [Value], VolumeError> {
    let list = codecs.and_then(Value::as_array).filter(|list| list.len() <= MAX_CODECS);
    list.map(Vec::as_slice)
        .ok_or_else(|| VolumeError::malformed(field, format!("expected a list of at most {MAX_CODECS} codecs")))
}

fn byte_order(endian: Option<&Value>, bytes: u64) -> Result<Endian, VolumeError> {
    match endian.and_then(Value::as_str) {
        Some("little") => Ok(Endian::Little),
        Some("big") => Ok(Endian::Big),
        // Single bytes have no order.
        None if bytes == 1 => Ok(Endian::Little),
        _ => Err(VolumeError::malformed("endian", "expected little or big")),
    }
}

/// The order of axes after one more transposition.
fn transposed(order: &[usize], by: Option<&Value>) -> Result<Vec<usize>, VolumeError> {
    let by = by.ok_or_else(|| VolumeError::malformed("order", "missing in transpose"))?;
    if let Some(name) = by.as_str().filter(|name| matches!(*name, "C" | "F")) {
        return Ok(if name == "C" { order.to_vec() } else { order.iter().rev().copied().collect() });
    }
    let axes = json::sizes("order", Some(by), super::array::MAX_AXES)?;
    let mut sorted = axes.clone();
    sorted.sort_unstable();
    if !sorted.into_iter().eq(0..order.len() as u64) {
        return Err(VolumeError::malformed("order", format!("{} is not an order of the axes", shown(by))));
    }
    Ok(axes.iter().map(|&axis| order[axis as usize]).collect())
}

fn unknown(field: &str, name: &str) -> VolumeError {
    let message = format!("{} is not read; expected gzip, zlib, zstd, blosc, lz4 or crc32c", excerpt(name));
    VolumeError::unsupported(field, message)
}

impl Chain {
    /// Names of the codecs that pack, in their order.
    pub(super) fn names(&self) -> String {
        let names: Vec<_> = self.packing.iter().map(|packing| packing.name()).collect();
        if names.is_empty() { "none".to_owned() } else { names.join(", ") }
    }

    /// Most bytes that a packed chunk of so many bytes may have: no packing doubles them.
    pub(super) fn most_packed(bytes: u64) -> u64 {
        bytes.saturating_mul(2).saturating_add(PACKING_BYTES)
    }

    /// The numbers' bytes, of which there are `expected`. No step unpacks to more than [`Chain::most_packed`].
    ///
    /// # Errors
    /// What is wrong with the bytes, as an error of input.
    pub(super) fn unpack(&self, packed: Vec<u8>, expected: u64) -> io::Result<Vec<u8>> {
        let mut bytes = packed;
        for (index, packing) in self.packing.iter().enumerate().rev() {
            let most = if index == 0 { expected } else { Self::most_packed(expected) };
            bytes = packing.unpack(bytes, most)?;
        }
        if bytes.len() as u64 == expected {
            return Ok(bytes);
        }
        Err(invalid(&format!("{} bytes of numbers; expected {expected}", bytes.len())))
    }
}

impl Packing {
    fn unpack(self, mut packed: Vec<u8>, most: u64) -> io::Result<Vec<u8>> {
        match self {
            Self::Gzip => read_all(MultiGzDecoder::new(&packed[..]), most),
            Self::Zlib => read_all(ZlibDecoder::new(&packed[..]), most),
            Self::Zstd => read_all(Wrapping::Zstd.unwrap(&packed[..]), most),
            Self::Blosc => blosc::unpack(&packed, most),
            Self::Lz4 => {
                let (length, block) = packed.split_first_chunk().ok_or(io::ErrorKind::UnexpectedEof)?;
                let length = u64::from(u32::from_le_bytes(*length));
                if length > most {
                    return Err(invalid("longer than it should be"));
                }
                let mut out = vec![0; length as usize];
                let got = lz4_flex::block::decompress_into(block, &mut out).map_err(|e| invalid(&e.to_string()))?;
                out.truncate(got);
                Ok(out)
            }
            Self::Crc32c => {
                let (bytes, sum) = packed.split_last_chunk().ok_or(io::ErrorKind::UnexpectedEof)?;
                if crc32c(bytes) != u32::from_le_bytes(*sum) {
                    return Err(invalid("its checksum does not match"));
                }
                packed.truncate(packed.len() - 4);
                Ok(packed)
            }
        }
    }
}

/// All bytes of a stream, which may be no more than `most`.
pub(super) fn read_all(reader: impl Read, most: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    // One byte more is enough to see that there is more; asking for it also checks the sum.
    reader.take(most.saturating_add(1)).read_to_end(&mut bytes)?;
    if bytes.len() as u64 > most { Err(invalid("unpacks to more than it should")) } else { Ok(bytes) }
}

pub(super) fn invalid(message: &str) -> io::Error {
    io::Error::new(io::ErrorKind::InvalidData, message)
}

/// An error of [`Chain::unpack`] with the chunk's key.
pub(super) fn in_chunk(key: &str, error: io::Error) -> VolumeError {
    match data_error("chunk", error) {
        VolumeError::Malformed { field, message } => {
            VolumeError::Malformed { field, message: format!("{}: {message}", excerpt(key)) }
        }
        other => other,
    }
}

/// CRC-32C (Castagnoli, RFC 3720 appendix B.4).
pub(super) fn crc32c(bytes: &[u8]) -> u32 {
    const TABLE: [u32; 256] = {
        let mut table = [0; 256];
        let mut byte = 0;
        while byte < 256 {
            let mut sum = byte as u32;
            let mut bit = 0;
            while bit < 8 {
                sum = if sum & 1 == 1 { sum >> 1 ^ 0x82f6_3b78 } else { sum >> 1 };
                bit += 1;
            }
            table[byte] = sum;
            byte += 1;
        }
        table
    };
    !bytes.iter().fold(!0, |sum, byte| sum >> 8 ^ TABLE[usize::from(sum as u8 ^ byte)])
}
