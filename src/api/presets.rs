//! Ready-made transfer functions and their thumbnails.

use axum::Json;
use axum::extract::{Path, State};
use axum::http::header;
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};

use super::AppState;
use super::extract::{QueryParams, shortened};
use crate::encode::{ImageFormat, encode_pixels};
use crate::error::{ApiError, ErrorCode};
use crate::scene::{Preset, Rgba, TransferFunction, preset, presets};

/// Pixels of a thumbnail.
const THUMBNAIL: [u32; 2] = [128, 48];

/// `GET /v1/presets?volume=`: with a volume, points that are relative to a value range become its values.
pub(super) async fn list(State(state): State<AppState>, mut query: QueryParams) -> Result<Json<Value>, ApiError> {
    let volume = query.text("volume")?.map(|id| state.volumes.get(&id)).transpose()?;
    query.finish()?;
    let range = volume.map(|entry| entry.volume.code_map.value_range());
    let presets: Vec<Value> = presets().iter().map(|preset| to_json(preset, range)).collect();
    Ok(Json(json!({ "presets": presets })))
}

fn to_json(preset: &Preset, range: Option<[f64; 2]>) -> Value {
    let mut json = json!(preset);
    if let Some(range) = range {
        let points = preset.transfer_function(range).points;
        let points =
            points.iter().map(|p| json!({ "value": p.value, "color": p.color.to_hex(), "opacity": p.opacity }));
        json["points"] = points.collect();
        json["units"] = "data".into();
    }
    json["thumbnail"] = format!("/v1/presets/{}/thumbnail", preset.id).into();
    json
}

/// `GET /v1/presets/{id}/thumbnail`
pub(super) async fn thumbnail(Path(id): Path<String>, query: QueryParams) -> Result<Response, ApiError> {
    query.finish()?;
    let preset = preset(&id)
        .ok_or_else(|| ApiError::new(ErrorCode::PresetNotFound, format!("there is no preset `{}`", shortened(&id))))?;
    let pixels = draw(&preset.transfer_function([0.0, 1.0]));
    // Six thousand pixels take microseconds: no need for the blocking pool.
    let png = encode_pixels(THUMBNAIL, &pixels, ImageFormat::Png, Rgba([0.0; 4]))?;
    let headers = [(header::CONTENT_TYPE, "image/png"), (header::CACHE_CONTROL, "max-age=3600")];
    Ok((headers, png).into_response())
}

/// The colours over the values of the points, as high as their opacity, over a dimmed strip of the same colours.
fn draw(transfer_function: &TransferFunction) -> Vec<u8> {
    let [width, height] = THUMBNAIL;
    let points = &transfer_function.points;
    let (low, high) = (points.first().map_or(0.0, |p| p.value), points.last().map_or(1.0, |p| p.value));
    let column = |x: u32| transfer_function.sample(low + (high - low) * (f64::from(x) + 0.5) / f64::from(width));
    let columns: Vec<_> = (0..width).map(column).collect();
    let mut pixels = Vec::with_capacity((width * height * 4) as usize);
    for y in 0..height {
        let opacity_here = 1.0 - (f64::from(y) + 0.5) / f64::from(height);
        for (color, opacity) in &columns {
            let brightness = if opacity_here < *opacity { 255.0 } else { 70.0 };
            pixels.extend(color.0.map(|c| (c * brightness).round() as u8));
            pixels.push(255);
        }
    }
    pixels
}
