//! Voxels without a header: everything about them is said beside them.

use std::io::Read;

use glam::DVec3;

use super::error::excerpt;
use super::input::Input;
use super::voxels::data_error;
use super::{Endian, Grid, Limits, Shape, Volume, VolumeError, VoxelType, Voxels, bytes_needed};

/// What a headerless file holds.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RawSpec {
    /// Number of voxels along x (fastest in the file), y and z.
    pub dims: [u32; 3],
    /// Type of the voxels.
    pub voxel_type: VoxelType,
    /// Their byte order.
    pub endian: Endian,
    /// World units between voxel centres along x, y and z.
    pub spacing: [f64; 3],
}

impl RawSpec {
    /// From the query parameters `dims=x,y,z`, `type`, `endian` (default `little`) and `spacing=x,y,z` (default 1).
    ///
    /// # Errors
    /// Names the parameter that is not understood.
    pub fn parse(
        dims: &str,
        voxel_type: &str,
        endian: Option<&str>,
        spacing: Option<&str>,
    ) -> Result<Self, VolumeError> {
        let voxel_type = VoxelType::ALL.into_iter().find(|t| t.name() == voxel_type).ok_or_else(|| {
            let names = VoxelType::ALL.map(VoxelType::name).join(", ");
            VolumeError::malformed("type", format!("{} is not one of {names}", excerpt(voxel_type)))
        })?;
        let endian = match endian {
            None | Some("little") => Endian::Little,
            Some("big") => Endian::Big,
            Some(other) => {
                let message = format!("{} is neither `little` nor `big`", excerpt(other));
                return Err(VolumeError::malformed("endian", message));
            }
        };
        let spacing = spacing.map_or(Ok([1.0; 3]), |text| parse_triple("spacing", text))?;
        Ok(Self { dims: parse_triple("dims", dims)?, voxel_type, endian, spacing })
    }

    /// Reads a volume from a file of `length` bytes, or, where that is not known, from all that comes.
    ///
    /// # Errors
    /// Names `dims` if they are beyond the limits or do not fit the number of bytes, `spacing` if it is not positive.
    pub fn read(&self, reader: &mut dyn Read, length: Option<u64>, limits: &Limits) -> Result<Volume, VolumeError> {
        let count = limits.check("dims", self.dims, self.voxel_type)?;
        let grid = Grid::axis_aligned(self.dims, DVec3::from_array(self.spacing));
        grid.check()?;
        let expected = count as u64 * self.voxel_type.bytes();
        let wrong_length = |length: &str| {
            let Self { dims, voxel_type, .. } = self;
            let message = format!("{dims:?} voxels of type {voxel_type} are {expected} bytes, but there are {length}");
            VolumeError::malformed("dims", message)
        };
        if let Some(length) = length.filter(|length| *length != expected) {
            return Err(wrong_length(&length.to_string()));
        }
        let mut voxels = Voxels::empty(self.voxel_type);
        voxels.reserve("dims", count)?;
        voxels.append("data", reader, count, self.endian)?;
        if reader.read(&mut [0]).map_err(|e| data_error("data", e))? > 0 {
            return Err(wrong_length("more"));
        }
        Volume::new(grid, voxels)
    }
}

/// Reads a file whose voxels may be wrapped, unless it has just the bytes that they have as they are: those may begin
/// with any value.
pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let (spec, limits) = (*required(input.raw)?, input.limits);
    let plain = input.open_wrapped()?.length == bytes_needed(spec.dims, spec.voxel_type);
    let mut stream = if plain { input.open_wrapped()? } else { input.open()? };
    spec.read(&mut stream.reader, stream.length, limits)
}

pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    required(input.raw).map(|raw| Shape { dims: raw.dims, voxel_type: raw.voxel_type, spacing: Some(raw.spacing) })
}

fn required(raw: Option<&RawSpec>) -> Result<&RawSpec, VolumeError> {
    raw.ok_or_else(|| VolumeError::malformed("dims", "missing; a raw file needs dims and type"))
}

fn parse_triple<T: std::str::FromStr>(field: &str, text: &str) -> Result<[T; 3], VolumeError> {
    let numbers: Option<Vec<T>> = text.split(',').take(4).map(|n| n.trim().parse().ok()).collect();
    numbers.and_then(|n| n.try_into().ok()).ok_or_else(|| {
        VolumeError::malformed(field, format!("{} is not three numbers with commas between them", excerpt(text)))
    })
}
