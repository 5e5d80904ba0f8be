//! The JSON Merge Patch (RFC 7396) that leads from one document to another.

use serde_json::{Map, Value};

/// The smallest merge patch that turns `before` into `after`; an empty object when they are equal. Members that
/// `after` lacks become null. A null inside `after` cannot be expressed by a merge patch and is sent as null, which
/// a client that fills in defaults reads as the same.
pub fn merge_patch_between(before: &Value, after: &Value) -> Value {
    let (Value::Object(before), Value::Object(after)) = (before, after) else {
        return after.clone();
    };
    let mut patch = Map::new();
    for (name, value) in after {
        match before.get(name) {
            Some(old) if old == value => {}
            Some(old) if old.is_object() && value.is_object() => {
                patch.insert(name.clone(), merge_patch_between(old, value));
            }
            _ => {
                patch.insert(name.clone(), value.clone());
            }
        }
    }
    for name in before.keys().filter(|name| !after.contains_key(*name)) {
        patch.insert(name.clone(), Value::Null);
    }
    Value::Object(patch)
}
