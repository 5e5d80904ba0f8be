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
    first_flag: u32,     // of the level's blocks in `changed`
    rows_log2: u32,      // rows and slices of a tile, which is 32 cells wide
    shift_log2: u32,     // cells of the target between the windows that are averaged: half its width
    near: i32,           // where SUBSAMPLED, cell c of the target is at cell 2c + near of the source, else at c
    blocks: vec2<u32>,
    first_slices: vec3<u32>,    // of the source, at the start of the three bindings
}

// The first level shifts by one cell, which is half a word.
override SHIFT_BY_HALF_WORD: bool = false;
// The target has a window at every second cell of the source.
override SUBSAMPLED: bool = false;

@group(0) @binding(0) var<uniform> params: NBufferParams;
// The slices of the source that are before, in and behind the middle of windows: three bindings, as one for all of
// them may be more than an adapter allows.
#repeat P 0..=2
@group(0) @binding(1@P@) var<storage, read> source_@P@: array<u32>;
#end
@group(0) @binding(2) var<storage, read_write> target_level: array<u32>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> changed: array<u32>;

// Sums of both windows along x that a target word needs, from the words half a width apart.
fn pair(far: vec2<u32>, near: vec2<u32>) -> vec2<u32> {
    if SHIFT_BY_HALF_WORD {
        return vec2<u32>(far.y + near.x, near.x + near.y);
    }
    return far + near;
}

// Where in the source the cells of the target lie. The rim is zero: what lies beyond it is read from it.
fn source_words(words: vec3<i32>) -> vec3<u32> {
    let last = i32((params.source.extent.x + 1u) / 2u) - 1;
    if SUBSAMPLED {
        // The word that holds the first of the two cells; the second is in the same half of the next word.
        return vec3<u32>(clamp(2 * words + vec3<i32>(params.near >> 1u), vec3<i32>(0), vec3<i32>(last)));
    }
    return vec3<u32>(clamp(words, vec3<i32>(0), vec3<i32>(last)));
}

fn source_rows(rows: vec3<i32>, extent: u32) -> vec3<u32> {
    let at = select(rows, 2 * rows + vec3<i32>(params.near), SUBSAMPLED);
    return vec3<u32>(clamp(at, vec3<i32>(0), vec3<i32>(i32(extent) - 1)));
}

// Sums along x and y for two words of two rows.
struct Plane {
    first_row: vec4<u32>,
    second_row: vec4<u32>,
}

#repeat P 0..=2
// Both cells of the source that lie where the target's word does, apart, so that sums have room.
fn source_cells_@P@(at: u32) -> vec2<u32> {
    let found = source_@P@[at];
    if SUBSAMPLED {
        let half = (u32(params.near) & 1u) * 16u;
        return vec2<u32>((found >> half) & 0xffffu, (source_@P@[at + 1u] >> half) & 0xffffu);
    }
    return vec2<u32>(low_half(found), high_half(found));
}

// Sums along x for two target words: xy and zw.
fn row_sums_@P@(words: vec3<u32>, start: u32) -> vec4<u32> {
    let before = source_cells_@P@(start + words.x);
    let first = source_cells_@P@(start + words.y);
    let second = source_cells_@P@(start + words.z);
    return vec4<u32>(pair(before, first), pair(first, second));
}

fn plane_@P@(words: vec3<u32>, rows: vec3<u32>, start: u32) -> Plane {
    let before = row_sums_@P@(words, start + rows.x);
    let first = row_sums_@P@(words, start + rows.y);
    let second = row_sums_@P@(words, start + rows.z);
    return Plane(before + first, first + second);
}
#end

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

// Marks the block of 32 x 8 x 8 cells around a word.
fn mark(word: u32, row: u32, slice: u32, differs: bool) {
    if differs {
        changed[params.first_flag + ((slice >> 3u) * params.blocks.y + (row >> 3u)) * params.blocks.x + (word >> 4u)] = 1u;
    }
}

// Two words, which are in one block, of two rows of a slice.
fn put_plane(at: vec3<u32>, shift: vec2<u32>, far: Plane, near: Plane, keep: u32) {
    let first_row = far.first_row + near.first_row;
    let second_row = far.second_row + near.second_row;
    let a = put(at.x, at.y, at.z, pack_means(first_row.xy) & keep);
    let b = put(at.x + shift.x, at.y, at.z, pack_means(first_row.zw) & keep);
    let c = put(at.x, at.y + shift.y, at.z, pack_means(second_row.xy) & keep);
    let d = put(at.x + shift.x, at.y + shift.y, at.z, pack_means(second_row.zw) & keep);
    mark(at.x, at.y, at.z, a || b);
    mark(at.x, at.y + shift.y, at.z, c || d);
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
    let shifts = vec3<i32>(-1, 0, 1);
    let words = source_words(vec3<i32>(i32(at.x)) + i32(stride) * shifts);
    let rows = source_rows(vec3<i32>(i32(at.y)) + i32(shift) * shifts, params.source.extent.y) * params.source.row_words;
    let slices = (source_rows(vec3<i32>(i32(at.z)) + i32(shift) * shifts, params.source.extent.z)
        - params.first_slices) * params.source.slice_words;
    let keep = select(0xffffffffu, 0u, (entry & CLEAR) != 0u);
    let before = plane_0(words, rows, slices.x);
    let middle = plane_1(words, rows, slices.y);
    let after = plane_2(words, rows, slices.z);
    put_plane(at, vec2<u32>(stride, shift), before, middle, keep);
    put_plane(at + vec3<u32>(0u, 0u, shift), vec2<u32>(stride, shift), middle, after, keep);
}
