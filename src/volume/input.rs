//! A file as the reader of a format gets it.

use std::fs::File;
use std::io::{self, BufRead, BufReader, Cursor, Read, Seek};
use std::path::{Path, PathBuf};

use super::indexed::Indexed;
use super::siblings::Siblings;
use super::voxels::data_error;
use super::watch::Watched;
use super::wrap::Wrapping;
use super::{Limits, LoadStage, LoadWatch, RawSpec, VolumeError};

/// Bytes of which a format can be recognised.
pub(super) const HEAD_BYTES: u64 = 1024;

/// Most bytes of a file that is unwrapped as a whole: unlike a stream, it takes memory before its header is read.
const MAX_UNWRAPPED_BYTES: u64 = 1 << 30;

/// The bytes of a file, wherever they are.
#[derive(Debug)]
pub(super) enum Source<'a> {
    Bytes(&'a [u8]),
    File(File),
    /// For formats of many files.
    Folder(PathBuf),
    /// A file in an archive.
    Packed(Indexed<'a>, String),
}

/// Which of several volumes in one file is meant.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Choice {
    /// Of a DICOM archive: the series' number, its `SeriesInstanceUID` or the end of that.
    pub series: Option<String>,
    /// Of a microscope's file: the number of the channel, from 0.
    pub channel: Option<u32>,
    /// Of an image at several levels of detail: the number of the level, 0 being the full resolution.
    pub scale: Option<u32>,
}

/// Bytes of a file for each byte of the largest volume: a number of eight bytes may be written in 32 characters.
const MAX_UNWRAPPED_RATIO: u64 = 4;

/// A file to read a volume from, already taken out of its wrapping.
#[derive(Debug)]
pub(super) struct Input<'a> {
    source: Source<'a>,
    wrapping: Option<Wrapping>,
    /// What a header without data may use; `None` for an upload.
    pub(super) siblings: Option<Siblings<'a>>,
    /// What is said beside a file that has no header.
    pub(super) raw: Option<&'a RawSpec>,
    /// Which of several volumes is meant.
    pub(super) choice: Choice,
    /// Most bytes that are unwrapped as a whole.
    pub(super) most_unwrapped: u64,
    /// How large the volume may be.
    pub(super) limits: &'a Limits,
    /// Told of what is read; may call it off.
    pub(super) watch: Option<&'a LoadWatch>,
}

/// The bytes of a file from its beginning.
pub(super) struct Stream<'a> {
    pub(super) reader: Box<dyn BufRead + 'a>,
    /// How many there are; `None` if that shows only when all are unwrapped.
    pub(super) length: Option<u64>,
}

/// A file to jump about in.
pub(super) trait ReadSeek: BufRead + Seek {}

impl<T: BufRead + Seek> ReadSeek for T {}

impl<'a> Input<'a> {
    /// An error names `field` if the file cannot be read.
    pub(super) fn new(
        field: &str,
        mut source: Source<'a>,
        raw: Option<&'a RawSpec>,
        limits: &'a Limits,
    ) -> Result<Self, VolumeError> {
        let mut magic = Vec::new();
        if !matches!(source, Source::Folder(_)) {
            let is_packed = matches!(source, Source::Packed(..));
            let read = open(&mut source, None, field)?.0.take(4).read_to_end(&mut magic);
            // A damaged archive says so when it is read.
            read.map(drop).or_else(|e| if is_packed { Ok(()) } else { Err(VolumeError::io(field, e)) })?;
        }
        Ok(Self {
            source,
            wrapping: Wrapping::of(&magic),
            siblings: None,
            raw,
            choice: Choice::default(),
            most_unwrapped: MAX_UNWRAPPED_BYTES,
            limits,
            watch: None,
        })
    }

    /// From here on the reading of the file is watched.
    pub(super) fn watched_by(&mut self, watch: &'a LoadWatch) -> Result<(), VolumeError> {
        let length = match &self.source {
            Source::Bytes(bytes) => bytes.len() as u64,
            Source::File(file) => file.metadata().map_err(|e| VolumeError::io("path", e))?.len(),
            Source::Folder(_) | Source::Packed(..) => 0,
        };
        watch.begin(LoadStage::Reading, length);
        self.watch = Some(watch);
        if let Some(Siblings::Directory { watch: told, .. }) = &mut self.siblings {
            *told = Some(watch);
        }
        Ok(())
    }

    /// Whether the file is in gzip or Zstandard.
    pub(super) fn is_wrapped(&self) -> bool {
        self.wrapping.is_some()
    }

    /// The folder, if it is one and not a file.
    pub(super) fn folder(&self) -> Option<&Path> {
        match &self.source {
            Source::Folder(path) => Some(path),
            Source::Bytes(_) | Source::File(_) | Source::Packed(..) => None,
        }
    }

    /// The file as a stream from its beginning; may be asked for again. What is wrapped ends where no volume within
    /// the limits would go on, so that time is limited too.
    pub(super) fn open(&mut self) -> Result<Stream<'_>, VolumeError> {
        let (reader, length) = open(&mut self.source, self.watch, "path")?;
        let most = self.limits.max_bytes.saturating_mul(MAX_UNWRAPPED_RATIO).max(MAX_UNWRAPPED_BYTES);
        Ok(match self.wrapping {
            None => Stream { reader, length: Some(length) },
            Some(wrapping) => Stream { reader: Box::new(wrapping.unwrap(reader).take(most)), length: None },
        })
    }

    /// The file as it is, with what it is wrapped in.
    pub(super) fn open_wrapped(&mut self) -> Result<Stream<'_>, VolumeError> {
        let (reader, length) = open(&mut self.source, self.watch, "path")?;
        Ok(Stream { reader, length: Some(length) })
    }

    /// The file for formats that are read by jumping about. What is wrapped is unwrapped into memory, and refused
    /// when more than a GiB comes out, or more than the largest volume may have bytes.
    pub(super) fn seekable(&mut self) -> Result<Box<dyn ReadSeek + '_>, VolumeError> {
        let watch = self.watch;
        if self.is_wrapped() || matches!(self.source, Source::Packed(..)) {
            let limit = self.limits.max_bytes.min(self.most_unwrapped);
            let mut bytes = Vec::new();
            let mut reader = self.open()?.reader.take(limit.saturating_add(1));
            reader.read_to_end(&mut bytes).map_err(|e| data_error("file", e))?;
            let needed = bytes.len() as u64;
            if needed > limit {
                let field = "file".to_owned();
                return Err(VolumeError::TooLarge { field, unit: "bytes", needed: u128::from(needed), limit });
            }
            return Ok(Box::new(Watched::uncounted(Cursor::new(bytes), watch)));
        }
        Ok(match &mut self.source {
            Source::Bytes(bytes) => Box::new(Watched::new(Cursor::new(*bytes), watch)),
            Source::File(file) => {
                file.rewind().map_err(|e| VolumeError::io("path", e))?;
                Box::new(BufReader::new(Watched::new(&*file, watch)))
            }
            Source::Folder(_) | Source::Packed(..) => {
                return Err(VolumeError::io("path", io::ErrorKind::IsADirectory.into()));
            }
        })
    }

    /// The first bytes, at most 1024; fewer where the wrapping is broken.
    pub(super) fn head(&mut self) -> Result<Vec<u8>, VolumeError> {
        let mut head = Vec::new();
        let read = self.open()?.reader.take(HEAD_BYTES).read_to_end(&mut head);
        match read {
            Err(e) if matches!(self.source, Source::Packed(..)) => Err(data_error("archive", e)),
            Err(e) if self.wrapping.is_none() => Err(VolumeError::io("path", e)),
            _ => Ok(head),
        }
    }
}

/// An error of the system names `field`.
fn open<'a>(
    source: &'a mut Source<'_>,
    watch: Option<&'a LoadWatch>,
    field: &str,
) -> Result<(Box<dyn BufRead + 'a>, u64), VolumeError> {
    let io = |error| VolumeError::io(field, error);
    Ok(match source {
        Source::Bytes(bytes) => (Box::new(Watched::new(*bytes, watch)), bytes.len() as u64),
        Source::File(file) => {
            file.rewind().map_err(io)?;
            let length = file.metadata().map_err(io)?.len();
            // What is appended meanwhile is not part of it.
            (Box::new(BufReader::new(Watched::new(&*file, watch)).take(length)), length)
        }
        Source::Folder(_) => return Err(io(io::ErrorKind::IsADirectory.into())),
        Source::Packed(archive, name) => archive.open_file(name)?,
    })
}

impl Stream<'_> {
    /// Skips what lies before the data; an error names `field` if the file ends before that.
    pub(super) fn skip(&mut self, field: &str, bytes: u64) -> Result<(), VolumeError> {
        let skipped = io::copy(&mut (&mut self.reader).take(bytes), &mut io::sink());
        let skipped = skipped.map_err(|e| data_error(field, e))?;
        if skipped == bytes {
            Ok(())
        } else {
            Err(VolumeError::malformed(field, format!("{bytes} bytes before the data, but the file has {skipped}")))
        }
    }

    /// Refuses a file that is too short for the data before memory is taken for them.
    pub(super) fn expect_bytes(&self, field: &str, skipped: u64, expected: u64) -> Result<(), VolumeError> {
        match self.length.map(|length| length.saturating_sub(skipped)) {
            Some(got) if got < expected => {
                Err(VolumeError::malformed(field, format!("truncated: expected {expected} bytes, got {got}")))
            }
            _ => Ok(()),
        }
    }

    /// Asks for one byte more than the data: checksums come after the last. What follows is ignored.
    pub(super) fn finish(mut self, field: &str) -> Result<(), VolumeError> {
        finish(&mut *self.reader, field)
    }
}

/// [`Stream::finish`] for the end of any compressed data.
pub(super) fn finish(reader: &mut dyn Read, field: &str) -> Result<(), VolumeError> {
    match reader.read(&mut [0]) {
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => {
            Err(VolumeError::malformed(field, "truncated: the end of the compressed data is missing"))
        }
        Err(e) => Err(data_error(field, e)),
        Ok(_) => Ok(()),
    }
}
