//! Pre-integration: what a piece of ray contributes along which the value runs linearly.
//!
//! Between two samples everything follows from the values at its ends, so that opacity and place of a steep surface
//! do not depend on where samples happen to fall.

use crate::scene::TransferFunction;

/// Optical depth of one step from which a value is opaque: 1 - e^-20 of the light is gone.
const OPAQUE_DEPTH: f64 = 20.0;

/// Opacities closer than this have the optical depth of their middle.
const SAME_OPACITY: f64 = 1e-5;

/// Optical depth τ(v) = min(-ln(1 - α(v)), 20) of one step of a ray at a value v, α being the opacity for that step.
#[derive(Clone, Copy, Debug)]
pub struct OpticalDepth<'a> {
    transfer: &'a TransferFunction,
    /// Length of a step in opacity unit distances.
    unit_distances: f64,
}

impl<'a> OpticalDepth<'a> {
    /// For steps of world length `step`.
    pub fn new(transfer: &'a TransferFunction, step: f64, smallest_spacing: f64) -> Self {
        let unit = transfer.opacity_unit_distance.unwrap_or(smallest_spacing);
        Self { transfer, unit_distances: step / unit }
    }

    /// τ at a value in the file's units, 0 to 20.
    pub fn at(&self, value: f64) -> f64 {
        self.of_opacity(self.transfer.sample(value).1)
    }

    /// Mean of τ over the values between `a` and `b`, in any order; τ(a) where they are equal.
    ///
    /// Exact: opacity is linear between neighbouring control points. The shader takes the mean over the entries of
    /// its table from one value's to the other's, both included.
    pub fn mean(&self, a: f64, b: f64) -> f64 {
        let (low, high) = (a.min(b), a.max(b));
        if low == high {
            return self.at(a);
        }
        let points = self.transfer.points.iter().map(|point| point.value);
        let (mut from, mut sum) = (low, 0.0);
        for to in points.filter(|&value| low < value && value < high).chain([high]) {
            sum += (to - from) * self.mean_between_points(from, to);
            from = to;
        }
        sum / (high - low)
    }

    /// Where on a segment from value `a` to value `b`, `steps` steps long, half of its contribution
    /// α = 1 - e^-depth lies in front: the share s in [0, 1] with 1 - e^-(depth in front of s) = α / 2.
    ///
    /// There a segment is coloured and lit: the front of an opaque one, the middle of a faint one. The segment must
    /// contribute something. The shader bisects three times and then takes a secant.
    pub fn half_way(&self, a: f64, b: f64, steps: f64) -> f64 {
        let depth = steps * self.mean(a, b);
        let wanted = -(0.5 * (-depth).exp_m1()).ln_1p();
        let (mut low, mut high) = (0.0, 1.0);
        for _ in 0..50 {
            let middle = 0.5 * (low + high);
            if steps * middle * self.mean(a, a + (b - a) * middle) < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        0.5 * (low + high)
    }

    /// Mean of τ between two values with no control point between them.
    fn mean_between_points(&self, from: f64, to: f64) -> f64 {
        // From inside, because the ends may lie on a step.
        let inside = |share: f64| self.transfer.sample(from + (to - from) * share).1;
        let half_change = inside(0.75) - inside(0.25);
        let first = (inside(0.25) - 0.5 * half_change).clamp(0.0, 1.0);
        let last = (inside(0.75) + 0.5 * half_change).clamp(0.0, 1.0);
        if (last - first).abs() < SAME_OPACITY {
            return self.of_opacity(0.5 * (first + last));
        }
        (self.integral(last) - self.integral(first)) / (last - first)
    }

    /// τ of an opacity for one unit distance.
    fn of_opacity(&self, opacity: f64) -> f64 {
        (-self.unit_distances * (-opacity).ln_1p()).min(OPAQUE_DEPTH)
    }

    /// ∫ τ over opacities (for one unit distance) from 0 to `opacity`: with u = 1 - opacity the integral of
    /// -ln u is 1 - u + u ln u, as far as τ is not capped.
    fn integral(&self, opacity: f64) -> f64 {
        let capped_from = -(-OPAQUE_DEPTH / self.unit_distances).exp_m1();
        let o = opacity.min(capped_from);
        // At o = 1 the product is 0 · ∞; its limit is 0.
        let product = if o < 1.0 { (1.0 - o) * (-o).ln_1p() } else { 0.0 };
        self.unit_distances * (o + product) + OPAQUE_DEPTH * (opacity - o)
    }
}
