//! How values in the file's units become the unsigned codes stored on the GPU, and back.

/// `value = lowest + code * step`, with codes 0..=`max_code`.
///
/// Integer data whose range spans at most 65,536 values keeps every value (`step` 1, `lossless`);
/// everything else is mapped to 16 bits over its range.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CodeMap {
    /// The lowest value of the volume, code 0.
    pub lowest: f64,
    /// The highest value of the volume, code `max_code`; kept because `lowest + max_code * step` is rounded.
    pub highest: f64,
    /// Value difference between neighbouring codes; positive, 1 for a constant volume.
    pub step: f64,
    /// The code of the highest value: 0..=65535.
    pub max_code: u16,
    /// No two different values share a code.
    pub lossless: bool,
}

/// Integers up to here are exact as `f64`.
const EXACT_INTEGER: f64 = 9_007_199_254_740_992.0;

/// The highest code there can be.
const HIGHEST_CODE: f64 = 65535.0;

impl CodeMap {
    /// The map for integer voxels with the given range.
    pub fn for_integers(lowest: f64, highest: f64) -> Self {
        let exact = lowest.abs() <= EXACT_INTEGER && highest.abs() <= EXACT_INTEGER;
        if exact && highest - lowest <= HIGHEST_CODE {
            Self { lowest, highest, step: 1.0, max_code: (highest - lowest) as u16, lossless: true }
        } else {
            // Beyond 2^53 the range itself is rounded, and one `f64` may stand for several integers.
            Self { lossless: false, ..Self::for_floats(lowest, highest) }
        }
    }

    /// The map for floating-point voxels with the given finite range.
    pub fn for_floats(lowest: f64, highest: f64) -> Self {
        if highest <= lowest {
            return Self { lowest, highest: lowest, step: 1.0, max_code: 0, lossless: true };
        }
        let span = highest - lowest;
        if span.is_infinite() {
            // Quotients first: the difference of two finite numbers can overflow, that of their quotients cannot.
            let step = highest / HIGHEST_CODE - lowest / HIGHEST_CODE;
            return Self { lowest, highest, step, max_code: u16::MAX, lossless: false };
        }
        let mut step = span / HIGHEST_CODE;
        if step < f64::MIN_POSITIVE {
            // Subnormal steps are coarse, down to 0: rounded up, the highest value still has a code, if a lower one.
            let steps = (span / f64::from_bits(1)).ceil();
            step = (steps / HIGHEST_CODE).ceil() * f64::from_bits(1);
        }
        Self { lowest, highest, step, max_code: (span / step).round() as u16, lossless: false }
    }

    /// Bytes per voxel on the GPU: 1 or 2.
    pub fn bytes_per_voxel(&self) -> u64 {
        if self.max_code <= 255 { 1 } else { 2 }
    }

    /// The nearest code; NaN and values below the range give 0.
    #[inline]
    pub fn code_from_value(&self, value: f64) -> u16 {
        let offset = value - self.lowest;
        let code = if offset.is_finite() { offset / self.step } else { value / self.step - self.lowest / self.step };
        // `as` truncates, saturates and sends NaN to 0, which is what is wanted; adding a half rounds without a
        // call into the maths library on processors that lack the instruction.
        ((code + 0.5) as u16).min(self.max_code)
    }

    /// The value a code stands for; fractional codes lie between.
    pub fn value_from_code(&self, code: f64) -> f64 {
        let value = self.lowest + code * self.step;
        // `code * step` overflows when the range is wider than the largest finite number.
        if value.is_finite() {
            return value;
        }
        let half = 0.5 * self.lowest + code * (0.5 * self.step);
        (2.0 * half).min(self.highest).max(self.lowest)
    }

    /// `[lowest, highest]` value of the volume.
    pub fn value_range(&self) -> [f64; 2] {
        [self.lowest, self.highest]
    }

    /// The normalised value of METHODS 1, in [0, 1] for values in the range; 0 everywhere in a constant volume.
    pub fn normalised(&self, value: f64) -> f64 {
        let span = self.highest - self.lowest;
        if span <= 0.0 {
            0.0
        } else if span.is_finite() {
            (value - self.lowest) / span
        } else {
            (0.5 * value - 0.5 * self.lowest) / (0.5 * self.highest - 0.5 * self.lowest)
        }
    }
}
