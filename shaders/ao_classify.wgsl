// Level 0: the opacity of every voxel (METHODS 1: per voxel, before interpolation). Twin: reference/field.rs.
#import common/levels

struct ClassifyParams {
    level: LevelInfo,
    dims: vec3<u32>,
    first_slice: u32,
    slice_count: u32,
    code_scale: f32,     // codes per stored value
}

@group(0) @binding(0) var<uniform> params: ClassifyParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(2) var<storage, read> opacity_table: array<u32>;
@group(0) @binding(3) var<storage, read_write> level: array<u32>;

fn opacity(voxel: vec3<i32>) -> u32 {
    if any(voxel < vec3<i32>(0)) || any(vec3<u32>(voxel) >= params.dims) {
        return 0u;
    }
    let code = u32(textureLoad(value_texture, voxel, 0).r * params.code_scale + 0.5);
    return (opacity_table[code >> 1u] >> ((code & 1u) * 16u)) & 0xffffu;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x >= (params.level.extent.x + 1u) / 2u || id.y >= params.level.extent.y || id.z >= params.slice_count {
        return;
    }
    let slice = id.z + params.first_slice;
    // Cell c holds voxel c - 1.
    let voxel = vec3<i32>(i32(2u * id.x), i32(id.y), i32(slice)) - vec3<i32>(1);
    let word = opacity(voxel) | (opacity(voxel + vec3<i32>(1, 0, 0)) << 16u);
    level[(slice - params.level.first_slice) * params.level.slice_words + id.y * params.level.row_words + id.x] = word;
}
