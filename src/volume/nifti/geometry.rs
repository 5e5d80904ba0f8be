//! Where a header says that the voxels are: sform, else qform, else no more than distances.

use glam::{DMat3, DQuat, DVec3};

use super::header::Header;
use crate::volume::grid::{check_origin, check_spacing};
use crate::volume::{About, Grid, VolumeError};

/// From right, anterior, superior to left, posterior, superior.
const LPS_FROM_RAS: DVec3 = DVec3::new(-1.0, -1.0, 1.0);

/// What nibabel forgives in the length of a quaternion of rounded numbers.
const QUATERNION_TOLERANCE: f64 = 3.0 * f32::EPSILON as f64;

/// The grid in patient space, in millimetres; an error names `srow`, `pixdim`, `quatern` or `qoffset`.
pub(super) fn grid(header: &Header, about: &mut About) -> Result<Grid, VolumeError> {
    let lps = LPS_FROM_RAS * header.unit;
    about.patient_axes = header.sform_code != 0 || header.qform_code != 0;
    if header.sform_code != 0 {
        let column = |i: usize| DVec3::from_array(header.srow.map(|row| row[i])) * lps;
        return Grid::from_steps("srow", header.dims, [column(0), column(1), column(2)], column(3));
    }
    let spacing = distances(header, about)? * header.unit;
    check_spacing("pixdim", spacing)?;
    let mut grid = Grid::axis_aligned(header.dims, spacing);
    if header.qform_code != 0 {
        let turn = rotation(header.quaternion)?;
        let sign = if header.pixdim[0] < 0.0 { -1.0 } else { 1.0 };
        grid.origin = header.qoffset * lps;
        check_origin("qoffset", grid.origin)?;
        return grid.turned("quatern", [turn.x_axis, turn.y_axis, turn.z_axis * sign].map(|axis| axis * LPS_FROM_RAS));
    }
    about.note("the file does not say how the volume lies in the patient: its first axis is taken to run to the left");
    let directions = [DVec3::X, DVec3::NEG_Y, DVec3::Z];
    let middle = (grid.dims_vec() - DVec3::ONE) * 0.5 * spacing;
    grid.origin = -(directions[0] * middle.x + directions[1] * middle.y + directions[2] * middle.z);
    grid.turned("pixdim", directions)
}

/// Positive distances between voxels, in the file's unit.
fn distances(header: &Header, about: &mut About) -> Result<DVec3, VolumeError> {
    let stored = DVec3::from_slice(&header.pixdim[1..]);
    if !stored.is_finite() {
        return Err(VolumeError::malformed(
            "pixdim",
            format!("{:?} are not three distances between voxels", stored.to_array()),
        ));
    }
    if stored.cmple(DVec3::ZERO).any() {
        about.note(format!(
            "distances between voxels in the file are {:?}: negative ones are taken as positive, 0 as 1",
            stored.to_array()
        ));
    }
    Ok(DVec3::from_array(stored.to_array().map(|d| if d == 0.0 { 1.0 } else { d.abs() })))
}

fn rotation(bcd: DVec3) -> Result<DMat3, VolumeError> {
    let rest = 1.0 - bcd.length_squared();
    if rest.is_nan() || rest < -QUATERNION_TOLERANCE {
        return Err(VolumeError::malformed(
            "quatern",
            format!("{:?} is longer than a unit quaternion", bcd.to_array()),
        ));
    }
    let quaternion = DQuat::from_xyzw(bcd.x, bcd.y, bcd.z, if rest < QUATERNION_TOLERANCE { 0.0 } else { rest.sqrt() });
    Ok(DMat3::from_quat(quaternion.normalize()))
}
