// Level 0: the opacity of voxels (METHODS 1: per voxel, before interpolation), tile by tile. Twin: reference/field.rs.
#import common/levels
#import common/tiles

struct ClassifyParams {
    level: LevelInfo,
    dims: vec3<u32>,
    origin: u32,         // cell of the first voxel
    tiles: vec3<u32>,
    code_scale: f32,     // codes per stored value
}

@group(0) @binding(0) var<uniform> params: ClassifyParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(2) var<storage, read> opacity_table: array<u32>;
@group(0) @binding(3) var<storage, read_write> level: array<u32>;
@group(0) @binding(4) var<storage, read> list: array<u32>;
@group(0) @binding(5) var<storage, read_write> changed: array<u32>;

fn opacity(voxel: vec3<i32>) -> u32 {
    if any(voxel < vec3<i32>(0)) || any(vec3<u32>(voxel) >= params.dims) {
        return 0u;
    }
    let code = u32(textureLoad(value_texture, voxel, 0).r * params.code_scale + 0.5);
    return (opacity_table[code >> 1u] >> ((code & 1u) * 16u)) & 0xffffu;
}

@compute @workgroup_size(16, 8, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let entry = list[group.x];
    let tile = entry & INDEX;
    let first = tile_at(tile, params.tiles) * vec3<u32>(32u, 8u, 8u);
    let row = first.y + local.y;
    var differs = false;
    for (var k = 0u; k < 8u; k++) {
        let slice = first.z + k;
        let voxel = vec3<i32>(vec3<u32>(first.x + 2u * local.x, row, slice)) - vec3<i32>(i32(params.origin));
        var word = opacity(voxel) | (opacity(voxel + vec3<i32>(1, 0, 0)) << 16u);
        word = select(word, 0u, (entry & CLEAR) != 0u);
        if row < params.level.extent.y && slice < params.level.extent.z {
            let at = (slice - params.level.first_slice) * params.level.slice_words + row * params.level.row_words
                + (first.x >> 1u) + local.x;
            if level[at] != word {
                level[at] = word;
                differs = true;
            }
        }
    }
    if differs {
        changed[tile] = 1u;
    }
}
