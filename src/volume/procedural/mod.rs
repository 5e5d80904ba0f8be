//! Volumes made by formula, for tests, benches and demos that need no file.
//!
//! Every voxel is a pure function of its position, the dims and the seed: the same volume whatever the number of
//! threads. Shapes are defined in index space; spacing stretches them in the world.

mod boxes;
mod cloud;
mod gyroid;
mod mandelbulb;
mod marschner_lobb;
mod menger;
mod sphere_flake;
pub mod sphere_on_plane;

use glam::DVec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::sample::Sample;
use super::{Grid, Limits, LoadStage, LoadWatch, Volume, VolumeError, VoxelType, Voxels};

/// Most voxels along an axis of a procedural volume.
pub const MAX_AXIS: u32 = 4096;

/// What to make.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum ProceduralKind {
    /// `u8`: a smooth minimal surface with four periods along the longest axis; the seed shifts it.
    Gyroid,
    /// `u16`: the test signal of Marschner and Lobb (1994) over the whole volume.
    MarschnerLobb,
    /// `u8`, 0 or 255: a Menger sponge, as deep as the shortest axis resolves; exact where dims are powers of 3.
    Menger,
    /// `u8`: the power-8 Mandelbulb, 255 inside, fading out over two voxels.
    Mandelbulb,
    /// `u16`: fractal noise in an ellipsoid; the seed chooses the noise.
    Cloud,
    /// `u8`: a recursive flake of spheres, 255 inside, fading over two voxels.
    SphereFlake,
    /// `u8`: one box along x, two along y, three along z, so that no flip or swap of axes goes unseen.
    Boxes,
    /// `u8`: a sphere that lies on a plane, 255 inside, antialiased; [`sphere_on_plane::geometry`] says where.
    SphereOnPlane,
}

/// A procedural volume as a client asks for it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProceduralSpec {
    /// What to make.
    pub kind: ProceduralKind,
    /// Number of voxels along x, y and z: 1 to [`MAX_AXIS`] each.
    pub dims: [u32; 3],
    /// Chooses among volumes of one kind, where there are several.
    #[serde(default)]
    pub seed: u64,
    /// World units between voxel centres; 1 if not given.
    #[serde(default)]
    pub spacing: Option<[f64; 3]>,
}

impl ProceduralSpec {
    /// Type of the voxels.
    pub fn voxel_type(&self) -> VoxelType {
        match self.kind {
            ProceduralKind::MarschnerLobb | ProceduralKind::Cloud => VoxelType::U16,
            _ => VoxelType::U8,
        }
    }

    /// Makes the volume, slice by slice in parallel.
    ///
    /// # Errors
    /// Names `dims` if they are 0 or beyond the limits, `spacing` if it is not positive.
    pub fn generate(&self, limits: &Limits) -> Result<Volume, VolumeError> {
        self.generate_watched(limits, &LoadWatch::default())
    }

    /// [`ProceduralSpec::generate`] that tells how far it is, and may be called off.
    ///
    /// # Errors
    /// As [`ProceduralSpec::generate`], and [`VolumeError::Cancelled`].
    pub fn generate_watched(&self, limits: &Limits, watch: &LoadWatch) -> Result<Volume, VolumeError> {
        let limits = Limits { max_axis: limits.max_axis.min(MAX_AXIS), ..*limits };
        let count = limits.check("dims", self.dims, self.voxel_type())?;
        let grid = Grid::axis_aligned(self.dims, DVec3::from_array(self.spacing.unwrap_or([1.0; 3])));
        grid.check()?;
        let mut voxels = Voxels::empty(self.voxel_type());
        voxels.reserve("dims", count)?;
        watch.begin(LoadStage::Reading, u64::from(self.dims[2]));
        match &mut voxels {
            Voxels::U8(out) => self.fill_u8(out, count, watch)?,
            Voxels::U16(out) => self.fill_u16(out, count, watch)?,
            _ => unreachable!("voxel_type() is u8 or u16"),
        }
        Volume::new(grid, voxels)
    }

    fn fill_u8(&self, out: &mut Vec<u8>, count: usize, watch: &LoadWatch) -> Result<(), VolumeError> {
        out.resize(count, 0);
        let dims = self.dims;
        match self.kind {
            ProceduralKind::Gyroid => fill(dims, out, watch, gyroid::voxel(dims, self.seed)),
            ProceduralKind::Menger => fill(dims, out, watch, menger::voxel(dims)),
            ProceduralKind::Mandelbulb => fill(dims, out, watch, mandelbulb::voxel(dims)),
            ProceduralKind::SphereFlake => sphere_flake::fill(dims, out, watch),
            ProceduralKind::Boxes => fill(dims, out, watch, boxes::voxel(dims)),
            ProceduralKind::SphereOnPlane => fill(dims, out, watch, sphere_on_plane::voxel(dims)),
            ProceduralKind::MarschnerLobb | ProceduralKind::Cloud => unreachable!("these are u16"),
        }
    }

    fn fill_u16(&self, out: &mut Vec<u16>, count: usize, watch: &LoadWatch) -> Result<(), VolumeError> {
        out.resize(count, 0);
        match self.kind {
            ProceduralKind::Cloud => fill(self.dims, out, watch, cloud::voxel(self.dims, self.seed)),
            _ => fill(self.dims, out, watch, marschner_lobb::voxel(self.dims)),
        }
    }
}

/// Sets every voxel from its integer position.
fn fill<T: Sample>(
    dims: [u32; 3],
    out: &mut [T],
    watch: &LoadWatch,
    voxel: impl Fn([u32; 3]) -> T + Sync,
) -> Result<(), VolumeError> {
    each_slice(dims, out, watch, |k, slice| {
        for (j, row) in slice.chunks_mut(dims[0] as usize).enumerate() {
            if watch.is_cancelled() {
                return;
            }
            for (i, out) in row.iter_mut().enumerate() {
                *out = voxel([i as u32, j as u32, k as u32]);
            }
        }
    })
}

/// Fills every slice by its number, in parallel; a slice is a unit of work.
fn each_slice<T: Sample>(
    dims: [u32; 3],
    out: &mut [T],
    watch: &LoadWatch,
    draw: impl Fn(usize, &mut [T]) + Sync,
) -> Result<(), VolumeError> {
    let slice_voxels = dims[0] as usize * dims[1] as usize;
    out.par_chunks_mut(slice_voxels).enumerate().try_for_each(|(k, slice)| {
        watch.check()?;
        draw(k, slice);
        watch.step(1)
    })
}

/// Centre of a voxel in index space.
fn voxel_centre(voxel: [u32; 3]) -> DVec3 {
    DVec3::from_array(voxel.map(f64::from)) + 0.5
}

/// Dims as a vector.
fn dims_vec(dims: [u32; 3]) -> DVec3 {
    DVec3::from_array(dims.map(f64::from))
}

/// How much of a voxel is inside a smooth surface that its centre is `distance` voxels outside of, as 0 to 255.
fn coverage(distance: f64) -> u8 {
    (255.0 * (0.5 - distance).clamp(0.0, 1.0)).round() as u8
}

/// Hash of a lattice point: every input bit changes about half of the output bits.
fn hash(point: [i32; 3], seed: u32) -> u32 {
    let [x, y, z] = point.map(i32::cast_unsigned);
    let mut h = x.wrapping_mul(0x8da6_b343) ^ y.wrapping_mul(0xd816_3841) ^ z.wrapping_mul(0xcb1a_b31f) ^ seed;
    h = (h ^ (h >> 16)).wrapping_mul(0x7feb_352d);
    h = (h ^ (h >> 15)).wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// All of a seed in 32 bits; 0 stays 0.
fn fold_seed(seed: u64) -> u32 {
    (seed as u32) ^ ((seed >> 32) as u32).wrapping_mul(0x9e37_79b9)
}
