//! The lines of a header, before anything is made of them.

use std::io::BufRead;
use std::str::FromStr;

use crate::volume::VolumeError;
use crate::volume::error::excerpt;
use crate::volume::lines::Lines;

/// The field that ends a header.
const LAST: &str = "ElementDataFile";

/// A header as text: `Name = value` lines in their order.
#[derive(Clone, Debug)]
pub(super) struct Fields {
    pub(super) lines: Vec<(String, String)>,
    /// Bytes up to the end of the last line.
    pub(super) bytes: u64,
}

impl Fields {
    /// Reads up to and including the line `ElementDataFile`.
    pub(super) fn read(reader: &mut impl BufRead) -> Result<Self, VolumeError> {
        let mut lines = Lines::new(reader);
        let mut fields: Vec<(String, String)> = Vec::new();
        while let Some(line) = lines.next()? {
            if line.trim().is_empty() {
                continue;
            }
            // The separator is `=`, and by the documentation `:` as well.
            let Some((name, value)) = line.split_once('=').or_else(|| line.split_once(':')) else {
                return Err(VolumeError::malformed("header", format!("{} is not `Name = value`", excerpt(&line))));
            };
            let (name, value) = (name.trim(), value.trim());
            if fields.iter().any(|(before, _)| before == name) {
                return Err(VolumeError::malformed("header", format!("{} is given twice", excerpt(name))));
            }
            fields.push((name.to_owned(), value.to_owned()));
            if name == LAST {
                return Ok(Self { lines: fields, bytes: lines.bytes() });
            }
        }
        Err(VolumeError::malformed(LAST, "missing: the header ends without it"))
    }

    pub(super) fn get(&self, name: &str) -> Option<&str> {
        self.lines.iter().find(|(field, _)| field == name).map(|(_, value)| value.as_str())
    }

    /// The first of several names that is there, with its value.
    pub(super) fn first<'a>(&'a self, names: &[&'static str]) -> Option<(&'static str, &'a str)> {
        names.iter().find_map(|name| Some((*name, self.get(name)?)))
    }

    pub(super) fn require(&self, name: &str) -> Result<&str, VolumeError> {
        self.get(name).ok_or_else(|| VolumeError::malformed(name, "missing"))
    }

    /// Whether a field is there and true, in any spelling of it.
    pub(super) fn flag(&self, name: &str) -> Result<Option<bool>, VolumeError> {
        self.get(name)
            .map(|value| match value.to_ascii_lowercase().as_str() {
                "true" | "t" | "1" => Ok(true),
                "false" | "f" | "0" => Ok(false),
                _ => Err(VolumeError::malformed(name, format!("{} is neither True nor False", excerpt(value)))),
            })
            .transpose()
    }
}

/// Exactly `count` numbers.
pub(super) fn numbers<T: FromStr>(field: &str, text: &str, count: usize) -> Result<Vec<T>, VolumeError> {
    let numbers: Option<Vec<T>> = text.split_whitespace().take(count + 1).map(|n| n.parse().ok()).collect();
    numbers
        .filter(|numbers| numbers.len() == count)
        .ok_or_else(|| VolumeError::malformed(field, format!("{} is not {count} numbers", excerpt(text))))
}
