//! Metadata of an array, of Zarr 2 (`.zarray`) or Zarr 3 (`zarr.json`).
//!
//! After <https://zarr-specs.readthedocs.io/en/latest/v2/v2.0.html> and
//! <https://zarr-specs.readthedocs.io/en/latest/v3/core/index.html>.

use serde_json::{Map, Value};

use super::codecs::{self, Chain};
use super::json::{self, shown};
use super::store::Store;
use crate::volume::stored::Stored;
use crate::volume::{Endian, VolumeError, VoxelType};

/// Most axes of an array: time, channel, three of space, and a few more of size 1.
pub(super) const MAX_AXES: usize = 8;

/// An array without its chunks.
#[derive(Debug)]
pub(super) struct Array {
    /// Key of the array's folder, empty or with a slash at its end.
    pub(super) folder: String,
    /// Version of the format: 2 or 3.
    pub(super) version: u8,
    /// Along each axis, the last of which runs fastest if the codecs do not say otherwise.
    pub(super) shape: Vec<u64>,
    pub(super) stored: Stored,
    /// Value of what is in no chunk.
    pub(super) fill: Fill,
    /// Elements along each axis of what a key holds: a chunk, or a shard of chunks.
    pub(super) outer: Vec<u64>,
    /// Elements along each axis of what is decoded at once.
    pub(super) chunk: Vec<u64>,
    /// How a chunk became bytes.
    pub(super) chain: Chain,
    /// How a shard's index became bytes; `None` without shards.
    pub(super) shard: Option<Shard>,
    key_prefix: &'static str,
    separator: char,
}

/// How shards find their chunks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Shard {
    pub(super) index_at_start: bool,
    pub(super) index_endian: Endian,
    pub(super) index_has_sum: bool,
}

/// Value of elements in chunks that are not there.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fill {
    Integer(i128),
    Float(f64),
}

impl Array {
    /// The array of a folder; `None` if there is none.
    ///
    /// # Errors
    /// Names the field at fault.
    pub(super) fn read(store: &mut Store, folder: &str) -> Result<Option<Self>, VolumeError> {
        if let Some(document) = json::read(store, &format!("{folder}zarr.json"))? {
            let is_array = document.get("node_type").and_then(Value::as_str) == Some("array");
            return if is_array { of_zarr_3(folder, &document).map(Some) } else { Ok(None) };
        }
        match json::read(store, &format!("{folder}.zarray"))? {
            Some(document) => of_zarr_2(folder, &document).map(Some),
            None => Ok(None),
        }
    }

    /// Key of the chunk or shard with these coordinates.
    pub(super) fn key(&self, coordinates: &[u64]) -> String {
        let mut key = format!("{}{}", self.folder, self.key_prefix);
        for (axis, coordinate) in coordinates.iter().enumerate() {
            if axis > 0 || !self.key_prefix.is_empty() {
                key.push(self.separator);
            }
            key.push_str(&coordinate.to_string());
        }
        key
    }

    /// Bytes of a decoded chunk.
    pub(super) fn chunk_bytes(&self) -> u128 {
        product(&self.chunk) * u128::from(self.stored.bytes())
    }

    /// Chunks along each axis of a shard; 1 without shards.
    pub(super) fn chunks_per_shard(&self) -> Vec<u64> {
        self.outer.iter().zip(&self.chunk).map(|(outer, chunk)| outer / chunk).collect()
    }

    fn check(self) -> Result<Self, VolumeError> {
        let axes = self.shape.len();
        for (field, sizes) in [("chunk_shape", &self.outer), ("chunk_shape", &self.chunk)] {
            if sizes.len() != axes || sizes.contains(&0) {
                let message = format!("{sizes:?}; expected {axes} sizes above 0, one for each axis");
                return Err(VolumeError::malformed(field, message));
            }
        }
        if self.shape.contains(&0) {
            return Err(VolumeError::malformed("shape", format!("{:?} has an empty axis", self.shape)));
        }
        if self.outer.iter().zip(&self.chunk).any(|(outer, chunk)| outer % chunk != 0) {
            let message = format!("chunks of {:?} do not fill shards of {:?}", self.chunk, self.outer);
            return Err(VolumeError::malformed("chunk_shape", message));
        }
        Ok(self)
    }
}

/// The number of elements, which no `u64` needs to hold.
pub(super) fn product(sizes: &[u64]) -> u128 {
    sizes.iter().fold(1, |product: u128, &size| product.saturating_mul(size.into()))
}

fn of_zarr_2(folder: &str, document: &Map<String, Value>) -> Result<Array, VolumeError> {
    if document.get("zarr_format") != Some(&Value::from(2)) {
        return Err(VolumeError::unsupported("zarr_format", "expected 2 in a .zarray"));
    }
    let shape = json::sizes("shape", document.get("shape"), MAX_AXES)?;
    let chunk = json::sizes("chunks", document.get("chunks"), MAX_AXES)?;
    let dtype = document.get("dtype").unwrap_or(&Value::Null);
    let number = dtype.as_str().and_then(Stored::from_descr);
    let (stored, endian) = number.ok_or_else(|| not_a_number("dtype", dtype))?;
    let separator = match document.get("dimension_separator").and_then(Value::as_str) {
        None | Some(".") => '.',
        Some("/") => '/',
        Some(other) => return Err(VolumeError::malformed("dimension_separator", format!("{other:?} is not . or /"))),
    };
    let array = Array {
        folder: folder.to_owned(),
        version: 2,
        chain: codecs::of_zarr_2(document, shape.len(), endian)?,
        fill: fill(document.get("fill_value"), stored)?,
        outer: chunk.clone(),
        shape,
        stored,
        chunk,
        shard: None,
        key_prefix: "",
        separator,
    };
    array.check()
}

fn of_zarr_3(folder: &str, document: &Map<String, Value>) -> Result<Array, VolumeError> {
    if document.get("zarr_format") != Some(&Value::from(3)) {
        return Err(VolumeError::unsupported("zarr_format", "expected 3 in a zarr.json"));
    }
    let shape = json::sizes("shape", document.get("shape"), MAX_AXES)?;
    let stored = stored(document.get("data_type").unwrap_or(&Value::Null))?;
    let (grid, configuration) = named("chunk_grid", document.get("chunk_grid"))?;
    if grid != "regular" {
        return Err(VolumeError::unsupported("chunk_grid", format!("`{grid}` is not read; expected regular")));
    }
    let outer = json::sizes("chunk_shape", configuration.get("chunk_shape"), MAX_AXES)?;
    let (encoding, configuration) = named("chunk_key_encoding", document.get("chunk_key_encoding"))?;
    let (key_prefix, usual) = match encoding.as_str() {
        "default" => ("c", "/"),
        "v2" => ("", "."),
        _ => {
            let message = format!("`{encoding}` is not read; expected default or v2");
            return Err(VolumeError::unsupported("chunk_key_encoding", message));
        }
    };
    let separator = match configuration.get("separator").and_then(Value::as_str).unwrap_or(usual) {
        "/" => '/',
        "." => '.',
        other => return Err(VolumeError::malformed("separator", format!("{other:?} is not . or /"))),
    };
    let codecs = codecs::of_zarr_3(document.get("codecs"), shape.len(), stored)?;
    let array = Array {
        folder: folder.to_owned(),
        version: 3,
        fill: fill(document.get("fill_value"), stored)?,
        chunk: codecs.chunk.unwrap_or_else(|| outer.clone()),
        outer,
        shape,
        stored,
        chain: codecs.chain,
        shard: codecs.shard,
        key_prefix,
        separator,
    };
    array.check()
}

/// What extensions look like: a name alone, or an object with a name and its configuration.
pub(super) fn named(field: &str, value: Option<&Value>) -> Result<(String, Map<String, Value>), VolumeError> {
    let found = match value {
        Some(Value::String(name)) => Some((name.as_str(), None)),
        Some(Value::Object(object)) => {
            object.get("name").and_then(Value::as_str).map(|name| (name, object.get("configuration")))
        }
        _ => None,
    };
    let (name, configuration) = found.ok_or_else(|| VolumeError::malformed(field, "missing, or without a name"))?;
    let configuration = configuration.and_then(Value::as_object).cloned().unwrap_or_default();
    Ok((name.chars().take(60).collect(), configuration))
}

fn stored(data_type: &Value) -> Result<Stored, VolumeError> {
    Ok(Stored::As(match data_type.as_str() {
        Some("bool" | "uint8") => VoxelType::U8,
        Some("int8") => VoxelType::I8,
        Some("uint16") => VoxelType::U16,
        Some("int16") => VoxelType::I16,
        Some("uint32") => VoxelType::U32,
        Some("int32") => VoxelType::I32,
        Some("uint64") => VoxelType::U64,
        Some("int64") => VoxelType::I64,
        Some("float16") => return Ok(Stored::Half),
        Some("float32") => VoxelType::F32,
        Some("float64") => VoxelType::F64,
        _ => return Err(not_a_number("data_type", data_type)),
    }))
}

fn not_a_number(field: &str, data_type: &Value) -> VolumeError {
    let message = format!(
        "{} is not read; expected bool, integers of 8 to 64 bits, float16, float32 or float64",
        shown(data_type)
    );
    VolumeError::unsupported(field, message)
}

fn fill(value: Option<&Value>, stored: Stored) -> Result<Fill, VolumeError> {
    let wrong = |value: &Value| {
        let message = format!("{} is not a value of type {}", shown(value), stored.voxel_type());
        VolumeError::malformed("fill_value", message)
    };
    let value = match value {
        None | Some(Value::Null) => return Ok(Fill::Integer(0)),
        Some(value) => value,
    };
    if stored.voxel_type().is_integer() {
        let number = match value {
            Value::Bool(value) => Some(i128::from(*value)),
            Value::Number(number) => number.as_i128(),
            _ => None,
        };
        let bits = stored.bytes() * 8;
        let signed = stored.voxel_type().name().starts_with('i');
        let (low, high) = if signed { (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) } else { (0, (1_i128 << bits) - 1) };
        return number.filter(|n| (low..=high).contains(n)).map(Fill::Integer).ok_or_else(|| wrong(value));
    }
    let number = match value {
        Value::Number(number) => number.as_f64(),
        Value::String(text) => match text.as_str() {
            "NaN" => Some(f64::NAN),
            "Infinity" => Some(f64::INFINITY),
            "-Infinity" => Some(f64::NEG_INFINITY),
            // The bits of the number.
            _ => text.strip_prefix("0x").and_then(|bits| match (bits.len(), u64::from_str_radix(bits, 16).ok()?) {
                (4, bits) => Some(half::f16::from_bits(bits as u16).to_f64()),
                (8, bits) => Some(f64::from(f32::from_bits(bits as u32))),
                (16, bits) => Some(f64::from_bits(bits)),
                _ => None,
            }),
        },
        _ => None,
    };
    number.map(Fill::Float).ok_or_else(|| wrong(value))
}
