//! Which format a file has, and reading it.

use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};

use super::error::excerpt;
use super::{Limits, RawSpec, Volume, VolumeError, VoxelType, nrrd, paths};

/// A file format that is read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NRRD, with the data attached or (by path) detached.
    Nrrd,
    /// Voxels alone; a [`RawSpec`] says what they are.
    Raw,
}

/// Formats that are recognised in order to say that they are not read: by what they are called, and how a content
/// type or a file's name gives them away.
const NOT_READ: [(&str, &[&str]); 5] = [
    ("nifti", &["nifti", "nii", "nii.gz"]),
    ("metaimage", &["metaimage", "mha", "mhd"]),
    ("npy", &["npy"]),
    ("tiff", &["tiff", "tif"]),
    ("dicom", &["dicom", "dcm", "zip", "tar"]),
];

impl Format {
    /// The format by its name in the API (`nrrd`, `raw`).
    ///
    /// # Errors
    /// Unsupported `format` for any other name.
    pub fn from_name(name: &str) -> Result<Self, VolumeError> {
        Self::from_hint(&name.to_ascii_lowercase())
            .unwrap_or_else(|| Err(unknown(&format!("{} is not a format", excerpt(name)))))
    }

    /// The format of an upload: by the parameter `format`, else by its content type, else by its first bytes.
    ///
    /// # Errors
    /// Unsupported `format` if it is none that is read; names it where it can.
    pub fn detect(name: Option<&str>, content_type: Option<&str>, first_bytes: &[u8]) -> Result<Self, VolumeError> {
        if let Some(name) = name {
            return Self::from_name(name);
        }
        // `application/x-nrrd; version=5` -> `nrrd`
        let subtype = content_type.and_then(|t| t.split(';').next()).and_then(|t| t.split('/').nth(1));
        let subtype = subtype.unwrap_or_default().trim().to_ascii_lowercase();
        Self::from_hint(subtype.trim_start_matches("x-"))
            .or_else(|| Self::from_magic(first_bytes))
            .unwrap_or_else(|| Err(unknown("not recognised by content type or first bytes")))
    }

    /// `None` for a hint that says nothing, such as `octet-stream`.
    fn from_hint(hint: &str) -> Option<Result<Self, VolumeError>> {
        match hint {
            "nrrd" | "nhdr" => Some(Ok(Self::Nrrd)),
            "raw" => Some(Ok(Self::Raw)),
            _ => NOT_READ.iter().find(|(_, hints)| hints.contains(&hint)).map(|(name, _)| Err(not_read(name))),
        }
    }

    fn from_magic(bytes: &[u8]) -> Option<Result<Self, VolumeError>> {
        let at = |offset: usize, magic: &[u8]| bytes.get(offset..).is_some_and(|rest| rest.starts_with(magic));
        if at(0, b"NRRD") {
            return Some(Ok(Self::Nrrd));
        }
        let name = if at(344, b"n+1\0") || at(344, b"ni1\0") {
            "nifti"
        } else if at(0, b"ObjectType") || at(0, b"NDims") {
            "metaimage"
        } else if at(0, b"\x93NUMPY") {
            "npy"
        } else if at(0, b"II*\0") || at(0, b"MM\0*") {
            "tiff"
        } else if at(128, b"DICM") || at(0, b"PK\x03\x04") || at(257, b"ustar") {
            "dicom"
        } else {
            return None;
        };
        Some(Err(not_read(name)))
    }

    /// By the end of a file's name, else by its first bytes.
    fn of_file(path: &Path, first_bytes: &[u8]) -> Result<Self, VolumeError> {
        let name = path.file_name().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
        let ends = name.split_once('.').map(|(_, ends)| ends).unwrap_or_default();
        // `head.v2.nii.gz`: every part after a dot may begin the ending.
        let mut hints = std::iter::successors(Some(ends), |ends| ends.split_once('.').map(|(_, rest)| rest));
        hints
            .find_map(Self::from_hint)
            .or_else(|| Self::from_magic(first_bytes))
            .unwrap_or_else(|| Err(unknown("not recognised by file name or first bytes")))
    }
}

fn not_read(name: &str) -> VolumeError {
    unknown(&format!("`{name}` is not read by this version"))
}

fn unknown(reason: &str) -> VolumeError {
    VolumeError::unsupported("format", format!("{reason}; expected nrrd or raw"))
}

/// Reads a volume from the bytes of an upload.
///
/// # Errors
/// Names `dims` if `format` is raw and `raw` does not say what it holds; otherwise those of the format.
pub fn read_bytes(bytes: &[u8], format: Format, raw: Option<&RawSpec>, limits: &Limits) -> Result<Volume, VolumeError> {
    let length = bytes.len() as u64;
    match format {
        Format::Nrrd => nrrd::read(bytes, length, None, limits),
        Format::Raw => required(raw)?.read(&mut &bytes[..], length, limits),
    }
}

/// Reads a volume from a file in the data directory, or in a directory inside it.
///
/// # Errors
/// Names `path` if it is not a file inside the data directory; otherwise as [`read_bytes`].
pub fn load_path(path: &str, data_dir: &Path, raw: Option<&RawSpec>, limits: &Limits) -> Result<Volume, VolumeError> {
    let mut opened = Opened::new(path, data_dir)?;
    match opened.format {
        Format::Nrrd => {
            let directory = opened.path.parent().unwrap_or(data_dir);
            let siblings = nrrd::Siblings { root: data_dir, directory };
            nrrd::read(opened.reader, opened.length, Some(siblings), limits)
        }
        Format::Raw => required(raw)?.read(&mut opened.reader, opened.length, limits),
    }
}

/// Dims and type of the volume in a file, without its voxels: what a dry run needs.
///
/// # Errors
/// As [`load_path`], as far as the header goes.
pub fn peek_path(path: &str, data_dir: &Path, raw: Option<&RawSpec>) -> Result<([u32; 3], VoxelType), VolumeError> {
    let mut opened = Opened::new(path, data_dir)?;
    match opened.format {
        Format::Nrrd => nrrd::read_header(&mut opened.reader).map(|header| (header.grid.dims, header.voxel_type)),
        Format::Raw => required(raw).map(|raw| (raw.dims, raw.voxel_type)),
    }
}

fn required(raw: Option<&RawSpec>) -> Result<&RawSpec, VolumeError> {
    raw.ok_or_else(|| VolumeError::malformed("dims", "missing; a raw file needs dims and type"))
}

struct Opened {
    path: PathBuf,
    reader: BufReader<std::fs::File>,
    length: u64,
    format: Format,
}

impl Opened {
    fn new(path: &str, data_dir: &Path) -> Result<Self, VolumeError> {
        let path = paths::resolve_inside(data_dir, data_dir, path, "path")?;
        let (file, length) = paths::open(&path, "path")?;
        let mut reader = BufReader::new(file);
        let first_bytes = reader.fill_buf().map_err(|e| VolumeError::io("path", e))?;
        let format = Format::of_file(&path, first_bytes)?;
        Ok(Self { path, reader, length, format })
    }
}
