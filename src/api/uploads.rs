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
use super::loads::{self, Blame, Origin, Wanted, blocking};
use crate::config::Limits;
use crate::error::{ApiError, ErrorCode};
use crate::renderer::GpuNeed;
use crate::session::{Extent, LoadPermit, Plan, Reduce, VolumeSource, Waiting};
use crate::volume::{Choice, Format, ProceduralSpec, RawSpec, Region, VolumeError, bytes_needed, parse_region};

/// Longest name of a volume, in characters.
const MAX_NAME: usize = 200;

/// What the query string says about a volume.
struct UploadQuery {
    name: Option<String>,
    format: Option<String>,
    raw: Option<RawSpec>,
    choice: Choice,
    extent: Extent,
    dry_run: bool,
    wait: bool,
}

impl UploadQuery {
    fn read(mut query: QueryParams) -> Result<Self, ApiError> {
        let name = query.text("name")?.map(|name| checked_name("name", name)).transpose()?;
        let format = query.text("format")?;
        let (dry_run, wait) = (query.flag("dry_run")?, query.flag_or("wait", true)?);
        let (dims, voxel_type) = (query.text("dims")?, query.text("type")?);
        let (endian, spacing) = (query.text("endian")?, query.text("spacing")?);
        let series = query.text("series")?;
        let channel = query.text("channel")?.map(|text| counted("channel", &text)).transpose()?;
        let scale = query.text("scale")?.map(|text| counted("scale", &text)).transpose()?;
        let region = query.text("region")?.map(|text| parse_region(&text).map_err(in_query)).transpose()?;
        let reduce = query.choice("reduce", "auto or never", Reduce::from_name)?.unwrap_or_default();
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
        Ok(Self { name, format, raw, choice, extent: Extent { region, reduce }, dry_run, wait })
    }
}

/// `POST /v1/volumes`
pub(super) async fn create(
    State(state): State<AppState>,
    query: QueryParams,
    request: Request,
) -> Result<Response, ApiError> {
    let query = UploadQuery::read(query)?;
    let deadline = Limits::MAX_UPLOAD_TIME;
    tokio::time::timeout(deadline, create_within(state, query, request))
        .await
        .unwrap_or_else(|_| Err(ApiError::new(ErrorCode::RequestTimeout, "the upload took too long")))
}

async fn create_within(state: AppState, query: UploadQuery, request: Request) -> Result<Response, ApiError> {
    let mut permit = state.loads.stand_in_line()?;
    let (wait, dry_run) = (query.wait, query.dry_run);
    let wanted = if query.format.is_none() && is_json(request.headers()) {
        from_json(&state, query, read_json(request).await?)?
    } else {
        // Bodies that wait cost nothing.
        permit.wait_for_transfer().await?;
        from_body(&state, query, request).await?
    };
    if dry_run {
        return plan(&state, wanted, permit).await;
    }
    let waiting = if wait { Waiting::Asker } else { Waiting::Nobody };
    let place = state.volumes.reserve(wanted.name(), wanted.to_json(), waiting)?;
    let location = format!("/v1/volumes/{}", place.loading().id());
    let headers = [(header::LOCATION, location)];
    if wait {
        let entry = loads::run(&state, &place, wanted, permit).await?;
        return Ok((StatusCode::CREATED, headers, Json(state.volumes.to_json(&entry))).into_response());
    }
    let json = place.loading().to_json();
    loads::start(state, place, wanted, permit);
    Ok((StatusCode::ACCEPTED, headers, Json(json)).into_response())
}

/// The answer to a dry run: what the volume would need.
async fn plan(state: &AppState, wanted: Wanted, mut permit: LoadPermit) -> Result<Response, ApiError> {
    let (limits, room) = (state.volume_limits(), state.room());
    let request = wanted.fetch(state, &mut permit, &|_, _| ()).await?;
    permit.wait_for_turn().await?;
    let blame = Blame::of(&request.source);
    let (plan, _permit) = blocking(move || (request.plan(&limits, &room), permit)).await?;
    let Plan { dims, voxel_type, resolution } = plan.map_err(|error| blame.error(error))?;
    // Integers of a narrow range may turn out to need less.
    let GpuNeed { volume_bytes, occlusion_bytes, .. } = room.need(dims, voxel_type.bytes().min(2));
    let memory = state.renderer.memory();
    let fits_axes = dims.iter().all(|&n| n <= room.max_axis);
    Ok(Json(json!({
        "dry_run": true,
        "dims": dims,
        "voxel_type": voxel_type,
        "resolution": resolution,
        "host_bytes": bytes_needed(dims, voxel_type),
        "gpu_bytes": volume_bytes,
        "occlusion_bytes": occlusion_bytes,
        "gpu_budget_bytes": memory.budget_bytes,
        "gpu_used_bytes": memory.used_bytes,
        // What is there already makes room where it can.
        "fits": fits_axes && volume_bytes <= memory.budget_bytes,
        "fits_beside_others": fits_axes && volume_bytes <= memory.budget_bytes.saturating_sub(memory.used_bytes),
    }))
    .into_response())
}

async fn from_body(state: &AppState, query: UploadQuery, request: Request) -> Result<Wanted, ApiError> {
    let content_type = request.headers().get(header::CONTENT_TYPE).and_then(|value| value.to_str().ok());
    let content_type = content_type.map(str::to_owned);
    if let Some(name) = &query.format {
        // A wrong name is told before the body has come.
        Format::from_name(name)?;
    }
    let bytes = read_body(request, state.limits.max_upload_bytes, state.limits.request_timeout).await?;
    let (name, of_bytes) = (query.format.clone(), bytes.clone());
    // As for a file from elsewhere.
    let format = move || Format::detect(name.as_deref(), content_type.as_deref(), &of_bytes);
    let format = tokio::task::spawn_blocking(format).await.map_err(ApiError::internal)??;
    let source = VolumeSource::Upload { bytes, format, raw: query.raw, choice: query.choice };
    Ok(Wanted { name: query.name, origin: Origin::Here(source), extent: query.extent })
}

/// Body of `POST /v1/volumes` as JSON.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct JsonRequest {
    name: Option<String>,
    source: JsonSource,
    reduce: Option<Reduce>,
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
    region: Option<Region>,
}

fn from_json(state: &AppState, query: UploadQuery, body: Value) -> Result<Wanted, ApiError> {
    if query.raw.is_some() {
        return Err(ApiError::invalid("dims", "only for a body of voxels, not for JSON"));
    }
    if query.choice != Choice::default() {
        return Err(ApiError::invalid("series", "goes with the path in JSON, as do `channel` and `scale`"));
    }
    if query.extent.region.is_some() {
        return Err(ApiError::invalid("region", "goes into `source` in JSON"));
    }
    if body.get("source").is_some_and(|source| !source.is_object()) {
        return Err(ApiError::invalid("source", "expected an object"));
    }
    let JsonRequest { name, source, reduce } = typed(body)?;
    let name = name.map(|name| checked_name("name", name)).transpose()?.or(query.name);
    let JsonSource { path, series, channel, scale, url, procedural, region } = source;
    let choice = Choice { series, channel, scale };
    if path.is_none() && url.is_none() && choice != Choice::default() {
        return Err(ApiError::invalid("source.series", "goes with `path` or `url`, as do `channel` and `scale`"));
    }
    let origin = match (path, url, procedural) {
        (Some(path), None, None) => Origin::Here(VolumeSource::Path { path, choice, data_dir: data_dir(state)? }),
        (None, Some(url), None) => Origin::Elsewhere { url: state.sources.admit(&url)?, choice },
        (None, None, Some(spec)) => Origin::Here(VolumeSource::Procedural(spec)),
        _ => {
            return Err(ApiError::invalid("source", "expected exactly one of `path`, `url` and `procedural`"));
        }
    };
    let extent = Extent { region, reduce: reduce.unwrap_or(query.extent.reduce) };
    Ok(Wanted { name, origin, extent })
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
