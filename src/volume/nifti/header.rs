//! The fixed bytes of a header: 348 of version 1, 540 of version 2.

use std::io::{BufRead, Read};

use glam::DVec3;

use crate::volume::scaled::Scaling;
use crate::volume::voxels::data_error;
use crate::volume::{About, Endian, VolumeError, VoxelType};

const BYTES_1: u64 = 348;
const BYTES_2: u64 = 540;

/// What of a header matters to a scalar volume, and more of it as text.
#[derive(Clone, Debug)]
pub(super) struct Header {
    /// 1 or 2.
    pub(super) version: u8,
    /// Bytes of the header itself.
    pub(super) bytes: u64,
    pub(super) endian: Endian,
    pub(super) dims: [u32; 3],
    pub(super) stored_type: VoxelType,
    pub(super) scaling: Scaling,
    /// Bytes of the file before the voxels; at least `bytes` + 4.
    pub(super) vox_offset: u64,
    /// The sign of the third axis, and distances, as the file has them.
    pub(super) pixdim: [f64; 4],
    pub(super) qform_code: i32,
    pub(super) sform_code: i32,
    /// b, c and d of a unit quaternion.
    pub(super) quaternion: DVec3,
    pub(super) qoffset: DVec3,
    /// Rows of the affine map from voxel indices to the world.
    pub(super) srow: [[f64; 4]; 3],
    /// Millimetres of the file's unit, as far as it is known.
    pub(super) unit: f64,
    /// Fields that are only told.
    text: Vec<(&'static str, String)>,
}

/// A header's bytes with their order.
struct Fields<'a> {
    bytes: &'a [u8],
    endian: Endian,
}

impl Fields<'_> {
    fn array<const N: usize>(&self, at: usize) -> [u8; N] {
        let mut array: [u8; N] = self.bytes[at..at + N].try_into().expect("fields lie inside of the fixed header");
        if self.endian == Endian::Big {
            array.reverse();
        }
        array
    }

    fn i16(&self, at: usize) -> i16 {
        i16::from_le_bytes(self.array(at))
    }

    fn i32(&self, at: usize) -> i32 {
        i32::from_le_bytes(self.array(at))
    }

    fn i64(&self, at: usize) -> i64 {
        i64::from_le_bytes(self.array(at))
    }

    fn f32(&self, at: usize) -> f64 {
        f64::from(f32::from_le_bytes(self.array(at)))
    }

    fn f64(&self, at: usize) -> f64 {
        f64::from_le_bytes(self.array(at))
    }

    /// Text up to the first zero byte.
    fn text(&self, at: usize, length: usize) -> String {
        let bytes = &self.bytes[at..at + length];
        let end = bytes.iter().position(|b| *b == 0).unwrap_or(length);
        String::from_utf8_lossy(&bytes[..end]).trim().to_owned()
    }
}

/// The fields as numbers, the same for both versions.
struct Values {
    dim: [i64; 8],
    datatype: i16,
    vox_offset: f64,
    slope: f64,
    intercept: f64,
    xyzt_units: i32,
    pixdim: [f64; 4],
    qform_code: i32,
    sform_code: i32,
    quaternion: [f64; 3],
    qoffset: [f64; 3],
    srow: [[f64; 4]; 3],
    text: Vec<(&'static str, String)>,
}

fn values_1(f: &Fields) -> Values {
    let floats = |at: usize| std::array::from_fn(|i| f.f32(at + 4 * i));
    Values {
        dim: std::array::from_fn(|i| i64::from(f.i16(40 + 2 * i))),
        datatype: f.i16(70),
        vox_offset: f.f32(108),
        slope: f.f32(112),
        intercept: f.f32(116),
        xyzt_units: i32::from(f.bytes[123]),
        pixdim: std::array::from_fn(|i| f.f32(76 + 4 * i)),
        qform_code: i32::from(f.i16(252)),
        sform_code: i32::from(f.i16(254)),
        quaternion: floats(256),
        qoffset: floats(268),
        srow: std::array::from_fn(|row| std::array::from_fn(|i| f.f32(280 + 16 * row + 4 * i))),
        text: vec![
            ("descrip", f.text(148, 80)),
            ("aux_file", f.text(228, 24)),
            ("intent_name", f.text(328, 16)),
            ("intent_code", f.i16(68).to_string()),
            ("cal_min", f.f32(128).to_string()),
            ("cal_max", f.f32(124).to_string()),
        ],
    }
}

fn values_2(f: &Fields) -> Values {
    let floats = |at: usize| std::array::from_fn(|i| f.f64(at + 8 * i));
    Values {
        dim: std::array::from_fn(|i| f.i64(16 + 8 * i)),
        datatype: f.i16(12),
        // Whole numbers of bytes that a file can have are exact.
        vox_offset: f.i64(168) as f64,
        slope: f.f64(176),
        intercept: f.f64(184),
        xyzt_units: f.i32(500),
        pixdim: std::array::from_fn(|i| f.f64(104 + 8 * i)),
        qform_code: f.i32(344),
        sform_code: f.i32(348),
        quaternion: floats(352),
        qoffset: floats(376),
        srow: std::array::from_fn(|row| std::array::from_fn(|i| f.f64(400 + 32 * row + 8 * i))),
        text: vec![
            ("descrip", f.text(240, 80)),
            ("aux_file", f.text(320, 24)),
            ("intent_name", f.text(508, 16)),
            ("intent_code", f.i32(504).to_string()),
            ("cal_min", f.f64(200).to_string()),
            ("cal_max", f.f64(192).to_string()),
        ],
    }
}

impl Header {
    /// An error names the field at fault; `sizeof_hdr` or `magic` if this is no such header.
    pub(super) fn read(reader: &mut dyn BufRead) -> Result<Self, VolumeError> {
        let mut bytes = Vec::new();
        reader.take(BYTES_1).read_to_end(&mut bytes).map_err(|e| data_error("header", e))?;
        let first: Option<[u8; 4]> = bytes.get(..4).and_then(|b| b.try_into().ok());
        let sizes = first.map(|b| [(Endian::Little, i32::from_le_bytes(b)), (Endian::Big, i32::from_be_bytes(b))]);
        let known = sizes.into_iter().flatten().find(|(_, size)| matches!(size, 348 | 540));
        let Some((endian, size)) = known else {
            let message = "not a NIfTI file: it begins with neither 348 nor 540. An .img file holds only voxels: join it \
                           with its .hdr in one .nii file";
            return Err(VolumeError::malformed("sizeof_hdr", message));
        };
        let (version, length) = if size == 348 { (1, BYTES_1) } else { (2, BYTES_2) };
        reader.take(length - BYTES_1).read_to_end(&mut bytes).map_err(|e| data_error("header", e))?;
        if (bytes.len() as u64) < length {
            let message = format!("truncated: a header has {length} bytes, but there are {}", bytes.len());
            return Err(VolumeError::malformed("header", message));
        }
        let fields = Fields { bytes: &bytes, endian };
        check_magic(if version == 1 { &bytes[344..348] } else { &bytes[4..12] })?;
        let values = if version == 1 { values_1(&fields) } else { values_2(&fields) };
        Self::new(version, length, endian, values)
    }

    fn new(version: u8, bytes: u64, endian: Endian, values: Values) -> Result<Self, VolumeError> {
        let dims = dims(values.dim)?;
        let stored_type = stored_type(values.datatype)?;
        Ok(Self {
            version,
            bytes,
            endian,
            dims,
            stored_type,
            scaling: scaling(values.slope, values.intercept)?,
            vox_offset: vox_offset(values.vox_offset, bytes)?,
            pixdim: values.pixdim,
            qform_code: values.qform_code,
            sform_code: values.sform_code,
            quaternion: DVec3::from_array(values.quaternion),
            qoffset: DVec3::from_array(values.qoffset),
            srow: values.srow,
            unit: unit(values.xyzt_units)?,
            text: values.text,
        })
    }

    /// The header as text.
    pub(super) fn describe(&self, about: &mut About) {
        let list = |numbers: &[f64]| numbers.iter().map(f64::to_string).collect::<Vec<_>>().join(" ");
        about.field("version", format!("NIfTI-{}", self.version));
        about.field("dim", self.dims.map(|n| n.to_string()).join(" "));
        about.field("datatype", self.stored_type.name());
        about.field("pixdim", list(&self.pixdim));
        about.field("scl_slope", self.scaling.slope.to_string());
        about.field("scl_inter", self.scaling.intercept.to_string());
        about.field("qform_code", self.qform_code.to_string());
        about.field("sform_code", self.sform_code.to_string());
        if self.qform_code != 0 {
            about.field("quatern", list(&self.quaternion.to_array()));
            about.field("qoffset", list(&self.qoffset.to_array()));
        }
        if self.sform_code != 0 {
            for (name, row) in ["srow_x", "srow_y", "srow_z"].into_iter().zip(&self.srow) {
                about.field(name, list(row));
            }
        }
        for (name, text) in self.text.iter().filter(|(_, text)| !text.is_empty()) {
            about.field(name, text);
        }
    }
}

fn check_magic(magic: &[u8]) -> Result<(), VolumeError> {
    match magic {
        b"n+1\0" | b"n+2\0\r\n\x1a\n" => Ok(()),
        b"ni1\0" | b"ni2\0\r\n\x1a\n" => {
            let message = "the header of a pair of .hdr and .img files; join them in one .nii file";
            Err(VolumeError::unsupported("magic", message))
        }
        [0, ..] => {
            let message = "an ANALYZE 7.5 header, which says nothing about left and right; convert it to NIfTI";
            Err(VolumeError::unsupported("magic", message))
        }
        _ => Err(VolumeError::malformed("magic", "not `n+1` or `n+2`: the header is damaged")),
    }
}

fn dims(dim: [i64; 8]) -> Result<[u32; 3], VolumeError> {
    let axes = match usize::try_from(dim[0]) {
        Ok(axes @ 1..=7) => axes,
        _ => return Err(VolumeError::malformed("dim", format!("{} axes; expected 3", dim[0]))),
    };
    if axes < 3 {
        let message = format!("{axes} axes: it is a picture and not a volume; expected 3");
        return Err(VolumeError::unsupported("dim", message));
    }
    let sizes = &dim[1..=axes];
    if let Some(wrong) = sizes.iter().find(|n| **n < 1) {
        return Err(VolumeError::malformed("dim", format!("{wrong} is not a size; expected at least 1")));
    }
    if let Some(many) = sizes[3..].iter().find(|n| **n > 1) {
        let message =
            format!("{many} volumes in one file, as over time; expected one: extract it into a file of its own");
        return Err(VolumeError::unsupported("dim", message));
    }
    let mut dims = [0; 3];
    for (n, size) in dims.iter_mut().zip(sizes) {
        *n = u32::try_from(*size).map_err(|_| VolumeError::TooLarge {
            field: "dim".to_owned(),
            unit: "voxels along an axis",
            needed: size.unsigned_abs().into(),
            limit: u32::MAX.into(),
        })?;
    }
    Ok(dims)
}

fn stored_type(datatype: i16) -> Result<VoxelType, VolumeError> {
    Ok(match datatype {
        2 => VoxelType::U8,
        4 => VoxelType::I16,
        8 => VoxelType::I32,
        16 => VoxelType::F32,
        64 => VoxelType::F64,
        256 => VoxelType::I8,
        512 => VoxelType::U16,
        768 => VoxelType::U32,
        1024 => VoxelType::I64,
        1280 => VoxelType::U64,
        other => {
            let name = match other {
                1 => "single bits",
                32 | 1792 | 2048 => "complex numbers",
                128 | 2304 => "colours",
                1536 => "128-bit floats",
                _ => return Err(VolumeError::malformed("datatype", format!("{other} is not a type of the format"))),
            };
            let message = format!("{other} means {name}; expected integers of 8 to 64 bits, float32 or float64");
            return Err(VolumeError::unsupported("datatype", message));
        }
    })
}

fn scaling(slope: f64, intercept: f64) -> Result<Scaling, VolumeError> {
    if slope == 0.0 || !slope.is_finite() {
        return Ok(Scaling::IDENTITY);
    }
    if !intercept.is_finite() {
        return Err(VolumeError::malformed("scl_inter", format!("{intercept} is not a number to add to values")));
    }
    Ok(Scaling { slope, intercept })
}

fn vox_offset(offset: f64, header: u64) -> Result<u64, VolumeError> {
    // After the header come four bytes that say whether extensions follow.
    let first = header + 4;
    if offset == 0.0 {
        return Ok(first);
    }
    if !(offset >= first as f64 && offset < 2_f64.powi(53)) {
        return Err(VolumeError::malformed(
            "vox_offset",
            format!("{offset} is not in the file; expected {first} or more"),
        ));
    }
    Ok(offset as u64)
}

fn unit(xyzt_units: i32) -> Result<f64, VolumeError> {
    match xyzt_units & 7 {
        // Not said: everybody means millimetres.
        0 | 2 => Ok(1.0),
        1 => Ok(1e3),
        3 => Ok(1e-3),
        other => Err(VolumeError::malformed("xyzt_units", format!("{other} is not a unit of length of the format"))),
    }
}
