// One level of box means, packed 2 x u16 (65535 = 1.0) to a word, x fastest. The first and the last two cells
// along every axis are zero, so that a clamped look-up outside the volume finds 0. Twin: ao/levels.rs.
struct LevelInfo {
    extent: vec3<u32>,     // cells stored along x, y, z
    row_words: u32,        // words between rows
    slice_words: u32,      // words between slices
    first_slice: u32,      // the slice at the start of the binding
    inverse_scale: f32,    // grid cells per voxel
    lookup_offset: f32,    // cells from a position, in cells, to where its box mean lies
}

fn low_half(word: u32) -> u32 {
    return word & 0xffffu;
}

fn high_half(word: u32) -> u32 {
    return word >> 16u;
}

// Mean of eight, rounded to nearest, for both halves of a word.
fn pack_means(sums: vec2<u32>) -> u32 {
    let means = (sums + vec2<u32>(4u)) >> vec2<u32>(3u);
    return means.x | (means.y << 16u);
}
