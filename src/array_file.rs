//! Float volumes to NumPy and NRRD files.

use std::path::Path;

use crate::renderer::AccessibilityVolume;
use crate::volume::nrrd::attached_header;
use crate::volume::{Grid, VoxelType};

/// A file format for float volumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ArrayFormat {
    /// NumPy's `.npy`, version 1.0: little-endian float32, C order, shape (z, y, x); without geometry.
    Npy,
    /// NRRD version 4, raw little-endian float; placed in the world like its volume.
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
        ArrayFormat::Npy => npy_header(accessibility.dims),
        ArrayFormat::Nrrd => attached_header(&sample_grid(accessibility, grid), VoxelType::F32).into_bytes(),
    };
    let mut file = header;
    file.reserve_exact(accessibility.values.len() * 4);
    file.extend(accessibility.values.iter().flat_map(|value| value.to_le_bytes()));
    file
}

/// Magic, version 1.0, length and a Python dict, padded so that the data starts at a multiple of 64 bytes.
fn npy_header([x, y, z]: [u32; 3]) -> Vec<u8> {
    let mut dict = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({z}, {y}, {x}), }}");
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
