// N-buffer level l from level l - 1 (SPAO 1.2.3), tile by tile: each window is the mean of eight windows of half its
// width. Twin: reference/box_mean.rs.
//
// Windows that lie half a width apart share what they read. An invocation makes 2 words x 2 rows x 2 slices of such
// windows, so that each word read serves up to eight of them: 27 reads for 8 words instead of 64.
#import common/levels
#import common/tiles

struct NBufferParams {
    source: LevelInfo,
    target_level: LevelInfo,
    tiles: vec3<u32>,
    first_flag: u32,     // of the level's tiles in `changed`
    rows_log2: u32,      // rows and slices of a tile, which is 32 cells wide
    shift_log2: u32,     // cells of the target between the windows that are averaged: half its width
    near: i32,           // where SUBSAMPLED, cell c of the target is at cell 2c + near of the source, else at c
}

// The first level shifts by one cell, which is half a word.
override SHIFT_BY_HALF_WORD: bool = false;
// The target has a window at every second cell of the source.
override SUBSAMPLED: bool = false;

@group(0) @binding(0) var<uniform> params: NBufferParams;
@group(0) @binding(1) var<storage, read> source: array<u32>;
@group(0) @binding(2) var<storage, read_write> target_level: array<u32>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> changed: array<u32>;

// Both cells of the source that lie where the target's word does, apart, so that sums have room.
fn source_cells(word: i32, row: i32, slice: i32) -> vec2<u32> {
    var at = vec3<i32>(word, row, slice);
    if SUBSAMPLED {
        // x: the word that holds the first of the two cells; the second is in the same half of the next word.
        at = vec3<i32>(2 * word + (params.near >> 1u), 2 * row + params.near, 2 * slice + params.near);
    }
    let extent = params.source.extent;
    let words = (extent.x + 1u) / 2u;
    // Negative indices wrap to large ones.
    let inside = u32(at.y) < extent.y && u32(at.z) < extent.z;
    let start = (u32(at.z) - params.source.first_slice) * params.source.slice_words + u32(at.y) * params.source.row_words;
    let first_inside = inside && u32(at.x) < words;
    let found = select(0u, source[select(0u, start + u32(at.x), first_inside)], first_inside);
    if SUBSAMPLED {
        let second_inside = inside && u32(at.x + 1) < words;
        let second = select(0u, source[select(0u, start + u32(at.x + 1), second_inside)], second_inside);
        let half = (u32(params.near) & 1u) * 16u;
        return vec2<u32>((found >> half) & 0xffffu, (second >> half) & 0xffffu);
    }
    return vec2<u32>(low_half(found), high_half(found));
}

// Sums of both windows along x that a target word needs, from the words half a width apart.
fn pair(far: vec2<u32>, near: vec2<u32>) -> vec2<u32> {
    if SHIFT_BY_HALF_WORD {
        return vec2<u32>(far.y + near.x, near.x + near.y);
    }
    return far + near;
}

// Sums along x for two target words: xy and zw.
fn row_sums(word: i32, stride: i32, row: i32, slice: i32) -> vec4<u32> {
    let before = source_cells(word - stride, row, slice);
    let first = source_cells(word, row, slice);
    let second = source_cells(word + stride, row, slice);
    return vec4<u32>(pair(before, first), pair(first, second));
}

// Sums along x and y for two words of two rows.
struct Plane {
    first_row: vec4<u32>,
    second_row: vec4<u32>,
}

fn plane(word: i32, stride: i32, row: i32, shift: i32, slice: i32) -> Plane {
    let before = row_sums(word, stride, row - shift, slice);
    let first = row_sums(word, stride, row, slice);
    let second = row_sums(word, stride, row + shift, slice);
    return Plane(before + first, first + second);
}

// Stores a word if it is in the level and not there already; true if it was stored.
fn put(word: u32, row: u32, slice: u32, value: u32) -> bool {
    let target_level_info = params.target_level;
    if row >= target_level_info.extent.y || slice >= target_level_info.extent.z || word >= target_level_info.row_words {
        return false;
    }
    let at = (slice - target_level_info.first_slice) * target_level_info.slice_words + row * target_level_info.row_words + word;
    if target_level[at] == value {
        return false;
    }
    target_level[at] = value;
    return true;
}

@compute @workgroup_size(8, 4, 4)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let entry = list[group.x];
    let tile = entry & INDEX;
    // A large tile takes several workgroups, one for each 8 x 8 rows and slices.
    let parts_log2 = params.rows_log2 - 3u;
    let part = vec3<u32>(0u, group.y & ((1u << parts_log2) - 1u), group.y >> parts_log2);
    let within = part * 4u + local;
    // Half a new width in words, at least one.
    let stride_log2 = select(params.shift_log2 - 1u, 0u, SHIFT_BY_HALF_WORD);
    let stride = 1u << stride_log2;
    let shift = 1u << params.shift_log2;
    // The first of each pair: pairs interleave in blocks of twice their distance.
    let logs = vec3<u32>(stride_log2, params.shift_log2, params.shift_log2);
    let low = within & ((vec3<u32>(1u) << logs) - vec3<u32>(1u));
    let first = tile_at(tile, params.tiles) << vec3<u32>(5u, params.rows_log2, params.rows_log2);
    let at = vec3<u32>(first.x >> 1u, first.yz) + ((within >> logs) << (logs + vec3<u32>(1u))) + low;
    let word = i32(at.x);
    let row = i32(at.y);
    let step = i32(shift);
    let keep = select(0xffffffffu, 0u, (entry & CLEAR) != 0u);
    var far = plane(word, i32(stride), row, step, i32(at.z) - step);
    var differs = false;
#repeat K 0..=1
    {
        let slice = at.z + @K@u * shift;
        let near = plane(word, i32(stride), row, step, i32(slice));
        let first_row = far.first_row + near.first_row;
        let second_row = far.second_row + near.second_row;
        let a = put(at.x, at.y, slice, pack_means(first_row.xy) & keep);
        let b = put(at.x + stride, at.y, slice, pack_means(first_row.zw) & keep);
        let c = put(at.x, at.y + shift, slice, pack_means(second_row.xy) & keep);
        let d = put(at.x + stride, at.y + shift, slice, pack_means(second_row.zw) & keep);
        differs = differs || a || b || c || d;
        far = near;
    }
#end
    if differs {
        changed[params.first_flag + tile] = 1u;
    }
}
