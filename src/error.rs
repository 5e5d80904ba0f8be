//! Every failure a client can meet, classified once: what went wrong becomes a code, a status and a message.
//!
//! Architecture Invariant: a server-side failure says nothing about its inside. [`ApiError::internal`] logs
//! the cause and keeps only the code.

use std::fmt;

use serde_json::{Value, json};

use crate::encode::EncodeError;
use crate::renderer::RenderError;
use crate::scene::{SceneError, SceneErrorKind};
use crate::volume::VolumeError;

/// Most characters of a client's own text in an answer to it.
const MOST_REPEATED: usize = 64;

/// What went wrong, as clients tell it apart.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ErrorCode {
    /// Not JSON, not the file format it claims to be, or a header that cannot be read.
    Malformed,
    /// No key, or a wrong one.
    Unauthorized,
    /// A page of another origin.
    ForbiddenOrigin,
    /// No such route.
    NotFound,
    /// No such volume.
    VolumeNotFound,
    /// No such scene.
    SceneNotFound,
    /// No such preset.
    PresetNotFound,
    /// The route has other methods.
    MethodNotAllowed,
    /// The body did not arrive in time.
    RequestTimeout,
    /// `If-Match` names another revision.
    RevisionMismatch,
    /// A scene looks at the volume.
    VolumeInUse,
    /// The volume is still being loaded, or could not be loaded.
    VolumeNotReady,
    /// The volume was deleted while it was loaded.
    VolumeCancelled,
    /// There is no earlier (or later) revision.
    NothingToUndo,
    /// More than the server's limits allow.
    TooLarge,
    /// Not a volume file format that is known.
    UnknownFormat,
    /// The body must be JSON.
    UnsupportedMediaType,
    /// Well-formed but invalid; `details.path` names the field.
    Invalid,
    /// Part of the contract, but not of this version.
    NotImplemented,
    /// The most volumes or scenes are there already.
    TooMany,
    /// A failure of the server; the log has the request id.
    Internal,
    /// A server that a file was to come from failed.
    SourceFailed,
    /// Too much work is waiting.
    Busy,
    /// Starting, draining, or the renderer is gone.
    NotReady,
    /// The answer took longer than the server allows.
    Timeout,
    /// Does not fit in GPU memory.
    OutOfGpuMemory,
}

impl ErrorCode {
    /// Every code, in the order of its status.
    pub const ALL: [Self; 26] = [
        Self::Malformed,
        Self::Unauthorized,
        Self::ForbiddenOrigin,
        Self::NotFound,
        Self::VolumeNotFound,
        Self::SceneNotFound,
        Self::PresetNotFound,
        Self::MethodNotAllowed,
        Self::RequestTimeout,
        Self::RevisionMismatch,
        Self::VolumeInUse,
        Self::VolumeNotReady,
        Self::VolumeCancelled,
        Self::NothingToUndo,
        Self::TooLarge,
        Self::UnknownFormat,
        Self::UnsupportedMediaType,
        Self::Invalid,
        Self::NotImplemented,
        Self::TooMany,
        Self::Internal,
        Self::SourceFailed,
        Self::Busy,
        Self::NotReady,
        Self::Timeout,
        Self::OutOfGpuMemory,
    ];

    /// Name in the API, and HTTP status.
    pub fn name_and_status(self) -> (&'static str, u16) {
        match self {
            Self::Malformed => ("malformed", 400),
            Self::Unauthorized => ("unauthorized", 401),
            Self::ForbiddenOrigin => ("forbidden_origin", 403),
            Self::NotFound => ("not_found", 404),
            Self::VolumeNotFound => ("volume_not_found", 404),
            Self::SceneNotFound => ("scene_not_found", 404),
            Self::PresetNotFound => ("preset_not_found", 404),
            Self::MethodNotAllowed => ("method_not_allowed", 405),
            Self::RequestTimeout => ("request_timeout", 408),
            Self::RevisionMismatch => ("revision_mismatch", 409),
            Self::VolumeInUse => ("volume_in_use", 409),
            Self::VolumeNotReady => ("volume_not_ready", 409),
            Self::VolumeCancelled => ("volume_cancelled", 409),
            Self::NothingToUndo => ("nothing_to_undo", 409),
            Self::TooLarge => ("too_large", 413),
            Self::UnknownFormat => ("unknown_format", 415),
            Self::UnsupportedMediaType => ("unsupported_media_type", 415),
            Self::Invalid => ("invalid", 422),
            Self::NotImplemented => ("not_implemented", 422),
            Self::TooMany => ("too_many", 429),
            Self::Internal => ("internal", 500),
            Self::SourceFailed => ("source_failed", 502),
            Self::Busy => ("busy", 503),
            Self::NotReady => ("not_ready", 503),
            Self::Timeout => ("timeout", 503),
            Self::OutOfGpuMemory => ("out_of_gpu_memory", 507),
        }
    }
}

/// One failure, ready to be shown to a client.
#[derive(Clone, Debug, PartialEq)]
pub struct ApiError {
    /// What went wrong.
    pub code: ErrorCode,
    /// One sentence for people.
    pub message: String,
    /// Facts for programs.
    pub details: Option<Value>,
}

impl fmt::Display for ApiError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl std::error::Error for ApiError {}

impl ApiError {
    /// A failure without details.
    pub fn new(code: ErrorCode, message: impl Into<String>) -> Self {
        Self { code, message: message.into(), details: None }
    }

    /// The same with details.
    #[must_use]
    pub fn with_details(mut self, details: Value) -> Self {
        self.details = Some(details);
        self
    }

    /// The same with one more detail.
    #[must_use]
    pub fn with_detail(mut self, name: &str, value: impl Into<Value>) -> Self {
        self.details.get_or_insert_with(|| json!({}))[name] = value.into();
        self
    }

    /// The failure as bodies have it, but for the request id.
    pub fn to_json(&self) -> Value {
        let mut json = json!({ "code": self.code.name_and_status().0, "message": self.message });
        if let Some(details) = &self.details {
            json["details"] = details.clone();
        }
        json
    }

    /// An invalid field; `path` as in `camera.fov_y_deg`, `$` is the document itself.
    pub fn invalid(path: &str, message: impl fmt::Display) -> Self {
        Self::new(ErrorCode::Invalid, format!("{path}: {message}")).with_details(json!({ "path": path }))
    }

    /// More than a limit allows.
    pub fn too_large(message: impl Into<String>, limit: u64) -> Self {
        Self::new(ErrorCode::TooLarge, message).with_details(json!({ "limit": limit }))
    }

    /// No such volume.
    pub fn volume_not_found(id: &impl fmt::Display) -> Self {
        // Whatever a client has sent.
        let id: String = id.to_string().chars().filter(|c| !c.is_control()).take(MOST_REPEATED).collect();
        Self::new(ErrorCode::VolumeNotFound, format!("there is no volume `{id}`")).with_details(json!({ "volume": id }))
    }

    /// The volume was deleted while it was loaded.
    pub fn volume_cancelled() -> Self {
        Self::new(ErrorCode::VolumeCancelled, "the volume was deleted while it was loaded")
    }

    /// No such scene.
    pub fn scene_not_found(id: &str) -> Self {
        Self::new(ErrorCode::SceneNotFound, format!("there is no scene `{id}`")).with_details(json!({ "scene": id }))
    }

    /// Too much work is waiting.
    pub fn busy() -> Self {
        Self::new(ErrorCode::Busy, "too much work is waiting; try again")
    }

    /// A bug or a broken part: `cause` goes to the log, not to the client.
    pub fn internal(cause: impl fmt::Display) -> Self {
        tracing::error!(%cause, "internal error");
        Self::new(ErrorCode::Internal, "the server failed; its log has more under this request id")
    }

    /// Seconds after which trying again makes sense, for failures that pass.
    pub fn retry_after_seconds(&self) -> Option<u32> {
        match self.code {
            ErrorCode::Busy | ErrorCode::NotReady => Some(1),
            ErrorCode::VolumeNotReady => self.details.as_ref().filter(|d| d["state"] == "loading").map(|_| 1),
            ErrorCode::Timeout => Some(10),
            _ => None,
        }
    }
}

impl From<SceneError> for ApiError {
    fn from(error: SceneError) -> Self {
        let code = match error.kind {
            SceneErrorKind::Invalid => ErrorCode::Invalid,
            SceneErrorKind::NotImplemented => ErrorCode::NotImplemented,
        };
        Self::new(code, error.to_string()).with_details(json!({ "path": error.path }))
    }
}

impl From<VolumeError> for ApiError {
    fn from(error: VolumeError) -> Self {
        let code = match error {
            VolumeError::Malformed { .. } => ErrorCode::Malformed,
            VolumeError::Unsupported { ref field, .. } if field == "format" => ErrorCode::UnknownFormat,
            VolumeError::Unsupported { .. } => ErrorCode::NotImplemented,
            VolumeError::TooLarge { .. } => ErrorCode::TooLarge,
            // The bytes are in memory by now or come from a file that was there a moment ago.
            VolumeError::Io { .. } => return Self::internal(error),
            VolumeError::Cancelled => return Self::volume_cancelled(),
        };
        let mut details = json!({ "path": error.field() });
        if let VolumeError::TooLarge { needed, limit, unit, .. } = error {
            // JSON numbers beyond 64 bits are not read back by everyone.
            details["needed"] = u64::try_from(needed).unwrap_or(u64::MAX).into();
            details["limit"] = limit.into();
            details["unit"] = unit.into();
        }
        Self::new(code, error.to_string()).with_details(details)
    }
}

impl From<RenderError> for ApiError {
    fn from(error: RenderError) -> Self {
        match error {
            RenderError::UnknownVolume(id) => Self::volume_not_found(&id),
            RenderError::DoesNotFit { ref needed_bytes, ref budget_bytes, ref resident, .. } => {
                let resident: Vec<Value> =
                    resident.iter().map(|(id, bytes)| json!({ "volume": id.0, "gpu_bytes": bytes })).collect();
                Self::new(ErrorCode::OutOfGpuMemory, error.to_string()).with_details(
                    json!({ "needed_bytes": needed_bytes, "budget_bytes": budget_bytes, "resident": resident }),
                )
            }
            RenderError::AxisTooLong { limit, .. } => Self::too_large(error.to_string(), u64::from(limit)),
            RenderError::Cancelled => Self::volume_cancelled(),
            RenderError::Busy => Self::busy(),
            RenderError::Gone => Self::new(ErrorCode::NotReady, "the renderer is gone")
                .with_details(json!({ "reason": "renderer_gone" })),
            RenderError::NoAdapter(cause) | RenderError::Device(cause) => Self::internal(cause),
        }
    }
}

impl From<EncodeError> for ApiError {
    fn from(error: EncodeError) -> Self {
        Self::internal(error)
    }
}
