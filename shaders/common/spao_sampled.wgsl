// Box means through the texture unit, from copies of the slices around the samples, and samples into a texture.
@group(0) @binding(2) var accessibility: texture_storage_3d<r16unorm, write>;
@group(0) @binding(4) var linear_sampler: sampler;

#repeat L 0..=LEVELS
@group(0) @binding(1@L@) var level_@L@: texture_3d<f32>;

// M of width 2^@L@ at an index-space position, as a fraction of 65535.
fn box_mean_@L@(position: vec3<f32>) -> f32 {
    let info = params.levels[@L@];
    let cell = position * info.inverse_scale + vec3<f32>(info.lookup_offset);
    let texel = cell + vec3<f32>(0.5, 0.5, 0.5 - f32(info.first_slice));
    return textureSampleLevel(level_@L@, linear_sampler, texel * params.inverse_sizes[@L@].xyz, 0.0).r * 65535.0;
}
#end

fn put(voxel: vec3<u32>, clear: bool) {
    let a = select(accessibility_at(vec3<i32>(voxel)), 0.0, clear);
    textureStore(accessibility, vec3<i32>(voxel), vec4<f32>(a, 0.0, 0.0, 1.0));
}
