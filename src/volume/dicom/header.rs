//! A file's header as text for people.

use super::dataset::{Dataset, Value};
use super::fields::{Vr, shown};
use crate::volume::About;

/// Keeps the elements that may be shown, with their values as text.
///
/// Those that name or place nobody by the basic profile of PS3.15 table E.1-1 are technical. The others that are kept
/// (names, numbers, dates, addresses, physicians, institutions, free text, unique identifiers) are not. Private
/// elements are never kept.
pub(super) fn keep(dataset: &Dataset, about: &mut About) {
    for (tag, value) in &dataset.elements {
        let Some((keyword, vr, technical)) = shown(*tag) else { continue };
        let text = match (value, vr) {
            (Value::Bytes(..), Vr::Us) => dataset.short(*tag).map(|number| number.to_string()),
            (Value::Bytes(..), _) => dataset.text(*tag),
            (Value::Items(_), _) => None,
        };
        match text {
            Some(text) if technical => about.technical_field(keyword, text),
            Some(text) => about.field(keyword, text),
            None => {}
        }
    }
}
