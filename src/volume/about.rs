//! What a file says besides voxels and geometry, and what its reader has to say about it.

/// Most fields of a header that are kept.
const MAX_FIELDS: usize = 500;

/// Longest value of a field that is kept, in characters.
const MAX_VALUE: usize = 1000;

/// What is known of a volume besides its voxels. Not part of what it is: equal voxels from two files have equal sums.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct About {
    /// World axes are the patient's: x to the left, y to the back (posterior), z to the head (superior), in mm.
    pub patient_axes: bool,
    /// The file's own header, field by field in its order, as text: at most 500 fields of at most 1000 characters.
    pub header: Vec<(String, String)>,
    /// What people should know: one sentence each, such as "2 slices are missing".
    pub notes: Vec<String>,
}

impl About {
    /// Keeps a field of the header, unless there are too many; cuts what is too long, and control characters out.
    pub(super) fn field(&mut self, name: &str, value: impl AsRef<str>) {
        if self.header.len() < MAX_FIELDS {
            self.header.push((plain(name), plain(value.as_ref())));
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
