//! The accessibility volume of a scene as a file.

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderName, header};
use axum::response::Response;
use serde_json::json;

use super::AppState;
use super::extract::QueryParams;
use super::frames::{SCENE_REVISION, server_timing};
use crate::array_file::{ArrayFormat, write_accessibility};
use crate::error::ApiError;

const AO_GRID: HeaderName = HeaderName::from_static("x-ao-grid");

/// `GET /v1/scenes/{id}/ao?format=npy|nrrd`
pub(super) async fn download(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<Response, ApiError> {
    let format = query.choice("format", "npy or nrrd", ArrayFormat::from_name)?.unwrap_or(ArrayFormat::Npy);
    query.finish()?;
    let snapshot = state.scenes.get(&id)?.snapshot();
    let volume = state.volumes.get(&snapshot.scene.volume.0)?.volume.clone();
    let _slot = state.render_slot()?;
    let accessibility = state.renderer.accessibility(snapshot.scene).await?;
    let ao_grid = json!({ "first": accessibility.first, "step": accessibility.step }).to_string();
    let timing = server_timing(&accessibility.timings, None);
    let file = tokio::task::spawn_blocking(move || write_accessibility(&accessibility, &volume.grid, format))
        .await
        .map_err(ApiError::internal)?;
    Response::builder()
        .header(header::CONTENT_TYPE, "application/octet-stream")
        .header(header::CONTENT_DISPOSITION, format!("attachment; filename=\"{id}-ao.{}\"", format.name()))
        .header(header::CACHE_CONTROL, "no-store")
        .header(SCENE_REVISION, snapshot.revision)
        .header(AO_GRID, ao_grid)
        .header("server-timing", timing)
        .body(Body::from(file))
        .map_err(ApiError::internal)
}
