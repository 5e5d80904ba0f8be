// Per-voxel gradient for shading: central differences of the normalised value, turned into world space and
// made dimensionless by the smallest spacing. Twin: reference/raycast.rs.
struct GradientParams {
    dims: vec3<u32>,
    first_slice: u32,
    // Columns of smallest_spacing * transpose(index_from_world).
    normal_from_index: mat3x3<f32>,
    // Normalised value per stored value.
    normalise: f32,
    max_length: f32,
}

@group(0) @binding(0) var<uniform> params: GradientParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(2) var gradient_texture: texture_storage_3d<rgba8snorm, write>;

fn value(voxel: vec3<i32>) -> f32 {
    let last = vec3<i32>(params.dims) - vec3<i32>(1);
    return textureLoad(value_texture, clamp(voxel, vec3<i32>(0), last), 0).r;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let voxel = vec3<i32>(id) + vec3<i32>(0, 0, i32(params.first_slice));
    if any(vec3<u32>(voxel) >= params.dims) {
        return;
    }
    let difference = vec3<f32>(
        value(voxel + vec3<i32>(1, 0, 0)) - value(voxel - vec3<i32>(1, 0, 0)),
        value(voxel + vec3<i32>(0, 1, 0)) - value(voxel - vec3<i32>(0, 1, 0)),
        value(voxel + vec3<i32>(0, 0, 1)) - value(voxel - vec3<i32>(0, 0, 1)),
    );
    let gradient = params.normal_from_index * (difference * 0.5 * params.normalise);
    // The square root of the length is stored: eight bits must still hold the direction of weak gradients.
    let length = length(gradient);
    var encoded = vec3<f32>(0.0);
    if length > 0.0 {
        encoded = gradient / length * sqrt(min(length / params.max_length, 1.0));
    }
    textureStore(gradient_texture, voxel, vec4<f32>(encoded, 0.0));
}
