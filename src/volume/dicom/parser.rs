//! From a file's bytes to the data set before its voxels (PS3.5 section 7, PS3.10 section 7).
//!
//! Elements are read one by one and all but the few in [`super::fields`] are passed over, so a file costs what is kept
//! of it, whatever lengths it claims.

use std::io::{self, BufReader, Cursor, Read};

use flate2::bufread::DeflateDecoder;

use super::dataset::{Dataset, Value};
use super::fields::{Tag, Vr, representation};
use super::syntax::{self, Syntax};
use crate::volume::{Endian, VolumeError};

/// Longest value that is kept, and most that is kept of a file.
const MAX_VALUE_BYTES: u32 = 1 << 16;
const MAX_KEPT_BYTES: usize = 32 << 20;

/// What an element or item costs besides its value.
const ELEMENT_BYTES: usize = 64;

/// Sequences within sequences.
const MAX_DEPTH: usize = 16;

/// A length that is not known before the end comes.
pub(super) const UNDEFINED: u32 = u32::MAX;

pub(super) const ITEM: Tag = 0xFFFE_E000;
const ITEM_END: Tag = 0xFFFE_E00D;
pub(super) const SEQUENCE_END: Tag = 0xFFFE_E0DD;

/// A file, read as far as its voxels.
pub(super) struct Parsed<'r> {
    pub(super) dataset: Dataset,
    pub(super) syntax: Syntax,
    /// `None` if the data set ends without voxels.
    pub(super) voxels: Option<PixelElement<'r>>,
}

/// The element with the voxels: what it is, and its bytes.
pub(super) struct PixelElement<'r> {
    pub(super) tag: Tag,
    /// In bytes, or [`UNDEFINED`].
    pub(super) length: u32,
    pub(super) reader: Box<dyn Read + 'r>,
}

/// Integers, or one of the floating-point kinds.
pub(super) const PIXEL_DATA: Tag = 0x7FE0_0010;
pub(super) const FLOAT_PIXEL_DATA: Tag = 0x7FE0_0008;
pub(super) const DOUBLE_PIXEL_DATA: Tag = 0x7FE0_0009;

/// Reads up to the voxels; `None` if this is not DICOM at all.
///
/// # Errors
/// Names `data set` if it is damaged, or the element at fault.
pub(super) fn parse<'r>(mut reader: impl Read + 'r) -> Result<Option<Parsed<'r>>, VolumeError> {
    let mut start = Vec::new();
    reader.by_ref().take(132).read_to_end(&mut start).map_err(io_error)?;
    let (mut parser, syntax) = if start.get(128..) == Some(b"DICM") {
        let mut meta = Parser::new(Box::new(reader), syntax::plain(true, Endian::Little));
        let first = meta.meta_information()?;
        let uid = meta.dataset.text(0x0002_0010);
        let uid = uid.ok_or_else(|| VolumeError::malformed("TransferSyntaxUID", "missing"))?;
        let syntax = syntax::from_uid(&uid)?;
        let rest = Cursor::new(first).chain(meta.reader);
        let reader: Box<dyn Read> =
            if syntax.deflated { Box::new(DeflateDecoder::new(BufReader::new(rest))) } else { Box::new(rest) };
        let kept = meta.dataset;
        (Parser { dataset: kept, ..Parser::new(reader, syntax) }, syntax)
    } else {
        let Some(syntax) = without_meta_information(&start) else {
            return Ok(None);
        };
        (Parser::new(Box::new(Cursor::new(start).chain(reader)), syntax), syntax)
    };
    let voxels = parser.top_level()?;
    let Parser { dataset, reader, .. } = parser;
    let voxels = voxels.map(|(tag, length)| PixelElement { tag, length, reader });
    Ok(Some(Parsed { dataset, syntax, voxels }))
}

/// Old files begin with the data set: an element of group 8 in little endian, with or without its representation.
fn without_meta_information(start: &[u8]) -> Option<Syntax> {
    let &[0x08, 0x00, element, 0x00, a, b, c, d] = start.get(..8)? else {
        return None;
    };
    let explicit = a.is_ascii_uppercase() && b.is_ascii_uppercase();
    let plausible = explicit || (b, c, d) == (0, 0, 0);
    (element <= 0x20 && plausible).then_some(syntax::plain(explicit, Endian::Little))
}

struct Parser<'r> {
    reader: Box<dyn Read + 'r>,
    syntax: Syntax,
    dataset: Dataset,
    kept_bytes: usize,
    consumed: u64,
}

/// Tag, representation (if the syntax says it) and length.
struct Head {
    tag: Tag,
    vr: Option<[u8; 2]>,
    length: u32,
}

impl<'r> Parser<'r> {
    fn new(reader: Box<dyn Read + 'r>, syntax: Syntax) -> Self {
        Self { reader, syntax, dataset: Dataset::default(), kept_bytes: 0, consumed: 0 }
    }

    /// Reads the elements of group 2, and returns the bytes that turned out not to be one.
    fn meta_information(&mut self) -> Result<Vec<u8>, VolumeError> {
        // Its length is not relied upon: some files lack it and in some it is wrong.
        loop {
            let mut tag = Vec::new();
            self.reader.by_ref().take(4).read_to_end(&mut tag).map_err(io_error)?;
            let &[0x02, 0x00, a, b] = tag.as_slice() else {
                return Ok(tag);
            };
            let tag = 0x0002_0000 | u32::from(u16::from_le_bytes([a, b]));
            let head = self.rest_of_head(tag)?;
            let mut kept = std::mem::take(&mut self.dataset);
            self.element(&head, Some(&mut kept), 0)?;
            self.dataset = kept;
        }
    }

    /// Reads elements until the voxels: their tag and length.
    fn top_level(&mut self) -> Result<Option<(Tag, u32)>, VolumeError> {
        let mut kept = std::mem::take(&mut self.dataset);
        let mut voxels = None;
        while let Some(head) = self.head()? {
            if matches!(head.tag, PIXEL_DATA | FLOAT_PIXEL_DATA | DOUBLE_PIXEL_DATA) {
                voxels = Some((head.tag, head.length));
                break;
            }
            self.element(&head, Some(&mut kept), 0)?;
        }
        self.dataset = kept;
        Ok(voxels)
    }

    /// The next element's head; `None` at the end of the file.
    fn head(&mut self) -> Result<Option<Head>, VolumeError> {
        let mut bytes = [0; 4];
        if !self.fill(&mut bytes)? {
            return Ok(None);
        }
        let tag = self.tag(bytes);
        self.rest_of_head(tag).map(Some)
    }

    fn tag(&self, [a, b, c, d]: [u8; 4]) -> Tag {
        match self.syntax.endian {
            Endian::Little => u32::from_be_bytes([b, a, d, c]),
            Endian::Big => u32::from_be_bytes([a, b, c, d]),
        }
    }

    fn rest_of_head(&mut self, tag: Tag) -> Result<Head, VolumeError> {
        if !self.syntax.explicit || tag >> 16 == 0xFFFE {
            return Ok(Head { tag, vr: None, length: self.long()? });
        }
        let [a, b, c, d] = self.bytes()?;
        let vr = [a, b];
        let length = match &vr {
            b"OB" | b"OD" | b"OF" | b"OL" | b"OV" | b"OW" | b"SQ" | b"SV" | b"UC" | b"UN" | b"UR" | b"UT" | b"UV" => {
                self.long()?
            }
            _ if a.is_ascii_uppercase() && b.is_ascii_uppercase() => u32::from(match self.syntax.endian {
                Endian::Little => u16::from_le_bytes([c, d]),
                Endian::Big => u16::from_be_bytes([c, d]),
            }),
            _ => {
                let message = format!("element ({:04X},{:04X}) has no value representation", tag >> 16, tag & 0xFFFF);
                return Err(VolumeError::malformed("data set", message));
            }
        };
        Ok(Head { tag, vr: Some(vr), length })
    }

    /// Reads an element into `into`, or past it.
    fn element(&mut self, head: &Head, into: Option<&mut Dataset>, depth: usize) -> Result<(), VolumeError> {
        let wanted = into.and_then(|into| representation(head.tag).map(|vr| (into, vr)));
        match wanted {
            Some((into, Vr::Sq)) => {
                let items = self.within_sequence(head, depth, true)?;
                into.elements.push((head.tag, Value::Items(items)));
            }
            Some((into, _)) if head.length <= MAX_VALUE_BYTES => {
                self.keep(head.length as usize)?;
                let mut value = Vec::new();
                self.reader.by_ref().take(u64::from(head.length)).read_to_end(&mut value).map_err(io_error)?;
                self.consumed += value.len() as u64;
                if value.len() < head.length as usize {
                    return Err(truncated());
                }
                into.elements.push((head.tag, Value::Bytes(value, self.syntax.endian)));
            }
            _ if head.length == UNDEFINED => {
                self.within_sequence(head, depth, false)?;
            }
            _ => self.skip(head.length)?,
        }
        Ok(())
    }

    /// [`Parser::sequence`], of which an unknown representation is always in implicit little endian (PS3.5, 6.2.2).
    fn within_sequence(&mut self, head: &Head, depth: usize, keep: bool) -> Result<Vec<Dataset>, VolumeError> {
        let outside = self.syntax;
        if head.vr == Some(*b"UN") {
            self.syntax = syntax::plain(false, Endian::Little);
        }
        let items = self.sequence(head.length, depth, keep);
        self.syntax = outside;
        items
    }

    /// The items of a sequence, as far as they are to be kept.
    fn sequence(&mut self, length: u32, depth: usize, keep: bool) -> Result<Vec<Dataset>, VolumeError> {
        if depth == MAX_DEPTH {
            let message = format!("sequences are more than {MAX_DEPTH} deep");
            return Err(VolumeError::malformed("data set", message));
        }
        let end = self.end(length);
        let mut items = Vec::new();
        while self.is_before(end)? {
            let head = self.head()?.ok_or_else(truncated)?;
            match head.tag {
                SEQUENCE_END => break,
                ITEM => {}
                _ => return Err(VolumeError::malformed("data set", "a sequence holds something that is not an item")),
            }
            if keep {
                let mut item = Dataset::default();
                self.item(head.length, Some(&mut item), depth)?;
                self.keep(0)?;
                items.push(item);
            } else if head.length == UNDEFINED {
                self.item(head.length, None, depth)?;
            } else {
                // Items may also be the fragments of an icon's voxels.
                self.skip(head.length)?;
            }
        }
        Ok(items)
    }

    fn item(&mut self, length: u32, mut into: Option<&mut Dataset>, depth: usize) -> Result<(), VolumeError> {
        let end = self.end(length);
        while self.is_before(end)? {
            let head = self.head()?.ok_or_else(truncated)?;
            if head.tag == ITEM_END {
                break;
            }
            self.element(&head, into.as_deref_mut(), depth + 1)?;
        }
        Ok(())
    }

    /// Where something of this length ends; `None` if only a delimiter will tell.
    fn end(&self, length: u32) -> Option<u64> {
        (length != UNDEFINED).then(|| self.consumed + u64::from(length))
    }

    fn is_before(&self, end: Option<u64>) -> Result<bool, VolumeError> {
        match end {
            Some(end) if self.consumed > end => {
                Err(VolumeError::malformed("data set", "an element is longer than the sequence it is in"))
            }
            Some(end) => Ok(self.consumed < end),
            None => Ok(true),
        }
    }

    /// Fills `bytes`; false if the file ends before the first of them.
    fn fill(&mut self, bytes: &mut [u8]) -> Result<bool, VolumeError> {
        let mut got = 0;
        while got < bytes.len() {
            match self.reader.read(&mut bytes[got..]).map_err(io_error)? {
                0 if got == 0 => return Ok(false),
                0 => return Err(truncated()),
                n => got += n,
            }
        }
        self.consumed += got as u64;
        Ok(true)
    }

    fn bytes(&mut self) -> Result<[u8; 4], VolumeError> {
        let mut bytes = [0; 4];
        if self.fill(&mut bytes)? { Ok(bytes) } else { Err(truncated()) }
    }

    fn long(&mut self) -> Result<u32, VolumeError> {
        let bytes = self.bytes()?;
        Ok(match self.syntax.endian {
            Endian::Little => u32::from_le_bytes(bytes),
            Endian::Big => u32::from_be_bytes(bytes),
        })
    }

    fn skip(&mut self, length: u32) -> Result<(), VolumeError> {
        let length = u64::from(length);
        let skipped = io::copy(&mut self.reader.by_ref().take(length), &mut io::sink()).map_err(io_error)?;
        self.consumed += skipped;
        if skipped < length { Err(truncated()) } else { Ok(()) }
    }

    fn keep(&mut self, bytes: usize) -> Result<(), VolumeError> {
        self.kept_bytes += bytes + ELEMENT_BYTES;
        if self.kept_bytes > MAX_KEPT_BYTES {
            return Err(VolumeError::TooLarge {
                field: "data set".into(),
                unit: "bytes",
                needed: self.kept_bytes as u128,
                limit: MAX_KEPT_BYTES as u64,
            });
        }
        Ok(())
    }
}

fn truncated() -> VolumeError {
    VolumeError::malformed("data set", "truncated: the file ends inside an element")
}

fn io_error(error: io::Error) -> VolumeError {
    crate::volume::voxels::data_error("data set", error)
}
