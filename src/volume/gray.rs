//! Grey pictures of values on the CPU: resampled to square pixels, seen through a window.

use rayon::prelude::*;

/// A picture of 8-bit grey.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct GrayPicture {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
    /// Rows from the top, left to right.
    pub pixels: Vec<u8>,
}

/// What the pixels of one row or column take from the samples: the first sample and the weights from there on.
struct Taps {
    first: usize,
    weights: Vec<f64>,
}

/// Resamples `samples` evenly spaced samples to `pixels` pixels over the same length: linearly where there are more pixels
/// than samples, else by a tent as wide as two pixels, so that nothing between pixels is lost. Beyond the ends, the
/// last samples go on.
fn taps(samples: usize, pixels: usize) -> Vec<Taps> {
    let scale = samples as f64 / pixels as f64;
    let reach = scale.max(1.0);
    let last = samples as i64 - 1;
    let of_pixel = |pixel: usize| {
        let center = (pixel as f64 + 0.5) * scale - 0.5;
        let (from, to) = ((center - reach).ceil() as i64, (center + reach).floor() as i64);
        let first = from.clamp(0, last);
        let mut weights = vec![0.0; (to.clamp(0, last) - first + 1) as usize];
        for sample in from..=to {
            weights[(sample.clamp(0, last) - first) as usize] += 1.0 - (sample as f64 - center).abs() / reach;
        }
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum);
        Taps { first: first as usize, weights }
    };
    (0..pixels).map(of_pixel).collect()
}

/// A picture of `samples` (across, down) values. `read_row` replaces the values of one row, the top one being 0; `low` is
/// shown black, `high` white, and values between them in proportion, rounded to the nearest grey.
pub(super) fn gray_picture(
    samples: [usize; 2],
    [width, height]: [u32; 2],
    [low, high]: [f64; 2],
    read_row: impl Fn(usize, &mut [f64]) + Sync,
) -> GrayPicture {
    let (across, down) = (taps(samples[0], width as usize), taps(samples[1], height as usize));
    let mut pixels = vec![0; width as usize * height as usize];
    // Halves first: the difference of two finite numbers can overflow.
    let gray = |value: f64| (0.5 * value - 0.5 * low) / (0.5 * high - 0.5 * low) * 255.0;
    let rows = pixels.par_chunks_mut(width as usize).zip(down);
    // Down before across: besides the picture only two rows of samples are held.
    rows.for_each_init(
        || (vec![0.0; samples[0]], vec![0.0; samples[0]]),
        |(row, mean), (out, down)| {
            mean.fill(0.0);
            for (y, weight) in (down.first..).zip(&down.weights).filter(|(_, weight)| **weight > 0.0) {
                read_row(y, row);
                mean.iter_mut().zip(&*row).for_each(|(sum, value)| *sum += weight * value);
            }
            for (pixel, taps) in out.iter_mut().zip(&across) {
                let values = &mean[taps.first..];
                let value: f64 = values.iter().zip(&taps.weights).map(|(value, weight)| value * weight).sum();
                // `as` saturates.
                *pixel = gray(value).round() as u8;
            }
        },
    );
    GrayPicture { width, height, pixels }
}

impl GrayPicture {
    /// The same picture within a square of `side` pixels, in proportion; never enlarged.
    #[must_use]
    pub fn shrunk(&self, side: u32) -> Self {
        let longest = self.width.max(self.height);
        if longest <= side {
            return self.clone();
        }
        let scaled = |n: u32| (f64::from(n) * f64::from(side) / f64::from(longest)).round().max(1.0) as u32;
        let across = self.width as usize;
        gray_picture(
            [across, self.height as usize],
            [scaled(self.width), scaled(self.height)],
            [0.0, 255.0],
            |y, row| {
                row.iter_mut().zip(&self.pixels[y * across..]).for_each(|(value, pixel)| *value = f64::from(*pixel))
            },
        )
    }
}
