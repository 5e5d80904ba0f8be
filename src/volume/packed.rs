//! One volume packed into a zip or tar archive: a header and the files of data that it names, or a single file.

use std::cell::RefCell;
use std::fmt;
use std::io::Read;

use super::archive::{is_tar, is_zip};
use super::error::excerpt;
use super::format::by_ending;
use super::formats::is_dicom;
use super::indexed::{Indexed, plain_name};
use super::input::{HEAD_BYTES, Input, Source, Stream};
use super::siblings::{self, Packed, Siblings};
use super::voxels::data_error;
use super::wrap::unwrapped_name;
use super::{Format, VolumeError, paths};

/// Headers that name other files.
const HEADERS: [(&str, Format); 2] = [(".nhdr", Format::Nrrd), (".mhd", Format::MetaImage)];

/// Formats whose files are not archives, and begin in a way of their own.
const PLAIN: [Format; 6] = [Format::Nrrd, Format::Nifti, Format::MetaImage, Format::Npy, Format::Vti, Format::Tiff];

/// Endings of slices of DICOM; others have none, or the last number of an identifier.
const SLICES: [&str; 3] = [".dcm", ".dicom", ".ima"];

/// Most bytes of a header whose data are in other files.
const MAX_HEADER_BYTES: u64 = 16 << 20;

/// Files that are looked into to tell whether they are slices.
const TOLD_BY: usize = 64;

/// The format of the one volume in an archive of these files; `None` if that is not one, or slices of DICOM are there
/// too. `archive` is there if its files can be looked into at little cost.
pub(super) fn format_of(names: &[String], mut archive: Option<Indexed>) -> Option<Format> {
    let (main, format) = main_file(names, |_| true).ok()?;
    let others = || names.iter().map(String::as_str).filter(|name| is_file(name) && *name != main);
    if others().any(|name| SLICES.iter().any(|ending| name.to_ascii_lowercase().ends_with(ending))) {
        return None;
    }
    let nameless = others().filter(|name| by_ending(base(name)).is_none());
    let any_slice = match &mut archive {
        Some(archive) => std::iter::once(main).chain(nameless).take(TOLD_BY).any(|name| is_slice(archive, name)),
        None => nameless.map(base).any(|name| name.rsplit('.').next().is_some_and(|end| end == name || is_number(end))),
    };
    (!any_slice).then_some(format)
}

fn is_number(text: &str) -> bool {
    text.bytes().all(|byte| byte.is_ascii_digit())
}

fn is_slice(archive: &mut Indexed, name: &str) -> bool {
    let mut head = Vec::new();
    let read = archive.open_file(name).is_ok_and(|(file, _)| file.take(HEAD_BYTES).read_to_end(&mut head).is_ok());
    read && is_dicom(&head)
}

/// Runs `work` on the volume's file in an archive, or on the file itself if it is none.
///
/// # Errors
/// Those of `work`. Names `archive` if it is damaged, or holds no volume of the format, or several.
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
    let (raw, limits, most, choice) = (input.raw, input.limits, input.most_unwrapped, input.choice.clone());
    let mut archive = Indexed::open(input)?;
    let names = archive.names();
    let main = main_file(&names, |found| found == format)?.0.to_owned();
    let mut header = Vec::new();
    if header_format(&main).is_some() {
        let mut first = archive.open_file(&main)?.0.take(MAX_HEADER_BYTES + 1);
        first.read_to_end(&mut header).map_err(|error| data_error("archive", error))?;
    }
    // A longer one has its data with it.
    if (1..=MAX_HEADER_BYTES).contains(&(header.len() as u64)) {
        let directory = main.rsplit_once('/').map_or(String::new(), |(directory, _)| directory.to_owned());
        let packed = PackedFiles { archive: RefCell::new(archive), directory, names };
        let mut inner = Input::new("archive", Source::Bytes(&header), raw, limits)?;
        (inner.choice, inner.siblings) = (choice, Some(Siblings::Archive(&packed)));
        return work(&mut inner);
    }
    let mut inner = Input::new("archive", Source::Packed(archive, main), raw, limits)?;
    (inner.choice, inner.most_unwrapped) = (choice, most);
    work(&mut inner)
}

/// The file that the volume is read from, and its format, which is one that is `meant`: a header, else the one file.
fn main_file(names: &[String], meant: impl Fn(Format) -> bool) -> Result<(&str, Format), VolumeError> {
    let of = |format_of: fn(&str) -> Option<Format>| {
        let files = names.iter().map(String::as_str).filter(|name| is_file(name));
        let known = files.filter_map(|name| Some((name, format_of(name)?)));
        known.filter(|(_, format)| meant(*format)).collect::<Vec<_>>()
    };
    for found in [of(header_format), of(plain_format)] {
        match found[..] {
            [] => {}
            [main] => return Ok(main),
            [(a, _), (b, _), ..] => {
                let both = format!("{} and {}", excerpt(a), excerpt(b));
                return Err(VolumeError::malformed("archive", format!("holds several volumes, {both}; expected one")));
            }
        }
    }
    Err(VolumeError::malformed(
        "archive",
        "expected one file of a volume, or one header (.nhdr or .mhd) with the files of data that it names",
    ))
}

/// Not hidden, nor what a system puts beside files of its own accord.
fn is_file(name: &str) -> bool {
    !name.starts_with("__MACOSX/") && !name.split('/').any(|part| part.starts_with('.'))
}

fn base(name: &str) -> &str {
    name.rsplit('/').next().unwrap_or(name)
}

fn header_format(name: &str) -> Option<Format> {
    let name = unwrapped_name(name);
    HEADERS.into_iter().find(|(ending, _)| name.ends_with(ending)).map(|(_, format)| format)
}

fn plain_format(name: &str) -> Option<Format> {
    by_ending(base(name))?.ok().filter(|format| PLAIN.contains(format))
}

struct PackedFiles<'i> {
    archive: RefCell<Indexed<'i>>,
    /// The header's place, without a slash at the end.
    directory: String,
    names: Vec<String>,
}

impl fmt::Debug for PackedFiles<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PackedFiles").field("directory", &self.directory).finish_non_exhaustive()
    }
}

impl PackedFiles<'_> {
    fn place(&self, name: &str) -> String {
        plain_name(&format!("{}/{name}", self.directory))
    }
}

impl Packed for PackedFiles<'_> {
    fn check(&self, name: &str, field: &str) -> Result<(), VolumeError> {
        paths::check_relative(name, field)?;
        // They are sorted.
        if self.names.binary_search(&self.place(name)).is_ok() {
            return Ok(());
        }
        Err(VolumeError::malformed(field, format!("{} is not in the archive", excerpt(name))))
    }

    fn read(&self, name: &str, read: &mut siblings::Read) -> Result<(), VolumeError> {
        let mut archive = self.archive.borrow_mut();
        let (reader, length) = archive.open_file(&self.place(name))?;
        read(Stream { reader, length: Some(length) })
    }
}
