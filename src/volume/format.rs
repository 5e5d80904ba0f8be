//! Which format a file has, and reading it.

use std::path::Path;

use super::error::excerpt;
use super::formats::{NOT_READ, Row, TABLE};
use super::input::{Choice, Input, Source};
use super::siblings::Siblings;
use super::wrap::{Wrapping, unwrapped_name};
use super::{Limits, LoadWatch, RawSpec, Shape, Volume, VolumeError, indexed, packed, paths, zarr};

/// Most bytes that are unwrapped as a whole only to say what is in a file.
const MOST_FOR_A_GLANCE: u64 = 64 << 20;

/// A file format that is read. Any file may be wrapped in gzip or Zstandard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NRRD, with the data attached or (by path) detached.
    Nrrd,
    /// NIfTI-1 and NIfTI-2 in one file.
    Nifti,
    /// MetaImage, with the data local or (by path) in a file beside the header.
    MetaImage,
    /// A NumPy array.
    Npy,
    /// An archive with one NumPy array that is a volume.
    Npz,
    /// VTK's XML image data.
    Vti,
    /// DICOM: a zip or tar of a series, a folder (by path), or one file.
    Dicom,
    /// TIFF stack, plain, of ImageJ or of OME.
    Tiff,
    /// OME-Zarr image or plain Zarr array: a folder (by path), or a zip or tar of one.
    Zarr,
    /// Voxels alone; a [`RawSpec`] says what they are.
    Raw,
}

impl Format {
    /// Every format.
    pub fn all() -> impl Iterator<Item = Self> {
        TABLE.iter().map(|row| row.format)
    }

    /// Name in the API.
    pub fn name(self) -> &'static str {
        self.row().name
    }

    fn row(self) -> &'static Row {
        TABLE.iter().find(|row| row.format == self).expect("every format has a row")
    }

    /// The format by its name in the API (`nrrd`, `raw`), or by what its files' names end in.
    ///
    /// # Errors
    /// Unsupported `format` for any other name; says what to do where it knows the name.
    pub fn from_name(name: &str) -> Result<Self, VolumeError> {
        let bare = unwrapped_name(name);
        by_hint(
            |row| row.name == bare || row.endings.contains(&bare.as_str()),
            |endings| endings.contains(&bare.as_str()),
        )
        .unwrap_or_else(|| Err(unknown(&format!("{} is not a format", excerpt(name)))))
    }

    /// The format of an upload: by the parameter `format`, else by its content type, else by its first bytes, which
    /// may be wrapped; of an archive, by what is in it.
    ///
    /// # Errors
    /// Unsupported `format` if it is none that is read; names it where it can.
    pub fn detect(name: Option<&str>, content_type: Option<&str>, bytes: &[u8]) -> Result<Self, VolumeError> {
        let limits = Limits::default();
        let mut input = Input::new("format", Source::Bytes(bytes), None, &limits)?;
        if let Some(name) = name {
            let format = Self::from_name(name)?;
            return Ok(if name == format.name() { format } else { format.of_archive(&mut input) });
        }
        // `application/x-nrrd; version=5` -> `nrrd`
        let subtype = content_type.and_then(|t| t.split(';').next()).and_then(|t| t.split('/').nth(1));
        let subtype = subtype.unwrap_or_default().trim().to_ascii_lowercase();
        let subtype = unwrapped_name(subtype.trim_start_matches("x-"));
        let by_type = by_hint(
            |row| row.name == subtype || row.content_types.contains(&subtype.as_str()),
            |endings| endings.contains(&subtype.as_str()),
        );
        let head = input.head()?;
        let format = by_type.or_else(|| by_magic(&head));
        let format = format.unwrap_or_else(|| Err(unrecognised("content type or first bytes", &head)))?;
        Ok(format.of_archive(&mut input))
    }

    /// What an archive that might be of DICOM files is really of.
    fn of_archive(self, input: &mut Input) -> Self {
        if self != Self::Dicom {
            return self;
        }
        if let Some(folder) = input.folder() {
            return if zarr::is_zarr_folder(folder) { Self::Zarr } else { self };
        }
        let (names, archive) = indexed::glance(input);
        if zarr::is_zarr(&names) { Self::Zarr } else { packed::format_of(&names, archive).unwrap_or(self) }
    }

    /// The format of a file that was fetched: by the end of its name, else as that of an upload.
    ///
    /// # Errors
    /// As [`Self::detect`].
    pub fn of_fetched(name: &str, content_type: Option<&str>, bytes: &[u8]) -> Result<Self, VolumeError> {
        let Some(format) = by_ending(name) else { return Self::detect(None, content_type, bytes) };
        let limits = Limits::default();
        Ok(format?.of_archive(&mut Input::new("format", Source::Bytes(bytes), None, &limits)?))
    }

    /// By the end of a file's name, else by its first bytes.
    fn of_file(path: &Path, input: &mut Input) -> Result<Self, VolumeError> {
        if input.folder().is_some() {
            return Ok(Self::Dicom.of_archive(input));
        }
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        let format = match by_ending(&name) {
            Some(format) => format,
            None => {
                let head = input.head()?;
                by_magic(&head).unwrap_or_else(|| Err(unrecognised("file name or first bytes", &head)))
            }
        };
        Ok(format?.of_archive(input))
    }
}

/// What a file is called without its format's ending: `head` for `head.nii.gz`.
pub fn bare_name(file_name: &str) -> &str {
    let name = unwrapped_name(file_name);
    let endings = TABLE.iter().flat_map(|row| row.endings);
    let bare = endings.filter_map(|ending| stem(&name, ending)).map(str::len).min();
    // Lower case, as the endings are, has as many bytes.
    let bare = bare.unwrap_or_else(|| Path::new(&name).file_stem().map_or(name.len(), |stem| stem.len()));
    &file_name[..bare]
}

/// `head` for `head.nii` and `nii`.
fn stem<'a>(name: &'a str, ending: &str) -> Option<&'a str> {
    name.strip_suffix(ending)?.strip_suffix('.').filter(|stem| !stem.is_empty())
}

/// `None` for a hint that says nothing, such as `octet-stream`.
fn by_hint(read: impl Fn(&Row) -> bool, not_read: impl Fn(&[&str]) -> bool) -> Option<Result<Format, VolumeError>> {
    let known = TABLE.iter().find(|row| read(row)).map(|row| Ok(row.format));
    known.or_else(|| NOT_READ.iter().find(|row| not_read(row.endings)).map(|row| Err(row.refusal())))
}

/// `None` for a name that says nothing.
pub(super) fn by_ending(file_name: &str) -> Option<Result<Format, VolumeError>> {
    let name = unwrapped_name(file_name);
    let ends_in = |endings: &[&str]| endings.iter().any(|ending| stem(&name, ending).is_some());
    by_hint(|row| ends_in(row.endings), |endings| ends_in(endings))
}

fn by_magic(head: &[u8]) -> Option<Result<Format, VolumeError>> {
    let known = TABLE.iter().find(|row| (row.magic)(head)).map(|row| Ok(row.format));
    known.or_else(|| NOT_READ.iter().find(|row| (row.magic)(head)).map(|row| Err(row.refusal())))
}

fn unrecognised(by: &str, head: &[u8]) -> VolumeError {
    if Wrapping::of(head).is_some() {
        return unknown("compressed twice; unpack it once");
    }
    unknown(&format!("not recognised by {by}"))
}

/// An error that lists what is read.
pub(super) fn unknown(reason: &str) -> VolumeError {
    let names: Vec<_> = Format::all().map(Format::name).collect();
    let names = names.join(", ");
    VolumeError::unsupported(
        "format",
        format!("{reason}; expected one of {names}, where raw means voxels without a header and needs dims and type"),
    )
}

/// Reads a volume from the bytes of an upload.
///
/// # Errors
/// Names `dims` if `format` is raw and `raw` does not say what it holds; otherwise those of the format.
pub fn read_bytes(bytes: &[u8], format: Format, raw: Option<&RawSpec>, limits: &Limits) -> Result<Volume, VolumeError> {
    read_chosen(bytes, format, raw, &Choice::default(), limits)
}

/// [`read_bytes`] of a file with several volumes.
///
/// # Errors
/// As [`read_bytes`]; names `series`, `channel` or `scale` if the choice is none of those in the file.
pub fn read_chosen(
    bytes: &[u8],
    format: Format,
    raw: Option<&RawSpec>,
    choice: &Choice,
    limits: &Limits,
) -> Result<Volume, VolumeError> {
    read_watched(bytes, format, raw, choice, limits, &LoadWatch::default())
}

/// [`read_chosen`] that tells how far it is, and may be called off.
///
/// # Errors
/// As [`read_chosen`], and [`VolumeError::Cancelled`].
pub fn read_watched(
    bytes: &[u8],
    format: Format,
    raw: Option<&RawSpec>,
    choice: &Choice,
    limits: &Limits,
    watch: &LoadWatch,
) -> Result<Volume, VolumeError> {
    let mut input = Input::new("data", Source::Bytes(bytes), raw, limits)?;
    input.choice = choice.clone();
    read(input, format, watch)
}

/// Reads a volume from a file in the data directory, or in a directory inside it.
///
/// # Errors
/// Names `path` if it is not a file inside the data directory; otherwise as [`read_bytes`].
pub fn load_path(path: &str, data_dir: &Path, raw: Option<&RawSpec>, limits: &Limits) -> Result<Volume, VolumeError> {
    load_chosen(path, data_dir, raw, &Choice::default(), limits)
}

/// [`load_path`] of a file with several volumes, or a folder of files.
///
/// # Errors
/// As [`load_path`]; names `series`, `channel` or `scale` if the choice is none of those in the file.
pub fn load_chosen(
    path: &str,
    data_dir: &Path,
    raw: Option<&RawSpec>,
    choice: &Choice,
    limits: &Limits,
) -> Result<Volume, VolumeError> {
    load_watched(path, data_dir, raw, choice, limits, &LoadWatch::default())
}

/// [`load_chosen`] that tells how far it is, and may be called off.
///
/// # Errors
/// As [`load_chosen`], and [`VolumeError::Cancelled`].
pub fn load_watched(
    path: &str,
    data_dir: &Path,
    raw: Option<&RawSpec>,
    choice: &Choice,
    limits: &Limits,
    watch: &LoadWatch,
) -> Result<Volume, VolumeError> {
    with_path(path, data_dir, raw, choice, limits, |input, format| read(input, format, watch))
}

/// Dims, type and spacing of the volume in a file, without its voxels.
///
/// # Errors
/// As [`load_path`], as far as the header goes; too large if more than 64 MiB had to be unwrapped at once.
pub fn peek_path(path: &str, data_dir: &Path, raw: Option<&RawSpec>) -> Result<Shape, VolumeError> {
    told_path(path, data_dir, raw)?.1
}

/// Which format a file or folder has, of an archive by what is in it, and what [`peek_path`] says of it.
pub(super) fn told_path(
    path: &str,
    data_dir: &Path,
    raw: Option<&RawSpec>,
) -> Result<(Format, Result<Shape, VolumeError>), VolumeError> {
    with_path(path, data_dir, raw, &Choice::default(), &Limits::default(), |mut input, format| {
        input.most_unwrapped = MOST_FOR_A_GLANCE;
        Ok((format, packed::unpacked(&mut input, format, format.row().peek)))
    })
}

/// [`peek_path`] of a file with several volumes, or a folder of files: what a dry run needs. Of several levels of
/// detail it is the one that would be read within the limits.
///
/// # Errors
/// As [`load_chosen`], as far as the header goes.
pub fn peek_chosen(
    path: &str,
    data_dir: &Path,
    raw: Option<&RawSpec>,
    choice: &Choice,
    limits: &Limits,
) -> Result<Shape, VolumeError> {
    let peek = |mut input: Input, format: Format| {
        check_choice(&input.choice, format)?;
        packed::unpacked(&mut input, format, format.row().peek)
    };
    with_path(path, data_dir, raw, choice, limits, peek)
}

/// Refuses a choice where there is nothing to choose.
fn check_choice(choice: &Choice, format: Format) -> Result<(), VolumeError> {
    let choices: [(&str, bool, &[Format]); 3] = [
        ("series", choice.series.is_some(), &[Format::Dicom]),
        ("channel", choice.channel.is_some(), &[Format::Tiff, Format::Zarr]),
        ("scale", choice.scale.is_some(), &[Format::Zarr]),
    ];
    for (field, is_chosen, formats) in choices {
        if is_chosen && !formats.contains(&format) {
            let names: Vec<_> = formats.iter().map(|format| format!("`{}`", format.name())).collect();
            let message = format!("only {} has it, and this is `{}`", names.join(" or "), format.name());
            return Err(VolumeError::malformed(field, message));
        }
    }
    Ok(())
}

fn read<'a>(mut input: Input<'a>, format: Format, watch: &'a LoadWatch) -> Result<Volume, VolumeError> {
    check_choice(&input.choice, format)?;
    input.watched_by(watch)?;
    let read = packed::unpacked(&mut input, format, format.row().read);
    // Whatever the reader of a format makes of its sudden end.
    watch.check()?;
    let mut volume = read?;
    volume.note_nan();
    Ok(volume)
}

fn with_path<T>(
    path: &str,
    data_dir: &Path,
    raw: Option<&RawSpec>,
    choice: &Choice,
    limits: &Limits,
    work: impl FnOnce(Input, Format) -> Result<T, VolumeError>,
) -> Result<T, VolumeError> {
    let path = paths::resolve_any(data_dir, data_dir, path, "path")?;
    let is_folder = path.is_dir();
    let source = if is_folder { Source::Folder(path.clone()) } else { Source::File(paths::open(&path, "path")?.0) };
    let mut input = Input::new("path", source, raw, limits)?;
    input.choice = choice.clone();
    let format = Format::of_file(&path, &mut input)?;
    input.siblings =
        Some(Siblings::Directory { root: data_dir, directory: path.parent().unwrap_or(data_dir), watch: None });
    work(input, format)
}
