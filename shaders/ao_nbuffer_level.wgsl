// N-buffer level l from level l - 1 (SPAO 1.2.3): each window is the mean of eight windows of half its width.
// Twin: reference/box_mean.rs.
#import common/levels

struct NBufferParams {
    source: LevelInfo,
    target_level: LevelInfo,
    first_slice: u32,
    slice_count: u32,
    shift: u32,          // cells between the windows that are averaged: half the new width
}

// The first level shifts by one cell, which is half a word.
override SHIFT_BY_HALF_WORD: bool = false;

@group(0) @binding(0) var<uniform> params: NBufferParams;
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
    let shift = i32(params.shift);
    var low_sum = 0u;
    var high_sum = 0u;
    for (var corner = 0; corner < 4; corner++) {
        let row = i32(id.y) - (corner & 1) * shift;
        let from_slice = i32(slice) - (corner >> 1) * shift;
        let near = source_word(i32(id.x), row, from_slice);
        if SHIFT_BY_HALF_WORD {
            let far = source_word(i32(id.x) - 1, row, from_slice);
            low_sum += high_half(far) + low_half(near);
            high_sum += low_half(near) + high_half(near);
        } else {
            let far = source_word(i32(id.x) - shift / 2, row, from_slice);
            low_sum += low_half(far) + low_half(near);
            high_sum += high_half(far) + high_half(near);
        }
    }
    let start = (slice - params.target_level.first_slice) * params.target_level.slice_words;
    target_level[start + id.y * params.target_level.row_words + id.x] = pack_means(low_sum, high_sum);
}
