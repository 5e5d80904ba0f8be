// Mip level l from level l - 1: each cell is the mean of 2 x 2 x 2, zero beyond the border (METHODS 2).
// Twin: reference/mipmap.rs.
#import common/levels

struct MipmapParams {
    source: LevelInfo,
    target_level: LevelInfo,
    first_slice: u32,
    slice_count: u32,
}

@group(0) @binding(0) var<uniform> params: MipmapParams;
@group(0) @binding(1) var<storage, read> source: array<u32>;
@group(0) @binding(2) var<storage, read_write> target_level: array<u32>;

fn source_word(word: i32, row: i32, slice: i32) -> u32 {
    let extent = params.source.extent;
    let words = (extent.x + 1u) / 2u;
    // Negative indices wrap to large ones.
    if u32(word) >= words || u32(row) >= extent.y || u32(slice) >= extent.z {
        return 0u;
    }
    let start = (u32(slice) - params.source.first_slice) * params.source.slice_words;
    return source[start + u32(row) * params.source.row_words + u32(word)];
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let extent = params.target_level.extent;
    if id.x >= (extent.x + 1u) / 2u || id.y >= extent.y || id.z >= params.slice_count {
        return;
    }
    let slice = id.z + params.first_slice;
    // Target cell c covers source cells 2c - 1 and 2c, since cell c of either level is window c - 1.
    let word = 2 * i32(id.x);
    var low_sum = 0u;
    var high_sum = 0u;
    for (var corner = 0; corner < 4; corner++) {
        let row = 2 * i32(id.y) - 1 + (corner & 1);
        let from_slice = 2 * i32(slice) - 1 + (corner >> 1);
        let middle = source_word(word, row, from_slice);
        low_sum += high_half(source_word(word - 1, row, from_slice)) + low_half(middle);
        high_sum += high_half(middle) + low_half(source_word(word + 1, row, from_slice));
    }
    let start = (slice - params.target_level.first_slice) * params.target_level.slice_words;
    target_level[start + id.y * params.target_level.row_words + id.x] = pack_means(low_sum, high_sum);
}
