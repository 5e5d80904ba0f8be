//! Slices of a volume and what lies behind each other in it, as pictures.

use glam::DVec3;
use rayon::prelude::*;

use super::gray::{GrayPicture, gray_picture};
use super::sample::{Sample, with_voxels};
use super::{Grid, Volume, VolumeError};

/// An index axis that is looked along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs)]
pub enum SliceAxis {
    X,
    Y,
    Z,
}

/// Longest side of a thumbnail, in pixels.
pub const LARGEST_THUMBNAIL: u32 = 512;

impl SliceAxis {
    /// The axis called `x`, `y` or `z`.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "x" => Some(Self::X),
            "y" => Some(Self::Y),
            "z" => Some(Self::Z),
            _ => None,
        }
    }

    /// Its number among the index axes.
    pub fn number(self) -> usize {
        self as usize
    }

    /// The axes that run to the right and down in a slice, and whether the second one runs up instead: across z, x runs
    /// right and y down; across y, x right and z up; across x, y right and z up. A patient whose axes are those of the
    /// grid is seen from the feet, from the front, and from the left, head up.
    fn in_picture(self) -> (usize, usize, bool) {
        match self {
            Self::X => (1, 2, true),
            Self::Y => (0, 2, true),
            Self::Z => (0, 1, false),
        }
    }
}

/// How large the picture of a slice is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SliceSize {
    /// Pixels across and down.
    pub pixels: [u32; 2],
    /// World units of a pixel, across and down: equal but for the rounding of `pixels`.
    pub pixel_size: [f64; 2],
}

impl SliceSize {
    /// The size of slices across an axis, with square pixels: of the given width; else as fine as the finer of the
    /// two spacings, but at most `longest` pixels along each side.
    ///
    /// # Errors
    /// Names `width` if it would make the picture higher than `longest`.
    pub fn new(grid: &Grid, axis: SliceAxis, width: Option<u32>, longest: u32) -> Result<Self, VolumeError> {
        let (across, down, _) = axis.in_picture();
        let extent = [across, down].map(|a| f64::from(grid.dims[a]) * grid.spacing[a]);
        let finest = grid.spacing[across].min(grid.spacing[down]);
        let pixel = match width {
            Some(width) => extent[0] / f64::from(width),
            None => finest.max(extent[0].max(extent[1]) / f64::from(longest)),
        };
        // `as` saturates.
        let pixels = extent.map(|length| (length / pixel).round().max(1.0) as u32);
        if pixels[1] > longest {
            let message = format!("the picture would have {} rows; the limit is {longest}", pixels[1]);
            return Err(VolumeError::malformed("width", message));
        }
        let pixels = [width.unwrap_or(pixels[0].min(longest)), pixels[1]];
        Ok(Self { pixels, pixel_size: [extent[0] / f64::from(pixels[0]), extent[1] / f64::from(pixels[1])] })
    }
}

/// Patient directions of the left, right, top and bottom edge of a slice, as letters: R and L, A and P, H and F. Means
/// something only where world axes are the patient's; of an oblique direction, the nearest.
pub fn slice_orientation(grid: &Grid, axis: SliceAxis) -> [char; 4] {
    let (across, down, up) = axis.in_picture();
    let right = grid.direction[across];
    let bottom = if up { -grid.direction[down] } else { grid.direction[down] };
    [letter(-right), letter(right), letter(-bottom), letter(bottom)]
}

/// Where in a patient a direction leads.
fn letter(direction: DVec3) -> char {
    let size = direction.abs();
    let (positive, negative, component) = if size.x >= size.y && size.x >= size.z {
        ('L', 'R', direction.x)
    } else if size.y >= size.z {
        ('P', 'A', direction.y)
    } else {
        ('H', 'F', direction.z)
    };
    if component >= 0.0 { positive } else { negative }
}

impl Volume {
    /// The slice number `index` across an axis. `low` is black, `high` white; NaN counts as the lowest value. Panics if
    /// there is no such slice.
    pub fn slice_picture(&self, axis: SliceAxis, index: u32, size: SliceSize, window: [f64; 2]) -> GrayPicture {
        let (across, down, up) = axis.in_picture();
        let dims = self.grid.dims.map(|n| n as usize);
        assert!((index as usize) < dims[axis.number()], "slice {index} is outside {dims:?}");
        let strides = [1, dims[0], dims[0] * dims[1]];
        let start = index as usize * strides[axis.number()];
        gray_picture([dims[across], dims[down]], size.pixels, window, |y, row| {
            let y = if up { dims[down] - 1 - y } else { y };
            let start = start + y * strides[down];
            with_voxels!(&self.voxels, v => {
                let values = v[start..].iter().step_by(strides[across]);
                row.iter_mut().zip(values).for_each(|(out, value)| *out = or(value.to_f64(), self.code_map.lowest));
            });
        })
    }

    /// The highest value behind each point of the volume as seen along y, x to the right and z up, between the lowest
    /// and the highest of them; at most [`LARGEST_THUMBNAIL`] pixels along each side. Reads every voxel.
    pub fn thumbnail(&self) -> GrayPicture {
        let dims = self.grid.dims.map(|n| n as usize);
        let highest = with_voxels!(&self.voxels, v => highest_along_y(v, dims, self.code_map.lowest));
        let low = highest.iter().copied().fold(f64::INFINITY, f64::min);
        let high = highest.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        // A constant picture is black.
        let window = if low < high { [low, high] } else { [low, low + low.abs().max(1.0)] };
        let size = SliceSize::new(&self.grid, SliceAxis::Y, None, LARGEST_THUMBNAIL).expect("no width is asked for");
        gray_picture([dims[0], dims[2]], size.pixels, window, |y, row| {
            row.copy_from_slice(&highest[(dims[2] - 1 - y) * dims[0]..][..dims[0]]);
        })
    }
}

fn or(value: f64, instead_of_nan: f64) -> f64 {
    if value.is_nan() { instead_of_nan } else { value }
}

/// nx x nz values.
fn highest_along_y<T: Sample>(values: &[T], [nx, ny, nz]: [usize; 3], lowest: f64) -> Vec<f64> {
    let mut highest = vec![lowest; nx * nz];
    highest.par_chunks_mut(nx).zip(values.par_chunks(nx * ny)).for_each(|(out, slice)| {
        for row in slice.chunks(nx) {
            // `max` ignores NaN.
            out.iter_mut().zip(row).for_each(|(out, value)| *out = out.max(value.to_f64()));
        }
    });
    highest
}
