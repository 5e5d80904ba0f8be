//! What is wrong with a scene document, and where.

use std::fmt;

/// Path of the document itself.
pub(super) const ROOT: &str = "$";

/// Longest path or message, in bytes; both may quote what the client wrote, which has no limit of its own.
const MAX_BYTES: usize = 400;

/// Why a document is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SceneErrorKind {
    /// Not a scene: wrong type, unknown field, out of range, contradictory.
    Invalid,
    /// A scene by the contract, but it asks for something that this server does not do yet.
    NotImplemented,
}

/// One refused field of a scene document.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{path}: {message}")]
pub struct SceneError {
    /// Why.
    pub kind: SceneErrorKind,
    /// JSON path of the field, like `transfer_function.points[2].opacity`; `$` is the document itself.
    pub path: String,
    /// What was expected and what was found.
    pub message: String,
}

impl SceneError {
    /// A document that is not a scene.
    pub fn invalid(path: impl fmt::Display, message: impl Into<String>) -> Self {
        Self::new(SceneErrorKind::Invalid, path.to_string(), message.into())
    }

    /// A scene that needs what does not exist yet.
    pub fn not_implemented(path: impl fmt::Display, message: impl Into<String>) -> Self {
        Self::new(SceneErrorKind::NotImplemented, path.to_string(), message.into())
    }

    fn new(kind: SceneErrorKind, path: String, message: String) -> Self {
        // An unknown field may well have no name.
        let path = if path.is_empty() { ROOT.to_owned() } else { shortened(path) };
        Self { kind, path, message: shortened(message) }
    }

    /// The same error in a document that holds the scene as its field `parent`.
    pub fn under(self, parent: &str) -> Self {
        let path = if self.path == ROOT { parent.to_owned() } else { format!("{parent}.{}", self.path) };
        Self { path, ..self }
    }
}

/// At most [`MAX_BYTES`] of a text, cut between characters.
fn shortened(mut text: String) -> String {
    if text.len() > MAX_BYTES {
        let end = (0..=MAX_BYTES).rev().find(|&i| text.is_char_boundary(i)).unwrap_or(0);
        text.truncate(end);
        text.push_str(" ...");
    }
    text
}
