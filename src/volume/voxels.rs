//! Voxel values in the type they were loaded as.

use std::borrow::Cow;
use std::fmt;
use std::io::{self, Read};
use std::ops::Range;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::VolumeError;
use super::sample::{Sample, with_voxels};

/// Type of a voxel, by its name in the API.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum VoxelType {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    I64,
    F32,
    F64,
}

/// Voxel values, x fastest, in native byte order.
#[derive(Clone, Debug, PartialEq)]
#[allow(missing_docs)]
pub enum Voxels {
    U8(Vec<u8>),
    I8(Vec<i8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    U32(Vec<u32>),
    I32(Vec<i32>),
    U64(Vec<u64>),
    I64(Vec<i64>),
    F32(Vec<f32>),
    F64(Vec<f64>),
}

/// Byte order of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[allow(missing_docs)]
pub enum Endian {
    Little,
    Big,
}

impl Endian {
    /// The byte order of this machine.
    pub const NATIVE: Self = if cfg!(target_endian = "big") { Self::Big } else { Self::Little };
}

impl VoxelType {
    /// Every type.
    pub const ALL: [Self; 10] =
        [Self::U8, Self::I8, Self::U16, Self::I16, Self::U32, Self::I32, Self::U64, Self::I64, Self::F32, Self::F64];

    /// Bytes of one voxel.
    pub fn bytes(self) -> u64 {
        match self {
            Self::U8 | Self::I8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::U32 | Self::I32 | Self::F32 => 4,
            Self::U64 | Self::I64 | Self::F64 => 8,
        }
    }

    /// Name in the API: `u8`, `i16`, `f32`, ...
    pub fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F32 => "f32",
            Self::F64 => "f64",
        }
    }

    /// Whether values are whole numbers.
    pub fn is_integer(self) -> bool {
        !matches!(self, Self::F32 | Self::F64)
    }
}

impl fmt::Display for VoxelType {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// What one parallel pass over the voxels finds out.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VoxelStatistics {
    /// Lowest and highest value that is not NaN; `None` if there is no such value.
    pub range: Option<[f64; 2]>,
    /// How many voxels are NaN.
    pub nan_count: u64,
}

impl Voxels {
    /// No voxels yet of the given type.
    pub(super) fn empty(voxel_type: VoxelType) -> Self {
        match voxel_type {
            VoxelType::U8 => Self::U8(Vec::new()),
            VoxelType::I8 => Self::I8(Vec::new()),
            VoxelType::U16 => Self::U16(Vec::new()),
            VoxelType::I16 => Self::I16(Vec::new()),
            VoxelType::U32 => Self::U32(Vec::new()),
            VoxelType::I32 => Self::I32(Vec::new()),
            VoxelType::U64 => Self::U64(Vec::new()),
            VoxelType::I64 => Self::I64(Vec::new()),
            VoxelType::F32 => Self::F32(Vec::new()),
            VoxelType::F64 => Self::F64(Vec::new()),
        }
    }

    /// Voxels from a file's bytes; an error names `voxels` if the bytes are not a whole number of them.
    pub fn from_bytes(voxel_type: VoxelType, endian: Endian, bytes: &[u8]) -> Result<Self, VolumeError> {
        let size = voxel_type.bytes() as usize;
        if !bytes.len().is_multiple_of(size) {
            let message = format!("{} bytes are not a whole number of {voxel_type} voxels", bytes.len());
            return Err(VolumeError::malformed("voxels", message));
        }
        let mut voxels = Self::empty(voxel_type);
        let count = bytes.len() / size;
        voxels.reserve("voxels", count)?;
        voxels.append("voxels", &mut &bytes[..], count, endian)?;
        Ok(voxels)
    }

    /// Room for `count` more voxels; the memory is touched only as they arrive.
    pub(super) fn reserve(&mut self, field: &str, count: usize) -> Result<(), VolumeError> {
        let reserved = with_voxels!(self, v => v.try_reserve_exact(count));
        reserved.map_err(|_| VolumeError::io(field, io::ErrorKind::OutOfMemory.into()))
    }

    /// Reads exactly `count` more voxels; an error names `field` if the reader ends before that.
    pub(super) fn append(
        &mut self,
        field: &str,
        reader: &mut dyn Read,
        count: usize,
        endian: Endian,
    ) -> Result<(), VolumeError> {
        with_voxels!(self, v => append(v, field, reader, count, endian))
    }

    /// Copies voxels of the same type over those from `to` on. Panics beyond either's `len`.
    pub(super) fn copy_row(&mut self, to: usize, from: &Self, range: Range<usize>) {
        macro_rules! copy {
            ($($variant:ident),*) => {
                match (self, from) {
                    $((Self::$variant(to_all), Self::$variant(all)) => {
                        to_all[to..to + range.len()].copy_from_slice(&all[range]);
                    })*
                    _ => unreachable!("both are of one type"),
                }
            };
        }
        copy!(U8, I8, U16, I16, U32, I32, U64, I64, F32, F64);
    }

    /// Number of voxels.
    pub fn len(&self) -> usize {
        with_voxels!(self, v => v.len())
    }

    /// Whether there are no voxels.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Type of the voxels.
    pub fn voxel_type(&self) -> VoxelType {
        match self {
            Self::U8(_) => VoxelType::U8,
            Self::I8(_) => VoxelType::I8,
            Self::U16(_) => VoxelType::U16,
            Self::I16(_) => VoxelType::I16,
            Self::U32(_) => VoxelType::U32,
            Self::I32(_) => VoxelType::I32,
            Self::U64(_) => VoxelType::U64,
            Self::I64(_) => VoxelType::I64,
            Self::F32(_) => VoxelType::F32,
            Self::F64(_) => VoxelType::F64,
        }
    }

    /// Value of a voxel; 64-bit integers beyond 2^53 are rounded, NaN stays NaN. Panics beyond `len`.
    pub fn value(&self, index: usize) -> f64 {
        with_voxels!(self, v => v[index].to_f64())
    }

    /// Bytes of host memory that the voxels fill.
    pub fn bytes(&self) -> u64 {
        self.len() as u64 * self.voxel_type().bytes()
    }

    /// The voxels as little-endian bytes; no copy on a little-endian machine.
    pub fn little_endian_bytes(&self) -> Cow<'_, [u8]> {
        let native: &[u8] = with_voxels!(self, v => bytemuck::cast_slice(v));
        match Endian::NATIVE {
            Endian::Little => Cow::Borrowed(native),
            Endian::Big => {
                let mut bytes = native.to_vec();
                reverse_each(&mut bytes, self.voxel_type().bytes() as usize);
                Cow::Owned(bytes)
            }
        }
    }

    /// The voxels of a range as little-endian bytes. Panics beyond `len`.
    pub fn little_endian_range(&self, voxels: Range<usize>) -> Vec<u8> {
        let mut bytes = with_voxels!(self, v => bytemuck::cast_slice::<_, u8>(&v[voxels]).to_vec());
        if Endian::NATIVE == Endian::Big {
            reverse_each(&mut bytes, self.voxel_type().bytes() as usize);
        }
        bytes
    }

    /// Value range and NaN count; an infinite value is an error that names `voxels` and its index.
    pub fn statistics(&self) -> Result<VoxelStatistics, VolumeError> {
        with_voxels!(self, v => statistics(v))
    }
}

/// Large enough that rayon's bookkeeping vanishes, small enough to share a small volume between threads.
const CHUNK: usize = 1 << 16;

fn append<T: Sample>(
    out: &mut Vec<T>,
    field: &str,
    reader: &mut dyn Read,
    count: usize,
    endian: Endian,
) -> Result<(), VolumeError> {
    let size = size_of::<T>();
    let mut done = 0;
    while done < count {
        let start = out.len();
        // Zeroing chunk by chunk touches only memory for which there are data: a short file that claims to be
        // large costs what it holds.
        out.resize(start + CHUNK.min(count - done), T::zeroed());
        let bytes: &mut [u8] = bytemuck::cast_slice_mut(&mut out[start..]);
        let got = read_full(field, reader, bytes)?;
        if got < bytes.len() {
            let message = format!("truncated: expected {} bytes, got {}", count * size, done * size + got);
            return Err(VolumeError::malformed(field, message));
        }
        if endian != Endian::NATIVE {
            reverse_each(bytes, size);
        }
        done += out.len() - start;
    }
    Ok(())
}

/// Fills `bytes` as far as the reader goes, and says how far that was.
fn read_full(field: &str, reader: &mut dyn Read, bytes: &mut [u8]) -> Result<usize, VolumeError> {
    let mut got = 0;
    while got < bytes.len() {
        match reader.read(&mut bytes[got..]) {
            Ok(0) => break,
            Ok(n) => got += n,
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            // A compressed stream that stops in the middle.
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => break,
            Err(e) => return Err(data_error(field, e)),
        }
    }
    Ok(got)
}

/// What decompressors report as bad input is the file's fault; the rest is the system's.
pub(super) fn data_error(field: &str, error: io::Error) -> VolumeError {
    match error.kind() {
        io::ErrorKind::InvalidInput | io::ErrorKind::InvalidData | io::ErrorKind::UnexpectedEof => {}
        _ if error.raw_os_error().is_some() => return VolumeError::io(field, error),
        // Decoders have kinds of their own for what they cannot read.
        _ => {}
    }
    VolumeError::malformed(field, format!("corrupt compressed data: {error}"))
}

pub(super) fn reverse_each(bytes: &mut [u8], size: usize) {
    if size > 1 {
        bytes.chunks_exact_mut(size).for_each(<[u8]>::reverse);
    }
}

/// [`VoxelStatistics`] of a chunk in the voxels' own type, before the infinite are refused.
struct ChunkStatistics<T> {
    range: Option<(T, T)>,
    nan_count: u64,
    first_infinite: Option<usize>,
}

fn statistics<T: Sample>(voxels: &[T]) -> Result<VoxelStatistics, VolumeError> {
    let total = voxels
        .par_chunks(CHUNK)
        .enumerate()
        .map(|(chunk, values)| chunk_statistics(values, chunk * CHUNK))
        .reduce_with(|a, b| ChunkStatistics {
            range: match (a.range, b.range) {
                (Some(a), Some(b)) => Some((if b.0 < a.0 { b.0 } else { a.0 }, if b.1 > a.1 { b.1 } else { a.1 })),
                (a, b) => a.or(b),
            },
            nan_count: a.nan_count + b.nan_count,
            // The chunks come in order, so the left one's is the first.
            first_infinite: a.first_infinite.or(b.first_infinite),
        });
    let Some(total) = total else {
        return Ok(VoxelStatistics { range: None, nan_count: 0 });
    };
    if let Some(index) = total.first_infinite {
        return Err(VolumeError::malformed("voxels", format!("infinite value at index {index}")));
    }
    let range = total.range.map(|(lo, hi)| [lo.to_f64(), hi.to_f64()]);
    Ok(VoxelStatistics { range, nan_count: total.nan_count })
}

fn chunk_statistics<T: Sample>(values: &[T], first_index: usize) -> ChunkStatistics<T> {
    let mut nan_count = 0;
    let mut range = None;
    if let Some(&first) = values.iter().find(|v| !v.to_f64().is_nan()) {
        let (mut lo, mut hi) = (first, first);
        for &v in values {
            // Comparisons with NaN are false, so NaN changes neither end.
            if v < lo {
                lo = v;
            }
            if v > hi {
                hi = v;
            }
            nan_count += u64::from(v.to_f64().is_nan());
        }
        range = Some((lo, hi));
    } else {
        nan_count = values.len() as u64;
    }
    let infinite = range.is_some_and(|(lo, hi)| lo.to_f64().is_infinite() || hi.to_f64().is_infinite());
    let first_infinite =
        if infinite { values.iter().position(|v| v.to_f64().is_infinite()).map(|i| first_index + i) } else { None };
    ChunkStatistics { range, nan_count, first_infinite }
}
