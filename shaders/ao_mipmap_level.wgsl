// Mip level l from level l - 1, tile by tile: each cell is the mean of 2 x 2 x 2, zero beyond the border (METHODS 2).
// Twin: reference/mipmap.rs.
#import common/levels
#import common/tiles

struct MipmapParams {
    source: LevelInfo,
    target_level: LevelInfo,
    tiles: vec3<u32>,
    first_flag: u32,     // of the level's tiles in `changed`, each of which is a block
    offset: i32,         // cell c is the mean of cells 2c + offset and 2c + offset + 1; even
}

@group(0) @binding(0) var<uniform> params: MipmapParams;
@group(0) @binding(1) var<storage, read> source: array<u32>;
@group(0) @binding(2) var<storage, read_write> target_level: array<u32>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> changed: array<u32>;

// Sum of both cells of a word.
fn source_sum(word: i32, row: i32, slice: i32) -> u32 {
    let extent = params.source.extent;
    // Negative indices wrap to large ones.
    let inside = u32(word) < (extent.x + 1u) / 2u && u32(row) < extent.y && u32(slice) < extent.z;
    let start = (u32(slice) - params.source.first_slice) * params.source.slice_words;
    let found = source[select(0u, start + u32(row) * params.source.row_words + u32(word), inside)];
    return select(0u, low_half(found) + high_half(found), inside);
}

@compute @workgroup_size(16, 8, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let entry = list[group.x];
    let tile = entry & INDEX;
    let first = tile_at(tile, params.tiles) * vec3<u32>(32u, 8u, 8u);
    let row = first.y + local.y;
    let word = (first.x >> 1u) + local.x;
    var differs = false;
    for (var k = 0u; k < 8u; k++) {
        let slice = first.z + k;
        var sums = vec2<u32>(0u);
        for (var corner = 0; corner < 4; corner++) {
            let from_row = 2 * i32(row) + params.offset + (corner & 1);
            let from_slice = 2 * i32(slice) + params.offset + (corner >> 1);
            let from_word = 2 * i32(word) + (params.offset >> 1u);
            sums += vec2<u32>(source_sum(from_word, from_row, from_slice), source_sum(from_word + 1, from_row, from_slice));
        }
        let means = select(pack_means(sums), 0u, (entry & CLEAR) != 0u);
        if row < params.target_level.extent.y && slice < params.target_level.extent.z
            && word < params.target_level.row_words {
            let at = (slice - params.target_level.first_slice) * params.target_level.slice_words
                + row * params.target_level.row_words + word;
            if target_level[at] != means {
                target_level[at] = means;
                differs = true;
            }
        }
    }
    if differs {
        changed[params.first_flag + tile] = 1u;
    }
}
