// N-buffer level l from level l - 1 (SPAO 1.2.3): each window is the mean of eight windows of half its width.
// Twin: reference/box_mean.rs.
//
// Neighbouring windows share most of what they read. An invocation makes 4 words x 4 rows that lie half a new
// width apart, so that each word read serves up to four of them: 3 reads per word written instead of 8.
#import common/levels

struct NBufferParams {
    source: LevelInfo,
    target_level: LevelInfo,
    first_slice: u32,
    slice_count: u32,
    shift_log2: u32,     // cells between the windows that are averaged: half the new width
}

// The first level shifts by one cell, which is half a word.
override SHIFT_BY_HALF_WORD: bool = false;

@group(0) @binding(0) var<uniform> params: NBufferParams;
@group(0) @binding(1) var<storage, read> source: array<u32>;
@group(0) @binding(2) var<storage, read_write> target_level: array<u32>;

// Both halves of a word, apart, so that sums have room.
fn source_cells(word: i32, row: i32, slice: i32) -> vec2<u32> {
    let extent = params.source.extent;
    let words = (extent.x + 1u) / 2u;
    // Negative indices wrap to large ones.
    let inside = u32(word) < words && u32(row) < extent.y && u32(slice) < extent.z;
    let start = (u32(slice) - params.source.first_slice) * params.source.slice_words;
    let found = select(0u, source[select(0u, start + u32(row) * params.source.row_words + u32(word), inside)], inside);
    return vec2<u32>(low_half(found), high_half(found));
}

// Sums of both windows along x that a target word needs, from the words half a width apart.
fn pair(far: vec2<u32>, near: vec2<u32>) -> vec2<u32> {
    if SHIFT_BY_HALF_WORD {
        return vec2<u32>(far.y + near.x, near.x + near.y);
    }
    return far + near;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let extent = params.target_level.extent;
    let words = (extent.x + 1u) / 2u;
    // Half a new width in words, at least one.
    let stride_log2 = select(params.shift_log2 - 1u, 0u, SHIFT_BY_HALF_WORD);
    let stride = 1u << stride_log2;
    let shift = 1u << params.shift_log2;
    let first_word = ((id.x >> stride_log2) << (stride_log2 + 2u)) + (id.x & (stride - 1u));
    let first_row = ((id.y >> params.shift_log2) << (params.shift_log2 + 2u)) + (id.y & (shift - 1u));
    if first_word >= words || first_row >= extent.y || id.z >= params.slice_count {
        return;
    }
    let slice = i32(id.z + params.first_slice);
    let to = (u32(slice) - params.target_level.first_slice) * params.target_level.slice_words;
    var before_0 = vec2<u32>(0u);
    var before_1 = vec2<u32>(0u);
    var before_2 = vec2<u32>(0u);
    var before_3 = vec2<u32>(0u);
    for (var j = 0u; j < 5u; j++) {
        // The row before the first only gives the first its lower half.
        let row = i32(first_row + j * shift) - i32(shift);
        let word = i32(first_word);
        let step = i32(stride);
        let back = slice - i32(shift);
        let c0 = source_cells(word - step, row, slice) + source_cells(word - step, row, back);
        let c1 = source_cells(word, row, slice) + source_cells(word, row, back);
        let c2 = source_cells(word + step, row, slice) + source_cells(word + step, row, back);
        let c3 = source_cells(word + 2 * step, row, slice) + source_cells(word + 2 * step, row, back);
        let c4 = source_cells(word + 3 * step, row, slice) + source_cells(word + 3 * step, row, back);
        let sum_0 = pair(c0, c1);
        let sum_1 = pair(c1, c2);
        let sum_2 = pair(c2, c3);
        let sum_3 = pair(c3, c4);
        if j > 0u && u32(row) < extent.y {
            let at = to + u32(row) * params.target_level.row_words + first_word;
            target_level[at] = pack_means(sum_0.x + before_0.x, sum_0.y + before_0.y);
            if first_word + stride < words {
                target_level[at + stride] = pack_means(sum_1.x + before_1.x, sum_1.y + before_1.y);
            }
            if first_word + 2u * stride < words {
                target_level[at + 2u * stride] = pack_means(sum_2.x + before_2.x, sum_2.y + before_2.y);
            }
            if first_word + 3u * stride < words {
                target_level[at + 3u * stride] = pack_means(sum_3.x + before_3.x, sum_3.y + before_3.y);
            }
        }
        before_0 = sum_0;
        before_1 = sum_1;
        before_2 = sum_2;
        before_3 = sum_3;
    }
}
