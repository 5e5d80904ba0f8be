//! Units of length by their names.

/// Millimetres in a unit of length, by its name as ImageJ, OME-XML and OME-Zarr (after UDUNITS-2) write it; `None` for
/// what is no length, such as `pixel`.
pub(super) fn millimetres(unit: &str) -> Option<f64> {
    Some(match unit {
        "femtometer" | "fm" => 1e-12,
        "picometer" | "pm" => 1e-9,
        "\u{c5}" | "angstrom" => 1e-7,
        "nm" | "nanometer" => 1e-6,
        // The two signs for micro, and what ImageJ makes of them.
        "\u{b5}m" | "\u{3bc}m" | "\\u00B5m" | "um" | "micron" | "microns" | "micrometer" => 1e-3,
        "mm" | "millimeter" => 1.0,
        "cm" | "centimeter" => 10.0,
        "dm" | "decimeter" => 100.0,
        "m" | "meter" => 1e3,
        "km" | "kilometer" => 1e6,
        "in" | "inch" => 25.4,
        "ft" | "foot" => 304.8,
        "yd" | "yard" => 914.4,
        _ => return None,
    })
}
