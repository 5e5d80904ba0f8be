//! VTK's XML image data, `.vti`, after <https://docs.vtk.org/en/latest/vtk_file_formats/vtkxml_file_format.html>.
//!
//! One piece, or several that fill the image, with one scalar array on points, or, if there is none, on cells, whose
//! centres are then the voxels. Data may be ascii, base64 or appended as they are or in base64, and compressed by zlib. VTK says nothing
//! about patients: its world is taken as it is.

mod encoded;
mod layout;
mod xml;

use std::io::{BufRead, BufReader, Read};

use encoded::{Base64, Blocks, UntilTag, read_counts};
use layout::{Encoding, Layout, Piece};
use xml::Walker;

use super::input::{Input, finish};
use super::sample::with_voxels;
use super::{About, Shape, Volume, VolumeError, Voxels};

/// Whether a file begins like one of VTK's image data.
pub(super) fn magic(head: &[u8]) -> bool {
    let text = String::from_utf8_lossy(head);
    text.trim_start_matches('\u{feff}').starts_with('<') && text.contains("<VTKFile") && text.contains("ImageData")
}

pub(super) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let limits = input.limits;
    let layout = Layout::read(input.open()?.reader)?;
    let count = limits.check("Extent", layout.grid.dims, layout.voxel_type)?;
    let voxels = match &layout.pieces[..] {
        [whole] => read_piece(input, &layout, whole)?,
        several => {
            let mut voxels = Voxels::empty(layout.voxel_type);
            voxels.reserve("Extent", count)?;
            with_voxels!(&mut voxels, v => v.resize(count, 0 as _));
            for piece in several {
                let part = read_piece(input, &layout, piece)?;
                place(&mut voxels, layout.grid.dims, &part, piece);
            }
            voxels
        }
    };
    let mut about = About::default();
    for (name, value) in &layout.text {
        about.field(name, value);
    }
    Ok(Volume::new(layout.grid, voxels)?.with_about(about))
}

pub(super) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    let layout = Layout::read(input.open()?.reader)?;
    Ok(Shape::of(&layout.grid, layout.voxel_type))
}

/// The voxels of a piece, which is within the grid and so within the limits.
fn read_piece(input: &mut Input, layout: &Layout, piece: &Piece) -> Result<Voxels, VolumeError> {
    let count = input.limits.check("Extent", piece.dims, layout.voxel_type)?;
    let mut voxels = Voxels::empty(layout.voxel_type);
    voxels.reserve("Extent", count)?;
    let mut walker = Walker::new(input.open()?.reader);
    match piece.encoding {
        Encoding::Ascii | Encoding::Base64 => walker.seek_array(piece.index)?,
        Encoding::AppendedRaw { offset } | Encoding::AppendedBase64 { offset } => walker.seek_appended(offset)?,
    }
    let mut stream = walker.data();
    match piece.encoding {
        Encoding::Ascii => voxels.append_ascii("DataArray", &mut BufReader::new(UntilTag::new(stream)), count)?,
        Encoding::Base64 | Encoding::AppendedBase64 { .. } => {
            let mut bytes = BufReader::new(Base64::new(BufReader::new(UntilTag::new(stream))));
            append(&mut voxels, &mut bytes, layout, count)?;
        }
        Encoding::AppendedRaw { .. } => append(&mut voxels, &mut stream, layout, count)?,
    }
    Ok(voxels)
}

/// Copies the voxels of a piece to their places, row by row.
fn place(voxels: &mut Voxels, dims: [u32; 3], part: &Voxels, piece: &Piece) {
    let ([nx, ny, _], [px, py, pz]) = (dims.map(|n| n as usize), piece.dims.map(|n| n as usize));
    let [x, y, z] = piece.start;
    for (k, j) in (0..pz).flat_map(|k| (0..py).map(move |j| (k, j))) {
        let (from, to) = ((k * py + j) * px, ((z + k) * ny + y + j) * nx + x);
        voxels.copy_row(to, part, from..from + px);
    }
}

/// Appends `count` voxels from the bytes of an array, which begin with how many they are.
fn append(voxels: &mut Voxels, reader: &mut dyn BufRead, layout: &Layout, count: usize) -> Result<(), VolumeError> {
    let expected = count as u64 * layout.voxel_type.bytes();
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
