// Accessibility from box means: the product over shells of what they let through (SPAO 1.2.2, METHODS 2), brick by
// brick. Twin: reference/ao_spao.rs.
#import common/levels
#import common/tiles

struct SpaoParams {
    levels: array<LevelInfo, 9>,
    inverse_sizes: array<vec4<f32>, 9>,  // of the textures that hold the levels
    dims: vec3<u32>,
    first_slice: u32,        // of the samples in words
    bricks: vec3<u32>,
    row_words: u32,          // words between their rows, two to a word
    normalise: f32,          // normalised value per stored value
    normal_factor: f32,
}

// False saves the gradient where normal_factor is 0.
override OFFSET_BY_NORMAL: bool = true;

@group(0) @binding(0) var<uniform> params: SpaoParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
#import common/spao_sampled

fn value(voxel: vec3<i32>) -> f32 {
    let last = vec3<i32>(params.dims) - vec3<i32>(1);
    return textureLoad(value_texture, clamp(voxel, vec3<i32>(0), last), 0).r;
}

// -grad of the normalised value by central differences, of length at most 1 (SPAO 1.3, METHODS 2).
fn normal(voxel: vec3<i32>) -> vec3<f32> {
    let difference = vec3<f32>(
        value(voxel - vec3<i32>(1, 0, 0)) - value(voxel + vec3<i32>(1, 0, 0)),
        value(voxel - vec3<i32>(0, 1, 0)) - value(voxel + vec3<i32>(0, 1, 0)),
        value(voxel - vec3<i32>(0, 0, 1)) - value(voxel + vec3<i32>(0, 0, 1)),
    );
    let n = difference * 0.5 * params.normalise;
    return n / max(length(n), 1.0);
}

fn accessibility_at(voxel: vec3<i32>) -> f32 {
    let position = vec3<f32>(voxel) + vec3<f32>(0.5);
    var half_offset = vec3<f32>(0.0);
    if OFFSET_BY_NORMAL {
        half_offset = normal(voxel) * (params.normal_factor * 0.5);
    }
    var product = 1.0;
    var inner = box_mean_0(position + half_offset);
#repeat L 1..=LEVELS
    let mean_@L@ = box_mean_@L@(position + half_offset * f32(1u << @L@u));
    product *= 1.0 - clamp((8.0 * mean_@L@ - inner) * (1.0 / (7.0 * 65535.0)), 0.0, 1.0);
    inner = mean_@L@;
#end
    return product;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let entry = list[group.x];
    let first = tile_at(entry & INDEX, params.bricks) * 8u + local;
    // Bounded by what was read, so that it stays a loop: eight copies of the look-ups do not fit an instruction cache.
    let end = min(first.z + 8u, params.dims.z);
    for (var z = first.z; z < end; z++) {
        if first.x < params.dims.x && first.y < params.dims.y {
            put(vec3<u32>(first.xy, z), (entry & CLEAR) != 0u);
        }
    }
}
