//! Colours as text: `#rgb`, `#rrggbb`, and with alpha `#rrggbbaa`, sRGB-encoded.

use super::{Rgb, Rgba};

impl Rgb {
    /// White.
    pub const WHITE: Self = Self([1.0; 3]);

    /// Reads `#rgb` or `#rrggbb`; `None` for anything else.
    pub fn from_hex(text: &str) -> Option<Self> {
        match hex_digits(text)?.as_slice() {
            [r, g, b] => Some(Self([r, g, b].map(|digit| fraction(*digit, *digit)))),
            [r, s, g, h, b, c] => Some(Self([fraction(*r, *s), fraction(*g, *h), fraction(*b, *c)])),
            _ => None,
        }
    }

    /// Writes `#rrggbb`; the inverse of [`Rgb::from_hex`].
    pub fn to_hex(self) -> String {
        let [r, g, b] = self.0.map(byte);
        format!("#{r:02x}{g:02x}{b:02x}")
    }

    /// 8 bits per channel, red in the lowest byte, alpha 255.
    pub fn to_packed(self) -> u32 {
        let [r, g, b] = self.0.map(byte);
        u32::from_le_bytes([r, g, b, 255])
    }
}

impl Rgba {
    /// Reads `#rgb`, `#rrggbb` (both opaque) or `#rrggbbaa`; `None` for anything else.
    pub fn from_hex(text: &str) -> Option<Self> {
        let (color, alpha) = match hex_digits(text)?.as_slice() {
            [.., high, low] if text.len() == 9 => (text.get(..7)?, fraction(*high, *low)),
            _ => (text, 1.0),
        };
        let Rgb([r, g, b]) = Rgb::from_hex(color)?;
        Some(Self([r, g, b, alpha]))
    }

    /// Writes `#rrggbb`, or `#rrggbbaa` unless opaque; the inverse of [`Rgba::from_hex`].
    pub fn to_hex(self) -> String {
        let [r, g, b, alpha] = self.0;
        let color = Rgb([r, g, b]).to_hex();
        if alpha == 1.0 { color } else { format!("{color}{:02x}", byte(alpha)) }
    }
}

/// The digits after `#`.
fn hex_digits(text: &str) -> Option<Vec<u8>> {
    if text.len() > 9 {
        return None;
    }
    text.strip_prefix('#')?.chars().map(|c| c.to_digit(16).map(|digit| digit as u8)).collect()
}

fn fraction(high: u8, low: u8) -> f64 {
    f64::from(high * 16 + low) / 255.0
}

fn byte(fraction: f64) -> u8 {
    // `as` cuts and saturates; `round` is a slow call on the baseline x86-64, and tables are made per edit.
    (fraction * 255.0 + 0.5) as u8
}
