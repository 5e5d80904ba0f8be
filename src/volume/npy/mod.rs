//! NumPy arrays: `.npy` of versions 1 to 3, and `.npz` archives of them.
//!
//! After <https://numpy.org/doc/stable/reference/generated/numpy.lib.format.html>. An array has shape (z, y, x), as
//! the program's own downloads have; axes of size 1 before or after three others are left out. There is no geometry:
//! spacing is 1.

mod header;
mod npz;

use std::io::BufRead;

use glam::DVec3;

use header::Header;

use super::input::{Input, finish};
use super::sample::{Sample, with_voxels};
use super::{About, Grid, Limits, Shape, Volume, VolumeError, Voxels};

pub(super) use npz::{magic as npz_magic, peek_input as npz_peek, read_input as npz_read};

/// Whether a file begins like an array.
pub(super) fn magic(head: &[u8]) -> bool {
    head.starts_with(header::MAGIC)
}

pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let limits = input.limits;
    let mut stream = input.open()?;
    let header = Header::read(&mut stream.reader)?;
    stream.expect_bytes("data", header.bytes, header.data_bytes(limits)?)?;
    let volume = header.read_volume(&mut stream.reader, limits)?;
    stream.finish("data")?;
    Ok(volume)
}

pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    let header = Header::read(&mut input.open()?.reader)?;
    Ok(Shape::without_spacing(header.dims()?, header.stored.voxel_type()))
}

impl Header {
    fn data_bytes(&self, limits: &Limits) -> Result<u64, VolumeError> {
        Ok(limits.check("shape", self.dims()?, self.stored.voxel_type())? as u64 * self.stored.bytes())
    }

    /// Reads the voxels that follow the header.
    fn read_volume(&self, reader: &mut dyn BufRead, limits: &Limits) -> Result<Volume, VolumeError> {
        let dims = self.dims()?;
        let count = limits.check("shape", dims, self.stored.voxel_type())?;
        let mut voxels = Voxels::empty(self.stored.voxel_type());
        voxels.reserve("shape", count)?;
        self.stored.append(&mut voxels, "data", reader, count, self.endian)?;
        finish(reader, "data")?;
        if self.fortran_order {
            with_voxels!(&mut voxels, v => *v = x_fastest(v, dims)?);
        }
        let mut about = About::default();
        about.field("descr", &self.descr);
        about.field("fortran_order", if self.fortran_order { "True" } else { "False" });
        about.field("shape", format!("{:?}", self.shape));
        about.note("the file says nothing about distances between voxels: they are taken to be 1");
        Ok(Volume::new(Grid::axis_aligned(dims, DVec3::ONE), voxels)?.with_about(about))
    }
}

/// Voxels of a file in which z runs fastest and x slowest; takes as much memory again.
fn x_fastest<T: Sample>(z_fastest: &[T], [nx, ny, nz]: [u32; 3]) -> Result<Vec<T>, VolumeError> {
    let mut out = Vec::new();
    let memory = |_| VolumeError::io("shape", std::io::ErrorKind::OutOfMemory.into());
    out.try_reserve_exact(z_fastest.len()).map_err(memory)?;
    let [nx, ny, nz] = [nx, ny, nz].map(|n| n as usize);
    for z in 0..nz {
        for y in 0..ny {
            out.extend((0..nx).map(|x| z_fastest[(x * ny + y) * nz + z]));
        }
    }
    Ok(out)
}
