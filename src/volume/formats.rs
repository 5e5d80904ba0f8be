//! The table of formats: a new one is a module, a variant of [`Format`] and a row here.

use super::format::unknown;
use super::input::Input;
use super::{Format, Shape, Volume, VolumeError};
use super::{archive, dicom, metaimage, nifti, npy, nrrd, raw, tiff, vti, zarr};

/// A format that is read.
pub(super) struct Row {
    pub(super) format: Format,
    /// Name in the API, in lower case.
    pub(super) name: &'static str,
    /// What names of its files end in after a dot, in lower case and without `.gz`.
    pub(super) endings: &'static [&'static str],
    /// Subtypes of its content types (`application/x-nrrd` has `nrrd`), besides its name.
    pub(super) content_types: &'static [&'static str],
    /// Whether a file begins like this: gets at least its first KiB, unwrapped.
    pub(super) magic: fn(&[u8]) -> bool,
    /// Reads the volume.
    pub(super) read: fn(&mut Input) -> Result<Volume, VolumeError>,
    /// Dims, type and spacing of the volume, from as little of the file as says so.
    pub(super) peek: fn(&mut Input) -> Result<Shape, VolumeError>,
}

/// In the order in which magic is looked for.
pub(super) const TABLE: &[Row] = &[
    Row {
        format: Format::Nrrd,
        name: "nrrd",
        endings: &["nrrd", "nhdr"],
        content_types: &["nhdr"],
        magic: |head| head.starts_with(b"NRRD"),
        read: nrrd::read_input,
        peek: nrrd::peek_input,
    },
    Row {
        format: Format::Nifti,
        name: "nifti",
        endings: &["nii", "hdr", "img"],
        content_types: &["nii"],
        magic: nifti::magic,
        read: nifti::read_input,
        peek: nifti::peek_input,
    },
    Row {
        format: Format::MetaImage,
        name: "metaimage",
        endings: &["mha", "mhd"],
        content_types: &["mha", "mhd"],
        magic: metaimage::magic,
        read: metaimage::read_input,
        peek: metaimage::peek_input,
    },
    Row {
        format: Format::Npy,
        name: "npy",
        endings: &["npy"],
        content_types: &[],
        magic: npy::magic,
        read: npy::read_input,
        peek: npy::peek_input,
    },
    Row {
        format: Format::Npz,
        name: "npz",
        endings: &["npz"],
        content_types: &[],
        magic: npy::npz_magic,
        read: npy::npz_read,
        peek: npy::npz_peek,
    },
    Row {
        format: Format::Vti,
        name: "vti",
        endings: &["vti"],
        content_types: &["vtk-imagedata"],
        magic: vti::magic,
        read: vti::read_input,
        peek: vti::peek_input,
    },
    // Before DICOM, whose archives have some of the same endings; archives without them are told apart by what is in
    // them (`Format::of_archive`).
    Row {
        format: Format::Zarr,
        name: "zarr",
        endings: &["ome.zarr", "zarr", "ome.zarr.zip", "zarr.zip", "ome.zarr.tar", "zarr.tar", "ozx"],
        content_types: &["ozx"],
        magic: |_| false,
        read: zarr::read_input,
        peek: zarr::peek_input,
    },
    Row {
        format: Format::Dicom,
        name: "dicom",
        endings: &["dcm", "dicom", "ima", "zip", "tar", "tgz"],
        content_types: &["zip", "tar"],
        magic: |head| is_dicom(head) || archive::is_zip(head) || archive::is_tar(head),
        read: dicom::read_input,
        peek: dicom::peek_input,
    },
    Row {
        format: Format::Tiff,
        name: "tiff",
        endings: &["tiff", "tif", "tf2", "tf8", "btf"],
        content_types: &[],
        magic: |head| [b"II*\0", b"MM\0*", b"II+\0", b"MM\0+"].iter().any(|magic| head.starts_with(*magic)),
        read: tiff::read_input,
        peek: tiff::peek_input,
    },
    Row {
        format: Format::Raw,
        name: "raw",
        endings: &["raw"],
        content_types: &[],
        magic: |_| false,
        read: raw::read_input,
        peek: raw::peek_input,
    },
];

/// A format that is recognised in order to say that it is not read.
pub(super) struct NotRead {
    /// What it is called; the first one, or what gives it away in a file's name or content type.
    pub(super) endings: &'static [&'static str],
    pub(super) magic: fn(&[u8]) -> bool,
    /// What to do instead, as the second half of a sentence; may be empty.
    advice: &'static str,
}

impl NotRead {
    pub(super) fn refusal(&self) -> VolumeError {
        unknown(&format!("`{}` is not read by this version{}", self.endings[0], self.advice))
    }
}

/// Whether a file begins like one of DICOM that is not in an archive.
pub(super) fn is_dicom(head: &[u8]) -> bool {
    at(head, 128, b"DICM")
}

fn at(head: &[u8], offset: usize, magic: &[u8]) -> bool {
    head.get(offset..).is_some_and(|rest| rest.starts_with(magic))
}

const PICTURE: &str = ": it is a single picture, and a volume is many";

const CONVERT: &str = ": convert it to NIfTI or NRRD first";

const ARCHIVE: &str = ": unpack it first";

pub(super) const NOT_READ: &[NotRead] = &[
    NotRead { endings: &["png"], magic: |h| at(h, 0, b"\x89PNG"), advice: PICTURE },
    NotRead { endings: &["jpeg", "jpg"], magic: |h| at(h, 0, b"\xff\xd8\xff"), advice: PICTURE },
    NotRead { endings: &["webp"], magic: |h| at(h, 0, b"RIFF") && at(h, 8, b"WEBP"), advice: PICTURE },
    NotRead { endings: &["gif"], magic: |h| at(h, 0, b"GIF8"), advice: PICTURE },
    NotRead { endings: &["bmp"], magic: |_| false, advice: PICTURE },
    NotRead { endings: &["mgh", "mgz"], magic: |_| false, advice: CONVERT },
    NotRead { endings: &["minc", "mnc"], magic: |h| at(h, 0, b"CDF"), advice: CONVERT },
    NotRead { endings: &["hdf5", "h5", "hdf"], magic: |h| at(h, 0, b"\x89HDF"), advice: CONVERT },
    NotRead {
        endings: &["matlab", "mat"],
        magic: |h| at(h, 0, b"MATLAB"),
        advice: ": save the array as .npy, or convert it to NIfTI",
    },
    NotRead {
        endings: &["vtk"],
        magic: |h| at(h, 0, b"# vtk DataFile"),
        advice: ": write it as .vti (XML image data)",
    },
    NotRead {
        endings: &["pvti"],
        magic: |_| false,
        advice: ": it only names others; write the image as one .vti file",
    },
    NotRead {
        endings: &["vtu", "vtp", "vtr", "vts"],
        magic: |_| false,
        advice: ": it is not image data on a regular grid; resample it to .vti",
    },
    NotRead { endings: &["analyze"], magic: |_| false, advice: CONVERT },
    NotRead { endings: &["7z"], magic: |h| at(h, 0, b"7z\xbc\xaf\x27\x1c"), advice: ARCHIVE },
    NotRead { endings: &["rar"], magic: |h| at(h, 0, b"Rar!"), advice: ARCHIVE },
    NotRead { endings: &["bz2"], magic: |h| at(h, 0, b"BZh"), advice: ARCHIVE },
    NotRead { endings: &["xz"], magic: |h| at(h, 0, b"\xfd7zXZ\0"), advice: ARCHIVE },
];
