//! Boxes of which no two axes have the same: a flipped or swapped axis shows at once.

use super::{dims_vec, voxel_centre};

/// First corner, last corner (in eighths of the volume) and value.
///
/// A cube at the corner of index (0, 0, 0); from it, one long box along x, two shorter ones along y, three short ones
/// along z. Each axis has its own value, and each box begins at low coordinates.
const BOXES: [([f64; 3], [f64; 3], u8); 7] = [
    ([0.5, 0.5, 0.5], [1.5, 1.5, 1.5], 60),
    ([2.0, 0.5, 0.5], [7.5, 1.5, 1.5], 110),
    ([0.5, 2.0, 0.5], [1.5, 4.0, 1.5], 160),
    ([0.5, 4.5, 0.5], [1.5, 6.5, 1.5], 160),
    ([0.5, 0.5, 2.0], [1.5, 1.5, 3.0], 255),
    ([0.5, 0.5, 3.5], [1.5, 1.5, 4.5], 255),
    ([0.5, 0.5, 5.0], [1.5, 1.5, 6.0], 255),
];

/// The value of the box that a voxel's centre is in, 0 outside all of them.
pub(super) fn voxel(dims: [u32; 3]) -> impl Fn([u32; 3]) -> u8 + Sync {
    let scale = 8.0 / dims_vec(dims);
    move |voxel| {
        let p = (voxel_centre(voxel) * scale).to_array();
        let inside = |first: &[f64; 3], last: &[f64; 3]| (0..3).all(|a| (first[a]..last[a]).contains(&p[a]));
        BOXES.iter().find(|(first, last, _)| inside(first, last)).map_or(0, |(.., value)| *value)
    }
}
