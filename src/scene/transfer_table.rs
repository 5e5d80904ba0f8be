//! Transfer functions as tables over the codes of a volume.

use super::{Rgb, TransferFunction};
use crate::volume::CodeMap;

/// Fewest entries where there are few codes, so that 8-bit volumes show no banding between codes.
const MIN_ENTRIES: u32 = 16_384;

/// Opacity of a voxel per code `0..=max_code`, in 1/65535: `1 - (1 - opacity)^(h / opacity_unit_distance)` for
/// one smallest spacing `h` (METHODS 1). Ambient occlusion classifies with it (METHODS 7: comparing two such
/// tables gives the changed codes).
pub fn opacity_table(transfer_function: &TransferFunction, code_map: &CodeMap, smallest_spacing: f64) -> Vec<u16> {
    let exponent = transfer_function.unit_distances_in(smallest_spacing, smallest_spacing);
    let mut walk = Walk::new(transfer_function, exponent);
    let codes = 0..=u32::from(code_map.max_code);
    codes.map(|code| (walk.step(code_map.value_from_code(f64::from(code))).1 * 65535.0).round() as u16).collect()
}

/// Colour and opacity for the ray caster.
///
/// Entry `t` stands for the value `lowest + step * t / entries_per_code` of the code map;
/// there are `max_code * entries_per_code + 1`, at most 65,536.
#[derive(Clone, Debug, PartialEq)]
pub struct TransferTable {
    /// Entries from one code to the next, at least 1.
    pub entries_per_code: u32,
    /// Opacity of one ray step, in [0, 1].
    pub opacity: Vec<f32>,
    /// sRGB-encoded straight colour, 8 bits each, red in the lowest byte, alpha 255.
    pub color: Vec<u32>,
    /// Item `t` counts the entries before `t` that are not fully transparent; one item more than entries.
    pub visible_prefix: Vec<u32>,
}

impl TransferTable {
    /// The table for ray steps of world length `step_length`.
    pub fn new(
        transfer_function: &TransferFunction,
        code_map: &CodeMap,
        step_length: f64,
        smallest_spacing: f64,
    ) -> Self {
        let max_code = u32::from(code_map.max_code);
        let entries_per_code = if max_code == 0 { 1 } else { (MIN_ENTRIES - 1).div_ceil(max_code) };
        let count = max_code * entries_per_code + 1;

        let mut walk = Walk::new(transfer_function, transfer_function.unit_distances_in(step_length, smallest_spacing));
        let mut table = Self {
            entries_per_code,
            opacity: Vec::with_capacity(count as usize),
            color: Vec::with_capacity(count as usize),
            visible_prefix: Vec::with_capacity(count as usize + 1),
        };
        let mut visible = 0;
        for entry in 0..count {
            let code = f64::from(entry) / f64::from(entries_per_code);
            let (color, opacity) = walk.step(code_map.value_from_code(code));
            let opacity = opacity as f32;
            table.opacity.push(opacity);
            table.color.push(color.to_packed());
            table.visible_prefix.push(visible);
            visible += u32::from(opacity > 0.0);
        }
        table.visible_prefix.push(visible);
        table
    }

    /// Whether any value between two codes, both included, is not fully transparent. `code_low <= code_high`;
    /// codes beyond the table count as its last.
    pub fn any_visible(&self, code_low: u16, code_high: u16) -> bool {
        let last = self.opacity.len() - 1;
        let entry = |code: u16| (usize::from(code) * self.entries_per_code as usize).min(last);
        self.visible_prefix[entry(code_high) + 1] > self.visible_prefix[entry(code_low)]
    }
}

/// Samples a transfer function at ascending values, in constant time each.
struct Walk<'a> {
    transfer_function: &'a TransferFunction,
    /// Ray length in opacity unit distances.
    exponent: f64,
    /// Points not above the last value.
    above: usize,
    /// The last opacity and what became of it: runs of one opacity are common and powers slow.
    last: (f64, f64),
}

impl<'a> Walk<'a> {
    fn new(transfer_function: &'a TransferFunction, exponent: f64) -> Self {
        Self { transfer_function, exponent, above: 0, last: (0.0, 0.0) }
    }

    /// Colour and opacity over the ray length; values must not descend.
    fn step(&mut self, value: f64) -> (Rgb, f64) {
        let points = &self.transfer_function.points;
        while points.get(self.above).is_some_and(|p| p.value <= value) {
            self.above += 1;
        }
        let (color, opacity) = self.transfer_function.sample_above(self.above, value);
        if opacity != self.last.0 {
            self.last = (opacity, 1.0 - (1.0 - opacity).powf(self.exponent));
        }
        (color, self.last.1)
    }
}
