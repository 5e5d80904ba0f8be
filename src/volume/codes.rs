//! Voxels as the codes that live on the GPU.

use std::ops::Range;

use rayon::prelude::*;

use super::sample::{Sample, with_voxels};
use super::{CodeMap, Volume};

/// Voxels per task.
const CHUNK: usize = 1 << 15;

impl Volume {
    /// Bytes of the whole volume's codes.
    pub fn code_bytes(&self) -> u64 {
        self.voxels.len() as u64 * self.code_map.bytes_per_voxel()
    }

    /// Replaces `out` by the codes of the slices `z`, x fastest, [`CodeMap::bytes_per_voxel`] little-endian bytes
    /// each. Slab by slab, with one `out`, an upload never holds a second copy of the volume. Slices beyond the last
    /// one are left out.
    pub fn write_codes(&self, z: Range<u32>, out: &mut Vec<u8>) {
        let slice = self.grid.dims[0] as usize * self.grid.dims[1] as usize;
        let end = z.end.min(self.grid.dims[2]) as usize;
        let voxels = slice * (z.start as usize).min(end)..slice * end;
        // No `clear` first: a buffer that is reused for slabs of one size is not zeroed again and again.
        out.resize(voxels.len() * self.code_map.bytes_per_voxel() as usize, 0);
        with_voxels!(&self.voxels, v => write_codes(&v[voxels], &self.code_map, out));
    }
}

fn write_codes<T: Sample>(values: &[T], map: &CodeMap, out: &mut [u8]) {
    if map.bytes_per_voxel() == 1 {
        values.par_chunks(CHUNK).zip(out.par_chunks_mut(CHUNK)).for_each(|(values, out)| {
            for (value, code) in values.iter().zip(out) {
                *code = map.code_from_value(value.to_f64()) as u8;
            }
        });
    } else {
        values.par_chunks(CHUNK).zip(out.par_chunks_mut(2 * CHUNK)).for_each(|(values, out)| {
            for (value, code) in values.iter().zip(out.chunks_exact_mut(2)) {
                code.copy_from_slice(&map.code_from_value(value.to_f64()).to_le_bytes());
            }
        });
    }
}
