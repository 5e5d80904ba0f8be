//! The JSON shape of a scene: field names and types, nothing about ranges. The same structs are read and
//! written, so that a field has its name in one place only.
//!
//! Every field may be missing or null, which both mean its default. Numbers stay [`Number`] so that whole
//! numbers are written without a fraction and error messages can quote what the client wrote.

use std::{fmt, marker::PhantomData};

use serde::de::{MapAccess, Visitor, value::MapAccessDeserializer};
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Number, Value};

use crate::scene::SceneError;
use crate::scene::error::ROOT;

/// Three numbers.
pub(super) type Triple = [Number; 3];

/// A struct that is read from a JSON object only; serde's derive alone also takes an array of its fields.
#[derive(Clone, Debug, Default, Serialize)]
#[serde(transparent)]
pub(super) struct Object<T>(pub(super) T);

impl<'de, T: Deserialize<'de>> Deserialize<'de> for Object<T> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct ObjectVisitor<T>(PhantomData<T>);
        impl<'de, T: Deserialize<'de>> Visitor<'de> for ObjectVisitor<T> {
            type Value = Object<T>;
            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }
            fn visit_map<A: MapAccess<'de>>(self, map: A) -> Result<Self::Value, A::Error> {
                T::deserialize(MapAccessDeserializer::new(map)).map(Object)
            }
        }
        deserializer.deserialize_map(ObjectVisitor(PhantomData))
    }
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct SceneShape {
    pub(super) volume: Option<String>,
    pub(super) transfer_function: Option<Object<TransferFunctionShape>>,
    pub(super) camera: Option<Object<CameraShape>>,
    pub(super) ambient_occlusion: Option<Object<AmbientOcclusionShape>>,
    pub(super) lighting: Option<Object<LightingShape>>,
    pub(super) rendering: Option<Object<RenderingShape>>,
    pub(super) viewport: Option<Object<ViewportShape>>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct TransferFunctionShape {
    /// Only ever read: a scene writes the points that the preset stood for.
    #[serde(skip_serializing)]
    pub(super) preset: Option<String>,
    pub(super) points: Option<Vec<Object<PointShape>>>,
    pub(super) opacity_unit_distance: Option<Number>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct PointShape {
    pub(super) value: Option<Number>,
    pub(super) color: Option<String>,
    pub(super) opacity: Option<Number>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct CameraShape {
    pub(super) eye: Option<Triple>,
    pub(super) target: Option<Triple>,
    pub(super) up: Option<Triple>,
    pub(super) projection: Option<String>,
    pub(super) fov_y_deg: Option<Number>,
    pub(super) height: Option<Number>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct AmbientOcclusionShape {
    pub(super) method: Option<String>,
    pub(super) structure: Option<String>,
    pub(super) levels: Option<Number>,
    pub(super) mip_levels: Option<Number>,
    pub(super) normal_factor: Option<Number>,
    pub(super) strength: Option<Number>,
    pub(super) rays: Option<Number>,
    /// A number or a string.
    pub(super) radius: Option<Value>,
    pub(super) falloff: Option<Number>,
    pub(super) color_bleeding: Option<Number>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct LightingShape {
    pub(super) ambient: Option<Number>,
    pub(super) diffuse: Option<Number>,
    pub(super) specular: Option<Number>,
    pub(super) shininess: Option<Number>,
    pub(super) direction: Option<Triple>,
    pub(super) color: Option<String>,
    pub(super) exposure: Option<Number>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct RenderingShape {
    pub(super) mode: Option<String>,
    pub(super) iso_value: Option<Number>,
    pub(super) sampling_rate: Option<Number>,
    pub(super) background: Option<String>,
    pub(super) clip_box: Option<[Triple; 2]>,
    pub(super) clip_planes: Option<Vec<[Number; 4]>>,
    /// Its shape is not fixed yet; anything but null is refused.
    pub(super) opacity_modulation: Option<Value>,
}

#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(super) struct ViewportShape {
    pub(super) width: Option<Number>,
    pub(super) height: Option<Number>,
}

/// Reads the shape; an unknown field or a wrong type is an error with its path.
pub(super) fn shape_from_json(json: &Value) -> Result<SceneShape, SceneError> {
    let Object(shape) = serde_path_to_error::deserialize(json).map_err(|error| {
        let path = error.path().to_string();
        SceneError::invalid(if path == "." { ROOT } else { &path }, error.inner().to_string())
    })?;
    Ok(shape)
}
