//! Scalar fields on a regular grid: voxels, geometry, files and procedural volumes.
//!
//! Architecture Invariant: nothing here knows the GPU, tokio or HTTP.

mod about;
mod archive;
mod ascii;
mod average;
mod bricks;
mod channels;
mod code_map;
mod codes;
mod dicom;
mod error;
pub mod format;
mod formats;
mod gray;
mod grid;
mod histogram;
mod indexed;
mod input;
mod limits;
mod lines;
mod listing;
mod metaimage;
mod nifti;
mod npy;
pub mod nrrd;
mod packed;
mod paths;
mod prepare;
mod probe;
pub mod procedural;
mod raw;
mod resolution;
mod sample;
mod scaled;
mod shape;
mod siblings;
mod slice;
mod stored;
mod tiff;
mod units;
mod voxels;
mod vti;
mod watch;
mod wrap;
mod zarr;

pub use about::About;
pub use bricks::{BRICK, Bricks, CodeSet};
pub use code_map::CodeMap;
pub use error::VolumeError;
pub use format::Format;
pub use gray::GrayPicture;
pub use grid::Grid;
pub use histogram::{Histogram, MAX_BINS};
pub use input::Choice;
pub use limits::{Limits, bytes_needed};
pub use listing::{ListedFile, Listing, list_directory};
pub use prepare::Derived;
pub use probe::Probe;
pub use procedural::{ProceduralKind, ProceduralSpec};
pub use raw::RawSpec;
pub use resolution::{Region, Resolution, factor_that_fits, parse_region, reduced_dims, region_dims};
pub use shape::Shape;
pub use slice::{LARGEST_THUMBNAIL, SliceAxis, SliceSize, slice_orientation};
pub use voxels::{Endian, VoxelStatistics, VoxelType, Voxels};
pub use watch::{LoadProgress, LoadStage, LoadWatch};

use std::fmt;
use std::sync::{Arc, OnceLock};

/// Name of a resident volume, as clients see it (`v_3f2a`).
#[derive(Clone, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct VolumeId(pub String);

impl fmt::Display for VolumeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

/// A scalar field as loaded: the host copy from which everything on the GPU can be rebuilt.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Where the voxels are in the world.
    pub grid: Grid,
    /// Values in the file's own units, x fastest.
    pub voxels: Voxels,
    /// How values become the 8- or 16-bit codes that live on the GPU; also holds the value range.
    pub code_map: CodeMap,
    /// Voxels that were NaN; they count as the lowest value.
    pub nan_count: u64,
    /// What its file says besides, if it came from one.
    pub about: About,
    /// How much of its source this is.
    pub resolution: Resolution,
    /// See [`Volume::bricks`].
    bricks: OnceLock<Arc<Bricks>>,
}

impl Volume {
    /// Checks voxels against the grid and finds their range.
    ///
    /// # Errors
    /// Names `dims`, `spacing`, `origin` or `direction` if the grid is not usable ([`Grid::check`]), `voxels` if
    /// their number is not that of the grid, one of them is infinite or all are NaN.
    pub fn new(grid: Grid, voxels: Voxels) -> Result<Self, VolumeError> {
        grid.check()?;
        if bytes_needed(grid.dims, VoxelType::U8) != Some(voxels.len() as u64) {
            let message = format!("{} voxels do not fill dims {:?}", voxels.len(), grid.dims);
            return Err(VolumeError::malformed("voxels", message));
        }
        let VoxelStatistics { range, nan_count } = voxels.statistics()?;
        let Some([lowest, highest]) = range else {
            return Err(VolumeError::malformed("voxels", "every value is NaN"));
        };
        let code_map = if voxels.voxel_type().is_integer() {
            CodeMap::for_integers(lowest, highest)
        } else {
            CodeMap::for_floats(lowest, highest)
        };
        let resolution = Resolution::full(grid.dims);
        Ok(Self { grid, voxels, code_map, nan_count, about: About::default(), resolution, bricks: OnceLock::new() })
    }

    /// The same volume with this said about it.
    #[must_use]
    pub fn with_about(mut self, about: About) -> Self {
        self.about = about;
        self
    }

    /// Says in the notes how many voxels are NaN now, whatever they were of before.
    pub(super) fn note_nan(&mut self) {
        const WHAT: &str = "NaN and shown as the lowest value";
        self.about.notes.retain(|note| !note.ends_with(WHAT));
        match self.nan_count {
            0 => {}
            1 => self.about.note(format!("1 voxel is {WHAT}")),
            n => self.about.note(format!("{n} voxels are {WHAT}")),
        }
    }

    /// Bytes of host memory that the voxels fill.
    pub fn host_bytes(&self) -> u64 {
        self.voxels.bytes()
    }

    /// Value of voxel (i, j, k) in the file's units, the lowest one for NaN. Panics outside the volume.
    pub fn value_at(&self, [i, j, k]: [u32; 3]) -> f64 {
        let [nx, ny, _] = self.grid.dims;
        assert!(i < nx && j < ny, "voxel ({i}, {j}, {k}) is outside {:?}", self.grid.dims);
        let value = self.voxels.value((k as usize * ny as usize + j as usize) * nx as usize + i as usize);
        if value.is_nan() { self.code_map.lowest } else { value }
    }
}
