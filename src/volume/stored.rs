//! Numbers as arrays store them, half-precision floats among them, which become voxels of type `f32`.

use std::io::Read;

use half::slice::HalfBitsSliceExt;

use super::{Endian, VolumeError, VoxelType, Voxels};

/// Halves converted at a time.
const CHUNK: usize = 1 << 16;

/// Type of a number in a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Stored {
    /// As a voxel is.
    As(VoxelType),
    /// IEEE 754 binary16.
    Half,
}

impl Stored {
    /// What `NumPy` calls `<i2`, `|u1`, `>f4`, with its byte order; `|b1` is a byte that is 0 or 1.
    pub(super) fn from_descr(descr: &str) -> Option<(Self, Endian)> {
        let (order, kind) = descr.split_at_checked(1)?;
        let endian = match order {
            "<" | "|" | "=" => Endian::Little,
            ">" => Endian::Big,
            _ => return None,
        };
        let voxel_type = match kind {
            "b1" | "u1" => VoxelType::U8,
            "i1" => VoxelType::I8,
            "u2" => VoxelType::U16,
            "i2" => VoxelType::I16,
            "u4" => VoxelType::U32,
            "i4" => VoxelType::I32,
            "u8" => VoxelType::U64,
            "i8" => VoxelType::I64,
            "f2" => return Some((Self::Half, endian)),
            "f4" => VoxelType::F32,
            "f8" => VoxelType::F64,
            _ => return None,
        };
        Some((Self::As(voxel_type), endian))
    }

    /// Type of the voxels.
    pub(super) fn voxel_type(self) -> VoxelType {
        match self {
            Self::As(voxel_type) => voxel_type,
            Self::Half => VoxelType::F32,
        }
    }

    /// Bytes of a number in the file.
    pub(super) fn bytes(self) -> u64 {
        match self {
            Self::As(voxel_type) => voxel_type.bytes(),
            Self::Half => 2,
        }
    }

    /// Appends exactly `count` numbers to voxels of [`Stored::voxel_type`].
    ///
    /// # Errors
    /// Names `field` if the reader ends before that.
    pub(super) fn append(
        self,
        voxels: &mut Voxels,
        field: &str,
        reader: &mut dyn Read,
        count: usize,
        endian: Endian,
    ) -> Result<(), VolumeError> {
        let (Self::Half, Voxels::F32(out)) = (self, &mut *voxels) else {
            return voxels.append(field, reader, count, endian);
        };
        let mut done = 0;
        while done < count {
            let now = CHUNK.min(count - done);
            let mut bits = Voxels::empty(VoxelType::U16);
            bits.append(field, reader, now, endian)?;
            if let Voxels::U16(bits) = bits {
                out.extend(bits.reinterpret_cast::<half::f16>().iter().map(|half| half.to_f32()));
            }
            done += now;
        }
        Ok(())
    }
}
