//! From chunks to their places in the volume.

use bytemuck::Pod;

use super::array::{Array, Fill, product};
use super::codecs::{Chain, PACKING_BYTES, crc32c, in_chunk};
use super::store::Store;
use crate::volume::error::excerpt;
use crate::volume::sample::with_voxels;
use crate::volume::stored::Stored;
use crate::volume::voxels::reverse_each;
use crate::volume::{Endian, Limits, VolumeError, Voxels};

/// Most chunks that are looked for, and most of a shard.
const MAX_CHUNKS: u64 = 1 << 20;

/// Most bytes of a chunk.
const MAX_CHUNK_BYTES: u64 = 1 << 30;

/// Bytes decoded in all, as a multiple of the largest volume: chunks reach beyond its edges, and hold what is of other
/// channels.
const DECODED_PER_VOLUME_BYTE: u64 = 16;

/// Offset and length of a chunk that is not in its shard.
const MISSING: u64 = u64::MAX;

/// Bytes of a shard's index for each chunk.
const ENTRY_BYTES: u64 = 16;

/// The part of an array that is the volume.
#[derive(Clone, Debug)]
pub(super) struct Selection {
    /// Axes of the array that are x, y and z.
    pub(super) space: [usize; 3],
    /// Index along every axis; of those of space 0.
    pub(super) at: Vec<u64>,
    /// Voxels along x, y and z.
    pub(super) dims: [u32; 3],
}

/// Places of chunks, from the first one that holds voxels to the last, along each axis of the array.
type Ranges = Vec<(u64, u64)>;

impl Selection {
    fn chunks(&self, array: &Array, sizes: &[u64]) -> Ranges {
        let range = |axis: usize| match array.shape[axis].div_ceil(sizes[axis]) {
            count if self.space.contains(&axis) => (0, count),
            _ => (self.at[axis] / sizes[axis], self.at[axis] / sizes[axis] + 1),
        };
        (0..array.shape.len()).map(range).collect()
    }
}

/// Reads every chunk that holds voxels; what is in none has the array's fill value.
/// `begun` is told, before each chunk, how many there are.
///
/// # Errors
/// Names `chunks` if they are too many or too large, or none of them is there, and `chunk` if one is damaged.
pub(super) fn read(
    store: &mut Store,
    array: &Array,
    selection: &Selection,
    limits: &Limits,
    mut begun: impl FnMut(u64) -> Result<(), VolumeError>,
) -> Result<Voxels, VolumeError> {
    let count = limits.check("shape", selection.dims, array.stored.voxel_type())?;
    check(array, selection, limits)?;
    let mut target = Target { array, selection, count, voxels: Voxels::empty(array.stored.voxel_type()) };
    let ranges = selection.chunks(array, &array.outer);
    let mut coordinates: Vec<u64> = ranges.iter().map(|range| range.0).collect();
    let chunks = ranges.iter().map(|range| range.1 - range.0).product();
    loop {
        begun(chunks)?;
        let key = array.key(&coordinates);
        let origin: Vec<u64> = coordinates.iter().zip(&array.outer).map(|(c, size)| c * size).collect();
        if array.shard.is_some() {
            target.shard(store, &key, &origin)?;
        } else if let Some(packed) = store.read(&key, most_packed(array))? {
            target.chunk(&key, packed, &origin)?;
        }
        if !next(&mut coordinates, &ranges) {
            break;
        }
    }
    if target.voxels.is_empty() {
        let message = format!("none of its chunks is there, such as {}", excerpt(&array.key(&coordinates)));
        return Err(VolumeError::malformed("chunks", message));
    }
    Ok(target.voxels)
}

/// Counts through all coordinates within ranges, the last axis fastest; false after the last, which is kept.
fn next(coordinates: &mut [u64], ranges: &Ranges) -> bool {
    for axis in (0..ranges.len()).rev() {
        if coordinates[axis] + 1 < ranges[axis].1 {
            coordinates[axis] += 1;
            for later in axis + 1..ranges.len() {
                coordinates[later] = ranges[later].0;
            }
            return true;
        }
    }
    false
}

fn most_packed(array: &Array) -> u64 {
    Chain::most_packed(array.chunk_bytes() as u64)
}

/// Bounds memory and time by what the metadata say, before any chunk is looked for.
fn check(array: &Array, selection: &Selection, limits: &Limits) -> Result<(), VolumeError> {
    let too_large = |unit, needed, limit| Err(VolumeError::TooLarge { field: "chunks".into(), unit, needed, limit });
    let (bytes, limit) = (array.chunk_bytes(), limits.max_bytes.min(MAX_CHUNK_BYTES));
    if bytes > u128::from(limit) {
        return too_large("bytes in a chunk", bytes, limit);
    }
    let per_shard = product(&array.chunks_per_shard());
    let all: Vec<u64> = selection.chunks(array, &array.chunk).iter().map(|(first, end)| end - first).collect();
    let all = product(&all);
    if per_shard.max(all) > u128::from(MAX_CHUNKS) {
        return too_large("chunks", per_shard.max(all), MAX_CHUNKS);
    }
    let most = limits.max_bytes.saturating_mul(DECODED_PER_VOLUME_BYTE);
    if bytes * all > u128::from(most) {
        return too_large("bytes in all chunks", bytes * all, most);
    }
    Ok(())
}

/// A volume that is filled.
struct Target<'a> {
    array: &'a Array,
    selection: &'a Selection,
    count: usize,
    /// Empty before the first chunk has come.
    voxels: Voxels,
}

impl Target<'_> {
    /// Reads the chunks of a shard, in the order in which they are in it.
    fn shard(&mut self, store: &mut Store, key: &str, origin: &[u64]) -> Result<(), VolumeError> {
        let array = self.array;
        let per_shard = array.chunks_per_shard();
        let Some(entries) = index(store, array, key, &per_shard)? else { return Ok(()) };
        let mut wanted = Vec::new();
        let ranges: Ranges = per_shard.iter().map(|&count| (0, count)).collect();
        let mut coordinates = vec![0; per_shard.len()];
        for &(offset, length) in &entries {
            let inner = coordinates.iter().zip(&array.chunk);
            let inner: Vec<u64> = origin.iter().zip(inner).map(|(o, (c, size))| o + c * size).collect();
            if (offset, length) != (MISSING, MISSING) && self.holds_voxels(&inner) {
                wanted.push((offset, length, inner));
            }
            next(&mut coordinates, &ranges);
        }
        wanted.sort_unstable();
        let Some(mut object) = store.object(key)? else { return Ok(()) };
        let mut end = 0;
        for (offset, length, inner) in wanted {
            let damaged = |message: &str| VolumeError::malformed("chunk", format!("{}: {message}", excerpt(key)));
            if offset < end {
                return Err(damaged("chunks of the shard overlap"));
            }
            if length > most_packed(array) || offset.saturating_add(length) > object.length {
                return Err(damaged("a chunk of the shard is longer than it may be"));
            }
            let packed = object.read_range(offset, length)?;
            if (packed.len() as u64) < length {
                return Err(damaged("truncated"));
            }
            self.chunk(key, packed, &inner)?;
            end = offset + length;
        }
        Ok(())
    }

    fn holds_voxels(&self, origin: &[u64]) -> bool {
        let Self { array, selection, .. } = self;
        (0..origin.len()).all(|axis| {
            let (start, end) = (origin[axis], origin[axis] + array.chunk[axis]);
            if selection.space.contains(&axis) {
                start < array.shape[axis]
            } else {
                (start..end).contains(&selection.at[axis])
            }
        })
    }

    /// Puts the voxels of a chunk, of which the first element is at `origin` in the array, in their places.
    fn chunk(&mut self, key: &str, packed: Vec<u8>, origin: &[u64]) -> Result<(), VolumeError> {
        let Self { array, selection, .. } = self;
        let expected = array.chunk_bytes() as u64;
        let bytes = array.chain.unpack(packed, expected).map_err(|error| in_chunk(key, error))?;
        let bytes = native(bytes, array.stored, array.chain.endian);
        if self.voxels.is_empty() {
            fill(&mut self.voxels, array.fill, self.count)?;
        }
        // Elements between neighbours along each axis of the array.
        let mut strides = vec![0; origin.len()];
        let mut stride = 1;
        for &axis in array.chain.order.iter().rev() {
            strides[axis] = stride;
            stride *= array.chunk[axis] as usize;
        }
        let others = (0..origin.len()).filter(|axis| !selection.space.contains(axis));
        let first = others.map(|axis| (selection.at[axis] - origin[axis]) as usize * strides[axis]).sum();
        let block = Block {
            first,
            strides: selection.space.map(|axis| strides[axis]),
            start: selection.space.map(|axis| origin[axis] as usize),
            size: selection.space.map(|axis| array.chunk[axis].min(array.shape[axis] - origin[axis]) as usize),
        };
        let dims = selection.dims.map(|n| n as usize);
        with_voxels!(&mut self.voxels, v => block.copy(&bytes, v, dims));
        Ok(())
    }
}

/// Offsets and lengths of a shard's chunks; `None` if there is no such shard.
fn index(
    store: &mut Store,
    array: &Array,
    key: &str,
    per_shard: &[u64],
) -> Result<Option<Vec<(u64, u64)>>, VolumeError> {
    let damaged = |message: &str| VolumeError::malformed("chunk", format!("{}: {message}", excerpt(key)));
    let (Some(shard), count) = (array.shard, product(per_shard) as u64) else { return Ok(None) };
    let Some(mut object) = store.object(key)? else { return Ok(None) };
    let index_bytes = count * ENTRY_BYTES + if shard.index_has_sum { 4 } else { 0 };
    let most = (most_packed(array) + PACKING_BYTES).saturating_mul(count).saturating_add(index_bytes);
    if object.length > most {
        return Err(damaged("the shard is longer than its chunks may be"));
    }
    let offset = object.length.checked_sub(index_bytes).ok_or_else(|| damaged("shorter than the index of a shard"))?;
    let mut bytes = object.read_range(if shard.index_at_start { 0 } else { offset }, index_bytes)?;
    if bytes.len() as u64 != index_bytes {
        return Err(damaged("truncated"));
    }
    if shard.index_has_sum {
        let (entries, sum) = bytes.split_last_chunk().ok_or_else(|| damaged("truncated"))?;
        if crc32c(entries) != u32::from_le_bytes(*sum) {
            return Err(damaged("the checksum of the shard's index does not match"));
        }
        bytes.truncate(bytes.len() - 4);
    }
    let number = |bytes: &[u8; 8]| match shard.index_endian {
        Endian::Little => u64::from_le_bytes(*bytes),
        Endian::Big => u64::from_be_bytes(*bytes),
    };
    let numbers = bytes.as_chunks::<8>().0;
    Ok(Some(numbers.as_chunks::<2>().0.iter().map(|[offset, length]| (number(offset), number(length))).collect()))
}

/// Numbers in this machine's byte order and of the voxels' type.
fn native(mut bytes: Vec<u8>, stored: Stored, endian: Endian) -> Vec<u8> {
    if endian != Endian::NATIVE {
        reverse_each(&mut bytes, stored.bytes() as usize);
    }
    match stored {
        Stored::As(_) => bytes,
        Stored::Half => {
            let halves = bytes.as_chunks().0.iter().map(|bits| half::f16::from_ne_bytes(*bits));
            halves.flat_map(|half| half.to_f32().to_ne_bytes()).collect()
        }
    }
}

fn fill(voxels: &mut Voxels, fill: Fill, count: usize) -> Result<(), VolumeError> {
    voxels.reserve("shape", count)?;
    with_voxels!(voxels, v => match fill {
        Fill::Integer(value) => v.resize(count, value as _),
        Fill::Float(value) => v.resize(count, value as _),
    });
    Ok(())
}

/// What of a decoded chunk are voxels, along x, y and z.
struct Block {
    /// Element of the first voxel.
    first: usize,
    /// Elements between neighbours.
    strides: [usize; 3],
    /// First voxel in the volume.
    start: [usize; 3],
    /// Number of voxels.
    size: [usize; 3],
}

impl Block {
    fn copy<T: Pod>(&self, bytes: &[u8], voxels: &mut [T], dims: [usize; 3]) {
        let [sx, sy, sz] = self.strides;
        let [x, y, z] = self.start;
        let size = size_of::<T>();
        for k in 0..self.size[2] {
            for j in 0..self.size[1] {
                let row = ((z + k) * dims[1] + y + j) * dims[0] + x;
                let row = &mut voxels[row..row + self.size[0]];
                let from = self.first + k * sz + j * sy;
                if sx == 1 {
                    let bytes = &bytes[from * size..(from + row.len()) * size];
                    bytemuck::cast_slice_mut(row).copy_from_slice(bytes);
                    continue;
                }
                for (i, voxel) in row.iter_mut().enumerate() {
                    let at = (from + i * sx) * size;
                    *voxel = bytemuck::pod_read_unaligned(&bytes[at..at + size]);
                }
            }
        }
    }
}
