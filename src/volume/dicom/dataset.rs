//! What is kept of a data set, and its values as text and numbers.

use super::fields::{Tag, keyword};
use crate::volume::error::excerpt;
use crate::volume::{Endian, VolumeError};

/// Elements by tag, in the order of the file.
#[derive(Clone, Debug, Default)]
pub(super) struct Dataset {
    pub(super) elements: Vec<(Tag, Value)>,
}

/// Value of an element.
#[derive(Clone, Debug)]
pub(super) enum Value {
    /// As in the file, with the byte order of numbers in it.
    Bytes(Vec<u8>, Endian),
    /// Of a sequence.
    Items(Vec<Dataset>),
}

impl Dataset {
    fn get(&self, tag: Tag) -> Option<&Value> {
        self.elements.iter().find(|(t, _)| *t == tag).map(|(_, value)| value)
    }

    /// Items of a sequence; none if there is no such element.
    pub(super) fn items(&self, tag: Tag) -> &[Dataset] {
        match self.get(tag) {
            Some(Value::Items(items)) => items,
            _ => &[],
        }
    }

    /// Text without its padding; `None` if it is missing or empty.
    pub(super) fn text(&self, tag: Tag) -> Option<String> {
        let Some(Value::Bytes(bytes, _)) = self.get(tag) else {
            return None;
        };
        let text = decode(bytes, self.is_latin1());
        let text = text.trim_matches(|c: char| c == '\0' || c.is_whitespace());
        (!text.is_empty()).then(|| text.to_owned())
    }

    fn is_latin1(&self) -> bool {
        matches!(self.get(0x0008_0005), Some(Value::Bytes(name, _)) if name.starts_with(b"ISO_IR 100"))
    }

    /// One unsigned 16-bit number.
    pub(super) fn short(&self, tag: Tag) -> Option<u16> {
        match self.get(tag)? {
            Value::Bytes(bytes, endian) => {
                let bytes = [*bytes.first()?, *bytes.get(1)?];
                Some(if *endian == Endian::Big { u16::from_be_bytes(bytes) } else { u16::from_le_bytes(bytes) })
            }
            Value::Items(_) => None,
        }
    }

    /// [`Dataset::short`] of an element that must be there.
    pub(super) fn require_short(&self, tag: Tag) -> Result<u16, VolumeError> {
        self.short(tag).ok_or_else(|| VolumeError::malformed(keyword(tag), "missing"))
    }

    /// Decimal numbers with backslashes between them; `None` if they are missing or empty.
    pub(super) fn numbers(&self, tag: Tag) -> Result<Option<Vec<f64>>, VolumeError> {
        let Some(text) = self.text(tag) else {
            return Ok(None);
        };
        let number = |part: &str| part.trim().parse().ok().filter(|v: &f64| v.is_finite());
        let numbers: Option<Vec<f64>> = text.split('\\').map(number).collect();
        let malformed = || {
            VolumeError::malformed(keyword(tag), format!("{} is not numbers with `\\` between them", excerpt(&text)))
        };
        numbers.map(Some).ok_or_else(malformed)
    }

    /// Exactly `N` decimal numbers.
    pub(super) fn array<const N: usize>(&self, tag: Tag) -> Result<Option<[f64; N]>, VolumeError> {
        let Some(numbers) = self.numbers(tag)? else {
            return Ok(None);
        };
        let count = numbers.len();
        let array = numbers.try_into().map(Some);
        array.map_err(|_| VolumeError::malformed(keyword(tag), format!("{count} numbers; expected {N}")))
    }
}

/// Of the character sets, those that most files have: the others show their letters beyond ASCII as marks.
fn decode(bytes: &[u8], latin1: bool) -> String {
    if latin1 { bytes.iter().map(|&b| char::from(b)).collect() } else { String::from_utf8_lossy(bytes).into_owned() }
}
