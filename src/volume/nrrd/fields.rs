//! The lines of a header, before anything is made of them.

use std::collections::BTreeMap;
use std::io::BufRead;

use crate::volume::VolumeError;
use crate::volume::error::excerpt;
use crate::volume::lines::Lines;

/// Most names in a list of data files.
pub(super) const MAX_DATA_FILES: usize = 4096;

/// Names of fields, with the spellings that the format allows; the first one is ours.
const FIELDS: &[&[&str]] = &[
    &["dimension"],
    &["type"],
    &["block size", "blocksize"],
    &["encoding"],
    &["endian"],
    &["content"],
    &["min"],
    &["max"],
    &["old min", "oldmin"],
    &["old max", "oldmax"],
    &["data file", "datafile"],
    &["line skip", "lineskip"],
    &["byte skip", "byteskip"],
    &["number"],
    &["sample units", "sampleunits"],
    &["sizes"],
    &["spacings"],
    &["thicknesses"],
    &["axis mins", "axismins"],
    &["axis maxs", "axismaxs"],
    &["centers", "centerings"],
    &["labels"],
    &["units"],
    &["kinds"],
    &["space"],
    &["space dimension"],
    &["space units"],
    &["space origin"],
    &["space directions"],
    &["measurement frame"],
];

/// A header as text.
#[derive(Debug, Default)]
pub(super) struct Fields {
    values: BTreeMap<&'static str, String>,
    /// Fields and key/value pairs as they stand in the file.
    pub(super) in_order: Vec<(String, String)>,
    /// Key/value pairs (`key:=value`).
    pub(super) metadata: BTreeMap<String, String>,
    /// Lines after `data file: LIST`.
    pub(super) listed_files: Vec<String>,
    /// Whether an empty line ended the header, so that data may follow.
    pub(super) ended_by_empty_line: bool,
}

impl Fields {
    pub(super) fn get(&self, field: &str) -> Option<&str> {
        self.values.get(field).map(String::as_str)
    }

    pub(super) fn require(&self, field: &str) -> Result<&str, VolumeError> {
        self.get(field).ok_or_else(|| VolumeError::malformed(field, "missing"))
    }

    /// Reads up to and including the empty line that ends a header, or to the end of a detached one.
    pub(super) fn read(reader: &mut impl BufRead) -> Result<Self, VolumeError> {
        let mut lines = Lines::new(reader);
        let magic = lines.next()?.unwrap_or_default();
        if !matches!(magic.as_str(), "NRRD0001" | "NRRD0002" | "NRRD0003" | "NRRD0004" | "NRRD0005") {
            return Err(VolumeError::malformed("magic", format!("{} is not NRRD0001 to NRRD0005", excerpt(&magic))));
        }
        let mut fields = Self::default();
        let mut in_list = false;
        while let Some(line) = lines.next()? {
            if line.is_empty() {
                fields.ended_by_empty_line = true;
                break;
            }
            if in_list {
                if fields.listed_files.len() == MAX_DATA_FILES {
                    return Err(VolumeError::malformed("data file", format!("more than {MAX_DATA_FILES} files")));
                }
                fields.listed_files.push(line);
            } else if !line.starts_with('#') {
                fields.add(&line)?;
                in_list = fields.get("data file").is_some_and(is_list);
            }
        }
        Ok(fields)
    }

    fn add(&mut self, line: &str) -> Result<(), VolumeError> {
        let Some((name, rest)) = line.split_once(':') else {
            return Err(VolumeError::malformed("header", format!("{} is not `field: value`", excerpt(line))));
        };
        if let Some(value) = rest.strip_prefix('=') {
            self.in_order.push((name.to_owned(), value.to_owned()));
            self.metadata.insert(name.to_owned(), value.to_owned());
            return Ok(());
        }
        let lower = name.trim().to_ascii_lowercase();
        let Some(spellings) = FIELDS.iter().find(|spellings| spellings.contains(&lower.as_str())) else {
            return Err(VolumeError::malformed("header", format!("{} is not a field of the format", excerpt(name))));
        };
        self.in_order.push((spellings[0].to_owned(), rest.trim().to_owned()));
        if self.values.insert(spellings[0], rest.trim().to_owned()).is_some() {
            return Err(VolumeError::malformed(spellings[0], "given twice"));
        }
        Ok(())
    }
}

/// Whether the value of `data file` says that names follow, one on each line.
pub(super) fn is_list(value: &str) -> bool {
    value.split_whitespace().next() == Some("LIST")
}
