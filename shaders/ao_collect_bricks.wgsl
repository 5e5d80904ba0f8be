// The list of bricks whose accessibility an update has to compute: of the candidates, those that must be, and those
// for which a look-up in some level meets a block that has changed (METHODS 7).
#import common/levels
#import common/tiles
#import common/marks

struct LevelBlocks {
    blocks: vec3<u32>,
    first_flag: u32,           // in `changed`
}

struct CollectBricksParams {
    levels: array<LevelInfo, 9>,
    level_blocks: array<LevelBlocks, 9>,
    bricks: vec3<u32>,
    level_count: u32,
    first_candidate: u32,
    candidate_count: u32,
    dispatch: u32,             // word of the dispatch's arguments
    half_offset: f32,          // of a look-up at level 0, in voxels, where the gradient has length 1
}

@group(0) @binding(0) var<uniform> params: CollectBricksParams;
@group(0) @binding(1) var<storage, read> candidates: array<u32>;
@group(0) @binding(3) var<storage, read_write> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> dispatches: array<atomic<u32>>;
// Longest component of the gradient in a brick.
@group(0) @binding(5) var<storage, read> steepest: array<f32>;

fn level_changed(level: u32, brick: vec3<u32>, reach: f32) -> bool {
    let info = params.levels[level];
    let grid = params.level_blocks[level];
    let last = vec3<f32>(info.extent - vec3<u32>(1u));
    let position = vec3<f32>(brick * 8u) + vec3<f32>(0.5);
    // A little more on either side than what is looked up, for rounding.
    let low_cell = (position - vec3<f32>(reach)) * info.inverse_scale + vec3<f32>(info.lookup_offset - 0.01);
    let high_cell = (position + vec3<f32>(7.0 + reach)) * info.inverse_scale + vec3<f32>(info.lookup_offset + 1.01);
    let low = vec3<u32>(clamp(low_cell, vec3<f32>(0.0), last));
    let high = vec3<u32>(clamp(high_cell, vec3<f32>(0.0), last));
    return any_marked(low, high, grid.blocks, grid.first_flag);
}

@compute @workgroup_size(64, 1, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= params.candidate_count {
        return;
    }
    let entry = candidates[params.first_candidate + id.x];
    let brick = entry & INDEX;
    var dirty = (entry & MUST) != 0u;
    var reach = params.half_offset * steepest[brick];
    for (var level = 0u; level < params.level_count && !dirty; level++) {
        dirty = level_changed(level, tile_at(brick, params.bricks), reach);
        reach *= 2.0;
    }
    if dirty {
        list[atomicAdd(&dispatches[params.dispatch], 1u)] = entry;
    }
}
