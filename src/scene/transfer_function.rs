//! The transfer function: colour and opacity over values in the file's units.

use super::Rgb;

/// Largest magnitude of a control point's value: the difference of two of them is still a finite number.
pub const MAX_VALUE: f64 = 1e300;

/// One point of the piecewise linear transfer function.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ControlPoint {
    /// In the volume's units; magnitude at most [`MAX_VALUE`].
    pub value: f64,
    /// sRGB-encoded.
    pub color: Rgb,
    /// In [0, 1], for a ray of length `opacity_unit_distance`.
    pub opacity: f64,
}

/// Piecewise linear between points, constant outside; two points at one value make a step, whose upper
/// point holds at the value itself.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferFunction {
    /// Sorted by value, at least one, at most two per value.
    pub points: Vec<ControlPoint>,
    /// World length that `opacity` is meant for; `None`: the volume's smallest spacing.
    pub opacity_unit_distance: Option<f64>,
}

impl TransferFunction {
    /// Makes points that were computed from a value range valid: where the range is so narrow that more than two
    /// of them fall on one value, the outer two make a step; `opacity_unit_distance` is that of the volume.
    pub(super) fn from_ascending(points: impl IntoIterator<Item = ControlPoint>) -> Self {
        let mut kept: Vec<ControlPoint> = Vec::new();
        for point in points {
            let point = ControlPoint { value: point.value.clamp(-MAX_VALUE, MAX_VALUE), ..point };
            match kept.as_mut_slice() {
                [.., a, b] if a.value == point.value => *b = point,
                _ => kept.push(point),
            }
        }
        Self { points: kept, opacity_unit_distance: None }
    }

    /// Colour and opacity at a value.
    pub fn sample(&self, value: f64) -> (Rgb, f64) {
        self.sample_above(self.points.partition_point(|p| p.value <= value), value)
    }

    /// The same for a caller who knows that `above` points are not above the value.
    pub(super) fn sample_above(&self, above: usize, value: f64) -> (Rgb, f64) {
        let (Some(b), Some(a)) = (self.points.get(above), above.checked_sub(1).map(|i| &self.points[i])) else {
            let p = if above == 0 { &self.points[0] } else { &self.points[above - 1] };
            return (p.color, p.opacity);
        };
        let t = (value - a.value) / (b.value - a.value);
        let mix = |x: f64, y: f64| x + (y - x) * t;
        let color = Rgb(std::array::from_fn(|c| mix(a.color.0[c], b.color.0[c])));
        (color, mix(a.opacity, b.opacity))
    }

    /// Opacity of a ray of world length `distance` through a place of the given value.
    pub fn opacity_over(&self, value: f64, distance: f64, smallest_spacing: f64) -> f64 {
        let (_, opacity) = self.sample(value);
        1.0 - (1.0 - opacity).powf(self.unit_distances_in(distance, smallest_spacing))
    }

    /// How many times `opacity_unit_distance` a ray of world length `distance` is.
    pub(super) fn unit_distances_in(&self, distance: f64, smallest_spacing: f64) -> f64 {
        distance / self.opacity_unit_distance.unwrap_or(smallest_spacing)
    }
}
