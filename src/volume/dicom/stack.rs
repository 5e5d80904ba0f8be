//! Slices in their order, and where they are in the patient.

use glam::DVec3;

use super::image::Slice;
use crate::volume::{Grid, VolumeError};

/// Cosines and positions in files have few digits.
const SAME_DIRECTION: f64 = 1e-3;

/// Relative deviation from even spacing, and from the same spacing in all slices, that nobody needs to know.
const EVEN: f64 = 0.02;

/// Sorts the slices of a series from feet to head (along the normal of their plane) and finds their grid.
///
/// Positions decide, never numbers or names of files. Slices that drift sideways (a tilted gantry) give an oblique
/// grid. Returns the grid and whether its axes are the patient's.
///
/// # Errors
/// Names the element in which the slices differ or that is missing.
pub(super) fn stack(slices: &mut [Slice], notes: &mut Vec<String>) -> Result<(Grid, bool), VolumeError> {
    check_alike(slices)?;
    let first = &slices[0];
    let count = slices.len();
    let dims = [u32::from(first.size[0]), u32::from(first.size[1]), count as u32];
    let [across, down] = first.spacing.unwrap_or_else(|| {
        notes.push("The file does not say how far apart voxels are (PixelSpacing); taken as 1 mm.".into());
        [1.0; 2]
    });
    let one_file = slices.iter().all(|slice| slice.file == first.file);
    let thickness = first.thickness.unwrap_or(1.0);
    let placed = slices.iter().all(|slice| slice.position.is_some());
    let spacing = DVec3::new(across, down, thickness);
    let (Some([row, column]), true) = (first.orientation, placed) else {
        if count > 1 && !one_file {
            let missing = if placed { "ImageOrientationPatient" } else { "ImagePositionPatient" };
            let message = "missing; without it the slices cannot be put in order";
            return Err(VolumeError::malformed(missing, message));
        }
        if count > 1 {
            notes.push(format!(
                "The frames have no positions: they are stacked in the file's order, {thickness} mm apart; \
                 they may be moments and not slices."
            ));
        }
        return Ok((Grid::axis_aligned(dims, spacing), false));
    };
    let normal = row.cross(column).normalize();
    let position = |slice: &Slice| slice.position.unwrap_or_default();
    slices.sort_by(|a, b| normal.dot(position(a)).total_cmp(&normal.dot(position(b))));
    let positions: Vec<DVec3> = slices.iter().map(position).collect();
    let origin = positions[0];
    let direction = |z: DVec3| [row, column, z];
    if count == 1 {
        return Ok((Grid { dims, spacing, origin, direction: direction(normal) }, true));
    }
    check_distinct(&positions, normal)?;
    let step = (positions[count - 1] - origin) / (count - 1) as f64;
    note_unevenness(&positions, normal, step, notes);
    let tilt = (step.length() / normal.dot(step)).clamp(-1e9, 1e9);
    if tilt > 1.0 + 1e-6 {
        let degrees = tilt.recip().acos().to_degrees();
        notes
            .push(format!("The slices drift sideways by {degrees:.1} degrees (a tilted gantry): the grid is oblique."));
    }
    let spacing = DVec3::new(across, down, step.length());
    Ok((Grid { dims, spacing, origin, direction: direction(step.normalize()) }, true))
}

fn check_alike(slices: &[Slice]) -> Result<(), VolumeError> {
    let first = &slices[0];
    for slice in slices {
        if slice.size != first.size {
            let ([a, b], [c, d]) = (first.size, slice.size);
            let message = format!("the series has slices of {b} x {a} and of {d} x {c} voxels; expected one size");
            return Err(VolumeError::malformed("Rows", message));
        }
        let turned = match (first.orientation, slice.orientation) {
            (Some([a, b]), Some([c, d])) => a.distance(c) > SAME_DIRECTION || b.distance(d) > SAME_DIRECTION,
            (a, b) => a.is_some() != b.is_some(),
        };
        if turned {
            let message = "the slices lie in different planes; expected parallel ones";
            return Err(VolumeError::malformed("ImageOrientationPatient", message));
        }
        let differs = |a: f64, b: f64| (a - b).abs() > EVEN * a.abs();
        let scaled = match (first.spacing, slice.spacing) {
            (Some([a, b]), Some([c, d])) => differs(a, c) || differs(b, d),
            (a, b) => a.is_some() != b.is_some(),
        };
        if scaled {
            let message = "the slices have different spacings; expected one";
            return Err(VolumeError::malformed("PixelSpacing", message));
        }
    }
    Ok(())
}

fn check_distinct(positions: &[DVec3], normal: DVec3) -> Result<(), VolumeError> {
    let count = positions.len();
    let length = normal.dot(positions[count - 1] - positions[0]);
    let same = |pair: &&[DVec3]| normal.dot(pair[1] - pair[0]) <= 1e-3 * length / (count - 1) as f64;
    let repeated = positions.windows(2).filter(same).count();
    if repeated == 0 {
        return Ok(());
    }
    let message = format!(
        "{repeated} of {count} slices are where another one is (moments, echoes or a second copy); \
         expected one slice at each position"
    );
    Err(VolumeError::malformed("ImagePositionPatient", message))
}

fn note_unevenness(positions: &[DVec3], normal: DVec3, step: DVec3, notes: &mut Vec<String>) {
    let mut gaps: Vec<f64> = positions.windows(2).map(|pair| normal.dot(pair[1] - pair[0])).collect();
    gaps.sort_by(f64::total_cmp);
    let (shortest, longest, median) = (gaps[0], gaps[gaps.len() - 1], gaps[gaps.len() / 2]);
    let off = |(k, p): (usize, &DVec3)| p.distance(positions[0] + step * k as f64);
    let farthest = positions.iter().enumerate().map(off).fold(0.0, f64::max);
    if longest - shortest <= 2.0 * EVEN * median && farthest <= 5.0 * EVEN * step.length() {
        return;
    }
    // A gap of twice or three times the usual one.
    let missing: f64 = gaps.iter().map(|gap| ((gap / median).round() - 1.0).clamp(0.0, 1e6)).sum();
    let missing = match missing as u64 {
        0 => String::new(),
        1 => " 1 slice seems to be missing.".into(),
        n => format!(" {n} slices seem to be missing."),
    };
    notes.push(format!(
        "The slices are between {shortest:.3} and {longest:.3} mm apart.{missing} They are stacked evenly, {:.3} mm \
         apart, so that a slice may be {farthest:.3} mm from its true place.",
        step.length()
    ));
}
