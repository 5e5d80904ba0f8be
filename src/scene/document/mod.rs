//! Scene documents: what a client writes, checked, and its completion against a volume.
//!
//! JSON -> shape (`shape.rs`: names and types) -> [`SceneDocument`] (ranges and what is implemented) -> [`Scene`]
//! (what depends on the volume is filled in). A [`Scene`] writes itself as the complete document, which reads back
//! as the same scene.

mod camera;
mod check;
mod rendering;
mod settings;
mod shape;
mod transfer_function;
mod volume_facts;

pub use rendering::MAX_CLIP_PLANES;
pub use transfer_function::MAX_POINTS;
pub use volume_facts::{HistogramView, VolumeFacts};

use serde_json::Value;

use self::camera::CameraDocument;
use self::shape::{Object, SceneShape};
use self::transfer_function::TransferFunctionDocument;
use super::{AmbientOcclusion, Lighting, Rendering, Scene, SceneError, Viewport};
use crate::volume::VolumeId;

/// Longest name of a volume in a document.
const MAX_VOLUME_ID_BYTES: usize = 128;

/// A checked scene of which the parts that depend on the volume are not filled in yet.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneDocument {
    volume: VolumeId,
    transfer_function: TransferFunctionDocument,
    camera: CameraDocument,
    ambient_occlusion: AmbientOcclusion,
    lighting: Lighting,
    rendering: Rendering,
    viewport: Viewport,
}

impl SceneDocument {
    /// Reads a document in which only `volume` is required; a field that is null counts as missing.
    ///
    /// # Errors
    /// The first unknown field, wrong type, value out of range or contradiction
    /// ([`Invalid`](super::SceneErrorKind::Invalid)), or the first thing that is known but does not exist yet
    /// ([`NotImplemented`](super::SceneErrorKind::NotImplemented)).
    pub fn from_json(json: &Value) -> Result<Self, SceneError> {
        let shape = shape::shape_from_json(json)?;
        Ok(Self {
            volume: volume_id(shape.volume)?,
            transfer_function: TransferFunctionDocument::from_shape(&section(shape.transfer_function))?,
            camera: CameraDocument::from_shape(&section(shape.camera))?,
            ambient_occlusion: settings::ambient_occlusion_from_shape(&section(shape.ambient_occlusion))?,
            lighting: settings::lighting_from_shape(&section(shape.lighting))?,
            rendering: rendering::from_shape(&section(shape.rendering))?,
            viewport: settings::viewport_from_shape(&section(shape.viewport))?,
        })
    }

    /// The volume that [`SceneDocument::complete`] needs the facts of.
    pub fn volume(&self) -> &VolumeId {
        &self.volume
    }

    /// Fills in what depends on the volume: the camera and the transfer function.
    ///
    /// # Errors
    /// A camera that contradicts itself once it is complete (`camera.target`, `camera.up`), a volume so large that
    /// no camera can frame it (`camera`), or facts about another volume (`volume`).
    pub fn complete(&self, facts: &VolumeFacts<'_>) -> Result<Scene, SceneError> {
        if &self.volume != facts.id {
            let message = format!("expected {}, which the defaults are computed for", facts.id);
            return Err(SceneError::invalid("volume", message));
        }
        let aspect = f64::from(self.viewport.width) / f64::from(self.viewport.height);
        Ok(Scene {
            volume: self.volume.clone(),
            transfer_function: self.transfer_function.complete(facts),
            camera: self.camera.complete(facts.grid, aspect)?,
            ambient_occlusion: self.ambient_occlusion,
            lighting: self.lighting,
            rendering: self.rendering.clone(),
            viewport: self.viewport,
        })
    }
}

impl Scene {
    /// The complete document: every field is there, and reading it back gives an equal scene. What means nothing to a
    /// camera has its default: `fov_y_deg` of an orthographic one, `height` of a perspective one.
    pub fn to_json(&self) -> Value {
        let shape = SceneShape {
            volume: Some(self.volume.0.clone()),
            transfer_function: Some(Object(transfer_function::to_shape(&self.transfer_function))),
            camera: Some(Object(camera::to_shape(&self.camera))),
            ambient_occlusion: Some(Object(settings::ambient_occlusion_to_shape(&self.ambient_occlusion))),
            lighting: Some(Object(settings::lighting_to_shape(&self.lighting))),
            rendering: Some(Object(rendering::to_shape(&self.rendering))),
            viewport: Some(Object(settings::viewport_to_shape(&self.viewport))),
        };
        serde_json::to_value(shape).expect("the shape has string keys and finite numbers only")
    }

    /// The document that a JSON Merge Patch (RFC 7396) makes of this scene. What the patch sets to null gets its
    /// default; a patch that names a preset replaces the whole transfer function.
    ///
    /// # Errors
    /// Those of [`SceneDocument::from_json`].
    pub fn patched_document(&self, patch: &Value) -> Result<SceneDocument, SceneError> {
        let mut json = self.to_json();
        if patch.pointer("/transfer_function/preset").is_some_and(Value::is_string) {
            json["transfer_function"] = Value::Null;
        }
        json_patch::merge(&mut json, patch);
        SceneDocument::from_json(&json)
    }

    /// This scene changed by a JSON Merge Patch; `facts` are about the volume that the *patched* scene looks at.
    ///
    /// # Errors
    /// Those of [`SceneDocument::from_json`] and [`SceneDocument::complete`].
    pub fn patched(&self, patch: &Value, facts: &VolumeFacts<'_>) -> Result<Self, SceneError> {
        self.patched_document(patch)?.complete(facts)
    }
}

/// A section of the document; one that is missing is one without fields.
fn section<T: Default>(given: Option<Object<T>>) -> T {
    given.unwrap_or_default().0
}

fn volume_id(given: Option<String>) -> Result<VolumeId, SceneError> {
    let given = given.ok_or_else(|| SceneError::invalid("volume", "required: the id of a volume"))?;
    if given.is_empty() || given.len() > MAX_VOLUME_ID_BYTES {
        let message = format!("expected the id of a volume, 1 to {MAX_VOLUME_ID_BYTES} bytes, got {}", given.len());
        return Err(SceneError::invalid("volume", message));
    }
    Ok(VolumeId(given))
}
