//! How much of a source becomes a volume: a region of it, and blocks of its voxels averaged where they are too many.

use serde::Serialize;

use super::{Volume, VolumeError};

/// A box of voxels: from the first index of each axis up to, but not with, the second.
pub type Region = [[u32; 3]; 2];

/// What became of a source's voxels on their way into a [`Volume`].
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Resolution {
    /// Voxels of the source along x, y, z.
    pub full_dims: [u32; 3],
    /// Voxels that were averaged into one, along x, y, z.
    pub factor: [u32; 3],
    /// The part of the source that was taken, in its voxels; `None` for all of it.
    pub region: Option<Region>,
}

impl Resolution {
    /// Every voxel as it is.
    pub fn full(dims: [u32; 3]) -> Self {
        Self { full_dims: dims, factor: [1; 3], region: None }
    }

    /// Whether voxels were averaged.
    pub fn is_reduced(&self) -> bool {
        self.factor != [1; 3]
    }
}

/// A region from `x0,y0,z0,x1,y1,z1`.
///
/// # Errors
/// Names `region`.
pub fn parse_region(text: &str) -> Result<Region, VolumeError> {
    let numbers: Option<Vec<u32>> = text.split(',').take(7).map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x0, y0, z0, x1, y1, z1]) => Ok([[x0, y0, z0], [x1, y1, z1]]),
        _ => Err(VolumeError::malformed("region", "expected six whole numbers x0,y0,z0,x1,y1,z1, counted in voxels")),
    }
}

/// Dims of a part of a volume.
///
/// # Errors
/// Names `region` if it is empty or not inside of the volume, and says the dims.
pub fn region_dims(region: &Region, dims: [u32; 3]) -> Result<[u32; 3], VolumeError> {
    let [first, end] = region;
    for (axis, name) in ["x", "y", "z"].into_iter().enumerate() {
        if first[axis] >= end[axis] || end[axis] > dims[axis] {
            let message = format!(
                "{} to {} along {name}; expected a first voxel and a later end, up to {} in a volume of {dims:?}",
                first[axis], end[axis], dims[axis]
            );
            return Err(VolumeError::malformed("region", message));
        }
    }
    Ok(std::array::from_fn(|axis| end[axis] - first[axis]))
}

/// Dims of a volume of which `factor` voxels are averaged into one; the last blocks may be smaller.
pub fn reduced_dims(dims: [u32; 3], factor: [u32; 3]) -> [u32; 3] {
    std::array::from_fn(|axis| dims[axis].div_ceil(factor[axis]))
}

/// How many voxels have to be averaged into one along each axis: the fewest with which no axis is longer than
/// `max_axis` and `fits` holds of the dims; `None` if not even a single voxel fits.
///
/// An axis that is too long is averaged alone. Where the whole is too much, all axes are averaged alike, but none more
/// than that needs, so that voxels stay as near to cubes as they can.
pub fn factor_that_fits(dims: [u32; 3], max_axis: u32, fits: impl Fn([u32; 3]) -> bool) -> Option<[u32; 3]> {
    let least = dims.map(|n| n.div_ceil(max_axis.max(1)).max(1));
    let most = dims.into_iter().max().unwrap_or(1).max(1);
    let factors = |all: u32| std::array::from_fn(|axis| least[axis].max(all).min(dims[axis].max(1)));
    (1..=most).map(factors).find(|&factor| fits(reduced_dims(dims, factor)))
}

impl Volume {
    /// Says in the notes what was averaged, and how to see the whole of a part.
    pub(super) fn note_resolution(&mut self) {
        let Resolution { full_dims, factor: [x, y, z], region } = &self.resolution;
        let [nx, ny, nz] = region.map_or(*full_dims, |[first, end]| std::array::from_fn(|a| end[a] - first[a]));
        let note = format!(
            "Too large for the GPU's memory or textures: of {nx} x {ny} x {nz} voxels, blocks of {x} x {y} x {z} are averaged. \
             A region of it can be loaded at full resolution."
        );
        self.about.note(note);
    }
}
