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

/// A file without its data.
#[derive(Clone, Debug)]
pub(super) struct Layout {
    pub(super) grid: Grid,
    pub(super) endian: Endian,
    /// Bytes of the numbers that say how long data are: 4 or 8.
    pub(super) count_bytes: usize,
    /// Whether binary data are blocks of zlib.
    pub(super) compressed: bool,
    pub(super) array: Array,
    /// Attributes as text.
    pub(super) text: Vec<(String, String)>,
}

/// The array whose values are the voxels.
#[derive(Clone, Debug)]
pub(super) struct Array {
    /// How many arrays come before it in the file.
    pub(super) index: usize,
    pub(super) voxel_type: VoxelType,
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
    piece: Option<Attributes>,
    /// Tags that hold arrays: those of points, then those of cells.
    holders: [Attributes; 2],
    /// Which of them is open.
    open: Option<usize>,
    /// Number in the file, holder, attributes.
    arrays: Vec<(usize, usize, Attributes)>,
    arrays_seen: usize,
    appended: Option<Attributes>,
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
                if kind != "ImageData" {
                    let message = format!("{} is not read; expected ImageData", excerpt(kind));
                    return Err(VolumeError::unsupported("type", message));
                }
                self.file = attributes;
            }
            "ImageData" => self.image = Some(attributes),
            "Piece" if self.piece.is_some() => {
                return Err(VolumeError::unsupported("Piece", "several pieces; expected the whole image in one"));
            }
            "Piece" => self.piece = Some(attributes),
            "PointData" | "CellData" => {
                let holder = usize::from(name == "CellData");
                self.open = (!empty).then_some(holder);
                self.holders[holder] = attributes;
            }
            "DataArray" => {
                if let Some(holder) = self.open {
                    self.arrays.push((self.arrays_seen, holder, attributes));
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
        let (index, holder, attributes) = self.choose()?;
        let grid = grid(image, self.piece.as_ref(), *holder == 1)?;
        let mut text = self.file.0.clone();
        text.extend(image.0.iter().cloned());
        text.extend(attributes.0.iter().map(|(name, value)| (format!("DataArray {name}"), value.clone())));
        Ok(Layout {
            grid,
            endian: endian(self.file.get("byte_order"))?,
            count_bytes: count_bytes(self.file.get("header_type"))?,
            compressed: compressed(self.file.get("compressor"))?,
            array: Array {
                index: *index,
                voxel_type: voxel_type(attributes)?,
                encoding: encoding(attributes, self.appended.as_ref())?,
            },
            text,
        })
    }

    /// The array of scalars: on points if there is any, the named one of several.
    fn choose(&self) -> Result<&(usize, usize, Attributes), VolumeError> {
        let holder = usize::from(!self.arrays.iter().any(|(_, holder, _)| *holder == 0));
        let arrays: Vec<_> = self.arrays.iter().filter(|(_, h, _)| *h == holder).collect();
        let active = self.holders[holder].get("Scalars");
        let components = |a: &Attributes| a.get("NumberOfComponents").unwrap_or("1").to_owned();
        let scalars: Vec<_> = arrays.iter().filter(|(_, _, a)| components(a) == "1").collect();
        let chosen =
            match (active.and_then(|name| arrays.iter().find(|(_, _, a)| a.get("Name") == Some(name))), &arrays[..]) {
                (Some(active), _) => active,
                (None, [only]) => only,
                (None, []) => {
                    return Err(VolumeError::malformed("DataArray", "no array on points or cells"));
                }
                (None, _) => match &scalars[..] {
                    [only] => only,
                    _ => {
                        let names: Vec<_> =
                            arrays.iter().take(10).map(|(_, _, a)| excerpt(a.get("Name").unwrap_or("?"))).collect();
                        let message = format!("several ({}); expected one, or one named by Scalars", names.join(", "));
                        return Err(VolumeError::unsupported("DataArray", message));
                    }
                },
            };
        let components = components(&chosen.2);
        if components != "1" {
            let message = format!("{} values per voxel, as of colours or vectors; expected 1", excerpt(&components));
            return Err(VolumeError::unsupported("NumberOfComponents", message));
        }
        Ok(chosen)
    }
}

fn grid(image: &Attributes, piece: Option<&Attributes>, cells: bool) -> Result<Grid, VolumeError> {
    let whole: [i64; 6] =
        image.numbers("WholeExtent")?.ok_or_else(|| VolumeError::malformed("WholeExtent", "missing"))?;
    let extent = piece.map_or(Ok(None), |piece| piece.numbers("Extent"))?.unwrap_or(whole);
    if extent != whole {
        let message = format!("{extent:?} is not the WholeExtent {whole:?}; expected the whole image in one piece");
        return Err(VolumeError::unsupported("Extent", message));
    }
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
