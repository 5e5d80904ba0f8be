//! Scenes: made, shown, changed, taken back, deleted.

use axum::Json;
use axum::extract::{Path, State};
use axum::http::{HeaderValue, StatusCode, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};

use super::AppState;
use super::extract::{IfMatch, JsonBody, QueryParams};
use crate::error::{ApiError, ErrorCode};
use crate::session::{SceneChange, SceneSnapshot};

/// `GET /v1/scenes`
pub(super) async fn list(State(state): State<AppState>, query: QueryParams) -> Result<Response, ApiError> {
    query.finish()?;
    let scenes: Vec<Value> = state.scenes.list().iter().map(|scene| scene.snapshot().to_json()).collect();
    Ok(Json(json!({ "scenes": scenes })).into_response())
}

/// `POST /v1/scenes`
pub(super) async fn create(
    State(state): State<AppState>,
    query: QueryParams,
    JsonBody(body): JsonBody,
) -> Result<Response, ApiError> {
    query.finish()?;
    let snapshot = state.scenes.create(&body)?;
    let location = format!("/v1/scenes/{}", snapshot.id);
    Ok((StatusCode::CREATED, [(header::LOCATION, location)], answer(&snapshot)).into_response())
}

/// `GET /v1/scenes/{id}`
pub(super) async fn show(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
) -> Result<Response, ApiError> {
    query.finish()?;
    Ok(answer(&state.scenes.get(&id)?.snapshot()))
}

/// `PUT /v1/scenes/{id}`
pub(super) async fn replace(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
    if_match: IfMatch,
    JsonBody(body): JsonBody,
) -> Result<Response, ApiError> {
    query.finish()?;
    let (body, revision) = without_identity(body, &id)?;
    change(&state, &id, &if_match, revision, SceneChange::Replace(&body))
}

/// `PATCH /v1/scenes/{id}`
pub(super) async fn patch(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
    if_match: IfMatch,
    JsonBody(body): JsonBody,
) -> Result<Response, ApiError> {
    query.finish()?;
    if !body.is_object() {
        // RFC 7396 would let it replace the whole scene, which no one means.
        return Err(ApiError::invalid("$", "expected an object with the fields to change"));
    }
    let (body, revision) = without_identity(body, &id)?;
    change(&state, &id, &if_match, revision, SceneChange::Patch(&body))
}

/// `POST /v1/scenes/{id}/undo`
pub(super) async fn undo(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
    if_match: IfMatch,
) -> Result<Response, ApiError> {
    query.finish()?;
    change(&state, &id, &if_match, None, SceneChange::Undo)
}

/// `POST /v1/scenes/{id}/redo`
pub(super) async fn redo(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
    if_match: IfMatch,
) -> Result<Response, ApiError> {
    query.finish()?;
    change(&state, &id, &if_match, None, SceneChange::Redo)
}

/// `DELETE /v1/scenes/{id}`
pub(super) async fn delete(
    State(state): State<AppState>,
    Path(id): Path<String>,
    query: QueryParams,
    if_match: IfMatch,
) -> Result<StatusCode, ApiError> {
    query.finish()?;
    state.scenes.delete(&id, |revision| if_match.allows(revision))?;
    Ok(StatusCode::NO_CONTENT)
}

/// Takes `id` and `revision` out of a body, so that what GET answered can be sent back. The id must be the
/// scene's own; the revision is a condition like `If-Match`.
fn without_identity(mut body: Value, id: &str) -> Result<(Value, Option<u64>), ApiError> {
    let Value::Object(fields) = &mut body else {
        return Ok((body, None));
    };
    if fields.shift_remove("id").is_some_and(|given| given != id) {
        return Err(ApiError::invalid("id", "not the id of this scene, and it cannot be changed"));
    }
    let revision = fields
        .shift_remove("revision")
        .map(|given| given.as_u64().ok_or_else(|| ApiError::invalid("revision", "expected the number of a revision")));
    let revision = revision.transpose()?;
    Ok((body, revision))
}

fn change(
    state: &AppState,
    id: &str,
    if_match: &IfMatch,
    revision: Option<u64>,
    change: SceneChange<'_>,
) -> Result<Response, ApiError> {
    let allowed = |current| if_match.allows(current) && revision.is_none_or(|expected| expected == current);
    state.scenes.change(id, allowed, change).map(|snapshot| answer(&snapshot))
}

/// The scene and its revision as an entity tag.
fn answer(snapshot: &SceneSnapshot) -> Response {
    let tag = HeaderValue::from_str(&format!("\"{}\"", snapshot.revision)).expect("digits are a valid header");
    ([(header::ETAG, tag)], Json(snapshot.to_json())).into_response()
}

/// Adds the scenes in the way to the error of deleting a volume.
pub(super) fn name_users(state: &AppState, volume: &str, error: ApiError) -> ApiError {
    if error.code == ErrorCode::VolumeInUse {
        let scenes = state.scenes.using(volume);
        return error.with_details(json!({ "volume": volume, "scenes": scenes }));
    }
    error
}
