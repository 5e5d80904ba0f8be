// Accessibility of every voxel from the plain form of N-buffers: a look-up in each level (SPAO 1.2.2).
struct PlainGatherParams {
    dims: vec3<u32>,
    normalise: f32,      // normalised value per stored value
    normal_factor: f32,
}

@group(0) @binding(0) var<uniform> params: PlainGatherParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(2) var accessibility: texture_storage_3d<r16unorm, write>;
@group(0) @binding(3) var linear_sampler: sampler;
#repeat L 0..=LEVELS
@group(0) @binding(1@L@) var level_@L@: texture_3d<f32>;
#end

fn value(voxel: vec3<i32>) -> f32 {
    let last = vec3<i32>(params.dims) - vec3<i32>(1);
    return textureLoad(value_texture, clamp(voxel, vec3<i32>(0), last), 0).r;
}

fn normal(voxel: vec3<i32>) -> vec3<f32> {
    let n = 0.5 * params.normalise * vec3<f32>(
        value(voxel - vec3<i32>(1, 0, 0)) - value(voxel + vec3<i32>(1, 0, 0)),
        value(voxel - vec3<i32>(0, 1, 0)) - value(voxel + vec3<i32>(0, 1, 0)),
        value(voxel - vec3<i32>(0, 0, 1)) - value(voxel + vec3<i32>(0, 0, 1)),
    );
    return n / max(length(n), 1.0);
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id >= params.dims) {
        return;
    }
    let half_offset = normal(vec3<i32>(id)) * (params.normal_factor * 0.5);
    let inverse = 1.0 / vec3<f32>(params.dims);
    let position = vec3<f32>(id) + vec3<f32>(0.5);
    var product = 1.0;
    var inner = textureSampleLevel(level_0, linear_sampler, (position + half_offset) * inverse, 0.0).r;
#repeat L 1..=LEVELS
    // Half a texel on: texel i is about its lower corner.
    let at_@L@ = position + half_offset * f32(1u << @L@u) + vec3<f32>(0.5);
    let mean_@L@ = textureSampleLevel(level_@L@, linear_sampler, at_@L@ * inverse, 0.0).r;
    product *= 1.0 - clamp((8.0 * mean_@L@ - inner) / 7.0, 0.0, 1.0);
    inner = mean_@L@;
#end
    textureStore(accessibility, id, vec4<f32>(product, 0.0, 0.0, 1.0));
}
