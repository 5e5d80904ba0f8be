//! Volumes: listed, shown, counted, deleted. How they come is in `uploads.rs`, what they hold in `voxels.rs`.

use axum::Json;
use axum::extract::{Path, State};
use axum::http::StatusCode;
use serde_json::{Value, json};

use super::AppState;
use super::extract::QueryParams;
use super::scenes::name_users;
use crate::config::Limits;
use crate::error::ApiError;

/// Bins when the request names no number.
const DEFAULT_BINS: u32 = 256;

/// `GET /v1/volumes`
pub(super) async fn list(State(state): State<AppState>, query: QueryParams) -> Result<Json<Value>, ApiError> {
    query.finish()?;
    Ok(Json(json!({ "volumes": state.volumes.list_json() })))
}

/// `GET /v1/volumes/{id}`
pub(super) async fn show(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
) -> Result<Json<Value>, ApiError> {
    query.finish()?;
    state.volumes.get_json(&id).map(Json)
}

/// `DELETE /v1/volumes/{id}?force=true`
pub(super) async fn delete(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<StatusCode, ApiError> {
    let force = query.flag("force")?;
    query.finish()?;
    state.volumes.delete(&id, force).await.map_err(|error| name_users(&state, &id, error))?;
    Ok(StatusCode::NO_CONTENT)
}

/// `GET /v1/volumes/{id}/histogram?bins=256`
pub(super) async fn histogram(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<Json<Value>, ApiError> {
    let bins = query.number("bins", 1..=Limits::MAX_HISTOGRAM_BINS)?.unwrap_or(DEFAULT_BINS);
    query.finish()?;
    let entry = state.volumes.get(&id)?;
    let histogram =
        tokio::task::spawn_blocking(move || entry.volume.histogram(bins)).await.map_err(ApiError::internal)??;
    Ok(Json(json!({ "range": histogram.range, "counts": histogram.counts })))
}

/// `GET /v1/volumes/{id}/metadata`
pub(super) async fn metadata(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
) -> Result<Json<Value>, ApiError> {
    query.finish()?;
    let entry = state.volumes.get(&id)?;
    let (volume, about) = (&entry.volume, &entry.volume.about);
    let (shown, withheld) = match state.keep_identity {
        true => (about.header.iter().collect(), 0),
        false => about.without_identity(),
    };
    let fields: Vec<Value> = shown.iter().map(|(name, value)| json!({ "name": name, "value": value })).collect();
    Ok(Json(json!({
        "patient_axes": about.patient_axes,
        "nan_count": volume.nan_count,
        "notes": about.notes,
        "header": fields,
        "withheld": withheld,
    })))
}
