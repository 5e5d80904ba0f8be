//! Volumes to NumPy and NRRD files.

use std::path::Path;

use crate::renderer::AccessibilityVolume;
use crate::volume::nrrd::{attached_header, attached_header_without_space};
use crate::volume::{Grid, Volume, VoxelType};

/// A file format for volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArrayFormat {
    /// NumPy's `.npy`, version 1.0: little-endian, C order, shape (z, y, x); without geometry.
    Npy,
    /// NRRD version 5, raw little-endian; placed in the world.
    Nrrd,
}

impl ArrayFormat {
    /// Every format.
    pub const ALL: [Self; 2] = [Self::Npy, Self::Nrrd];

    /// Name in the API, and ending of file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Npy => "npy",
            Self::Nrrd => "nrrd",
        }
    }

    /// The format of a name in the API.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|format| format.name() == name)
    }

    /// The format that a file name's ending stands for.
    pub fn from_path(path: &Path) -> Option<Self> {
        Self::from_name(&path.extension()?.to_str()?.to_ascii_lowercase())
    }
}

/// The bytes of a file with the accessibility of every sample; `grid` is that of the volume it belongs to.
pub fn write_accessibility(accessibility: &AccessibilityVolume, grid: &Grid, format: ArrayFormat) -> Vec<u8> {
    let header = match format {
        ArrayFormat::Npy => npy_header(accessibility.dims, VoxelType::F32),
        ArrayFormat::Nrrd => attached_header(&sample_grid(accessibility, grid), VoxelType::F32).into_bytes(),
    };
    let mut file = header;
    file.reserve_exact(accessibility.values.len() * 4);
    file.extend(accessibility.values.iter().flat_map(|value| value.to_le_bytes()));
    file
}

/// What a file of a volume begins with; its voxels follow as little-endian bytes, x fastest.
pub fn volume_header(volume: &Volume, format: ArrayFormat) -> Vec<u8> {
    let voxel_type = volume.voxels.voxel_type();
    match format {
        ArrayFormat::Npy => npy_header(volume.grid.dims, voxel_type),
        ArrayFormat::Nrrd if volume.about.patient_axes => attached_header(&volume.grid, voxel_type).into_bytes(),
        ArrayFormat::Nrrd => attached_header_without_space(&volume.grid, voxel_type).into_bytes(),
    }
}

/// Magic, version 1.0, length and a Python dict, padded so that the data starts at a multiple of 64 bytes.
fn npy_header([x, y, z]: [u32; 3], voxel_type: VoxelType) -> Vec<u8> {
    let descr = match voxel_type {
        VoxelType::U8 => "|u1",
        VoxelType::I8 => "|i1",
        VoxelType::U16 => "<u2",
        VoxelType::I16 => "<i2",
        VoxelType::U32 => "<u4",
        VoxelType::I32 => "<i4",
        VoxelType::U64 => "<u8",
        VoxelType::I64 => "<i8",
        VoxelType::F32 => "<f4",
        VoxelType::F64 => "<f8",
    };
    let mut dict = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': ({z}, {y}, {x}), }}");
    let preamble = 10;
    let padding = 63 - (preamble + dict.len()) % 64;
    dict.extend(std::iter::repeat_n(' ', padding));
    dict.push('\n');
    let length = u16::try_from(dict.len()).expect("three numbers take less than 64 kB");
    let mut header = b"\x93NUMPY\x01\x00".to_vec();
    header.extend(length.to_le_bytes());
    header.extend(dict.bytes());
    header
}

/// The grid of the samples, which are centres of cells of their own.
fn sample_grid(accessibility: &AccessibilityVolume, grid: &Grid) -> Grid {
    Grid {
        dims: accessibility.dims,
        spacing: grid.spacing * glam::DVec3::from_array(accessibility.step),
        origin: grid.world_from_index().transform_point3(accessibility.first.into()),
        direction: grid.direction,
    }
}
