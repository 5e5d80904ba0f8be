//! Voxels stored in one type that mean values in another: `value = stored * slope + intercept`.

use std::io::BufRead;

use super::sample::{Sample, with_voxels};
use super::{Endian, VolumeError, VoxelType, Voxels};

/// Voxels converted at a time: the stored ones never fill more memory than that.
const CHUNK: usize = 1 << 16;

/// From stored numbers to values.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scaling {
    pub(super) slope: f64,
    pub(super) intercept: f64,
}

impl Scaling {
    /// Nothing to do.
    pub(super) const IDENTITY: Self = Self { slope: 1.0, intercept: 0.0 };

    /// Type of the values: the stored one if nothing is to be done; else `f32` where its 24 bits hold every stored
    /// number, and `f64` where they do not.
    pub(super) fn result_type(self, stored: VoxelType) -> VoxelType {
        match stored {
            _ if self == Self::IDENTITY => stored,
            VoxelType::U8 | VoxelType::I8 | VoxelType::U16 | VoxelType::I16 | VoxelType::F32 => VoxelType::F32,
            _ => VoxelType::F64,
        }
    }

    /// Appends `count` values to voxels of the type that they have by [`Scaling::result_type`]. Computed in `f64` and
    /// rounded once.
    ///
    /// # Errors
    /// Names `field` if the reader ends before that.
    pub(super) fn append(
        self,
        voxels: &mut Voxels,
        field: &str,
        reader: &mut dyn BufRead,
        count: usize,
        stored: VoxelType,
        endian: Endian,
    ) -> Result<(), VolumeError> {
        if self == Self::IDENTITY {
            return voxels.append(field, reader, count, endian);
        }
        let mut done = 0;
        while done < count {
            let mut chunk = Voxels::empty(stored);
            let now = CHUNK.min(count - done);
            chunk.append(field, reader, now, endian)?;
            with_voxels!(&chunk, values => {
                let values = values.iter().map(|v| v.to_f64() * self.slope + self.intercept);
                match voxels {
                    Voxels::F32(out) => out.extend(values.map(|v| v as f32)),
                    Voxels::F64(out) => out.extend(values),
                    _ => unreachable!("result_type gives floats"),
                }
            });
            done += now;
        }
        Ok(())
    }
}
