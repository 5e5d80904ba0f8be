//! VTK's XML image data, `.vti`, after <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>.
//!
//! One piece with one scalar array on its points, or, if there is none, on its cells, whose centres are then the
//! voxels. Data may be ascii, base64 or appended as they are or in base64, and compressed by zlib. VTK says nothing
//! about patients: its world is taken as it is.

mod encoded;
mod layout;
mod xml;

use std::io::{BufRead, BufReader, Read};

use encoded::{Base64, Blocks, UntilTag, read_counts};
use layout::{Encoding, Layout};
use xml::Walker;

use super::input::{Input, finish};
use super::{About, Volume, VolumeError, VoxelType, Voxels};

/// Whether a file begins like one of VTK's image data.
pub(super) fn magic(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head);
    text.trim_start_matches('\u{feff}').starts_with('<') && text.contains("<VTKFile") && text.contains("ImageData")
}

pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let limits = input.limits;
    let layout = Layout::read(input.open()?.reader)?;
    let count = limits.check("Extent", layout.grid.dims, layout.array.voxel_type)?;
    let mut voxels = Voxels::empty(layout.array.voxel_type);
    voxels.reserve("Extent", count)?;
    let mut walker = Walker::new(input.open()?.reader);
    match layout.array.encoding {
        Encoding::Ascii | Encoding::Base64 => walker.seek_array(layout.array.index)?,
        Encoding::AppendedRaw { offset } | Encoding::AppendedBase64 { offset } => walker.seek_appended(offset)?,
    }
    let mut stream = walker.data();
    match layout.array.encoding {
        Encoding::Ascii => voxels.append_ascii("DataArray", &mut BufReader::new(UntilTag::new(stream)), count)?,
        Encoding::Base64 | Encoding::AppendedBase64 { .. } => {
            let mut bytes = BufReader::new(Base64::new(BufReader::new(UntilTag::new(stream))));
            append(&mut voxels, &mut bytes, &layout, count)?;
        }
        Encoding::AppendedRaw { .. } => append(&mut voxels, &mut stream, &layout, count)?,
    }
    let mut about = About::default();
    for (name, value) in &layout.text {
        about.field(name, value);
    }
    Ok(Volume::new(layout.grid, voxels)?.with_about(about))
}

pub(super) fn peek_input(input: &mut Input) -> Result<([u32; 3], VoxelType), VolumeError> {
    let layout = Layout::read(input.open()?.reader)?;
    Ok((layout.grid.dims, layout.array.voxel_type))
}

/// Appends `count` voxels from the bytes of an array, which begin with how many they are.
fn append(voxels: &mut Voxels, reader: &mut dyn BufRead, layout: &Layout, count: usize) -> Result<(), VolumeError> {
    let expected = count as u64 * layout.array.voxel_type.bytes();
    if !layout.compressed {
        let bytes = read_counts(reader, layout.count_bytes, layout.endian, 1)?[0];
        if bytes != expected {
            let message = format!("{bytes} bytes of voxels; expected {expected} by the extent and the type");
            return Err(VolumeError::malformed("DataArray", message));
        }
        return voxels.append("DataArray", reader, count, layout.endian);
    }
    let mut blocks = Blocks::read(reader, layout.count_bytes, layout.endian, expected)?;
    voxels.append("DataArray", &mut blocks, count, layout.endian)?;
    finish(&mut blocks as &mut dyn Read, "DataArray")
}
