//! Checks that turn numbers and names of a document into ranged values.

use std::fmt;

use glam::DVec3;
use serde_json::Number;

use super::shape::Triple;
use crate::scene::SceneError;

/// Largest magnitude of a world coordinate: far beyond any volume, yet its square is still a finite number.
pub(super) const MAX_COORDINATE: f64 = 1e30;

/// Shortest vector that still has a direction: its square does not underflow.
const MIN_LENGTH: f64 = 1e-100;

/// The numbers a field accepts.
#[derive(Clone, Copy)]
pub(super) enum Interval {
    /// Both ends belong to it.
    Closed(f64, f64),
    /// Neither end belongs to it.
    Open(f64, f64),
    /// Only the upper end belongs to it.
    OpenBelow(f64, f64),
}

/// Positive sizes in world units.
pub(super) const POSITIVE: Interval = Interval::OpenBelow(0.0, MAX_COORDINATE);

/// World coordinates.
pub(super) const COORDINATE: Interval = Interval::Closed(-MAX_COORDINATE, MAX_COORDINATE);

impl Interval {
    fn contains(self, x: f64) -> bool {
        match self {
            Self::Closed(low, high) => low <= x && x <= high,
            Self::Open(low, high) => low < x && x < high,
            Self::OpenBelow(low, high) => low < x && x <= high,
        }
    }
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let end = |x: f64| {
            if x.abs() >= 1e6 { format!("{x:e}") } else { x.to_string() }
        };
        match *self {
            Self::Closed(low, high) => write!(f, "[{}, {}]", end(low), end(high)),
            Self::Open(low, high) => write!(f, "({}, {})", end(low), end(high)),
            Self::OpenBelow(low, high) => write!(f, "({}, {}]", end(low), end(high)),
        }
    }
}

/// A number in an interval.
pub(super) fn number(path: impl fmt::Display, given: &Number, range: Interval) -> Result<f64, SceneError> {
    given
        .as_f64()
        .filter(|&x| range.contains(x))
        .ok_or_else(|| SceneError::invalid(path, format!("expected a number in {range}, got {given}")))
}

/// A number in an interval, or the default where the document has none.
pub(super) fn number_or(path: &str, given: Option<&Number>, range: Interval, default: f64) -> Result<f64, SceneError> {
    given.map_or(Ok(default), |given| number(path, given, range))
}

/// A whole number in `low..=high` (`6.0` is one), or the default where the document has none.
pub(super) fn whole_number_or(
    path: &str,
    given: Option<&Number>,
    (low, high): (u32, u32),
    default: u32,
) -> Result<u32, SceneError> {
    let Some(given) = given else { return Ok(default) };
    let x = given.as_f64().filter(|x| x.fract() == 0.0 && f64::from(low) <= *x && *x <= f64::from(high));
    x.map(|x| x as u32)
        .ok_or_else(|| SceneError::invalid(path, format!("expected a whole number in [{low}, {high}], got {given}")))
}

/// Three world coordinates.
pub(super) fn vector(path: impl fmt::Display, given: &Triple) -> Result<DVec3, SceneError> {
    let mut vector = DVec3::ZERO;
    for (axis, given) in given.iter().enumerate() {
        vector[axis] = number(format_args!("{path}[{axis}]"), given, COORDINATE)?;
    }
    Ok(vector)
}

/// The vector if it has a direction.
pub(super) fn nonzero(path: impl fmt::Display, vector: DVec3) -> Result<DVec3, SceneError> {
    if vector.length() >= MIN_LENGTH {
        Ok(vector)
    } else {
        Err(SceneError::invalid(path, "expected a vector that is not zero"))
    }
}

/// What has to be multiplied to a non-zero vector so that it has unit length. A vector of unit length up to
/// rounding stays as it is: otherwise reading what was written could change its last bit.
pub(super) fn unit_length_factor(vector: DVec3) -> f64 {
    let length = vector.length();
    if (length - 1.0).abs() < 1e-12 { 1.0 } else { 1.0 / length }
}

/// A colour, or the default where the document has none.
pub(super) fn color<T>(
    path: impl fmt::Display,
    given: Option<&str>,
    from_hex: fn(&str) -> Option<T>,
    default: T,
) -> Result<T, SceneError> {
    let Some(given) = given else { return Ok(default) };
    from_hex(given)
        .ok_or_else(|| SceneError::invalid(path, format!("expected a colour like \"#cc9966\", got {given:?}")))
}

/// The value that belongs to a name, or the default where the document has none.
pub(super) fn named_or<T: Copy>(
    path: &str,
    given: Option<&str>,
    names: &[(&str, T)],
    default: T,
) -> Result<T, SceneError> {
    let Some(given) = given else { return Ok(default) };
    names
        .iter()
        .find(|(name, _)| *name == given)
        .map(|&(_, value)| value)
        .ok_or_else(|| SceneError::invalid(path, format!("expected one of: {}; got {given:?}", listed(names))))
}

/// Like [`named_or`], for fields of which the contract has more names than this server implements.
pub(super) fn implemented_or<T: Copy>(
    path: &str,
    given: Option<&str>,
    (names, not_yet): (&[(&str, T)], &[&str]),
    default: T,
) -> Result<T, SceneError> {
    match given.filter(|given| not_yet.contains(given)) {
        Some(given) => Err(SceneError::not_implemented(
            path,
            format!("`{given}` is known, but this server does not implement it yet; available: {}", listed(names)),
        )),
        None => named_or(path, given, names, default),
    }
}

/// The name of a value, the inverse of [`named_or`].
pub(super) fn name_of<T: Copy + PartialEq>(value: T, names: &[(&'static str, T)]) -> &'static str {
    names.iter().find(|(_, v)| *v == value).map(|&(name, _)| name).expect("every variant is in its table of names")
}

/// A finite number as JSON.
pub(super) fn json_number(x: f64) -> Number {
    Number::from_f64(x).expect("numbers of a scene are finite")
}

/// Three numbers as JSON.
pub(super) fn json_triple(v: DVec3) -> Triple {
    v.to_array().map(json_number)
}

fn listed<T>(names: &[(&str, T)]) -> String {
    names.iter().map(|(name, _)| *name).collect::<Vec<_>>().join(", ")
}
