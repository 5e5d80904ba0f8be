//! The data directory, for those who look for a volume to load.

use axum::Json;
use axum::extract::State;
use serde_json::{Value, json};

use super::AppState;
use super::extract::QueryParams;
use crate::error::ApiError;
use crate::volume::{ListedFile, Shape, VolumeError, list_directory};

/// Entries of a page when the request names no number.
const DEFAULT_LIMIT: usize = 100;

/// Most entries of a page.
const MAX_LIMIT: usize = 1000;

/// Most entries of a page with headers: each is a file that is opened.
const MAX_HEADERS: usize = 100;

/// `GET /v1/files?path=&after=&limit=&headers=`
pub(super) async fn list(State(state): State<AppState>, mut query: QueryParams) -> Result<Json<Value>, ApiError> {
    let path = query.text("path")?.unwrap_or_default();
    let after = query.text("after")?.unwrap_or_default();
    let headers = query.flag("headers")?;
    let most = if headers { MAX_HEADERS } else { MAX_LIMIT };
    let limit = query.number("limit", 1..=most)?.unwrap_or(DEFAULT_LIMIT);
    query.finish()?;
    let data_dir = state.data_dir.clone().ok_or_else(|| ApiError::invalid("path", "the server has no --data-dir"))?;
    let _slot = state.render_slot()?;
    let directory = path.trim_end_matches('/').to_owned();
    let below = directory.clone();
    let listing = tokio::task::spawn_blocking(move || list_directory(&below, &data_dir, &after, limit, headers));
    let listing = listing.await.map_err(ApiError::internal)?.map_err(in_query)?;
    let next = listing.entries.last().filter(|_| listing.more).map(|entry| entry.name.clone());
    let entries: Vec<Value> = listing.entries.iter().map(|entry| to_json(&directory, entry)).collect();
    Ok(Json(json!({ "path": directory, "entries": entries, "next": next })))
}

fn to_json(directory: &str, entry: &ListedFile) -> Value {
    let path = if directory.is_empty() { entry.name.clone() } else { format!("{directory}/{}", entry.name) };
    let format = entry.format.map(|format| format.name());
    let mut json = match (entry.bytes, format) {
        (Some(bytes), _) => {
            json!({ "kind": "file", "name": entry.name, "path": path, "bytes": bytes, "format": format })
        }
        (None, Some(_)) => json!({ "kind": "directory", "name": entry.name, "path": path, "format": format }),
        (None, None) => json!({ "kind": "directory", "name": entry.name, "path": path }),
    };
    match &entry.header {
        None => {}
        Some(Ok(Shape { dims, voxel_type, spacing })) => {
            json["dims"] = json!(dims);
            json["voxel_type"] = json!(voxel_type);
            json["spacing"] = json!(spacing);
        }
        Some(Err(error)) => json["error"] = json!(error),
    }
    json
}

/// A query parameter is invalid where a file is malformed or missing.
fn in_query(error: VolumeError) -> ApiError {
    match error {
        VolumeError::Malformed { field, message } => ApiError::invalid(&field, message),
        VolumeError::Io { field, source } => ApiError::invalid(&field, source.kind()),
        other => other.into(),
    }
}
