//! A connection's own camera and size.

use std::sync::Arc;

use serde::Deserialize;
use serde_json::{Value, json};

use crate::error::ApiError;
use crate::scene::Scene;
use crate::session::{View, VolumeEntry};

/// `view` of an update. A missing part stays as it is; `camera: null` goes back to the scene's own.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct ViewPatch {
    #[serde(default, deserialize_with = "present")]
    camera: Option<Value>,
    width: Option<u32>,
    height: Option<u32>,
}

/// Tells a null from a missing member.
fn present<'de, D: serde::Deserializer<'de>>(deserializer: D) -> Result<Option<Value>, D::Error> {
    Value::deserialize(deserializer).map(Some)
}

/// The scene as this connection sees it.
pub(super) fn seen_through(scene: &Arc<Scene>, view: &View) -> Arc<Scene> {
    match &view.camera {
        None => scene.clone(),
        Some(camera) => Arc::new(Scene { camera: camera.clone(), ..Scene::clone(scene) }),
    }
}

/// The view after a patch; `view` itself stays what it is.
///
/// # Errors
/// What is wrong with the patch, its path beginning with `view.`.
pub(super) fn patched(
    view: &View,
    patch: Value,
    scene: &Arc<Scene>,
    volume: &VolumeEntry,
    max_axis: u32,
) -> Result<View, ApiError> {
    let patch: ViewPatch = serde_path_to_error::deserialize(patch).map_err(|error| {
        let path = error.path().to_string();
        let path = if path == "." { "view".to_owned() } else { format!("view.{path}") };
        ApiError::invalid(&path, error.inner())
    })?;
    let mut new = view.clone();
    match patch.camera {
        None => {}
        Some(Value::Null) => new.camera = None,
        Some(camera) => {
            let seen = seen_through(scene, view);
            let patched = seen.patched(&json!({ "camera": camera }), &volume.facts());
            new.camera = Some(patched.map_err(|error| error.under("view"))?.camera);
        }
    }
    new.width = side("view.width", patch.width.unwrap_or(view.width), max_axis)?;
    new.height = side("view.height", patch.height.unwrap_or(view.height), max_axis)?;
    Ok(new)
}

/// Checks a picture's side.
///
/// # Errors
/// Names `path`.
pub(super) fn side(path: &str, pixels: u32, max_axis: u32) -> Result<u32, ApiError> {
    if (1..=max_axis).contains(&pixels) {
        Ok(pixels)
    } else {
        Err(ApiError::invalid(path, format!("expected 1 to {max_axis} pixels, got {pixels}")))
    }
}
