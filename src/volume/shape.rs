//! What a header says of a volume before its voxels are read.

use super::{Grid, VoxelType};

/// Size, type and spacing of a volume, by its header alone.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shape {
    /// Voxels along x, y and z.
    pub dims: [u32; 3],
    /// Type of the voxels; of DICOM an `i16` may turn out to be `i32`.
    pub voxel_type: VoxelType,
    /// World units between voxel centres along x, y and z; `None` where the format or the file does not say.
    pub spacing: Option<[f64; 3]>,
}

impl Shape {
    /// Of a volume whose geometry is known.
    pub fn of(grid: &Grid, voxel_type: VoxelType) -> Self {
        Self { dims: grid.dims, voxel_type, spacing: Some(grid.spacing.to_array()) }
    }

    /// Of an array that is said nothing about but its size and type.
    pub(super) fn without_spacing(dims: [u32; 3], voxel_type: VoxelType) -> Self {
        Self { dims, voxel_type, spacing: None }
    }
}
