//! A volume's voxels cropped, or averaged in blocks, where they were in the world.

use rayon::prelude::*;

use super::resolution::{Region, Resolution, reduced_dims, region_dims};
use super::sample::{Average, with_voxels};
use super::{Grid, LoadStage, LoadWatch, Volume, VolumeError, Voxels};

impl Volume {
    /// A box of the voxels.
    ///
    /// # Errors
    /// Names `region` if it is empty or not inside of the volume, `voxels` if every value in it is NaN;
    /// [`VolumeError::Cancelled`].
    pub fn cropped(&self, region: &Region, watch: &LoadWatch) -> Result<Self, VolumeError> {
        let dims = region_dims(region, self.grid.dims)?;
        let [first, _] = *region;
        let voxels = with_voxels!(&self.voxels, v => crop(v, self.grid.dims, first, dims, watch))?;
        let resolution = Resolution { region: Some(*region), ..self.resolution.clone() };
        self.with(self.grid.part(first, [1; 3], dims), voxels, resolution)
    }

    /// Each block of `factor` voxels averaged into one, in the voxels' own type: integers are rounded to the nearest
    /// (halves away from 0), NaN is left out, and where there is nothing else it stays. The first block begins at the
    /// first voxel. The last ones along each axis may hold fewer voxels, and are means of those; their cell is as large
    /// as any other, so that the volume ends up to `factor - 1` old voxels further out than it did.
    ///
    /// # Errors
    /// [`VolumeError::Cancelled`].
    pub fn averaged(&self, factor: [u32; 3], watch: &LoadWatch) -> Result<Self, VolumeError> {
        let dims = reduced_dims(self.grid.dims, factor);
        let voxels = with_voxels!(&self.voxels, v => average(v, self.grid.dims, factor, watch))?;
        let resolution = Resolution { factor, ..self.resolution.clone() };
        let mut volume = self.with(self.grid.part([0; 3], factor, dims), voxels, resolution)?;
        volume.note_resolution();
        Ok(volume)
    }

    /// Other voxels of the same thing.
    fn with(&self, grid: Grid, voxels: Voxels, resolution: Resolution) -> Result<Self, VolumeError> {
        let mut volume = Self::new(grid, voxels)?.with_about(self.about.clone());
        volume.note_nan();
        Ok(Self { resolution, ..volume })
    }
}

/// Room for `count` voxels, none of which is touched.
fn room<T: Average>(count: usize) -> Result<Vec<T>, VolumeError> {
    let mut voxels = Vec::new();
    let reserved = voxels.try_reserve_exact(count);
    reserved.map_err(|_| VolumeError::io("voxels", std::io::ErrorKind::OutOfMemory.into()))?;
    Ok(voxels)
}

fn count(dims: [u32; 3]) -> usize {
    dims.iter().map(|&n| n as usize).product()
}

fn crop<T: Average>(
    voxels: &[T],
    full: [u32; 3],
    first: [u32; 3],
    dims: [u32; 3],
    watch: &LoadWatch,
) -> Result<Voxels, VolumeError> {
    let mut out = room(count(dims))?;
    watch.begin(LoadStage::Preparing, u64::from(dims[2]));
    let ([x, y, z], [nx, ny, nz]) = (first.map(|n| n as usize), dims.map(|n| n as usize));
    for k in z..z + nz {
        for j in y..y + ny {
            let row = (k * full[1] as usize + j) * full[0] as usize + x;
            out.extend_from_slice(&voxels[row..row + nx]);
        }
        watch.step(1)?;
    }
    Ok(T::into_voxels(out))
}

fn average<T: Average>(
    voxels: &[T],
    full: [u32; 3],
    factor: [u32; 3],
    watch: &LoadWatch,
) -> Result<Voxels, VolumeError> {
    let dims = reduced_dims(full, factor);
    let mut out: Vec<T> = room(count(dims))?;
    out.resize(count(dims), T::zeroed());
    watch.begin(LoadStage::Preparing, u64::from(dims[2]));
    let [fx, fy, fz] = factor.map(|n| n as usize);
    let [nx, ny, nz] = full.map(|n| n as usize);
    let [rx, ry, _] = dims.map(|n| n as usize);
    out.par_chunks_mut(rx * ry).enumerate().try_for_each(|(block_z, slice)| {
        for (block_y, row) in slice.chunks_mut(rx).enumerate() {
            watch.check()?;
            let mut sums = vec![(T::Total::default(), 0); rx];
            for k in block_z * fz..((block_z + 1) * fz).min(nz) {
                for j in block_y * fy..((block_y + 1) * fy).min(ny) {
                    let values = &voxels[(k * ny + j) * nx..][..nx];
                    for (sum, block) in sums.iter_mut().zip(values.chunks(fx)) {
                        block.iter().for_each(|value| value.add_to(sum));
                    }
                }
            }
            for (mean, sum) in row.iter_mut().zip(sums) {
                *mean = T::mean(sum);
            }
        }
        watch.step(1)
    })?;
    Ok(T::into_voxels(out))
}
