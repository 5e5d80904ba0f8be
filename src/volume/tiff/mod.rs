//! TIFF stacks: pages of grey values, plain, of ImageJ or of OME (<https://docs.openmicroscopy.org/ome-model/>).
//!
//! Read are whole numbers of 8 to 64 bits and floating-point values, in strips or tiles, plain, `PackBits`, LZW or
//! deflated, BigTIFF, both byte orders.
//!
//! Where the formats leave room:
//! - World units are mm, as for patients: OME's micrometres (its default) and ImageJ's units are turned into them.
//!   Where no unit is known, lengths are taken as they are. A plain TIFF's resolution is of printing, not of space.
//! - Of several channels one is chosen, the first by default; of several time points the first. Both are noted.
//! - Pages of reduced resolution are passed over.

mod imagej;
mod layout;
mod ome;
mod pages;

use layout::Layout;
use pages::Pages;

use super::input::Input;
use super::{About, Shape, Volume, VolumeError, Voxels};

/// Reads the volume.
///
/// # Errors
/// Names `pages` where they differ or are not of grey values, `channel` if there is no such, `description` if its OME
/// metadata contradict the file.
pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let (limits, channel) = (*input.limits, input.choice.channel);
    let mut pages = Pages::open(input.seekable()?, &limits)?;
    let layout = Layout::new(&pages, channel)?;
    let count = limits.check("dims", layout.grid.dims, pages.voxel_type)?;
    layout.grid.check()?;
    let mut voxels = Voxels::empty(pages.voxel_type);
    voxels.reserve("pages", count)?;
    for &page in &layout.planes {
        pages.append(page, &mut voxels)?;
    }
    let mut about = About { notes: layout.notes, ..About::default() };
    for (name, value) in pages.technical_fields().iter().chain(&layout.technical) {
        about.technical_field(name, value);
    }
    if let Some(description) = &pages.description {
        about.field("ImageDescription", description);
    }
    Ok(Volume::new(layout.grid, voxels)?.with_about(about))
}

/// Dims and type of the volume, without its voxels.
///
/// # Errors
/// As [`read_input`].
pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    let (limits, channel) = (*input.limits, input.choice.channel);
    let pages = Pages::open(input.seekable()?, &limits)?;
    let layout = Layout::new(&pages, channel)?;
    limits.check("dims", layout.grid.dims, pages.voxel_type)?;
    Ok(if layout.is_placed {
        Shape::of(&layout.grid, pages.voxel_type)
    } else {
        Shape::without_spacing(layout.grid.dims, pages.voxel_type)
    })
}
