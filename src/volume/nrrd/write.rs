//! The header that makes a file of our voxels.

use glam::DVec3;

use crate::volume::{Grid, VoxelType};

/// A header, to be followed by the voxels as raw little-endian bytes, x fastest; the space is the patient's.
pub fn attached_header(grid: &Grid, voxel_type: VoxelType) -> String {
    header(grid, voxel_type, "space: left-posterior-superior")
}

/// The same for a volume of which nobody knows whether its axes are a patient's.
pub fn attached_header_without_space(grid: &Grid, voxel_type: VoxelType) -> String {
    header(grid, voxel_type, "space dimension: 3")
}

fn header(grid: &Grid, voxel_type: VoxelType, space: &str) -> String {
    let name = match voxel_type {
        VoxelType::U8 => "uint8",
        VoxelType::I8 => "int8",
        VoxelType::U16 => "uint16",
        VoxelType::I16 => "int16",
        VoxelType::U32 => "uint32",
        VoxelType::I32 => "int32",
        VoxelType::U64 => "uint64",
        VoxelType::I64 => "int64",
        VoxelType::F32 => "float",
        VoxelType::F64 => "double",
    };
    let vector = |v: DVec3| format!("({},{},{})", v.x, v.y, v.z);
    let [nx, ny, nz] = grid.dims;
    let spacing = grid.spacing.to_array();
    let [x, y, z]: [String; 3] = std::array::from_fn(|a| vector(grid.direction[a] * spacing[a]));
    let origin = vector(grid.origin);
    format!(
        "NRRD0005\ntype: {name}\ndimension: 3\n{space}\nsizes: {nx} {ny} {nz}\n\
         space directions: {x} {y} {z}\nkinds: domain domain domain\nendian: little\nencoding: raw\n\
         space origin: {origin}\n\n"
    )
}
