//! What documents in JSON say, with errors that name the field.

use serde_json::{Map, Value};

use super::store::Store;
use crate::volume::VolumeError;
use crate::volume::error::excerpt;

/// Bytes of a document; the root's may hold those of all below it.
const MAX_DOCUMENT_BYTES: u64 = 16 << 20;

/// A document; `None` if there is no such key.
///
/// # Errors
/// Names the key if it is not an object in JSON.
pub(super) fn read(store: &mut Store, key: &str) -> Result<Option<Map<String, Value>>, VolumeError> {
    let Some(bytes) = store.read(key, MAX_DOCUMENT_BYTES)? else { return Ok(None) };
    match serde_json::from_slice(&bytes) {
        Ok(Value::Object(object)) => Ok(Some(object)),
        Ok(_) => Err(VolumeError::malformed(base(key), format!("{} is not a JSON object", excerpt(key)))),
        Err(error) => {
            let message = format!("{} is not JSON: {}", excerpt(key), excerpt(&error.to_string()));
            Err(VolumeError::malformed(base(key), message))
        }
    }
}

/// A document's own name, without the folders of its key.
fn base(key: &str) -> &str {
    key.rsplit('/').next().unwrap_or(key)
}

/// Whole numbers, of which there may be no more than `most`.
pub(super) fn sizes(field: &str, value: Option<&Value>, most: usize) -> Result<Vec<u64>, VolumeError> {
    let array = value.and_then(Value::as_array).filter(|array| array.len() <= most);
    let sizes: Option<Vec<u64>> = array.and_then(|array| array.iter().map(Value::as_u64).collect());
    sizes.ok_or_else(|| VolumeError::malformed(field, format!("expected at most {most} whole numbers")))
}

/// Exactly `count` finite numbers.
pub(super) fn numbers(field: &str, value: Option<&Value>, count: usize) -> Result<Vec<f64>, VolumeError> {
    let array = value.and_then(Value::as_array).filter(|array| array.len() == count);
    let numbers: Option<Vec<f64>> = array.and_then(|array| array.iter().map(Value::as_f64).collect());
    numbers.ok_or_else(|| VolumeError::malformed(field, format!("expected {count} numbers, one for each axis")))
}

/// The start of any value, for messages.
pub(super) fn shown(value: &Value) -> String {
    match value {
        Value::String(text) => excerpt(text),
        other => excerpt(&other.to_string()),
    }
}
