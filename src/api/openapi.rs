//! The OpenAPI document: written by hand, compared with the router by a test.

use serde_json::Value;

/// The document as it is published.
pub const OPENAPI: &str = include_str!("openapi.json");

/// The document, parsed.
pub fn document() -> Value {
    serde_json::from_str(OPENAPI).expect("the embedded document is JSON")
}
