//! What the server is, and whether it works.

use axum::Json;
use axum::extract::State;
use serde_json::{Value, json};

use super::AppState;
use super::extract::QueryParams;
use crate::encode::ImageFormat;
use crate::error::ApiError;
use crate::volume::Format;

/// `GET /v1/server`
pub(super) async fn show(State(state): State<AppState>, query: QueryParams) -> Result<Json<Value>, ApiError> {
    query.finish()?;
    let info = state.renderer.info();
    Ok(Json(json!({
        "name": env!("CARGO_PKG_NAME"),
        "version": env!("CARGO_PKG_VERSION"),
        "adapter": info.adapter,
        "backend": info.backend,
        "driver": info.driver,
        "driver_info": info.driver_info,
        "software": info.software,
        "limits": state.limits_json(),
        "memory": state.renderer.memory(),
        "volumes": state.volumes.list().len(),
        "scenes": state.scenes.list().len(),
        "features": {
            "volume_formats": Format::all().map(Format::name).collect::<Vec<_>>(),
            "volume_sources": volume_sources(&state),
            "image_formats": ImageFormat::ALL.map(ImageFormat::name),
            "ao_methods": ["off", "spao", "raytraced"],
            "ao_structures": ["n_buffer", "mipmap", "hybrid"],
            "render_modes": ["composite"],
            "texture_16bit_norm": info.texture_16bit_norm,
            "stream": true,
        },
        "self_test": null,
    })))
}

/// Where this server takes volumes from.
fn volume_sources(state: &AppState) -> Vec<&'static str> {
    let sources = [
        ("upload", true),
        ("path", state.data_dir.is_some()),
        ("url", state.sources.any_allowed()),
        ("procedural", true),
    ];
    sources.into_iter().filter(|(_, there)| *there).map(|(name, _)| name).collect()
}

/// `GET /livez`: the process answers.
pub(super) async fn livez() -> Json<Value> {
    Json(json!({ "status": "alive" }))
}

/// `GET /readyz`: work is accepted.
pub(super) async fn readyz(State(state): State<AppState>) -> Result<Json<Value>, ApiError> {
    state.ready()?;
    Ok(Json(json!({ "status": "ready" })))
}
