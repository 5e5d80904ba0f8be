//! Pictures: of a scene, and of a scene document that is not kept.

use std::fmt::Write as _;
use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Body;
use axum::extract::{Path, State};
use axum::http::{HeaderName, HeaderValue, header};
use axum::response::Response;
use serde::Deserialize;
use serde_json::Value;

use super::AppState;
use super::extract::{JsonBody, QueryParams, shortened, typed};
use crate::encode::{ImageFormat, encode};
use crate::error::{ApiError, ErrorCode};
use crate::renderer::{AoPolicy, FrameRequest, StageTimings};
use crate::scene::Scene;

/// Header that names the revision a picture shows.
pub(super) const SCENE_REVISION: HeaderName = HeaderName::from_static("x-scene-revision");

const SERVER_TIMING: HeaderName = HeaderName::from_static("server-timing");

/// `GET /v1/scenes/{id}/frame?width=&height=&format=`
pub(super) async fn of_scene(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<Response, ApiError> {
    let width = query.number("width", 1..=u32::MAX)?;
    let height = query.number("height", 1..=u32::MAX)?;
    let format = query.choice("format", "png, jpeg or webp", ImageFormat::from_name)?;
    query.finish()?;
    let snapshot = state.scenes.get(&id)?.snapshot();
    let size = picture_size(&state, &snapshot.scene, width, height, "")?;
    let mut response = picture(&state, snapshot.scene, size, format.unwrap_or(ImageFormat::Png)).await?;
    response.headers_mut().insert(SCENE_REVISION, HeaderValue::from(snapshot.revision));
    Ok(response)
}

/// Body of `POST /v1/render`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct OneShot {
    scene: Value,
    width: Option<u32>,
    height: Option<u32>,
    format: Option<String>,
}

/// `POST /v1/render`
pub(super) async fn one_shot(
    State(state): State<AppState>,
    query: QueryParams,
    JsonBody(body): JsonBody,
) -> Result<Response, ApiError> {
    query.finish()?;
    let body: OneShot = typed(body)?;
    let format = match body.format.as_deref() {
        None => ImageFormat::Png,
        Some(name) => ImageFormat::from_name(name).ok_or_else(|| {
            ApiError::invalid("format", format!("expected png, jpeg or webp, got `{}`", shortened(name)))
        })?,
    };
    let scene = state.scenes.complete(&body.scene, "scene")?;
    let size = picture_size(&state, &scene, body.width, body.height, "scene.")?;
    picture(&state, scene, size, format).await
}

/// The size asked for, or that of the scene's viewport, within the server's limit.
fn picture_size(
    state: &AppState,
    scene: &Scene,
    width: Option<u32>,
    height: Option<u32>,
    scene_path: &str,
) -> Result<[u32; 2], ApiError> {
    let limit = state.limits.max_image_axis;
    let check = |name: &str, asked: Option<u32>, viewport: u32| {
        let path = if asked.is_some() { name.to_owned() } else { format!("{scene_path}viewport.{name}") };
        match asked.unwrap_or(viewport) {
            0 => Err(ApiError::invalid(&path, "expected at least 1 pixel")),
            size if size > limit => {
                let message = format!("{path}: {size} pixels; this server draws at most {limit}");
                Err(ApiError::new(ErrorCode::TooLarge, message)
                    .with_details(serde_json::json!({ "path": path, "limit": limit })))
            }
            size => Ok(size),
        }
    };
    Ok([check("width", width, scene.viewport.width)?, check("height", height, scene.viewport.height)?])
}

/// Draws and encodes.
async fn picture(
    state: &AppState,
    scene: Arc<Scene>,
    [width, height]: [u32; 2],
    format: ImageFormat,
) -> Result<Response, ApiError> {
    let _slot = state.render_slot()?;
    let background = scene.rendering.background;
    let frame = state.renderer.render(FrameRequest { scene, width, height, ao_policy: AoPolicy::Exact }).await?;
    let timings = frame.timings;
    let (bytes, encoding) = tokio::task::spawn_blocking(move || {
        let started = Instant::now();
        encode(&frame, format, background).map(|bytes| (bytes, started.elapsed()))
    })
    .await
    .map_err(ApiError::internal)??;
    Response::builder()
        .header(header::CONTENT_TYPE, format.media_type())
        .header(header::CACHE_CONTROL, "no-store")
        .header(SERVER_TIMING, server_timing(&timings, Some(encoding)))
        .body(Body::from(bytes))
        .map_err(ApiError::internal)
}

/// Milliseconds per stage, as browsers' tools show them.
pub(super) fn server_timing(timings: &StageTimings, encode: Option<Duration>) -> String {
    let stages =
        [("queue", timings.queue), ("ao", timings.ao), ("raycast", timings.raycast), ("readback", timings.readback)];
    let mut text = String::new();
    for (name, duration) in stages.into_iter().chain(encode.map(|duration| ("encode", duration))) {
        let comma = if text.is_empty() { "" } else { ", " };
        // Writing into a String cannot fail.
        let _ = write!(text, "{comma}{name};dur={:.3}", duration.as_secs_f64() * 1e3);
    }
    text
}
