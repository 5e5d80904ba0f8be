//! How open the surfaces of a volume are: what automatic exposure is taken from.

use super::field::{OpacityField, voxel_count};

/// Share of the surface that is at most as open as the reference.
const QUANTILE: f64 = 0.8;

/// The accessibility, in [0, 1], that four fifths of the surface do not exceed; 1 where there is no surface.
///
/// A voxel belongs to the surface as far as it is clear and has an opaque face neighbour: by the weight
/// (1 - α) · max α of its six neighbours, 0 outside the volume. Of every axis only voxels 0, 2, 4, ... count.
/// `accessibility` is at every voxel centre, x fastest. The answer is the least A for which voxels that are at most
/// as open as A have four fifths of all weight.
///
/// The shader rounds weights to 1/255 and counts in 256 bins over √A, within which it takes A for evenly spread.
pub fn surface_reference(opacity: &OpacityField, accessibility: &[f64]) -> f64 {
    assert_eq!(accessibility.len(), voxel_count(opacity.dims), "one accessibility per voxel");
    let [nx, ny, nz] = opacity.dims.map(|n| n as usize);
    let mut weighed = Vec::new();
    for k in (0..nz).step_by(2) {
        for j in (0..ny).step_by(2) {
            for i in (0..nx).step_by(2) {
                let weight = surface_weight(opacity, [i, j, k].map(|v| v as i64));
                if weight > 0.0 {
                    weighed.push((accessibility[(k * ny + j) * nx + i], weight));
                }
            }
        }
    }
    weighed.sort_by(|a, b| a.0.total_cmp(&b.0));
    let wanted = QUANTILE * weighed.iter().map(|&(_, weight)| weight).sum::<f64>();
    let mut below = 0.0;
    for (accessibility, weight) in &weighed {
        below += weight;
        if below >= wanted {
            return *accessibility;
        }
    }
    weighed.last().map_or(1.0, |&(accessibility, _)| accessibility)
}

fn surface_weight(opacity: &OpacityField, voxel: [i64; 3]) -> f64 {
    let mut densest = 0.0_f64;
    for axis in 0..3 {
        for step in [-1, 1] {
            let mut neighbour = voxel;
            neighbour[axis] += step;
            densest = densest.max(opacity.at(neighbour));
        }
    }
    (1.0 - opacity.at(voxel)) * densest
}
