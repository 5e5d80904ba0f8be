//! The files beside one that is only a header.

use std::fmt;
use std::io::BufReader;
use std::path::Path;

use super::input::Stream;
use super::watch::Watched;
use super::{LoadWatch, VolumeError, paths};

/// What is done with a file of data.
pub(super) type Read<'r> = dyn FnMut(Stream) -> Result<(), VolumeError> + 'r;

/// Where a file that is only a header may find its data.
#[derive(Clone, Copy, Debug)]
pub(super) enum Siblings<'a> {
    /// Files of a directory.
    Directory {
        /// The directory that no data file may be outside of.
        root: &'a Path,
        /// The header's own directory, which names of data files are relative to; inside `root`.
        directory: &'a Path,
        /// Told of what is read of them.
        watch: Option<&'a LoadWatch>,
    },
    /// Files of the archive that the header is in.
    Archive(&'a dyn Packed),
}

/// The files of an archive, whose names are relative to the header's place in it.
pub(super) trait Packed: fmt::Debug {
    /// Refuses a name that is not that of a file.
    fn check(&self, name: &str, field: &str) -> Result<(), VolumeError>;

    /// Shows a file.
    fn read(&self, name: &str, read: &mut Read) -> Result<(), VolumeError>;
}

impl Siblings<'_> {
    /// Refuses names that are not of files, before the first of them is read.
    pub(super) fn check(&self, names: &[String], field: &str) -> Result<(), VolumeError> {
        match *self {
            Self::Archive(files) => names.iter().try_for_each(|name| files.check(name, field)),
            Self::Directory { root, directory, watch } => {
                let find = |name: &String| paths::resolve_inside(root, directory, name, field);
                let files: Vec<_> = names.iter().map(find).collect::<Result<_, _>>()?;
                if let Some(watch) = watch {
                    watch.expect(files.iter().filter_map(|path| path.metadata().ok()).map(|file| file.len()).sum());
                }
                Ok(())
            }
        }
    }

    /// Shows one file, which [`Self::check`] has found.
    pub(super) fn read(&self, name: &str, field: &str, read: &mut Read) -> Result<(), VolumeError> {
        match *self {
            Self::Archive(files) => files.read(name, read),
            Self::Directory { root, directory, watch } => {
                let path = paths::resolve_inside(root, directory, name, field)?;
                let (file, length) = paths::open(&path, field)?;
                let file = BufReader::new(Watched::new(file, watch));
                read(Stream { reader: Box::new(std::io::Read::take(file, length)), length: Some(length) })
            }
        }
    }
}
