//! How volumes come: as the body of a request, from the data directory, from elsewhere, or computed.

use std::path::PathBuf;

use axum::Json;
use axum::extract::{Request, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde::Deserialize;
use serde_json::{Value, json};

use super::AppState;
use super::extract::{QueryParams, is_json, read_body, read_json, typed};
use crate::config::Limits;
use crate::error::{ApiError, ErrorCode};
use crate::session::{LoadPermit, VolumeSource};
use crate::volume::{Choice, Format, ProceduralSpec, RawSpec, Shape, VolumeError, VoxelType, bytes_needed};

/// Longest name of a volume, in characters.
const MAX_NAME: usize = 200;

/// Bytes of a voxel's precomputed gradient.
const GRADIENT_BYTES: u64 = 4;

/// What the query string says about a volume.
struct UploadQuery {
    name: Option<String>,
    format: Option<String>,
    raw: Option<RawSpec>,
    choice: Choice,
    dry_run: bool,
}

impl UploadQuery {
    fn read(mut query: QueryParams) -> Result<Self, ApiError> {
        let name = query.text("name")?.map(|name| checked_name("name", name)).transpose()?;
        let format = query.text("format")?;
        let dry_run = query.flag("dry_run")?;
        let (dims, voxel_type) = (query.text("dims")?, query.text("type")?);
        let (endian, spacing) = (query.text("endian")?, query.text("spacing")?);
        let series = query.text("series")?;
        let channel = query.text("channel")?.map(|text| counted("channel", &text)).transpose()?;
        let scale = query.text("scale")?.map(|text| counted("scale", &text)).transpose()?;
        query.finish()?;
        let choice = Choice { series, channel, scale };
        let raw = match (&dims, &voxel_type) {
            (Some(dims), Some(kind)) => {
                Some(RawSpec::parse(dims, kind, endian.as_deref(), spacing.as_deref()).map_err(in_query)?)
            }
            (None, None) if endian.is_none() && spacing.is_none() => None,
            (None, _) => {
                return Err(ApiError::invalid("dims", "missing; raw voxels need dims=x,y,z and type"));
            }
            (_, None) => {
                return Err(ApiError::invalid("type", "missing; raw voxels need dims=x,y,z and type"));
            }
        };
        Ok(Self { name, format, raw, choice, dry_run })
    }
}

/// `POST /v1/volumes`
pub(super) async fn create(
    State(state): State<AppState>,
    query: QueryParams,
    request: Request,
) -> Result<Response, ApiError> {
    let query = UploadQuery::read(query)?;
    // The line is entered before the body is read: bodies that wait cost nothing.
    let deadline = Limits::MAX_UPLOAD_TIME;
    tokio::time::timeout(deadline, create_within(state, query, request))
        .await
        .unwrap_or_else(|_| Err(ApiError::new(ErrorCode::RequestTimeout, "the upload took too long")))
}

async fn create_within(state: AppState, query: UploadQuery, request: Request) -> Result<Response, ApiError> {
    let permit = state.loads.enter().await?;
    let dry_run = query.dry_run;
    let (name, source) = if query.format.is_none() && is_json(request.headers()) {
        from_json(&state, query, read_json(request).await?).await?
    } else {
        from_body(&state, query, request).await?
    };
    if dry_run {
        return plan(&state, source, permit).await;
    }
    let place = state.volumes.reserve()?;
    let (limits, blame) = (state.volume_limits(), Blame::of(&source));
    // The permit goes with the work: it cannot be cancelled, even when the client goes away.
    let (prepared, _permit) = blocking(move || (source.prepare(name, &limits), permit)).await?;
    let entry = place.fill(prepared.map_err(|error| blame.error(error))?).await?;
    let location = format!("/v1/volumes/{}", entry.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], Json(state.volumes.to_json(&entry))).into_response())
}

/// The answer to a dry run: what the volume would need.
async fn plan(state: &AppState, source: VolumeSource, permit: LoadPermit) -> Result<Response, ApiError> {
    let limits = state.volume_limits();
    let blame = Blame::of(&source);
    let (peeked, _permit) = blocking(move || (source.peek(&limits), permit)).await?;
    let Shape { dims, voxel_type, .. } = peeked.map_err(|error| blame.error(error))?;
    let voxels = bytes_needed(dims, VoxelType::U8).unwrap_or(u64::MAX);
    let texel_bytes = match voxel_type.bytes() {
        1 => 1,
        _ if state.renderer.info().texture_16bit_norm => 2,
        _ => 4,
    };
    // Values and gradients. Integers of a narrow range may turn out to need less.
    let gpu_bytes = voxels.saturating_mul(texel_bytes + GRADIENT_BYTES);
    let memory = state.renderer.memory();
    Ok(Json(json!({
        "dry_run": true,
        "dims": dims,
        "voxel_type": voxel_type,
        "host_bytes": bytes_needed(dims, voxel_type),
        "gpu_bytes": gpu_bytes,
        "gpu_budget_bytes": memory.budget_bytes,
        "gpu_used_bytes": memory.used_bytes,
        // What is there already makes room where it can.
        "fits": gpu_bytes <= memory.budget_bytes,
        "fits_beside_others": gpu_bytes <= memory.budget_bytes.saturating_sub(memory.used_bytes),
    }))
    .into_response())
}

async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, ApiError> {
    tokio::task::spawn_blocking(work).await.map_err(ApiError::internal)
}

async fn from_body(
    state: &AppState,
    query: UploadQuery,
    request: Request,
) -> Result<(Option<String>, VolumeSource), ApiError> {
    let content_type = request.headers().get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let content_type = content_type.map(str::to_owned);
    if let Some(name) = &query.format {
        // A wrong name is told before the body has come.
        Format::from_name(name)?;
    }
    let bytes = read_body(request, state.limits.max_upload_bytes, state.limits.request_timeout).await?;
    let format = Format::detect(query.format.as_deref(), content_type.as_deref(), &bytes)?;
    Ok((query.name, VolumeSource::Upload { bytes, format, raw: query.raw, choice: query.choice }))
}

/// Body of `POST /v1/volumes` as JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonRequest {
    name: Option<String>,
    source: JsonSource,
}

/// Exactly one of these.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonSource {
    path: Option<String>,
    series: Option<String>,
    channel: Option<u32>,
    scale: Option<u32>,
    url: Option<String>,
    procedural: Option<ProceduralSpec>,
}

async fn from_json(
    state: &AppState,
    query: UploadQuery,
    body: Value,
) -> Result<(Option<String>, VolumeSource), ApiError> {
    if query.raw.is_some() {
        return Err(ApiError::invalid("dims", "only for a body of voxels, not for JSON"));
    }
    if query.choice != Choice::default() {
        return Err(ApiError::invalid("series", "goes with the path in JSON, as do `channel` and `scale`"));
    }
    let JsonRequest { name, source } = typed(body)?;
    let name = name.map(|name| checked_name("name", name)).transpose()?.or(query.name);
    let JsonSource { path, series, channel, scale, url, procedural } = source;
    let choice = Choice { series, channel, scale };
    if path.is_none() && url.is_none() && choice != Choice::default() {
        return Err(ApiError::invalid("source.series", "goes with `path` or `url`, as do `channel` and `scale`"));
    }
    let source = match (path, url, procedural) {
        (Some(path), None, None) => VolumeSource::Path { path, choice, data_dir: data_dir(state)? },
        (None, Some(url), None) => {
            let file = state.sources.fetch(&url, state.limits.max_upload_bytes).await?;
            let format = Format::of_fetched(&file.name, file.content_type.as_deref(), &file.bytes)?;
            VolumeSource::Fetched { url: file.url, bytes: file.bytes, format, choice }
        }
        (None, None, Some(spec)) => VolumeSource::Procedural(spec),
        _ => {
            return Err(ApiError::invalid("source", "expected exactly one of `path`, `url` and `procedural`"));
        }
    };
    Ok((name, source))
}

fn data_dir(state: &AppState) -> Result<PathBuf, ApiError> {
    state.data_dir.clone().ok_or_else(|| ApiError::invalid("source.path", "the server has no --data-dir"))
}

fn checked_name(path: &str, name: String) -> Result<String, ApiError> {
    if name.chars().count() > MAX_NAME || name.chars().any(char::is_control) {
        let message = format!("expected at most {MAX_NAME} characters without control characters");
        return Err(ApiError::invalid(path, message));
    }
    Ok(name)
}

/// What of a request its volume errors are about.
#[derive(Clone, Copy)]
enum Blame {
    Body,
    Path,
    Procedural,
}

impl Blame {
    fn of(source: &VolumeSource) -> Self {
        match source {
            VolumeSource::Upload { .. } | VolumeSource::Fetched { .. } => Self::Body,
            VolumeSource::Path { .. } => Self::Path,
            VolumeSource::Procedural(_) => Self::Procedural,
        }
    }

    /// A field of the JSON body is invalid where a file is malformed.
    fn error(self, error: VolumeError) -> ApiError {
        match (self, error) {
            (Self::Procedural, VolumeError::Malformed { field, message }) => {
                ApiError::invalid(&format!("source.procedural.{field}"), message)
            }
            (Self::Path, VolumeError::Malformed { field, message })
                if matches!(field.as_str(), "path" | "series" | "channel" | "scale") =>
            {
                ApiError::invalid(&format!("source.{field}"), message)
            }
            (Self::Body, VolumeError::Malformed { field, message })
                if matches!(field.as_str(), "series" | "channel" | "scale") =>
            {
                ApiError::invalid(&field, message)
            }
            // Only the kind: the system's message may say more than the client should know.
            (Self::Path, VolumeError::Io { field, source }) if field == "path" => {
                ApiError::invalid("source.path", source.kind())
            }
            (_, other) => other.into(),
        }
    }
}

fn counted(name: &str, text: &str) -> Result<u32, ApiError> {
    text.parse().map_err(|_| ApiError::invalid(name, "expected a whole number, counted from 0"))
}

/// A query parameter is invalid where a file is malformed.
fn in_query(error: VolumeError) -> ApiError {
    match error {
        VolumeError::Malformed { field, message } => ApiError::invalid(&field, message),
        other => other.into(),
    }
}
