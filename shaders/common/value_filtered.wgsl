// Values through the texture unit: r8unorm or r16unorm.
@group(0) @binding(1) var value_texture: texture_3d<f32>;

// Stored value (code / 255 or code / 65535) at a position in voxels, trilinear between voxel centres,
// clamped at the border.
fn sample_value(position: vec3<f32>, inverse_dims: vec3<f32>) -> f32 {
    return textureSampleLevel(value_texture, linear_sampler, position * inverse_dims, 0.0).r;
}
