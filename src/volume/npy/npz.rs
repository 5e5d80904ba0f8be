//! Archives of arrays, as `numpy.savez` and `numpy.savez_compressed` write them.

use std::io::BufReader;

use zip::ZipArchive;
use zip::read::ZipFile;
use zip::result::ZipError;

use super::Header;
use crate::volume::archive::is_zip;
use crate::volume::error::excerpt;
use crate::volume::input::{Input, ReadSeek};
use crate::volume::{Limits, Shape, Volume, VolumeError};

/// Most arrays that are looked at.
const MAX_ARRAYS: usize = 1000;

/// The array that is read if several have three axes.
const PREFERRED: &str = "array";

/// Whether a zip archive begins with an array.
pub(in crate::volume) fn magic(head: &[u8]) -> bool {
    let length = head.get(26..28).map_or(0, |b| usize::from(u16::from_le_bytes([b[0], b[1]])));
    head.starts_with(b"PK\x03\x04") && head.get(30..30 + length).is_some_and(|name| name.ends_with(b".npy"))
}

pub(in crate::volume) fn read_input(input: &mut Input) -> Result<Volume, VolumeError> {
    let limits = input.limits;
    with_array(input, |header, reader| read_array(header, reader, limits))
}

pub(in crate::volume) fn peek_input(input: &mut Input) -> Result<Shape, VolumeError> {
    with_array(input, |header, _| Ok(Shape::without_spacing(header.dims()?, header.stored.voxel_type())))
}

type Entry<'a, 'b> = BufReader<ZipFile<'a, Box<dyn ReadSeek + 'b>>>;

fn read_array(header: &Header, mut reader: Entry, limits: &Limits) -> Result<Volume, VolumeError> {
    let name = reader.get_ref().name().map_err(fault)?.into_owned();
    let mut volume = header.read_volume(&mut reader, limits)?;
    volume.about.field("array", name.trim_end_matches(".npy"));
    Ok(volume)
}

/// Finds the one array that is a volume, and works on it.
fn with_array<T>(
    input: &mut Input,
    work: impl FnOnce(&Header, Entry) -> Result<T, VolumeError>,
) -> Result<T, VolumeError> {
    // The library finds an archive anywhere in a file, even in one that only holds it.
    if !is_zip(&input.head()?) {
        return Err(VolumeError::malformed("archive", "not a zip archive: it does not begin like one"));
    }
    let mut archive = ZipArchive::new(input.seekable()?).map_err(fault)?;
    if archive.len() > MAX_ARRAYS {
        let message = format!("{} arrays in the archive; expected at most {MAX_ARRAYS}", archive.len());
        return Err(VolumeError::unsupported("archive", message));
    }
    let mut volumes = Vec::new();
    let mut refused = None;
    for index in 0..archive.len() {
        let (name, header) = {
            let entry = archive.by_index(index).map_err(fault)?;
            let name = entry.name().map_err(fault)?;
            let Some(name) = name.strip_suffix(".npy").map(str::to_owned) else { continue };
            (name, Header::read(&mut BufReader::new(entry)))
        };
        match header.and_then(|header| header.dims()) {
            Ok(_) => volumes.push((index, name)),
            Err(error) => refused = Some(error),
        }
    }
    let index = match volumes.as_slice() {
        [] => return Err(refused.unwrap_or_else(|| VolumeError::malformed("archive", "no array in it"))),
        [(index, _)] => *index,
        several => match several.iter().find(|(_, name)| name == PREFERRED) {
            Some((index, _)) => *index,
            None => return Err(ambiguous(several)),
        },
    };
    let mut entry = BufReader::new(archive.by_index(index).map_err(fault)?);
    let header = Header::read(&mut entry)?;
    work(&header, entry)
}

fn ambiguous(several: &[(usize, String)]) -> VolumeError {
    let names: Vec<_> = several.iter().take(10).map(|(_, name)| excerpt(name)).collect();
    let message = format!(
        "{} arrays with three axes ({}{}); expected one, or one called `{PREFERRED}`",
        several.len(),
        names.join(", "),
        if several.len() > names.len() { ", ..." } else { "" },
    );
    VolumeError::unsupported("archive", message)
}

fn fault(error: ZipError) -> VolumeError {
    match error {
        ZipError::Io(error) => crate::volume::voxels::data_error("archive", error),
        other => VolumeError::malformed("archive", format!("not a zip archive that can be read: {other}")),
    }
}
