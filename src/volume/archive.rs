//! Many small files as one source: a zip or tar archive, a folder, or a single file, visited one after the other.
//!
//! Nothing is unpacked to disk, and no more than one file is open at a time. What the files may unpack to is bounded
//! over all visits together; sizes that an archive claims are not believed.

use std::cell::Cell;
use std::fs::File;
use std::io::{self, BufReader, Read};
use std::path::{Component, Path, PathBuf};

use zip::ZipArchive;
use zip::result::ZipError;

use super::error::excerpt;
use super::input::{Input, ReadSeek};
use super::watch::Watched;
use super::{LoadWatch, VolumeError};

/// Most files that are looked at.
const MAX_FILES: usize = 1 << 16;

/// Folders within folders.
const MAX_DEPTH: usize = 16;

/// Bytes unpacked in all, as a multiple of the largest volume: headers are read twice, the voxels once more.
const UNPACKED_PER_VOLUME_BYTE: u64 = 2;

/// What is done with each file: its number, which is the same on every visit, its name and its bytes.
pub(super) type Visit<'v> = dyn FnMut(usize, &str, &mut dyn Read) -> Result<(), VolumeError> + 'v;

/// Files that can be visited more than once.
pub(super) struct Files<'i, 'a> {
    kind: Kind<'i, 'a>,
    /// Bytes that may still be unpacked.
    left: Cell<u64>,
    limit: u64,
    watch: Option<&'a LoadWatch>,
}

enum Kind<'i, 'a> {
    One(&'i mut Input<'a>),
    Zip(ZipArchive<Box<dyn ReadSeek + 'i>>),
    Tar(&'i mut Input<'a>),
    Folder(Vec<PathBuf>),
}

impl<'i, 'a> Files<'i, 'a> {
    /// The files of an archive or a folder (links are passed over), or one file if the bytes are not an archive's.
    ///
    /// # Errors
    /// Names `archive` if it is damaged or has too many files, `path` if a folder cannot be listed.
    pub(super) fn open(input: &'i mut Input<'a>) -> Result<Self, VolumeError> {
        let limit = input.limits.max_bytes.saturating_mul(UNPACKED_PER_VOLUME_BYTE);
        let watch = input.watch;
        let kind = if let Some(folder) = input.folder() {
            let mut files = Vec::new();
            list(folder, MAX_DEPTH, &mut files)?;
            files.sort();
            if let Some(watch) = watch {
                watch.expect(files.iter().filter_map(|path| path.metadata().ok()).map(|file| file.len()).sum());
            }
            Kind::Folder(files)
        } else {
            let head = input.head()?;
            if is_zip(&head) {
                let archive = ZipArchive::new(input.seekable()?).map_err(zip_error)?;
                check_count(archive.len())?;
                Kind::Zip(archive)
            } else if is_tar(&head) {
                if let (Some(watch), Some(length)) = (watch, input.open_wrapped()?.length) {
                    // It is read to its end for the headers, and again for the voxels.
                    watch.expect(length);
                }
                Kind::Tar(input)
            } else {
                Kind::One(input)
            }
        };
        Ok(Self { kind, left: Cell::new(limit), limit, watch })
    }

    /// Whether this is one file and not several.
    pub(super) fn is_single(&self) -> bool {
        matches!(self.kind, Kind::One(_))
    }

    /// Whether the files are those of a folder.
    pub(super) fn is_folder(&self) -> bool {
        matches!(self.kind, Kind::Folder(_))
    }

    /// Shows every regular file to `visit`; links and folders are passed over.
    ///
    /// # Errors
    /// Those of `visit`. Names `archive` if it is damaged, has a name that leads out of it, or unpacks to more than
    /// the limits allow.
    pub(super) fn visit(&mut self, visit: &mut Visit) -> Result<(), VolumeError> {
        let (left, watch) = (&self.left, self.watch);
        let visited = match &mut self.kind {
            Kind::One(input) => visit(0, "", &mut BufReader::new(Metered { inner: input.open()?.reader, left })),
            Kind::Zip(archive) => visit_zip(archive, left, visit),
            Kind::Tar(input) => visit_tar(Metered { inner: input.open()?.reader, left }, visit),
            Kind::Folder(files) => files.iter().enumerate().try_for_each(|(index, path)| {
                let name = path.file_name().unwrap_or_default().to_string_lossy();
                let file = File::open(path).map_err(|e| VolumeError::io("path", e))?;
                visit(index, &name, &mut BufReader::new(Metered { inner: Watched::new(file, watch), left }))
            }),
        };
        if left.get() == 0 {
            // Whatever the reader made of its sudden end.
            let needed = u128::from(self.limit) + 1;
            return Err(VolumeError::TooLarge { field: "archive".into(), unit: "bytes", needed, limit: self.limit });
        }
        visited
    }
}

/// Whether a file begins like a zip archive.
pub(super) fn is_zip(head: &[u8]) -> bool {
    head.starts_with(b"PK\x03\x04") || head.starts_with(b"PK\x05\x06")
}

/// Whether a file begins like a tar archive, of which this is the first KiB.
pub(super) fn is_tar(head: &[u8]) -> bool {
    head.get(257..).is_some_and(|rest| rest.starts_with(b"ustar"))
}

fn visit_zip(
    archive: &mut ZipArchive<Box<dyn ReadSeek + '_>>,
    left: &Cell<u64>,
    visit: &mut Visit,
) -> Result<(), VolumeError> {
    for index in 0..archive.len() {
        let file = archive.by_index(index).map_err(zip_error)?;
        let name = file.name().map_err(zip_error)?.into_owned();
        check_name(&name)?;
        if file.is_file() {
            visit(index, &name, &mut BufReader::new(Metered { inner: file, left }))?;
        }
    }
    Ok(())
}

fn visit_tar(reader: impl Read, visit: &mut Visit) -> Result<(), VolumeError> {
    let mut archive = tar::Archive::new(reader);
    // Raw: extensions, such as long names, are entries like others and not read into memory whatever their size.
    let entries = archive.entries().map_err(tar_error)?.raw(true);
    for (index, entry) in entries.enumerate() {
        check_count(index)?;
        let entry = entry.map_err(tar_error)?;
        let name = String::from_utf8_lossy(&entry.path_bytes()).into_owned();
        check_name(&name)?;
        let kind = entry.header().entry_type();
        if kind.is_file() || kind.is_contiguous() {
            visit(index, &name, &mut BufReader::new(entry))?;
        }
    }
    Ok(())
}

fn list(folder: &Path, depth: usize, files: &mut Vec<PathBuf>) -> Result<(), VolumeError> {
    let io = |e| VolumeError::io("path", e);
    if depth == 0 {
        return Err(VolumeError::unsupported("path", format!("folders are more than {MAX_DEPTH} deep")));
    }
    for entry in folder.read_dir().map_err(io)? {
        let entry = entry.map_err(io)?;
        // Does not follow links.
        let kind = entry.file_type().map_err(io)?;
        if kind.is_dir() {
            list(&entry.path(), depth - 1, files)?;
        } else if kind.is_file() {
            files.push(entry.path());
            check_count(files.len())?;
        }
    }
    Ok(())
}

fn check_count(count: usize) -> Result<(), VolumeError> {
    if count <= MAX_FILES {
        return Ok(());
    }
    Err(VolumeError::TooLarge {
        field: "archive".into(),
        unit: "files",
        needed: count as u128,
        limit: MAX_FILES as u64,
    })
}

/// Nothing is written where a name points, but a name that points outside is no accident.
pub(super) fn check_name(name: &str) -> Result<(), VolumeError> {
    let plain = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if Path::new(name).components().all(plain) && !name.split('\\').any(|part| part == "..") {
        Ok(())
    } else {
        let message = format!("{} leads out of the archive; expected relative names without `..`", excerpt(name));
        Err(VolumeError::malformed("archive", message))
    }
}

pub(super) fn zip_error(error: ZipError) -> VolumeError {
    match error {
        ZipError::Io(e) => tar_error(e),
        ZipError::CompressionMethodNotSupported(_) => {
            VolumeError::unsupported("archive", "the zip is not compressed with deflate, the method that is read")
        }
        ZipError::UnsupportedArchive(reason) => VolumeError::unsupported("archive", reason),
        other => VolumeError::malformed("archive", format!("not a whole zip file: {other}")),
    }
}

/// What is not the system's fault is the archive's.
pub(super) fn tar_error(error: io::Error) -> VolumeError {
    if error.raw_os_error().is_some() {
        VolumeError::io("archive", error)
    } else {
        VolumeError::malformed("archive", format!("damaged: {error}"))
    }
}

/// Ends with an error when there is nothing left of what may be read.
struct Metered<'l, R> {
    inner: R,
    left: &'l Cell<u64>,
}

impl<R: Read> Read for Metered<'_, R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let got = self.inner.read(bytes)?;
        self.left.set(self.left.get().saturating_sub(got as u64));
        if self.left.get() == 0 && got > 0 {
            return Err(io::Error::other("more bytes than the limit allows"));
        }
        Ok(got)
    }
}
