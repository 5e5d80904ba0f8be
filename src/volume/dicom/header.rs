//! A file's header as text for people.

use super::dataset::{Dataset, Value};
use super::fields::{Vr, shown};

/// The elements that may be shown, with their values as text.
///
/// Unless `keep_identity`, what names or places the patient is left out, as the basic profile of PS3.15 table E.1-1
/// has it: names, numbers, dates, addresses, physicians, institutions, free text, unique identifiers. Private elements
/// are never shown.
pub(super) fn header(dataset: &Dataset, keep_identity: bool) -> Vec<(String, String)> {
    let elements = dataset.elements.iter().filter_map(|(tag, value)| {
        let (keyword, vr) = shown(*tag, keep_identity)?;
        let text = match (value, vr) {
            (Value::Bytes(..), Vr::Us) => dataset.short(*tag)?.to_string(),
            (Value::Bytes(..), _) => dataset.text(*tag)?,
            (Value::Items(_), _) => return None,
        };
        Some((keyword.to_owned(), text))
    });
    elements.collect()
}
