//! Menger sponge: hard edges, holes at every scale.

/// 255 in the sponge, 0 in its holes.
///
/// The level is the deepest of which the shortest axis still has a voxel per cell: 5 for 243, 6 for 729.
pub(super) fn voxel(dims: [u32; 3]) -> impl Fn([u32; 3]) -> u8 + Sync {
    let shortest = dims.into_iter().min().unwrap_or(1);
    let cells = u64::from(3_u32.pow(shortest.max(1).ilog(3)));
    move |voxel| {
        let mut cell: [u64; 3] = std::array::from_fn(|a| u64::from(voxel[a]) * cells / u64::from(dims[a]));
        let mut left = cells;
        while left > 1 {
            // The middle third of two axes or more is a hole.
            if cell.iter().filter(|&&c| c % 3 == 1).count() >= 2 {
                return 0;
            }
            cell = cell.map(|c| c / 3);
            left /= 3;
        }
        255
    }
}
