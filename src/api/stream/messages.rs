//! What is said over the stream, as JSON.

use serde::Deserialize;
use serde_json::{Value, json};

use crate::encode::ImageFormat;
use crate::error::{ApiError, ErrorCode};
use crate::renderer::{AoReport, AoState, AoUpdate, StageTimings};

/// Version of this protocol.
pub(super) const PROTOCOL: u32 = 1;

/// From client to server.
#[derive(Debug)]
pub(super) enum Incoming {
    Hello(Hello),
    Update(Update),
    Ack(Ack),
    Visibility(Visibility),
    Refresh,
}

/// The first message.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Hello {
    pub(super) protocol: u32,
    #[serde(default)]
    pub(super) encodings: Vec<String>,
    pub(super) max_in_flight: Option<u32>,
    pub(super) width: Option<u32>,
    pub(super) height: Option<u32>,
    pub(super) resume: Option<String>,
    /// For clients that can set neither headers nor subprotocols.
    pub(super) api_key: Option<String>,
}

/// A change of the scene, of the connection's own view, or both.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Update {
    pub(super) seq: u64,
    pub(super) scene: Option<Value>,
    pub(super) view: Option<Value>,
}

/// Pictures up to this one are on the client's screen.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Ack {
    pub(super) frame: u64,
}

/// Whether anybody looks.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Visibility {
    pub(super) visible: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Refresh {}

/// Reads a message; what is wrong names the field.
///
/// The `seq` of an update comes along even when the rest is wrong, for the error to name it.
pub(super) fn parse(text: &str) -> Result<Incoming, (ApiError, Option<u64>)> {
    let json: Value = serde_json::from_str(text)
        .map_err(|e| (ApiError::new(ErrorCode::Malformed, format!("not JSON: {e}")), None))?;
    let seq = json.get("seq").and_then(Value::as_u64);
    message(json).map_err(|error| (error, seq))
}

fn message(json: Value) -> Result<Incoming, ApiError> {
    let Value::Object(mut fields) = json else {
        return Err(ApiError::invalid("$", "expected an object"));
    };
    let kind = fields.remove("type");
    let fields = Value::Object(fields);
    match kind.as_ref().and_then(Value::as_str) {
        Some("hello") => read(fields).map(Incoming::Hello),
        Some("update") => read(fields).map(Incoming::Update),
        Some("ack") => read(fields).map(Incoming::Ack),
        Some("visibility") => read(fields).map(Incoming::Visibility),
        Some("refresh") => read(fields).map(|Refresh {}| Incoming::Refresh),
        _ => Err(ApiError::invalid("type", "expected `hello`, `update`, `ack`, `visibility` or `refresh`")),
    }
}

fn read<T: for<'de> Deserialize<'de>>(fields: Value) -> Result<T, ApiError> {
    serde_path_to_error::deserialize(fields).map_err(|error| {
        let path = error.path().to_string();
        ApiError::invalid(if path == "." { "$" } else { &path }, error.inner())
    })
}

/// Everything that a `frame` message tells.
#[derive(Clone, Copy, Debug)]
pub(super) struct FrameHeader {
    pub(super) frame: u64,
    pub(super) seq: u64,
    pub(super) scene_revision: u64,
    pub(super) width: u32,
    pub(super) height: u32,
    pub(super) encoding: ImageFormat,
    pub(super) bytes: usize,
    pub(super) moving: bool,
    pub(super) exact: bool,
    pub(super) dropped: u64,
    pub(super) ao: AoReport,
    pub(super) timings: StageTimings,
    pub(super) encode: std::time::Duration,
}

impl FrameHeader {
    pub(super) fn to_json(self) -> Value {
        json!({
            "type": "frame",
            "frame": self.frame,
            "seq": self.seq,
            "scene_revision": self.scene_revision,
            "width": self.width,
            "height": self.height,
            "encoding": self.encoding.name(),
            "bytes": self.bytes,
            "phase": if self.moving { "moving" } else { "final" },
            "exact": self.exact,
            "dropped": self.dropped,
            "ao": ao_json(&self.ao),
            "timings_ms": {
                "queue": ms(self.timings.queue),
                "ao": ms(self.timings.ao),
                "raycast": ms(self.timings.raycast),
                "readback": ms(self.timings.readback),
                "encode": ms(self.encode),
            },
        })
    }
}

fn ao_json(ao: &AoReport) -> Value {
    json!({
        "version": ao.version,
        "state": match ao.state {
            AoState::Off => "off",
            AoState::Exact => "exact",
            AoState::Refining => "refining",
        },
        "update": match ao.update {
            AoUpdate::Off => "none",
            AoUpdate::Cached => "cached",
            AoUpdate::Incremental => "incremental",
            AoUpdate::Full => "full",
        },
        "bricks": ao.bricks,
        "bricks_classified": ao.bricks_classified,
        "bricks_recomputed": ao.bricks_recomputed,
        "ms": ms(ao.elapsed),
    })
}

/// Milliseconds with three decimals.
fn ms(duration: std::time::Duration) -> f64 {
    (duration.as_secs_f64() * 1e6).round() / 1e3
}

pub(super) fn error(error: &ApiError, seq: Option<u64>) -> Value {
    let mut json = json!({ "type": "error", "code": error.code.name_and_status().0, "message": error.message });
    if let Some(details) = &error.details {
        json["details"] = details.clone();
    }
    if let Some(seq) = seq {
        json["seq"] = seq.into();
    }
    json
}

pub(super) fn goodbye(reason: &str) -> Value {
    json!({ "type": "goodbye", "reason": reason })
}

/// What the pictures of a stream wait for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Awaited {
    AmbientOcclusion,
    /// It had made room for another and comes back to the GPU.
    Volume,
}

pub(super) fn progress(what: Awaited, fraction: f64) -> Value {
    let what = match what {
        Awaited::AmbientOcclusion => "ambient_occlusion",
        Awaited::Volume => "volume",
    };
    json!({ "type": "progress", "what": what, "fraction": (fraction * 1e3).round() / 1e3 })
}
