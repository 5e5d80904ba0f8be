// The list of tiles of a level that an update has to compute: of the candidates, those that must be, and those whose
// inputs have changed (METHODS 7). Each is counted in the arguments of the dispatch that computes them.
#import common/tiles
#import common/marks

struct CollectParams {
    tiles: vec3<u32>,          // of the level
    first_flag: u32,           // of the source's blocks in `changed`
    tile: vec3<u32>,           // cells of a tile
    first_candidate: u32,
    source_blocks: vec3<u32>,
    candidate_count: u32,
    source_extent: vec3<u32>,  // cells
    scale: i32,                // cells scale * c + offset to scale * c + offset + distance are read
    offset: i32,
    distance: i32,
    dispatch: u32,             // word of the dispatch's arguments
}

@group(0) @binding(0) var<uniform> params: CollectParams;
@group(0) @binding(1) var<storage, read> candidates: array<u32>;
@group(0) @binding(3) var<storage, read_write> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> dispatches: array<atomic<u32>>;

fn any_changed(tile: vec3<u32>) -> bool {
    let last = vec3<i32>(params.source_extent) - vec3<i32>(1);
    let cell = vec3<i32>(tile * params.tile) * params.scale + vec3<i32>(params.offset);
    let end = cell + (vec3<i32>(params.tile) - vec3<i32>(1)) * params.scale + vec3<i32>(params.distance);
    let low = vec3<u32>(clamp(cell, vec3<i32>(0), last));
    let high = vec3<u32>(clamp(end, vec3<i32>(0), last));
    return any_marked(low, high, params.source_blocks, params.first_flag);
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.candidate_count {
        return;
    }
    let entry = candidates[params.first_candidate + id.x];
    if (entry & MUST) != 0u || any_changed(tile_at(entry & INDEX, params.tiles)) {
        list[atomicAdd(&dispatches[params.dispatch], 1u)] = entry;
    }
}
