//! What ImageJ writes into the description: lines of `name=value`.

use crate::volume::units::millimetres;

/// Sizes and lengths of a hyperstack.
#[derive(Debug, Default, PartialEq)]
pub(super) struct ImageJ {
    pub(super) images: Option<usize>,
    pub(super) channels: usize,
    pub(super) slices: usize,
    pub(super) frames: usize,
    /// Between slices.
    pub(super) spacing: Option<f64>,
    /// Millimetres in a unit of length; `None` if no unit is known.
    pub(super) millimetres: Option<f64>,
}

/// `None` if the description is not ImageJ's.
pub(super) fn parse(description: &str) -> Option<ImageJ> {
    if !description.starts_with("ImageJ=") {
        return None;
    }
    let get = |name: &str| {
        let mut fields = description.lines().filter_map(|line| line.split_once('='));
        fields.find(|(key, _)| *key == name).map(|(_, value)| value.trim())
    };
    let count = |name: &str| get(name).and_then(|text| text.parse().ok());
    let length = get("spacing").and_then(|text| text.parse().ok()).map(f64::abs);
    Some(ImageJ {
        images: count("images"),
        channels: count("channels").unwrap_or(1),
        slices: count("slices").unwrap_or(1),
        frames: count("frames").unwrap_or(1),
        spacing: length.filter(|length| length.is_finite() && *length > 0.0),
        millimetres: get("unit").and_then(millimetres),
    })
}
