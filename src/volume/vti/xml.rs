//! The tags of a file, one by one, with the data between them left where they are.

use std::io::{self, BufRead, Read};

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::volume::VolumeError;
use crate::volume::voxels::data_error;

/// Bytes of all that is not data.
const MAX_XML_BYTES: u64 = 16 << 20;

/// A tag.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Tag {
    /// `<name ...>`, or `<name .../>`, which no end follows.
    Start {
        name: String,
        attributes: Vec<(String, String)>,
        empty: bool,
    },
    End(String),
    /// The end of the file.
    Eof,
}

/// Walks over tags.
pub(super) struct Walker<'a> {
    reader: Reader<Metered<'a>>,
    buffer: Vec<u8>,
    /// Start tags of `DataArray` so far.
    arrays: usize,
}

/// A file of which the XML part is limited, the data are not.
pub(super) struct Metered<'a> {
    inner: Box<dyn BufRead + 'a>,
    left: u64,
    in_data: bool,
}

impl<'a> Walker<'a> {
    pub(super) fn new(inner: Box<dyn BufRead + 'a>) -> Self {
        let reader = Reader::from_reader(Metered { inner, left: MAX_XML_BYTES, in_data: false });
        Self { reader, buffer: Vec::new(), arrays: 0 }
    }

    /// The next tag. What is in a `DataArray` before its first tag is skipped.
    pub(super) fn next(&mut self) -> Result<Tag, VolumeError> {
        let tag = self.next_tag()?;
        if matches!(&tag, Tag::Start { name, empty: false, .. } if name == "DataArray") {
            self.skip_to_tag()?;
        }
        Ok(tag)
    }

    fn next_tag(&mut self) -> Result<Tag, VolumeError> {
        loop {
            self.buffer.clear();
            let event = self.reader.read_event_into(&mut self.buffer).map_err(fault)?;
            let (start, empty) = match event {
                Event::Start(start) => (start, false),
                Event::Empty(start) => (start, true),
                Event::End(end) => return Ok(Tag::End(end.name().as_ref().to_owned())),
                Event::Eof => return Ok(Tag::Eof),
                _ => continue,
            };
            let name = start.name().as_ref().to_owned();
            let attributes = attributes(&start)?;
            self.arrays += usize::from(name == "DataArray");
            return Ok(Tag::Start { name, attributes, empty });
        }
    }

    /// Stops where the data of the array with this number begin.
    pub(super) fn seek_array(&mut self, index: usize) -> Result<(), VolumeError> {
        loop {
            match self.next_tag()? {
                Tag::Start { name, empty: false, .. } if name == "DataArray" && self.arrays == index + 1 => break,
                Tag::Start { name, empty: false, .. } if name == "DataArray" => self.skip_to_tag()?,
                Tag::Eof => return Err(no_data()),
                _ => {}
            }
        }
        // Facts about the array may come first, in tags of their own.
        let mut depth = 0;
        while depth > 0 || self.peek()? == Some(b'<') {
            match self.next_tag()? {
                Tag::Start { empty: false, .. } => depth += 1,
                Tag::End(_) if depth > 0 => depth -= 1,
                Tag::End(_) | Tag::Eof => return Err(no_data()),
                Tag::Start { .. } => {}
            }
        }
        Ok(())
    }

    /// Stops `offset` bytes after the `_` with which appended data begin.
    pub(super) fn seek_appended(&mut self, offset: u64) -> Result<(), VolumeError> {
        loop {
            match self.next()? {
                Tag::Start { name, empty: false, .. } if name == "AppendedData" => break,
                Tag::Eof => return Err(no_data()),
                _ => {}
            }
        }
        if self.peek()? != Some(b'_') {
            return Err(VolumeError::malformed("AppendedData", "does not begin with `_`"));
        }
        let skip = offset.saturating_add(1);
        let skipped = io::copy(&mut self.data().take(skip), &mut io::sink()).map_err(|e| data_error("offset", e))?;
        if skipped < skip {
            let message = format!("{offset} is beyond the appended data, which end after {skipped} bytes");
            return Err(VolumeError::malformed("offset", message));
        }
        Ok(())
    }

    /// The file from here, as data.
    pub(super) fn data(&mut self) -> impl BufRead + '_ {
        self.reader.get_mut().in_data = true;
        self.reader.stream()
    }

    /// The next byte that is not white space.
    fn peek(&mut self) -> Result<Option<u8>, VolumeError> {
        let next = (|| {
            let mut data = self.data();
            loop {
                let bytes = data.fill_buf()?;
                if bytes.is_empty() {
                    return Ok(None);
                }
                if let Some(at) = bytes.iter().position(|b| !b.is_ascii_whitespace()) {
                    let byte = bytes[at];
                    data.consume(at);
                    return Ok(Some(byte));
                }
                let length = bytes.len();
                data.consume(length);
            }
        })();
        self.reader.get_mut().in_data = false;
        next.map_err(|e| data_error("DataArray", e))
    }

    /// Skips to the next `<`, or to the end of the file.
    fn skip_to_tag(&mut self) -> Result<(), VolumeError> {
        let skipped = io::copy(&mut super::UntilTag::new(self.data()), &mut io::sink());
        self.reader.get_mut().in_data = false;
        skipped.map(|_| ()).map_err(|e| data_error("DataArray", e))
    }
}

fn no_data() -> VolumeError {
    VolumeError::malformed("DataArray", "truncated: the file ends before the data")
}

fn attributes(start: &BytesStart) -> Result<Vec<(String, String)>, VolumeError> {
    start
        .attributes()
        .map(|attribute| {
            let attribute = attribute.map_err(|e| ill_formed(&e.to_string()))?;
            Ok((attribute.key.as_ref().to_owned(), attribute.value.into_owned()))
        })
        .collect()
}

fn fault(error: quick_xml::Error) -> VolumeError {
    match error {
        quick_xml::Error::Io(error) => data_error("XML", io::Error::new(error.kind(), error.to_string())),
        other => ill_formed(&other.to_string()),
    }
}

/// The parser quotes the file at any length.
fn ill_formed(message: &str) -> VolumeError {
    const LONGEST: usize = 160;
    let message = message.chars().take(LONGEST).map(|c| if c.is_control() { ' ' } else { c });
    VolumeError::malformed("XML", message.collect::<String>())
}

impl Metered<'_> {
    fn limit(&self, length: usize) -> io::Result<usize> {
        if self.in_data {
            return Ok(length);
        }
        if length > 0 && self.left == 0 {
            let message = format!("more than {MAX_XML_BYTES} bytes besides the data");
            return Err(io::Error::new(io::ErrorKind::InvalidData, message));
        }
        Ok(usize::try_from(self.left).unwrap_or(usize::MAX).min(length))
    }
}

impl Read for Metered<'_> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        let got = {
            let mut bytes = self.fill_buf()?;
            bytes.read(out)?
        };
        self.consume(got);
        Ok(got)
    }
}

impl BufRead for Metered<'_> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        let length = self.inner.fill_buf()?.len();
        let length = self.limit(length)?;
        Ok(&self.inner.fill_buf()?[..length])
    }

    fn consume(&mut self, amount: usize) {
        if !self.in_data {
            self.left = self.left.saturating_sub(amount as u64);
        }
        self.inner.consume(amount);
    }
}
