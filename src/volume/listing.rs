//! What is in the data directory, for people who look for a volume.

use std::fs::DirEntry;
use std::path::Path;

use super::format::{by_ending, told_path};
use super::{Format, Shape, VolumeError, paths};

/// Most entries of one directory that are looked at.
const MAX_ENTRIES: usize = 100_000;

/// A page of a directory.
#[derive(Clone, Debug, PartialEq)]
pub struct Listing {
    /// In the order of their names.
    pub entries: Vec<ListedFile>,
    /// Whether there are more after the last one.
    pub more: bool,
}

/// A file or a directory.
#[derive(Clone, Debug, PartialEq)]
pub struct ListedFile {
    /// Its name in the directory.
    pub name: String,
    /// Bytes of a file; `None` for a directory.
    pub bytes: Option<u64>,
    /// By the end of its name, if that says so; of a directory, if it is a volume as a whole. With its header, by what
    /// is in it.
    pub format: Option<Format>,
    /// What its header says, or what is wrong with it; `None` where nobody asked.
    pub header: Option<Result<Shape, String>>,
}

/// Lists at most `limit` entries of a directory below `data_dir`, `""` being that one, whose names come after `after`.
/// Hidden files, names that are not Unicode, and links that lead outside are left out.
///
/// # Errors
/// Names `path` if it is not a directory inside `data_dir`, or has more than 100,000 entries.
pub fn list_directory(
    path: &str,
    data_dir: &Path,
    after: &str,
    limit: usize,
    with_headers: bool,
) -> Result<Listing, VolumeError> {
    let io = |error| VolumeError::io("path", error);
    let directory = match path {
        "" => data_dir.canonicalize().map_err(io)?,
        _ => paths::canonical_inside(data_dir, data_dir, path, "path")?,
    };
    if !directory.is_dir() {
        return Err(VolumeError::malformed("path", "not a directory"));
    }
    let mut names = Vec::new();
    for (count, entry) in directory.read_dir().map_err(io)?.enumerate() {
        if count >= MAX_ENTRIES {
            return Err(VolumeError::malformed("path", format!("the directory has more than {MAX_ENTRIES} entries")));
        }
        let entry = entry.map_err(io)?;
        if let Some(name) = entry.file_name().to_str()
            && !name.starts_with('.')
            && name > after
        {
            names.push((name.to_owned(), entry));
        }
    }
    names.sort_unstable_by(|(a, _), (b, _)| a.cmp(b));
    let root = data_dir.canonicalize().map_err(io)?;
    let mut found = names.into_iter().filter_map(|(name, entry)| listed(name, &entry, &root));
    let mut entries: Vec<ListedFile> = found.by_ref().take(limit).collect();
    let more = found.next().is_some();
    if with_headers {
        for entry in entries.iter_mut().filter(|entry| entry.bytes.is_some() || entry.format.is_some()) {
            let file = Path::new(path).join(&entry.name);
            // Both parts were text.
            let Some(file) = file.to_str() else { continue };
            let header = told_path(file, data_dir, None).and_then(|(format, header)| {
                entry.format = Some(format);
                header
            });
            entry.header = Some(header.map_err(|error| told(&error)));
        }
    }
    Ok(Listing { entries, more })
}

/// `None` for what cannot be loaded in any case.
fn listed(name: String, entry: &DirEntry, root: &Path) -> Option<ListedFile> {
    let path = entry.path().canonicalize().ok()?;
    let metadata = path.metadata().ok()?;
    if !path.starts_with(root) || !(metadata.is_dir() || metadata.is_file()) {
        return None;
    }
    let bytes = metadata.is_file().then_some(metadata.len());
    let format = by_ending(&name).and_then(Result::ok);
    // A folder may be called anything; those of Zarr are called so by all who write them.
    let format = format.filter(|format| bytes.is_some() || *format == Format::Zarr);
    Some(ListedFile { name, bytes, format, header: None })
}

/// Of a system's failure only the kind: the rest may say more than a client should know.
fn told(error: &VolumeError) -> String {
    match error {
        VolumeError::Io { field, source } => format!("{field}: {}", source.kind()),
        other => other.to_string(),
    }
}
