//! An archive whose files are read in any order: a zip, or a tar. One that is wrapped is unwrapped into memory first.

use std::collections::BTreeMap;
use std::fmt;
use std::io::{self, BufRead, BufReader, Read, SeekFrom};

use zip::ZipArchive;

use super::VolumeError;
use super::archive::{check_name, is_tar, is_zip, tar_error, zip_error};
use super::input::{Input, ReadSeek};

/// Most bytes of a name that does not fit into a header of a tar, and of the records that may hold one.
const MAX_NAME_BYTES: u64 = 4096;
const MAX_RECORD_BYTES: u64 = 1 << 16;

/// Most files of a tar, whose places are kept.
const MAX_TAR_FILES: usize = 1 << 20;

/// Files at the beginning of a wrapped tar, and bytes of it, by which it is told what it holds.
const TOLD_BY: usize = 64;
const TOLD_BY_BYTES: u64 = 64 << 20;

/// Offset and length of each file of a tar, by its name.
pub(super) type TarFiles = BTreeMap<String, (u64, u64)>;

/// The regular files of an archive by their names, which have slashes between folders and no `.`.
pub(super) struct Indexed<'i> {
    kind: Kind<'i>,
}

enum Kind<'i> {
    Zip(ZipArchive<Box<dyn ReadSeek + 'i>>, BTreeMap<String, usize>),
    Tar(Box<dyn ReadSeek + 'i>, TarFiles),
}

impl fmt::Debug for Indexed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Indexed").finish_non_exhaustive()
    }
}

impl<'i> Indexed<'i> {
    /// # Errors
    /// Names `archive` if it is none, is damaged, has too many files, or one whose name leads out of it.
    pub(super) fn open(input: &'i mut Input<'_>) -> Result<Self, VolumeError> {
        let head = input.head()?;
        if is_tar(&head) {
            let mut reader = input.seekable()?;
            let files = tar_files(&mut reader)?;
            return Ok(Self { kind: Kind::Tar(reader, files) });
        }
        if !is_zip(&head) {
            return Err(VolumeError::malformed("archive", "not a zip or tar archive"));
        }
        let archive = ZipArchive::new(input.seekable()?).map_err(zip_error)?;
        let mut files = BTreeMap::new();
        for (index, name) in archive.file_names().enumerate() {
            let name = name.map_err(zip_error)?;
            check_name(&name)?;
            if !name.ends_with('/') {
                files.insert(plain_name(&name), index);
            }
        }
        Ok(Self { kind: Kind::Zip(archive, files) })
    }

    /// Names of all files.
    pub(super) fn names(&self) -> Vec<String> {
        match &self.kind {
            Kind::Zip(_, files) => files.keys().cloned().collect(),
            Kind::Tar(_, files) => files.keys().cloned().collect(),
        }
    }

    /// A file from its beginning, and how long it is said to be.
    ///
    /// # Errors
    /// Names `archive` if it is damaged there, or no such file is in it.
    pub(super) fn open_file(&mut self, name: &str) -> Result<(Box<dyn BufRead + '_>, u64), VolumeError> {
        let none = || VolumeError::malformed("archive", "a file in it is gone");
        match &mut self.kind {
            Kind::Zip(archive, files) => {
                let file = archive.by_index(*files.get(name).ok_or_else(none)?).map_err(zip_error)?;
                let length = file.size();
                Ok((Box::new(BufReader::new(file)), length))
            }
            Kind::Tar(reader, files) => {
                let &(start, length) = files.get(name).ok_or_else(none)?;
                reader.seek(SeekFrom::Start(start)).map_err(tar_error)?;
                Ok((Box::new(BufReader::new(reader.take(length))), length))
            }
        }
    }
}

/// Names of the files in an archive, and the archive if they are all. Of a wrapped tar they are the first ones, and
/// into a wrapped zip nobody looks: all of it would have to be unwrapped. None if it is no archive, or damaged.
pub(super) fn glance<'i>(input: &'i mut Input<'_>) -> (Vec<String>, Option<Indexed<'i>>) {
    let head = input.head().unwrap_or_default();
    if !input.is_wrapped() {
        let archive = Indexed::open(input).ok();
        return (archive.as_ref().map(Indexed::names).unwrap_or_default(), archive);
    }
    let mut names = Vec::new();
    if is_tar(&head)
        && let Ok(stream) = input.open()
    {
        let mut archive = tar::Archive::new(stream.reader.take(TOLD_BY_BYTES));
        // What is damaged further on does not matter here.
        let _ = each_file(archive.entries().map(|entries| entries.raw(true)), &mut |name, _| {
            names.push(name);
            if names.len() < TOLD_BY { Ok(()) } else { Err(VolumeError::malformed("archive", "enough is known")) }
        });
    }
    (names, None)
}

/// The regular files of a tar.
///
/// # Errors
/// Names `archive` if it is damaged, or has too many files, or a name that leads out of it or is endless.
pub(super) fn tar_files(reader: &mut dyn ReadSeek) -> Result<TarFiles, VolumeError> {
    let mut files = TarFiles::new();
    let mut archive = tar::Archive::new(reader);
    let entries = archive.entries_with_seek().map(|entries| entries.raw(true));
    each_file(entries, &mut |name, place| {
        files.insert(name, place);
        if files.len() <= MAX_TAR_FILES {
            return Ok(());
        }
        let (needed, limit) = (files.len() as u128, MAX_TAR_FILES as u64);
        Err(VolumeError::TooLarge { field: "archive".into(), unit: "files", needed, limit })
    })?;
    Ok(files)
}

/// Tells of every regular file of a tar; links, folders and others are passed over. Extensions are entries like others,
/// and of those that hold a long name no more is read than a name may have.
fn each_file<R: Read>(
    entries: io::Result<tar::Entries<'_, R>>,
    tell: &mut dyn FnMut(String, (u64, u64)) -> Result<(), VolumeError>,
) -> Result<(), VolumeError> {
    let mut long_name: Option<String> = None;
    for entry in entries.map_err(tar_error)? {
        let mut entry = entry.map_err(tar_error)?;
        let kind = entry.header().entry_type();
        if kind.is_gnu_longname() {
            let bytes = extension(&mut entry, MAX_NAME_BYTES)?;
            long_name = bytes.split(|&byte| byte == 0).next().map(text);
        } else if kind.is_pax_local_extensions() {
            let bytes = extension(&mut entry, MAX_RECORD_BYTES)?;
            let paths = tar::PaxExtensions::new(&bytes).flatten().filter(|record| record.key_bytes() == b"path");
            long_name = paths.map(|record| text(record.value_bytes())).last().or(long_name);
        } else if kind.is_file() || kind.is_contiguous() {
            let name = long_name.take().unwrap_or_else(|| text(&entry.path_bytes()));
            check_name(&name)?;
            tell(plain_name(&name), (entry.raw_file_position(), entry.size()))?;
        } else if !kind.is_gnu_longlink() && !kind.is_pax_global_extensions() {
            check_name(&text(&entry.path_bytes()))?;
            long_name = None;
        }
    }
    Ok(())
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

fn extension(entry: &mut impl Read, most: u64) -> Result<Vec<u8>, VolumeError> {
    let mut bytes = Vec::new();
    entry.take(most + 1).read_to_end(&mut bytes).map_err(tar_error)?;
    if bytes.len() as u64 > most {
        return Err(tar_error(io::Error::other("a name in it is too long")));
    }
    Ok(bytes)
}

/// With slashes, and without `.` between them.
pub(super) fn plain_name(name: &str) -> String {
    let name = name.replace('\\', "/");
    let parts = name.split('/').filter(|part| !part.is_empty() && *part != ".");
    parts.collect::<Vec<_>>().join("/")
}
