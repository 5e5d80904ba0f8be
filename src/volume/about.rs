//! What a file says besides voxels and geometry, and what its reader has to say about it.

use std::collections::BTreeSet;

/// Most fields of a header that are kept.
const MAX_FIELDS: usize = 500;

/// Longest value of a field that is kept, in characters.
const MAX_VALUE: usize = 1000;

/// Fields that say how voxels are stored and where they are, by their names in lower case, over all formats whose
/// headers are text with names of any kind. No others of theirs are technical: free text and names of files may name a
/// patient. Readers that know each of their fields say so themselves ([`About::technical_field`]).
const TECHNICAL: &[&str] = &[
    // NRRD
    "axis maxs",
    "axis mins",
    "axismaxs",
    "axismins",
    "block size",
    "blocksize",
    "byte skip",
    "byteskip",
    "centerings",
    "centers",
    "dimension",
    "encoding",
    "endian",
    "kinds",
    "line skip",
    "lineskip",
    "max",
    "measurement frame",
    "min",
    "number",
    "old max",
    "old min",
    "oldmax",
    "oldmin",
    "sample units",
    "sampleunits",
    "sizes",
    "space",
    "space dimension",
    "space directions",
    "space origin",
    "space units",
    "spacings",
    "thicknesses",
    "type",
    "units",
    // NIfTI
    "datatype",
    "dim",
    "pixdim",
    "qform_code",
    "qoffset",
    "quatern",
    "scl_inter",
    "scl_slope",
    "sform_code",
    "srow_x",
    "srow_y",
    "srow_z",
    "version",
    // MetaImage
    "anatomicalorientation",
    "binarydata",
    "binarydatabyteordermsb",
    "centerofrotation",
    "compresseddata",
    "compresseddatasize",
    "dimsize",
    "distanceunits",
    "elementbyteordermsb",
    "elementmax",
    "elementmin",
    "elementnumberofchannels",
    "elementsize",
    "elementspacing",
    "elementtype",
    "headersize",
    "modality",
    "ndims",
    "objecttype",
    "offset",
    "orientation",
    "origin",
    "position",
    "rotation",
    "transformmatrix",
    // NumPy
    "descr",
    "fortran_order",
    "shape",
    // VTK
    "dataarray format",
    "dataarray numberofcomponents",
    "dataarray offset",
    "dataarray type",
    "byte_order",
    "compressor",
    "direction",
    "extent",
    "header_type",
    "piece",
    "spacing",
    "wholeextent",
];

/// What is known of a volume besides its voxels. Not part of what it is: equal voxels from two files have equal sums.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct About {
    /// World axes are the patient's: x to the left, y to the back (posterior), z to the head (superior), in mm.
    pub patient_axes: bool,
    /// The file's own header, field by field in its order, as text: at most 500 fields of at most 1000 characters.
    pub header: Vec<(String, String)>,
    /// What people should know: one sentence each, such as "2 slices are missing".
    pub notes: Vec<String>,
    /// Which fields of the header their reader knows to be technical, by their number.
    pub(super) technical: BTreeSet<usize>,
}

impl About {
    /// The fields of the header that cannot name a patient, and how many others there are. Whatever is not known to be
    /// technical is among the others.
    pub fn without_identity(&self) -> (Vec<&(String, String)>, usize) {
        let technical = |(index, (name, _)): &(usize, &(String, String))| {
            self.technical.contains(index) || TECHNICAL.contains(&name.to_ascii_lowercase().as_str())
        };
        let shown: Vec<_> = self.header.iter().enumerate().filter(technical).map(|(_, field)| field).collect();
        let withheld = self.header.len() - shown.len();
        (shown, withheld)
    }

    /// Keeps a field of the header, unless there are too many; cuts what is too long, and control characters out.
    pub(super) fn field(&mut self, name: &str, value: impl AsRef<str>) {
        if self.header.len() < MAX_FIELDS {
            self.header.push((plain(name), plain(value.as_ref())));
        }
    }

    /// [`About::field`] of which the reader knows that it cannot name a patient, whatever its value.
    pub(super) fn technical_field(&mut self, name: &str, value: impl AsRef<str>) {
        let index = self.header.len();
        self.field(name, value);
        if self.header.len() > index {
            self.technical.insert(index);
        }
    }

    /// Adds a sentence for people.
    pub(super) fn note(&mut self, sentence: impl Into<String>) {
        self.notes.push(sentence.into());
    }
}

/// Untrusted text as one line.
fn plain(text: &str) -> String {
    let mut plain: String = text.chars().take(MAX_VALUE).map(|c| if c.is_control() { ' ' } else { c }).collect();
    if text.chars().nth(MAX_VALUE).is_some() {
        plain.push_str("...");
    }
    plain.trim().to_owned()
}
