//! From the text of a header to what it means.

use std::io::BufRead;

use glam::DVec3;

use super::fields::{Fields, numbers};
use crate::volume::error::excerpt;
use crate::volume::grid::{check_origin, check_spacing};
use crate::volume::{About, Endian, Grid, VolumeError, VoxelType};

/// A valid header: everything but the voxels.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) grid: Grid,
    pub(super) voxel_type: VoxelType,
    pub(super) endian: Endian,
    pub(super) ascii: bool,
    pub(super) compressed: bool,
    /// Bytes before the data; `None` if the data are the last bytes of their file.
    pub(super) skip: Option<u64>,
    pub(super) data: DataFile,
    fields: Fields,
}

/// Where the data are.
#[derive(Clone, Debug)]
pub(super) enum DataFile {
    /// After the header.
    Local,
    /// In a file of this name, relative to the header's directory.
    Beside(String),
}

impl Header {
    /// The header, and how many bytes it has. Leaves the reader at local data.
    ///
    /// # Errors
    /// Names the field that is missing, malformed or not supported.
    pub(super) fn read(reader: &mut impl BufRead) -> Result<(Self, u64), VolumeError> {
        let fields = Fields::read(reader)?;
        if let Some(kind) = fields.get("ObjectType").filter(|kind| !kind.eq_ignore_ascii_case("image")) {
            return Err(VolumeError::unsupported("ObjectType", format!("{} is not Image", excerpt(kind))));
        }
        if let Some(channels) = fields.get("ElementNumberOfChannels").filter(|n| *n != "1") {
            let message = format!("{} values per voxel, as of colours or vectors; expected 1", excerpt(channels));
            return Err(VolumeError::unsupported("ElementNumberOfChannels", message));
        }
        let voxel_type = voxel_type(fields.require("ElementType")?)?;
        let grid = grid(&fields)?;
        let data = data_file(fields.require("ElementDataFile")?)?;
        let ascii = fields.flag("BinaryData")? == Some(false);
        let compressed = fields.flag("CompressedData")? == Some(true);
        if ascii && compressed {
            return Err(VolumeError::unsupported("CompressedData", "True for voxels as text; expected binary voxels"));
        }
        let big = match fields.flag("BinaryDataByteOrderMSB")? {
            Some(big) => big,
            None => fields.flag("ElementByteOrderMSB")?.unwrap_or(false),
        };
        let endian = if big { Endian::Big } else { Endian::Little };
        let skip = skip(&fields, &data, compressed || ascii)?;
        let bytes = fields.bytes;
        Ok((Self { grid, voxel_type, endian, ascii, compressed, skip, data, fields }, bytes))
    }

    /// The header as text, and what of it has no effect.
    pub(super) fn describe(&self, about: &mut About) {
        for (name, value) in &self.fields.lines {
            about.field(name, value);
        }
        // Left, posterior, superior is where axes of RAI run *to*.
        let contradicts = |code: &&str| !code.eq_ignore_ascii_case("RAI") && !code.starts_with('?');
        let turned = self.grid.direction != [DVec3::X, DVec3::Y, DVec3::Z];
        if let Some(code) = self.fields.get("AnatomicalOrientation").filter(contradicts)
            && !turned
        {
            about.note(format!(
                "AnatomicalOrientation {} has no effect: the directions of the axes are those of TransformMatrix",
                excerpt(code)
            ));
        }
        let plain = |value: &str, nothing: f64| value.parse() == Ok(nothing);
        let slope = self.fields.get("ElementToIntensityFunctionSlope").is_none_or(|value| plain(value, 1.0));
        let offset = self.fields.get("ElementToIntensityFunctionOffset").is_none_or(|value| plain(value, 0.0));
        if !(slope && offset) {
            about.note("ElementToIntensityFunction has no effect: values are those that are stored");
        }
    }
}

fn voxel_type(text: &str) -> Result<VoxelType, VolumeError> {
    Ok(match text {
        "MET_CHAR" => VoxelType::I8,
        "MET_UCHAR" => VoxelType::U8,
        "MET_SHORT" => VoxelType::I16,
        "MET_USHORT" => VoxelType::U16,
        // A `long` has four bytes in this format.
        "MET_INT" | "MET_LONG" => VoxelType::I32,
        "MET_UINT" | "MET_ULONG" => VoxelType::U32,
        "MET_LONG_LONG" => VoxelType::I64,
        "MET_ULONG_LONG" => VoxelType::U64,
        "MET_FLOAT" => VoxelType::F32,
        "MET_DOUBLE" => VoxelType::F64,
        other => {
            let message = format!("{} is not read; expected MET_CHAR to MET_DOUBLE", excerpt(other));
            return Err(VolumeError::unsupported("ElementType", message));
        }
    })
}

fn grid(fields: &Fields) -> Result<Grid, VolumeError> {
    let axes: usize = numbers("NDims", fields.require("NDims")?, 1)?[0];
    if !(3..=4).contains(&axes) {
        let message = format!("{axes} axes; expected 3, or 4 of which the last has size 1");
        return Err(VolumeError::unsupported("NDims", message));
    }
    let sizes: Vec<u32> = numbers("DimSize", fields.require("DimSize")?, axes)?;
    if axes == 4 && sizes[3] != 1 {
        let message = format!("{} volumes in one file, as over time; expected one", sizes[3]);
        return Err(VolumeError::unsupported("DimSize", message));
    }
    let unit = unit(fields.get("DistanceUnits").unwrap_or("mm"))?;
    let mut grid = Grid::axis_aligned([sizes[0], sizes[1], sizes[2]], DVec3::ONE);
    if let Some((name, text)) = fields.first(&["ElementSpacing", "ElementSize"]) {
        grid.spacing = DVec3::from_slice(&numbers::<f64>(name, text, axes)?) * unit;
        check_spacing(name, grid.spacing)?;
    }
    if let Some((name, text)) = fields.first(&["Offset", "Position", "Origin"]) {
        grid.origin = DVec3::from_slice(&numbers::<f64>(name, text, axes)?) * unit;
        check_origin(name, grid.origin)?;
    }
    if let Some((name, text)) = fields.first(&["TransformMatrix", "Rotation", "Orientation"]) {
        let matrix: Vec<f64> = numbers(name, text, axes * axes)?;
        let rows = std::array::from_fn(|axis| DVec3::from_slice(&matrix[axis * axes..]));
        grid = grid.turned(name, rows)?;
    }
    Ok(grid)
}

/// Millimetres of a unit.
fn unit(text: &str) -> Result<f64, VolumeError> {
    match text {
        "mm" | "?" | "" => Ok(1.0),
        "um" => Ok(1e-3),
        "cm" => Ok(10.0),
        "m" => Ok(1e3),
        other => {
            Err(VolumeError::unsupported("DistanceUnits", format!("{} is none of um, mm, cm and m", excerpt(other))))
        }
    }
}

fn data_file(text: &str) -> Result<DataFile, VolumeError> {
    let field = "ElementDataFile";
    let first = text.split_whitespace().next().unwrap_or_default();
    if first.is_empty() {
        return Err(VolumeError::malformed(field, "names no file; expected LOCAL or a name"));
    }
    if first.eq_ignore_ascii_case("LIST") || first.contains('%') {
        let message = "one file for each slice is not read; expected LOCAL or the name of one file";
        return Err(VolumeError::unsupported(field, message));
    }
    Ok(if text.eq_ignore_ascii_case("LOCAL") { DataFile::Local } else { DataFile::Beside(text.to_owned()) })
}

fn skip(fields: &Fields, data: &DataFile, encoded: bool) -> Result<Option<u64>, VolumeError> {
    let field = "HeaderSize";
    let bytes: i64 = fields.get(field).map_or(Ok(0), |text| numbers(field, text, 1).map(|n| n[0]))?;
    match (u64::try_from(bytes), data) {
        (Ok(0), _) => Ok(Some(0)),
        (Ok(skip), DataFile::Beside(_)) => Ok(Some(skip)),
        (Err(_), DataFile::Beside(_)) if bytes == -1 && !encoded => Ok(None),
        (Ok(_), DataFile::Local) => Err(VolumeError::unsupported(field, "only for data in a file of their own")),
        (Err(_), _) => Err(VolumeError::malformed(
            field,
            format!("{bytes}; expected bytes to skip, or -1 before plain binary data in a file of their own"),
        )),
    }
}
