//! How large moving pictures are.

use std::time::Duration;

/// Time that a moving picture should take, from its order to the end of encoding.
const TARGET: Duration = Duration::from_millis(70);

/// Least size of a moving picture, as a share of each side.
const SMALLEST: f64 = 0.25;

/// Sizes are multiples of this share, so that they do not change with every picture.
const STEP: f64 = 0.125;

/// Follows the time that moving pictures take: smaller when they are late, larger when there is time to spare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Quality {
    scale: f64,
}

impl Quality {
    /// Half the size on adapters that compute on the CPU, all of it on others, until something is known.
    pub fn new(software: bool) -> Self {
        Self { scale: if software { 0.5 } else { 1.0 } }
    }

    /// Pixels of a moving picture for a view of `width` x `height`.
    pub fn moving_size(&self, width: u32, height: u32) -> [u32; 2] {
        [width, height].map(|side| ((f64::from(side) * self.scale).round() as u32).max(1))
    }

    /// Share of each side.
    pub fn scale(&self) -> f64 {
        self.scale
    }

    /// Takes into account how long a moving picture of the current size took.
    pub fn observe(&mut self, elapsed: Duration) {
        let ratio = TARGET.as_secs_f64() / elapsed.as_secs_f64().max(1e-3);
        // Time goes with the number of pixels. Between the limits the size stays: a little slack against flutter.
        let wanted = (self.scale * ratio.sqrt()).clamp(SMALLEST, 1.0);
        if ratio < 0.8 {
            self.scale = ((wanted / STEP).floor() * STEP).max(SMALLEST);
        } else if ratio > 1.6 {
            self.scale = (self.scale + STEP).min(((wanted / STEP).ceil() * STEP).min(1.0));
        }
    }
}
