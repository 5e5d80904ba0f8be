//! What the tags of a file say: where the voxels are in the world, and where in the file.

use std::io::BufRead;
use std::str::FromStr;

use glam::DVec3;

use super::xml::{Tag, Walker};
use crate::volume::error::excerpt;
use crate::volume::grid::{check_origin, check_spacing};
use crate::volume::{Endian, Grid, VolumeError, VoxelType};

/// Most arrays of a file.
const MAX_ARRAYS: usize = 1000;

/// Most pieces of an image, each of which is looked for from the beginning of the file.
const MAX_PIECES: usize = 64;

/// A file without its data.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) grid: Grid,
    pub(super) endian: Endian,
    /// Bytes of the numbers that say how long data are: 4 or 8.
    pub(super) count_bytes: usize,
    /// Whether binary data are blocks of zlib.
    pub(super) compressed: bool,
    pub(super) voxel_type: VoxelType,
    /// One, or several that fill the grid.
    pub(super) pieces: Vec<Piece>,
    /// Attributes as text.
    pub(super) text: Vec<(String, String)>,
}

/// A part of the image, and the array whose values are its voxels.
#[derive(Clone, Debug)]
pub(super) struct Piece {
    /// Its first voxel in the grid.
    pub(super) start: [usize; 3],
    /// Voxels along x, y and z.
    pub(super) dims: [u32; 3],
    /// How many arrays come before its own in the file.
    pub(super) index: usize,
    pub(super) encoding: Encoding,
}

/// How voxels became bytes, and where those are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Encoding {
    Ascii,
    Base64,
    /// So many bytes after the beginning of the appended data.
    AppendedRaw {
        offset: u64,
    },
    /// So many characters after the beginning of the appended data.
    AppendedBase64 {
        offset: u64,
    },
}

/// The attributes of a tag.
#[derive(Clone, Debug, Default)]
struct Attributes(Vec<(String, String)>);

impl Attributes {
    fn get(&self, name: &str) -> Option<&str> {
        self.0.iter().find(|(key, _)| key == name).map(|(_, value)| value.trim())
    }

    fn numbers<T: FromStr + Copy, const N: usize>(&self, name: &str) -> Result<Option<[T; N]>, VolumeError> {
        let Some(text) = self.get(name) else { return Ok(None) };
        let numbers: Option<Vec<T>> = text.split_whitespace().take(N + 1).map(|n| n.parse().ok()).collect();
        let wrong = || VolumeError::malformed(name, format!("{} is not {N} numbers", excerpt(text)));
        numbers.and_then(|n| n.try_into().ok()).ok_or_else(wrong).map(Some)
    }
}

/// Everything that was found on the way.
#[derive(Debug, Default)]
struct Found {
    file: Attributes,
    image: Option<Attributes>,
    pieces: Vec<Attributes>,
    /// Tags that hold arrays: those of points, then those of cells.
    holders: [Attributes; 2],
    /// Which of them is open.
    open: Option<usize>,
    arrays: Vec<FoundArray>,
    arrays_seen: usize,
    appended: Option<Attributes>,
}

/// An array of points or cells.
#[derive(Debug)]
struct FoundArray {
    /// Number in the file.
    index: usize,
    /// Number of its piece.
    piece: usize,
    holder: usize,
    attributes: Attributes,
}

impl Layout {
    /// An error names the attribute or tag at fault.
    pub(super) fn read(reader: Box<dyn BufRead + '_>) -> Result<Self, VolumeError> {
        let mut walker = Walker::new(reader);
        let mut found = Found::default();
        while found.appended.is_none() {
            match walker.next()? {
                Tag::Start { name, attributes, empty } => found.start(&name, Attributes(attributes), empty)?,
                Tag::End(name) if name == "PointData" || name == "CellData" => found.open = None,
                Tag::End(_) => {}
                Tag::Eof => break,
            }
        }
        found.layout()
    }
}

impl Found {
    fn start(&mut self, name: &str, attributes: Attributes, empty: bool) -> Result<(), VolumeError> {
        match name {
            "VTKFile" => {
                let kind = attributes.get("type").unwrap_or_default();
                if kind == "PImageData" {
                    let message = "a .pvti file only names others; write the image as one .vti file";
                    return Err(VolumeError::unsupported("type", message));
                }
                if kind != "ImageData" {
                    let message = format!("{} is not read; expected ImageData", excerpt(kind));
                    return Err(VolumeError::unsupported("type", message));
                }
                self.file = attributes;
            }
            "ImageData" => self.image = Some(attributes),
            "Piece" if self.pieces.len() == MAX_PIECES => {
                let message = format!("more than {MAX_PIECES} pieces; write the image in fewer");
                return Err(VolumeError::unsupported("Piece", message));
            }
            "Piece" => self.pieces.push(attributes),
            "PointData" | "CellData" => {
                let holder = usize::from(name == "CellData");
                self.open = (!empty).then_some(holder);
                self.holders[holder] = attributes;
            }
            "DataArray" => {
                if let Some(holder) = self.open {
                    let piece = self.pieces.len().saturating_sub(1);
                    self.arrays.push(FoundArray { index: self.arrays_seen, piece, holder, attributes });
                }
                self.arrays_seen += 1;
                if self.arrays_seen > MAX_ARRAYS {
                    let message = format!("more than {MAX_ARRAYS} arrays in the file");
                    return Err(VolumeError::unsupported("DataArray", message));
                }
            }
            "AppendedData" => self.appended = Some(attributes),
            _ => {}
        }
        Ok(())
    }

    fn layout(self) -> Result<Layout, VolumeError> {
        let image = self.image.as_ref().ok_or_else(|| VolumeError::malformed("ImageData", "missing"))?;
        let chosen = self.choose()?;
        let (cells, attributes) = (chosen.holder == 1, &chosen.attributes);
        let whole: [i64; 6] =
            image.numbers("WholeExtent")?.ok_or_else(|| VolumeError::malformed("WholeExtent", "missing"))?;
        let grid = grid(image, whole, cells)?;
        let mut text = self.file.0.clone();
        text.extend(image.0.iter().cloned());
        text.extend(attributes.0.iter().map(|(name, value)| (format!("DataArray {name}"), value.clone())));
        Ok(Layout {
            grid,
            endian: endian(self.file.get("byte_order"))?,
            count_bytes: count_bytes(self.file.get("header_type"))?,
            compressed: compressed(self.file.get("compressor"))?,
            voxel_type: voxel_type(attributes)?,
            pieces: self.pieces(chosen, whole)?,
            text,
        })
    }

    /// The pieces, each with its array of the chosen name.
    fn pieces(&self, chosen: &FoundArray, whole: [i64; 6]) -> Result<Vec<Piece>, VolumeError> {
        let cells = chosen.holder == 1;
        let extent = |piece: &Attributes| piece.numbers("Extent").map(|extent| extent.unwrap_or(whole));
        let extents: Vec<[i64; 6]> = self.pieces.iter().map(extent).collect::<Result<_, _>>()?;
        // A file without a piece has its arrays in the image.
        let extents = if extents.is_empty() { vec![whole] } else { extents };
        // VTK writes an image that it cannot cut as several copies of it.
        let is_new = |(number, extent): &(usize, &[i64; 6])| !extents[..*number].contains(extent);
        let distinct: Vec<(usize, &[i64; 6])> = extents.iter().enumerate().filter(is_new).collect();
        check_cover(whole, &distinct)?;
        let name = chosen.attributes.get("Name");
        let piece = |(number, extent): (usize, &[i64; 6])| {
            let is_same = |array: &&FoundArray| {
                let is_here = array.piece == number && array.holder == chosen.holder;
                is_here && (number == chosen.piece || array.attributes.get("Name") == name)
            };
            let here = if number == chosen.piece { Some(chosen) } else { self.arrays.iter().find(is_same) };
            let missing = || format!("piece {number} has no array {}", excerpt(name.unwrap_or("?")));
            let array = here.ok_or_else(|| VolumeError::malformed("DataArray", missing()))?;
            check_scalar(&array.attributes)?;
            if array.attributes.get("type") != chosen.attributes.get("type") {
                let message = "the arrays of the pieces are of several types; expected one";
                return Err(VolumeError::unsupported("type", message));
            }
            Ok(Piece {
                start: [0, 1, 2].map(|axis| (extent[2 * axis] - whole[2 * axis]) as usize),
                dims: dims(*extent, cells)?,
                index: array.index,
                encoding: encoding(&array.attributes, self.appended.as_ref())?,
            })
        };
        distinct.into_iter().map(piece).collect()
    }

    /// The array of scalars of the first piece that has arrays: on points if there is any, the named one of several.
    fn choose(&self) -> Result<&FoundArray, VolumeError> {
        let piece = self.arrays.iter().map(|array| array.piece).min().unwrap_or(0);
        let of_piece = || self.arrays.iter().filter(|array| array.piece == piece);
        let holder = usize::from(!of_piece().any(|array| array.holder == 0));
        let arrays: Vec<&FoundArray> = of_piece().filter(|array| array.holder == holder).collect();
        let named = |name: &str| arrays.iter().copied().find(|array| array.attributes.get("Name") == Some(name));
        let scalars: Vec<_> = arrays.iter().filter(|array| components(&array.attributes) == "1").collect();
        let chosen = match (self.holders[holder].get("Scalars").and_then(named), &arrays[..], &scalars[..]) {
            (Some(active), ..) => active,
            (None, [only], _) => only,
            (None, [], _) => return Err(VolumeError::malformed("DataArray", "no array on points or cells")),
            (None, _, [only]) => only,
            _ => {
                let name = |array: &&FoundArray| excerpt(array.attributes.get("Name").unwrap_or("?"));
                let names: Vec<_> = arrays.iter().take(10).map(name).collect();
                let message = format!("several ({}); expected one, or one named by Scalars", names.join(", "));
                return Err(VolumeError::unsupported("DataArray", message));
            }
        };
        check_scalar(&chosen.attributes)?;
        Ok(chosen)
    }
}

fn components(attributes: &Attributes) -> &str {
    attributes.get("NumberOfComponents").unwrap_or("1")
}

fn check_scalar(attributes: &Attributes) -> Result<(), VolumeError> {
    match components(attributes) {
        "1" => Ok(()),
        other => {
            let message = format!("{} values per voxel, as of colours or vectors; expected 1", excerpt(other));
            Err(VolumeError::unsupported("NumberOfComponents", message))
        }
    }
}

/// Whether pieces fill the whole, and none of them lies in another one; those of points share their faces.
fn check_cover(whole: [i64; 6], pieces: &[(usize, &[i64; 6])]) -> Result<(), VolumeError> {
    let malformed = |message: String| Err(VolumeError::malformed("Extent", message));
    // Cells along an axis; an axis of one point counts as one of one cell.
    let cells = |extent: &[i64; 6], axis: usize| {
        let [low, high] = [extent[2 * axis], extent[2 * axis + 1]].map(i128::from);
        if whole[2 * axis] == whole[2 * axis + 1] { (low, high + 1) } else { (low, high) }
    };
    let count = |extent: &[i64; 6]| {
        (0..3).map(|axis| cells(extent, axis)).fold(1_i128, |n, (low, high)| n.saturating_mul((high - low).max(0)))
    };
    let mut sum = 0_i128;
    for (index, &(_, piece)) in pieces.iter().enumerate() {
        if (0..3).any(|axis| piece[2 * axis] < whole[2 * axis] || piece[2 * axis + 1] > whole[2 * axis + 1]) {
            return malformed(format!("{piece:?} is not within the WholeExtent {whole:?}"));
        }
        let overlaps = |(_, other): &&(usize, &[i64; 6])| {
            (0..3).all(|axis| {
                let ((a, b), (c, d)) = (cells(piece, axis), cells(other, axis));
                a.max(c) < b.min(d)
            })
        };
        if let Some((_, other)) = pieces[..index].iter().find(overlaps) {
            return malformed(format!("the pieces {other:?} and {piece:?} overlap"));
        }
        sum = sum.saturating_add(count(piece));
    }
    if sum == count(&whole) {
        return Ok(());
    }
    malformed(format!("the pieces do not fill the WholeExtent {whole:?}; expected the whole image in one file"))
}

/// Voxels along x, y and z.
fn dims(extent: [i64; 6], cells: bool) -> Result<[u32; 3], VolumeError> {
    let mut dims = [0; 3];
    for (axis, n) in dims.iter_mut().enumerate() {
        let [low, high] = [extent[2 * axis], extent[2 * axis + 1]].map(i128::from);
        let size = high - low + i128::from(!cells);
        if size < 1 {
            return Err(VolumeError::malformed("Extent", format!("{extent:?} has no voxels")));
        }
        *n = u32::try_from(size).map_err(|_| VolumeError::TooLarge {
            field: "Extent".to_owned(),
            unit: "voxels along an axis",
            needed: size.unsigned_abs(),
            limit: u32::MAX.into(),
        })?;
    }
    Ok(dims)
}

fn grid(image: &Attributes, extent: [i64; 6], cells: bool) -> Result<Grid, VolumeError> {
    let dims = dims(extent, cells)?;
    let spacing = DVec3::from_array(image.numbers("Spacing")?.unwrap_or([1.0; 3]));
    check_spacing("Spacing", spacing)?;
    let mut grid = Grid::axis_aligned(dims, spacing);
    if let Some(matrix) = image.numbers::<f64, 9>("Direction")? {
        // Rows of the matrix; its columns are the directions of the axes.
        grid =
            grid.turned("Direction", std::array::from_fn(|a| DVec3::new(matrix[a], matrix[3 + a], matrix[6 + a])))?;
    }
    let first = DVec3::new(extent[0] as f64, extent[2] as f64, extent[4] as f64);
    let first = (first + if cells { DVec3::splat(0.5) } else { DVec3::ZERO }) * grid.spacing;
    let [x, y, z] = grid.direction;
    grid.origin =
        DVec3::from_array(image.numbers("Origin")?.unwrap_or([0.0; 3])) + x * first.x + y * first.y + z * first.z;
    check_origin("Origin", grid.origin)?;
    Ok(grid)
}

fn endian(text: Option<&str>) -> Result<Endian, VolumeError> {
    match text {
        None | Some("LittleEndian") => Ok(Endian::Little),
        Some("BigEndian") => Ok(Endian::Big),
        Some(other) => {
            let message = format!("{} is neither LittleEndian nor BigEndian", excerpt(other));
            Err(VolumeError::malformed("byte_order", message))
        }
    }
}

fn count_bytes(text: Option<&str>) -> Result<usize, VolumeError> {
    match text {
        None | Some("UInt32") => Ok(4),
        Some("UInt64") => Ok(8),
        Some(other) => {
            Err(VolumeError::malformed("header_type", format!("{} is neither UInt32 nor UInt64", excerpt(other))))
        }
    }
}

fn compressed(text: Option<&str>) -> Result<bool, VolumeError> {
    match text {
        None | Some("") => Ok(false),
        Some("vtkZLibDataCompressor") => Ok(true),
        Some(other) => {
            let message = format!("{} is not read; expected vtkZLibDataCompressor or none", excerpt(other));
            Err(VolumeError::unsupported("compressor", message))
        }
    }
}

fn voxel_type(attributes: &Attributes) -> Result<VoxelType, VolumeError> {
    Ok(match attributes.get("type").unwrap_or_default() {
        "Int8" => VoxelType::I8,
        "UInt8" => VoxelType::U8,
        "Int16" => VoxelType::I16,
        "UInt16" => VoxelType::U16,
        "Int32" => VoxelType::I32,
        "UInt32" => VoxelType::U32,
        "Int64" => VoxelType::I64,
        "UInt64" => VoxelType::U64,
        "Float32" => VoxelType::F32,
        "Float64" => VoxelType::F64,
        other => {
            let message = format!("{} is not read; expected Int8 to UInt64, Float32 or Float64", excerpt(other));
            return Err(VolumeError::unsupported("type", message));
        }
    })
}

fn encoding(attributes: &Attributes, appended: Option<&Attributes>) -> Result<Encoding, VolumeError> {
    match attributes.get("format") {
        None | Some("ascii") => return Ok(Encoding::Ascii),
        Some("binary") => return Ok(Encoding::Base64),
        Some("appended") => {}
        Some(other) => {
            let message = format!("{} is not ascii, binary or appended", excerpt(other));
            return Err(VolumeError::malformed("format", message));
        }
    }
    let appended = appended.ok_or_else(|| VolumeError::malformed("AppendedData", "missing"))?;
    let [offset] = attributes.numbers("offset")?.ok_or_else(|| VolumeError::malformed("offset", "missing"))?;
    match appended.get("encoding") {
        Some("raw") => Ok(Encoding::AppendedRaw { offset }),
        None | Some("base64") => Ok(Encoding::AppendedBase64 { offset }),
        Some(other) => Err(VolumeError::malformed("encoding", format!("{} is neither raw nor base64", excerpt(other)))),
    }
}
