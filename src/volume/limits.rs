//! How large a volume may be, checked before anything is allocated.

use super::{VolumeError, VoxelType};

/// Upper bounds on a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Limits {
    /// Most voxels along any axis.
    pub max_axis: u32,
    /// Most voxels altogether.
    pub max_voxels: u64,
    /// Most bytes of host memory for the voxels in their own type.
    pub max_bytes: u64,
}

impl Default for Limits {
    /// 4096 along an axis, 2^31 voxels, 8 GiB.
    fn default() -> Self {
        Self { max_axis: 4096, max_voxels: 1 << 31, max_bytes: 8 << 30 }
    }
}

impl Limits {
    /// The number of voxels if a volume is within the limits; otherwise an error that names `field`.
    pub fn check(&self, field: &str, dims: [u32; 3], voxel_type: VoxelType) -> Result<usize, VolumeError> {
        if dims.contains(&0) {
            return Err(VolumeError::malformed(
                field,
                format!("{dims:?} has an empty axis; expected at least 1 voxel"),
            ));
        }
        let voxels: u128 = dims.iter().map(|&n| u128::from(n)).product();
        let bytes = voxels * u128::from(voxel_type.bytes());
        let longest = u128::from(dims.into_iter().max().unwrap_or(0));
        let checks = [
            ("voxels along an axis", longest, u64::from(self.max_axis)),
            ("voxels", voxels, self.max_voxels),
            ("bytes", bytes, self.max_bytes.min(isize::MAX as u64)),
        ];
        for (unit, needed, limit) in checks {
            if needed > u128::from(limit) {
                return Err(VolumeError::TooLarge { field: field.to_owned(), unit, needed, limit });
            }
        }
        Ok(usize::try_from(voxels).expect("no more voxels than bytes, and those fit in isize"))
    }
}

/// Host bytes of the voxels of a volume; `None` if that does not fit in 64 bits.
pub fn bytes_needed(dims: [u32; 3], voxel_type: VoxelType) -> Option<u64> {
    dims.iter().try_fold(voxel_type.bytes(), |bytes, &n| bytes.checked_mul(u64::from(n)))
}
