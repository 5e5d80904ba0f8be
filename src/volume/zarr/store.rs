//! Where a hierarchy's keys are: a folder, or a zip or tar archive of one.

use std::fs::File;
use std::io::{self, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use zip::ZipArchive;

use crate::volume::archive::{check_name, is_tar, is_zip, zip_error};
use crate::volume::error::excerpt;
use crate::volume::indexed::{TarFiles, tar_files};
use crate::volume::input::{Input, ReadSeek, finish};
use crate::volume::voxels::data_error;
use crate::volume::{VolumeError, paths};

/// Documents of which a hierarchy, or a level of one, is known.
const DOCUMENTS: [&str; 4] = ["zarr.json", ".zgroup", ".zarray", ".zattrs"];

/// Keys with bytes.
pub(super) struct Store<'i> {
    kind: Kind<'i>,
    /// What comes before each key, empty or with a slash at its end.
    prefix: String,
}

enum Kind<'i> {
    Folder(PathBuf),
    Zip(ZipArchive<Box<dyn ReadSeek + 'i>>),
    Tar(Box<dyn ReadSeek + 'i>, TarFiles),
}

/// Whether a folder holds a hierarchy.
pub(in crate::volume) fn is_zarr_folder(folder: &Path) -> bool {
    DOCUMENTS.iter().any(|name| folder.join(name).is_file())
}

/// Whether an archive of these files holds a hierarchy, at its root or below.
pub(in crate::volume) fn is_zarr(names: &[String]) -> bool {
    names.iter().any(|name| is_document(name))
}

/// Whether a name in an archive is that of a hierarchy's document, or inside of a folder called so.
fn is_document(name: &str) -> bool {
    let base = name.rsplit('/').next().unwrap_or_default();
    // Attributes alone are no array, and may have been left by anything.
    (DOCUMENTS.contains(&base) && base != ".zattrs") || name.split('/').any(|folder| folder.ends_with(".zarr"))
}

impl<'i> Store<'i> {
    /// The hierarchy at the root of a folder or archive, or in the one folder of an archive that has one.
    ///
    /// # Errors
    /// Names `archive` if it is damaged or holds no hierarchy or several, `path` if a folder holds none.
    pub(super) fn open(input: &'i mut Input<'_>) -> Result<Self, VolumeError> {
        if let Some(folder) = input.folder() {
            let kind = Kind::Folder(folder.to_owned());
            return Ok(Self { kind, prefix: String::new() });
        }
        let head = input.head()?;
        let (kind, prefix) = if is_zip(&head) {
            let archive = ZipArchive::new(input.seekable()?).map_err(zip_error)?;
            let names: Vec<_> = archive.file_names().collect::<Result<_, _>>().map_err(zip_error)?;
            names.iter().try_for_each(|name| check_name(name))?;
            let prefix = prefix(names.iter().map(AsRef::as_ref))?;
            (Kind::Zip(archive), prefix)
        } else if is_tar(&head) {
            let mut reader = input.seekable()?;
            let files = tar_files(&mut reader)?;
            let prefix = prefix(files.keys().map(String::as_str))?;
            (Kind::Tar(reader, files), prefix)
        } else {
            let message = "not a zip or tar archive; a Zarr hierarchy is a folder, or an archive of one";
            return Err(VolumeError::malformed("archive", message));
        };
        Ok(Self { kind, prefix })
    }

    /// All bytes of a key; `None` if there is no such.
    ///
    /// # Errors
    /// Names `chunk` if there are more than `most`, or the archive is damaged.
    pub(super) fn read(&mut self, key: &str, most: u64) -> Result<Option<Vec<u8>>, VolumeError> {
        let Some(mut object) = self.object(key)? else { return Ok(None) };
        if object.length > most {
            let (unit, needed) = ("bytes", u128::from(object.length));
            return Err(VolumeError::TooLarge { field: format!("chunk {}", excerpt(key)), unit, needed, limit: most });
        }
        let bytes = object.read_range(0, object.length)?;
        // Checksums come after the last byte.
        if let Reader::Stream(reader) = &mut object.reader {
            finish(reader, "chunk")?;
        }
        Ok(Some(bytes))
    }

    /// The bytes of a key, to be read from its beginning on; `None` if there is no such.
    pub(super) fn object(&mut self, key: &str) -> Result<Option<Object<'_>>, VolumeError> {
        let io = |error| VolumeError::io("chunk", error);
        let name = format!("{}{key}", self.prefix);
        match &mut self.kind {
            Kind::Folder(folder) => {
                let path = match paths::canonical_inside(folder, folder, &name, "chunk") {
                    Ok(path) if path.is_file() => path,
                    // Not opened: it may be a named pipe.
                    Ok(_) => return Ok(None),
                    Err(VolumeError::Io { source, .. })
                        if matches!(
                            source.kind(),
                            io::ErrorKind::NotFound | io::ErrorKind::NotADirectory | io::ErrorKind::InvalidFilename
                        ) =>
                    {
                        return Ok(None);
                    }
                    Err(error) => return Err(error),
                };
                let file = File::open(path).map_err(io)?;
                let length = file.metadata().map_err(io)?.len();
                Ok(Some(Object { reader: Reader::Seek(Box::new(file)), start: 0, length, at: 0 }))
            }
            Kind::Zip(archive) => {
                let Some(index) = archive.index_for_name_raw(name.as_bytes()) else { return Ok(None) };
                let file = archive.by_index(index).map_err(zip_error)?;
                let length = file.size();
                Ok(Some(Object { reader: Reader::Stream(Box::new(file)), start: 0, length, at: 0 }))
            }
            Kind::Tar(reader, files) => {
                let Some(&(start, length)) = files.get(&name) else { return Ok(None) };
                reader.seek(SeekFrom::Start(start)).map_err(io)?;
                Ok(Some(Object { reader: Reader::Seek(Box::new(reader)), start, length, at: 0 }))
            }
        }
    }
}

/// The folder of an archive that holds a hierarchy's document.
fn prefix<'n>(names: impl Iterator<Item = &'n str>) -> Result<String, VolumeError> {
    let mut folders: Vec<&str> = Vec::new();
    for name in names {
        match name.rsplit_once('/') {
            None if DOCUMENTS.contains(&name) => return Ok(String::new()),
            Some((folder, name)) if DOCUMENTS.contains(&name) && !folder.contains('/') => folders.push(folder),
            _ => {}
        }
    }
    folders.sort_unstable();
    folders.dedup();
    match folders[..] {
        [folder] => Ok(format!("{folder}/")),
        [] => Err(VolumeError::malformed(
            "archive",
            "no Zarr hierarchy in it: neither zarr.json nor .zgroup nor .zarray is at its root or in its one folder",
        )),
        [a, b, ..] => {
            let message = format!("several Zarr hierarchies, such as {} and {}; expected one", excerpt(a), excerpt(b));
            Err(VolumeError::unsupported("archive", message))
        }
    }
}

/// The bytes of a key.
pub(super) struct Object<'s> {
    reader: Reader<'s>,
    start: u64,
    /// As the store claims.
    pub(super) length: u64,
    /// Where the reader is.
    at: u64,
}

enum Reader<'s> {
    Seek(Box<dyn ReadAndSeek + 's>),
    Stream(Box<dyn Read + 's>),
}

trait ReadAndSeek: Read + Seek {}

impl<T: Read + Seek> ReadAndSeek for T {}

impl Object<'_> {
    /// The bytes from `offset` on, which must not be before the end of what was read last; fewer than `count` at the
    /// object's end.
    pub(super) fn read_range(&mut self, offset: u64, count: u64) -> Result<Vec<u8>, VolumeError> {
        let fault = |error| data_error("chunk", error);
        let skip = offset.saturating_sub(self.at);
        match &mut self.reader {
            Reader::Seek(reader) => {
                reader.seek(SeekFrom::Start(self.start.saturating_add(offset))).map_err(fault)?;
            }
            Reader::Stream(reader) => {
                io::copy(&mut reader.take(skip), &mut io::sink()).map_err(fault)?;
            }
        }
        let count = count.min(self.length.saturating_sub(offset));
        let mut bytes = Vec::new();
        (&mut self.reader).take(count).read_to_end(&mut bytes).map_err(fault)?;
        self.at = offset + bytes.len() as u64;
        Ok(bytes)
    }
}

impl Read for Reader<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        match self {
            Self::Seek(reader) => reader.read(bytes),
            Self::Stream(reader) => reader.read(bytes),
        }
    }
}
