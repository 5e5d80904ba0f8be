//! One volume packed into a zip or tar archive: a header and the files of data that it names, or a single file.

use std::cell::RefCell;
use std::fmt;
use std::io::{BufReader, Read};
use std::path::{Component, Path};

use super::archive::{Files, first_names, is_tar, is_zip};
use super::error::excerpt;
use super::format::by_ending;
use super::input::{Input, MAX_UNWRAPPED_BYTES, Source, Stream};
use super::siblings::{self, Packed, Siblings};
use super::voxels::data_error;
use super::wrap::unwrapped_name;
use super::{Format, VolumeError};

/// Headers that name other files.
const HEADERS: [(&str, Format); 2] = [(".nhdr", Format::Nrrd), (".mhd", Format::MetaImage)];

/// Formats whose files are not archives, and begin in a way of their own.
const PLAIN: [Format; 6] = [Format::Nrrd, Format::Nifti, Format::MetaImage, Format::Npy, Format::Vti, Format::Tiff];

/// Most bytes of a header.
const MAX_HEADER_BYTES: u64 = 16 << 20;

/// What the files of an archive make it; `None` if that is not one volume of another format.
pub(super) fn format_of(input: &mut Input) -> Option<Format> {
    let names = first_names(input);
    let mut files = names.iter().filter(|name| is_file(name));
    if let Some(format) = files.clone().find_map(|name| header_format(name)) {
        return Some(format);
    }
    let (first, others) = (files.next()?, files.count());
    plain_format(first).filter(|_| others == 0)
}

/// Runs `work` on the volume's file in an archive, or on the file itself if it is none.
///
/// # Errors
/// Those of `work`. Names `archive` if it is damaged, or holds no volume of a format that may be packed, or several.
pub(super) fn unpacked<T>(
    input: &mut Input,
    format: Format,
    work: impl FnOnce(&mut Input) -> Result<T, VolumeError>,
) -> Result<T, VolumeError> {
    if !PLAIN.contains(&format) || input.folder().is_some() {
        return work(input);
    }
    let head = input.head()?;
    if !is_zip(&head) && !is_tar(&head) {
        return work(input);
    }
    let (raw, limits, watch, choice) = (input.raw, input.limits, input.watch, input.choice.clone());
    let mut files = Files::open(input)?;
    let (main, names) = main_file(&mut files, limits.max_bytes)?;
    let directory = main.name.rsplit_once('/').map_or(String::new(), |(directory, _)| directory.to_owned());
    let packed = PackedFiles { files: RefCell::new(files), directory, names };
    let mut inner = Input::new("archive", Source::Bytes(&main.bytes), raw, limits)?;
    (inner.choice, inner.watch, inner.siblings) = (choice, watch, Some(Siblings::Archive(&packed)));
    work(&mut inner)
}

/// The file that the volume is read from.
struct Main {
    name: String,
    bytes: Vec<u8>,
    is_header: bool,
}

/// Finds it in one visit, and the names of all files.
fn main_file(files: &mut Files, max_bytes: u64) -> Result<(Main, Vec<String>), VolumeError> {
    let mut names = Vec::new();
    let mut main: Option<Main> = None;
    files.visit(&mut |entry, reader| {
        if !is_file(entry.name) {
            return Ok(());
        }
        let is_header = header_format(entry.name).is_some();
        match &main {
            Some(Main { is_header: true, name, .. }) if is_header => {
                let both = format!("{} and {}", excerpt(name), excerpt(entry.name));
                return Err(VolumeError::malformed("archive", format!("holds several headers, {both}; expected one")));
            }
            _ => {}
        }
        if is_header || (names.is_empty() && plain_format(entry.name).is_some()) {
            let limit = if is_header { MAX_HEADER_BYTES } else { max_bytes.min(MAX_UNWRAPPED_BYTES) };
            main = Some(Main { name: plain_name(entry.name), bytes: whole(reader, limit)?, is_header });
        }
        names.push(plain_name(entry.name));
        Ok(())
    })?;
    let several = names.len() > 1;
    main.filter(|main| main.is_header || !several).map(|main| (main, names)).ok_or_else(|| {
        VolumeError::malformed(
            "archive",
            "expected one file of a volume, or one header (.nhdr or .mhd) with the files of data that it names",
        )
    })
}

fn whole(reader: &mut dyn Read, limit: u64) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    reader.take(limit + 1).read_to_end(&mut bytes).map_err(|e| data_error("archive", e))?;
    let needed = bytes.len() as u64;
    if needed > limit {
        let needed = u128::from(needed);
        return Err(VolumeError::TooLarge { field: "archive".into(), unit: "bytes", needed, limit });
    }
    Ok(bytes)
}

/// Not a folder, nor what systems put beside files of their own accord.
fn is_file(name: &str) -> bool {
    let base = name.rsplit('/').next().unwrap_or_default();
    !base.is_empty() && !base.starts_with('.') && !name.starts_with("__MACOSX/")
}

fn header_format(name: &str) -> Option<Format> {
    let name = unwrapped_name(name);
    HEADERS.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, format)| format)
}

fn plain_format(name: &str) -> Option<Format> {
    by_ending(name.rsplit('/').next()?)?.ok().filter(|format| PLAIN.contains(format))
}

/// Without `.` between slashes.
fn plain_name(name: &str) -> String {
    let parts = Path::new(name).components().filter(|c| matches!(c, Component::Normal(_)));
    parts.map(|c| c.as_os_str().to_string_lossy()).collect::<Vec<_>>().join("/")
}

struct PackedFiles<'i, 'a> {
    files: RefCell<Files<'i, 'a>>,
    /// The header's place, without a slash at the end.
    directory: String,
    names: Vec<String>,
}

impl fmt::Debug for PackedFiles<'_, '_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PackedFiles").field("directory", &self.directory).finish_non_exhaustive()
    }
}

impl PackedFiles<'_, '_> {
    fn place(&self, name: &str) -> String {
        let name = plain_name(name);
        if self.directory.is_empty() { name } else { format!("{}/{name}", self.directory) }
    }
}

impl Packed for PackedFiles<'_, '_> {
    fn check(&self, name: &str, field: &str) -> Result<(), VolumeError> {
        let plain = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
        if name.is_empty() || !Path::new(name).components().all(plain) {
            let message = format!("{} is not a relative path without `..`", excerpt(name));
            return Err(VolumeError::malformed(field, message));
        }
        if self.names.contains(&self.place(name)) {
            return Ok(());
        }
        Err(VolumeError::malformed(field, format!("{} is not in the archive", excerpt(name))))
    }

    fn read(&self, name: &str, read: &mut siblings::Read) -> Result<(), VolumeError> {
        let place = self.place(name);
        let mut done = false;
        self.files.borrow_mut().visit(&mut |entry, reader| {
            if done || plain_name(entry.name) != place {
                return Ok(());
            }
            done = true;
            read(Stream { reader: Box::new(BufReader::new(reader)), length: Some(entry.bytes) })
        })
    }
}
