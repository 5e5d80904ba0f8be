//! The work of one build as a list of steps, each a dispatch of bounded size.

use std::ops::Range;

use super::levels::{LevelLayout, mip_levels};
use crate::scene::{AmbientOcclusion, AoMethod, Radius};

/// Cells of the largest step: a fraction of a second even on two CPU cores, so that another scene never waits longer
/// for its turn.
const STEP_CELLS: u64 = 4 << 20;

/// Samples of the largest step, likewise: each takes look-ups in all levels.
const STEP_SAMPLES: u64 = 1 << 20;

/// One dispatch. Ranges are slices (z) of the step's target, except for `Trace`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Step {
    /// Opacity of voxels into level 0.
    Classify(Range<u32>),
    /// A level made by halving the one before.
    Mipmap(u32, Range<u32>),
    /// An N-buffer level from the one before.
    NBuffer(u32, Range<u32>),
    /// Accessibility from all levels.
    Combine(Range<u32>),
    /// Ray-traced accessibility of rows (counted through the slices) of the volume; cut up as it runs, since
    /// the cost of a row is only known once one has been traced.
    Trace(Range<u32>),
}

/// Steps of a build in order. `largest_binding` is the adapter's limit in bytes. `None` when a step cannot be
/// made small enough for it.
pub fn plan(
    dims: [u32; 3],
    settings: &AmbientOcclusion,
    layouts: &[LevelLayout],
    largest_binding: u64,
) -> Option<Vec<Step>> {
    let mut steps = Vec::new();
    let Some(first) = layouts.first() else { return Some(steps) };
    // A level's source needs up to half a window more than its target.
    let thickness = |layout: &LevelLayout, margin: u32| {
        let fitting = (largest_binding / layout.slice_bytes()).checked_sub(u64::from(margin))?;
        let cells = u64::from(layout.extent[0]) * u64::from(layout.extent[1]);
        Some(u32::try_from((STEP_CELLS / cells).clamp(1, fitting.max(1))).unwrap_or(u32::MAX)).filter(|_| fitting > 0)
    };
    steps.extend(slabs(first.extent[2], thickness(first, 0)?).map(Step::Classify));
    // Padded rows count in full: they fill the buffer of samples, and bound the rows of a dispatch.
    let slice = 2 * u64::from(sample_row_words(dims)) * u64::from(dims[1]);
    let samples_fit = |slices: u32| 2 * slice * u64::from(slices) <= largest_binding;
    if settings.method == AoMethod::Raytraced {
        steps.push(Step::Trace(0..dims[1] * dims[2]));
        let fits = samples_fit(1) && trace_window_fits(dims, settings, first, largest_binding);
        return fits.then_some(steps);
    }
    for (level, layout) in (0..).zip(layouts).skip(1) {
        if level <= mip_levels(settings) {
            let source = &layouts[level as usize - 1];
            // Two source slices to a target slice.
            let most = (largest_binding / source.slice_bytes()).checked_sub(2)? / 2;
            let thick = thickness(layout, 0)?.min(u32::try_from(most).unwrap_or(u32::MAX));
            steps.extend(slabs(layout.extent[2], Some(thick).filter(|&t| t > 0)?).map(|s| Step::Mipmap(level, s)));
        } else {
            let thick = thickness(layout, layout.width / 2 + 1)?;
            steps.extend(slabs(layout.extent[2], thick).map(|s| Step::NBuffer(level, s)));
        }
    }
    let mut thick = u32::try_from(STEP_SAMPLES / slice).unwrap_or(u32::MAX).max(1);
    let windows_fit = |slab: Range<u32>| combine_window_fits(&slab, settings, layouts, largest_binding);
    while !samples_fit(thick.min(dims[2])) || !slabs(dims[2], thick).all(windows_fit) {
        thick = Some(thick / 2).filter(|&t| t > 0)?;
    }
    steps.extend(slabs(dims[2], thick).map(Step::Combine));
    Some(steps)
}

/// Words, two samples each, between rows of the buffer of samples: rows of a buffer that is copied to a texture
/// begin at multiples of 256 bytes.
pub(super) fn sample_row_words(dims: [u32; 3]) -> u32 {
    dims[0].div_ceil(2).next_multiple_of(64)
}

/// Slices of level `level` that combining the samples of `slab` looks up.
pub(super) fn combine_window(
    slab: &Range<u32>,
    settings: &AmbientOcclusion,
    level: u32,
    layout: &LevelLayout,
) -> Range<u32> {
    // Half a difference of values in [0, 1]: n is at most 1/2 along an axis, a look-up at most f * 2^l / 4 away.
    let reach = settings.normal_factor * f64::from(1_u32 << level) * 0.25;
    layout.slices_around(f64::from(slab.start) + 0.5 - reach, f64::from(slab.end) - 0.5 + reach)
}

fn combine_window_fits(
    slab: &Range<u32>,
    settings: &AmbientOcclusion,
    layouts: &[LevelLayout],
    largest_binding: u64,
) -> bool {
    (0..).zip(layouts).all(|(level, layout)| {
        combine_window(slab, settings, level, layout).len() as u64 * layout.slice_bytes() <= largest_binding
    })
}

/// Slices of level 0 that rays from `rows` can meet.
pub(super) fn trace_window(
    dims: [u32; 3],
    rows: &Range<u32>,
    settings: &AmbientOcclusion,
    layout: &LevelLayout,
) -> Range<u32> {
    let reach = reach_in_voxels(settings).unwrap_or(f64::from(dims[2]));
    let (first, last) = (rows.start / dims[1], (rows.end - 1) / dims[1]);
    layout.slices_around(f64::from(first) + 0.5 - reach, f64::from(last) + 0.5 + reach)
}

fn trace_window_fits(dims: [u32; 3], settings: &AmbientOcclusion, layout: &LevelLayout, largest_binding: u64) -> bool {
    let middle = dims[2] / 2 * dims[1];
    let slices = trace_window(dims, &(middle..middle + 1), settings, layout).len() as u64;
    slices * layout.slice_bytes() <= largest_binding
}

/// Max-norm distance at which reference rays end; `None`: at the volume's border (METHODS 3).
pub(super) fn reach_in_voxels(settings: &AmbientOcclusion) -> Option<f64> {
    match settings.radius {
        Radius::SameAsLevels => Some(f64::from(1_u32 << settings.levels) * 0.5),
        Radius::Voxels(reach) => Some(reach),
        Radius::Unlimited => None,
    }
}

fn slabs(slices: u32, thickness: u32) -> impl Iterator<Item = Range<u32>> {
    (0..slices).step_by(thickness as usize).map(move |start| start..slices.min(start.saturating_add(thickness)))
}
