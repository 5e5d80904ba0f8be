//! Files named by clients and by files: only those inside a directory that the operator chose.

use std::fs::File;
use std::path::{Component, Path, PathBuf};

use super::VolumeError;
use super::error::excerpt;

/// A file inside `root`, found from the directory `base` inside it by a relative name without `..`.
///
/// Symbolic links are followed, and refused where they lead outside. Anything but a regular file is refused before it
/// is opened: a named pipe would wait for ever.
pub(super) fn resolve_inside(root: &Path, base: &Path, name: &str, field: &str) -> Result<PathBuf, VolumeError> {
    let path = resolve_any(root, base, name, field)?;
    if !path.is_file() {
        return Err(VolumeError::malformed(field, format!("{} is not a file", excerpt(name))));
    }
    Ok(path)
}

/// [`resolve_inside`] for a file or a folder.
pub(super) fn resolve_any(root: &Path, base: &Path, name: &str, field: &str) -> Result<PathBuf, VolumeError> {
    let path = canonical_inside(root, base, name, field)?;
    if !path.is_file() && !path.is_dir() {
        return Err(VolumeError::malformed(field, format!("{} is neither a file nor a folder", excerpt(name))));
    }
    Ok(path)
}

/// The same for anything that may be inside.
pub(super) fn canonical_inside(root: &Path, base: &Path, name: &str, field: &str) -> Result<PathBuf, VolumeError> {
    check_relative(name, field)?;
    let canonical = |path: &Path| path.canonicalize().map_err(|e| VolumeError::io(field, e));
    let path = canonical(&base.join(name))?;
    if !path.starts_with(canonical(root)?) {
        let message = format!("{} leads out of the data directory", excerpt(name));
        return Err(VolumeError::malformed(field, message));
    }
    Ok(path)
}

/// Refuses a name that could lead out of where it is looked for.
pub(super) fn check_relative(name: &str, field: &str) -> Result<(), VolumeError> {
    let plain = |c: Component| matches!(c, Component::Normal(_) | Component::CurDir);
    if !name.is_empty() && Path::new(name).components().all(plain) {
        return Ok(());
    }
    Err(VolumeError::malformed(field, format!("{} is not a relative path without `..`", excerpt(name))))
}

/// Opens a resolved file; also says how many bytes it has.
pub(super) fn open(path: &Path, field: &str) -> Result<(File, u64), VolumeError> {
    let file = File::open(path).map_err(|e| VolumeError::io(field, e))?;
    let length = file.metadata().map_err(|e| VolumeError::io(field, e))?.len();
    Ok((file, length))
}
