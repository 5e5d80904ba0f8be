//! What can be wrong with a volume: always says which field, and what was expected.

use std::io;

/// Why a volume could not be read, made or used. `field` is the header field, parameter or part of the file.
#[derive(Debug, thiserror::Error)]
pub enum VolumeError {
    /// The input contradicts its format or itself.
    #[error("{field}: {message}")]
    Malformed {
        /// Header field, parameter or part of the file.
        field: String,
        /// What is wrong and what was expected.
        message: String,
    },
    /// Valid, perhaps, but not something this program reads.
    #[error("{field}: {message}")]
    Unsupported {
        /// Header field, parameter or part of the file.
        field: String,
        /// What is not supported and what would be.
        message: String,
    },
    /// Beyond the caller's limits; nothing was allocated.
    #[error("{field}: {needed} {unit} needed, the limit is {limit}")]
    TooLarge {
        /// Header field or parameter that asks for it.
        field: String,
        /// What is counted: `bytes`, `voxels`, `voxels along an axis`.
        unit: &'static str,
        /// How many would be needed.
        needed: u128,
        /// How many are allowed.
        limit: u64,
    },
    /// The file could not be read.
    #[error("{field}: {source}")]
    Io {
        /// Which file or part of it, as the caller named it.
        field: String,
        /// The system's reason.
        source: io::Error,
    },
    /// Whoever wanted the volume does not want it any more.
    #[error("the load was called off")]
    Cancelled,
}

impl VolumeError {
    pub(super) fn malformed(field: &str, message: impl Into<String>) -> Self {
        Self::Malformed { field: field.to_owned(), message: plain(message.into()) }
    }

    pub(super) fn unsupported(field: &str, message: impl Into<String>) -> Self {
        Self::Unsupported { field: field.to_owned(), message: plain(message.into()) }
    }

    pub(super) fn io(field: &str, source: io::Error) -> Self {
        Self::Io { field: field.to_owned(), source }
    }

    /// The field that the error is about.
    pub fn field(&self) -> &str {
        match self {
            Self::Malformed { field, .. }
            | Self::Unsupported { field, .. }
            | Self::TooLarge { field, .. }
            | Self::Io { field, .. } => field,
            Self::Cancelled => "volume",
        }
    }
}

/// A message without control characters: libraries repeat in theirs what is in the file.
fn plain(message: String) -> String {
    if message.contains(char::is_control) { message.replace(char::is_control, "?") } else { message }
}

/// The start of untrusted text, short enough and plain enough to put into a message.
pub(super) fn excerpt(text: &str) -> String {
    const LONGEST: usize = 60;
    let mut short = plain(text.chars().take(LONGEST).collect());
    if text.chars().nth(LONGEST).is_some() {
        short.push_str("...");
    }
    format!("`{short}`")
}
