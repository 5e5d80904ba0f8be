//! What a volume holds: slices and a thumbnail as pictures, the value at a place, all voxels as a file.

use std::sync::{Arc, Weak};

use axum::Json;
use axum::body::{Body, Bytes};
use axum::extract::{Path, State};
use axum::http::{HeaderName, HeaderValue, header};
use axum::response::{IntoResponse, Response};
use futures_util::stream;
use glam::DVec3;
use serde_json::{Value, json};

use super::AppState;
use super::extract::QueryParams;
use crate::array_file::{ArrayFormat, volume_header};
use crate::encode::{ImageFormat, encode_gray};
use crate::error::ApiError;
use crate::session::VolumeEntry;
use crate::volume::{GrayPicture, LARGEST_THUMBNAIL, SliceAxis, SliceSize, VolumeError, slice_orientation};

/// Letters of the four edges of a slice.
pub(super) const ORIENTATION: HeaderName = HeaderName::from_static("x-orientation");
/// World units of a pixel, across and down.
pub(super) const PIXEL_SIZE: HeaderName = HeaderName::from_static("x-pixel-size");
/// Which slice is shown.
pub(super) const SLICE_INDEX: HeaderName = HeaderName::from_static("x-slice-index");
/// The values shown black and white.
pub(super) const WINDOW: HeaderName = HeaderName::from_static("x-window");

/// Side of a thumbnail when the request names none.
const DEFAULT_THUMBNAIL: u32 = 128;

/// Voxels in one piece of a download, at most 2 MiB: few enough for many downloads at once, enough for speed.
const PIECE: usize = 1 << 18;

/// Voxels of an id never change, but a cache must not be shared between keys.
const CACHE: HeaderValue = HeaderValue::from_static("private, max-age=3600");

/// `GET /v1/volumes/{id}/slice?axis=z&index=60&low=&high=&width=`
pub(super) async fn slice(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<Response, ApiError> {
    let axis = query.choice("axis", "x, y or z", SliceAxis::from_name)?.unwrap_or(SliceAxis::Z);
    let width = query.number("width", 1..=state.limits.max_image_axis)?;
    let (low, high) = (query.finite("low")?, query.finite("high")?);
    let entry = state.volumes.get(&id)?;
    let grid = &entry.volume.grid;
    let slices = grid.dims[axis.number()];
    let index = query.number("index", 0..=slices - 1)?.unwrap_or(slices / 2);
    query.finish()?;
    let window = window(low, high, entry.volume.code_map.value_range())?;
    let size = SliceSize::new(grid, axis, width, state.limits.max_image_axis).map_err(in_query)?;
    let mut response = {
        let (_slot, entry) = (state.render_slot()?, entry.clone());
        png(move || entry.volume.slice_picture(axis, index, size, window)).await?
    };
    let headers = response.headers_mut();
    let text = |text: String| HeaderValue::try_from(text).map_err(ApiError::internal);
    headers.insert(SLICE_INDEX, HeaderValue::from(index));
    headers.insert(WINDOW, text(format!("low={},high={}", window[0], window[1]))?);
    headers.insert(PIXEL_SIZE, text(format!("{},{}", size.pixel_size[0], size.pixel_size[1]))?);
    if entry.volume.about.patient_axes {
        let [left, right, top, bottom] = slice_orientation(grid, axis);
        headers.insert(ORIENTATION, text(format!("left={left},right={right},top={top},bottom={bottom}"))?);
    }
    Ok(response)
}

/// What is black and what is white: the range of the values where nothing is said.
fn window(low: Option<f64>, high: Option<f64>, range: [f64; 2]) -> Result<[f64; 2], ApiError> {
    let window = [low.unwrap_or(range[0]), high.unwrap_or(range[1])];
    if window[0] < window[1] {
        return Ok(window);
    }
    let message = |other: f64, what| format!("expected a value {what} {other}");
    match (low, high) {
        // A volume of a single value, and nothing else to go by.
        (None, None) => Ok([window[0], window[0] + window[0].abs().max(1.0)]),
        (_, Some(_)) => Err(ApiError::invalid("high", message(window[0], "above"))),
        (Some(_), None) => Err(ApiError::invalid("low", message(window[1], "below"))),
    }
}

/// `GET /v1/volumes/{id}/thumbnail?size=128`
pub(super) async fn thumbnail(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<Response, ApiError> {
    let size = query.number("size", 16..=LARGEST_THUMBNAIL)?.unwrap_or(DEFAULT_THUMBNAIL);
    query.finish()?;
    let entry = state.volumes.get(&id)?;
    let _slot = state.render_slot()?;
    png(move || entry.thumbnail().shrunk(size)).await
}

/// A picture made and encoded on a blocking thread.
async fn png(draw: impl FnOnce() -> GrayPicture + Send + 'static) -> Result<Response, ApiError> {
    let encoded = tokio::task::spawn_blocking(move || {
        let picture = draw();
        encode_gray([picture.width, picture.height], &picture.pixels)
    });
    let file = encoded.await.map_err(ApiError::internal)??;
    let media_type = HeaderValue::from_static(ImageFormat::Png.media_type());
    Ok(([(header::CONTENT_TYPE, media_type), (header::CACHE_CONTROL, CACHE)], file).into_response())
}

/// `GET /v1/volumes/{id}/probe?x=&y=&z=`
pub(super) async fn probe(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<Json<Value>, ApiError> {
    let mut world = DVec3::ZERO;
    for (name, component) in ["x", "y", "z"].into_iter().zip(world.as_mut()) {
        let missing = || ApiError::invalid(name, "missing; expected a world position x, y, z");
        *component = query.finite(name)?.ok_or_else(missing)?;
    }
    query.finish()?;
    let entry = state.volumes.get(&id)?;
    let position = entry.volume.grid.index_from_world().transform_point3(world);
    // Far away, a position may not be a finite number of voxels from here.
    let position_json = position.is_finite().then_some(position.to_array());
    // JSON has no NaN: null.
    let found = entry.volume.probe(position);
    Ok(Json(json!({
        "inside": found.is_some(),
        "index": found.map(|probe| probe.index),
        "position_in_voxels": position_json,
        "value": found.map(|probe| probe.value),
        "interpolated": found.map(|probe| probe.interpolated),
    })))
}

/// `GET /v1/volumes/{id}/data?format=nrrd|npy`
pub(super) async fn data(
    State(state): State<AppState>,
    Path(id): Path<String>,
    mut query: QueryParams,
) -> Result<Response, ApiError> {
    let format = query.choice("format", "nrrd or npy", ArrayFormat::from_name)?.unwrap_or(ArrayFormat::Nrrd);
    query.finish()?;
    let entry = state.volumes.get(&id)?;
    let head = volume_header(&entry.volume, format);
    let length = head.len() as u64 + entry.volume.host_bytes();
    // Weak: a slow client does not keep a volume in memory that has been deleted.
    let pieces = stream::try_unfold((Some(head), 0, Arc::downgrade(&entry)), piece);
    Response::builder()
        .header(header::CONTENT_TYPE, "application/octet-stream")
        .header(header::CONTENT_LENGTH, length)
        .header(header::CONTENT_DISPOSITION, format!("attachment; filename=\"{id}.{}\"", format.name()))
        .header(header::CACHE_CONTROL, CACHE)
        .body(Body::from_stream(pieces))
        .map_err(ApiError::internal)
}

/// What of a download is still to come: the header, the voxels from a number on.
type Rest = (Option<Vec<u8>>, usize, Weak<VolumeEntry>);

/// The next piece of a download; made only when the client has taken the one before. A copy of 2 MiB takes a fraction of
/// a millisecond, which an async worker may spend.
async fn piece((head, done, entry): Rest) -> Result<Option<(Bytes, Rest)>, &'static str> {
    if let Some(head) = head {
        return Ok(Some((head.into(), (None, done, entry))));
    }
    // The answer has begun: all that can be done is to end it early.
    let volume = entry.upgrade().ok_or("the volume was deleted")?;
    let voxels = &volume.volume.voxels;
    let end = (done + PIECE).min(voxels.len());
    if done == end {
        return Ok(None);
    }
    Ok(Some((voxels.little_endian_range(done..end).into(), (None, end, entry))))
}

/// A query parameter is invalid where a file is malformed.
fn in_query(error: VolumeError) -> ApiError {
    match error {
        VolumeError::Malformed { field, message } => ApiError::invalid(&field, message),
        other => other.into(),
    }
}
