//! A transfer function for data that nothing is known about, from its histogram.

use super::presets::HOUNSFIELD_DEFAULT;
use super::{ControlPoint, HistogramView, Rgb, TransferFunction, VolumeFacts};

/// Bins that thresholds are searched in: enough for 8-bit data, few enough to be smooth for the rest.
const MAX_BINS: usize = 256;

/// Share of the voxels that may lie beyond either end of the searched range: a few outliers must not squeeze
/// everything else into a handful of bins.
const OUTLIERS: f64 = 1e-4;

/// A background peak lies in this lowest share of the range...
const BACKGROUND_RANGE: f64 = 0.3;

/// ...and holds at least this share of the voxels in its bin and the next.
const BACKGROUND_SHARE: f64 = 0.05;

/// A transfer function that shows what is in the volume: the preset for skin and bone if the values look like
/// Hounsfield units, a ramp over everything above the background otherwise.
pub fn automatic_transfer_function(facts: &VolumeFacts<'_>) -> TransferFunction {
    if looks_like_hounsfield(facts) {
        return HOUNSFIELD_DEFAULT.transfer_function(facts.value_range);
    }
    let bins = Bins::new(facts.histogram);
    let occupied = bins.counts.iter().filter(|&&count| count > 0.0).count();
    if occupied < 2 { haze(facts.value_range[0]) } else { foreground_ramp(&bins, facts.value_range[1]) }
}

/// Whether values are Hounsfield units: the range fits, there is air and soft tissue, and less between them.
pub fn looks_like_hounsfield(facts: &VolumeFacts<'_>) -> bool {
    let [lowest, highest] = facts.value_range;
    if !(-3100.0..=-900.0).contains(&lowest) || !(500.0..=35_000.0).contains(&highest) {
        return false;
    }
    let total: u64 = facts.histogram.counts.iter().sum();
    let share = |low: f64, high: f64| {
        let within = |bin: &usize| (low..high).contains(&facts.histogram.center(*bin));
        let bins = (0..facts.histogram.counts.len()).filter(within);
        bins.map(|bin| facts.histogram.counts[bin]).sum::<u64>() as f64 / total as f64
    };
    let (air, between, soft) = (share(-1150.0, -850.0), share(-700.0, -300.0), share(-200.0, 200.0));
    // A flat distribution, which many computed fields have, fills all three alike.
    air > 0.02 && soft > 0.02 && air + soft > 3.0 * between
}

/// One value everywhere: there is no structure, but the volume should not be invisible.
fn haze(value: f64) -> TransferFunction {
    TransferFunction::from_ascending([control_point(value, "#e8c9a0", 0.05)])
}

/// From transparent at the background through the two classes of what is above it.
fn foreground_ramp(bins: &Bins, highest: f64) -> TransferFunction {
    let background = bins.background_peak();
    let floor = match background {
        Some(peak) => bins.knee_above(peak),
        None => bins.otsu_split(0),
    };
    let split = bins.otsu_split(floor);
    let lower = bins.mean(floor, split).unwrap_or(bins.edge(floor));
    let upper = bins.mean(split, bins.counts.len()).unwrap_or(lower);
    // A surface against the background is half-way between the two.
    let surface = background.map_or(bins.edge(floor), |peak| bins.edge(floor).max((bins.center(peak) + lower) * 0.5));
    let start = surface - (surface - bins.edge(floor)) * 0.3;
    let mut last = f64::NEG_INFINITY;
    let mut point = |value: f64, color, opacity| {
        last = value.max(last);
        control_point(last, color, opacity)
    };
    TransferFunction::from_ascending([
        point(start, "#7a3b26", 0.0),
        point(surface, "#b8683f", 0.06),
        point(lower, "#d99e6a", 0.3),
        point(bins.edge(split), "#e8c193", 0.5),
        point(upper, "#f3dfc0", 0.85),
        point(highest, "#fffaf0", 0.95),
    ])
}

fn control_point(value: f64, color: &str, opacity: f64) -> ControlPoint {
    ControlPoint { value, color: Rgb::from_hex(color).expect("the colours above are well-formed"), opacity }
}

/// A histogram of at most [`MAX_BINS`] bins without outliers.
struct Bins {
    counts: Vec<f64>,
    /// Lower edge of the first bin, upper edge of the last.
    range: [f64; 2],
}

impl Bins {
    fn new(histogram: HistogramView<'_>) -> Self {
        let fine = histogram.counts;
        let total: f64 = fine.iter().map(|&count| count as f64).sum();
        let beyond = |counts: &mut dyn Iterator<Item = &u64>| {
            let mut seen = 0.0;
            let within = |count: &&u64| {
                seen += **count as f64;
                seen <= total * OUTLIERS
            };
            counts.take_while(within).count()
        };
        let mut first = beyond(&mut fine.iter());
        let mut last = fine.len() - beyond(&mut fine.iter().rev()).min(fine.len());
        if last <= first + 1 {
            // What is left is one bin: the outliers are all there is to see.
            (first, last) = (0, fine.len());
        }
        let width = (last - first).div_ceil(MAX_BINS).max(1);
        let counts = fine[first..last].chunks(width).map(|chunk| chunk.iter().sum::<u64>() as f64);
        let counts: Vec<f64> = counts.collect();
        let edge = |bin: usize| histogram.value_at(bin as f64 / fine.len().max(1) as f64);
        let range = [edge(first), edge(first + counts.len() * width)];
        Self { counts, range }
    }

    /// Lower edge of a bin.
    fn edge(&self, bin: usize) -> f64 {
        let fraction = bin as f64 / self.counts.len() as f64;
        self.range[0] * (1.0 - fraction) + self.range[1] * fraction
    }

    fn center(&self, bin: usize) -> f64 {
        (self.edge(bin) + self.edge(bin + 1)) * 0.5
    }

    /// Mean value of the voxels in `first..last`.
    fn mean(&self, first: usize, last: usize) -> Option<f64> {
        let total: f64 = self.counts[first..last].iter().sum();
        let weighted = (first..last).map(|bin| self.counts[bin] / total * self.center(bin));
        (total > 0.0).then(|| weighted.sum())
    }

    /// The bin of the background, if there is a clear one at the low end.
    fn background_peak(&self) -> Option<usize> {
        let low_end = ((self.counts.len() as f64 * BACKGROUND_RANGE) as usize).max(1);
        let peak = (0..low_end).max_by(|&a, &b| self.counts[a].total_cmp(&self.counts[b]))?;
        let around = self.counts[peak] + self.counts.get(peak + 1).unwrap_or(&0.0);
        let total: f64 = self.counts.iter().sum();
        (around >= BACKGROUND_SHARE * total).then_some(peak)
    }

    /// The bin where a peak's upper flank ends: the farthest below the line from the peak to the highest
    /// occupied bin (Zack, Rogers and Latt 1977, the triangle method).
    fn knee_above(&self, peak: usize) -> usize {
        let last = self.counts.iter().rposition(|&count| count > 0.0).unwrap_or(peak);
        let (height, end) = (self.counts[peak], self.counts[last]);
        let below_line = |bin: usize| {
            let t = (bin - peak) as f64 / (last - peak).max(1) as f64;
            height + (end - height) * t - self.counts[bin]
        };
        (peak + 1..=last).max_by(|&a, &b| below_line(a).total_cmp(&below_line(b))).unwrap_or(peak)
    }

    /// The first bin of the upper of two classes in `first..` (Otsu 1979: greatest variance between classes).
    /// Counts enter by their square root, so that a large class does not hide a small one.
    fn otsu_split(&self, first: usize) -> usize {
        let weights: Vec<f64> = self.counts[first..].iter().map(|count| count.sqrt()).collect();
        let total: f64 = weights.iter().sum();
        let moment: f64 = weights.iter().enumerate().map(|(bin, weight)| bin as f64 * weight).sum();
        let (mut below, mut moment_below) = (0.0, 0.0);
        let mut best = (0.0, 0);
        for (bin, weight) in weights.iter().enumerate() {
            let above = total - below;
            if below > 0.0 && above > 0.0 {
                let between = (moment_below / below - (moment - moment_below) / above).powi(2) * below * above;
                if between > best.0 {
                    best = (between, bin);
                }
            }
            below += weight;
            moment_below += bin as f64 * weight;
        }
        first + best.1
    }
}
