// Opacity of every voxel into a texture: level 0 of the plain form of N-buffers.
struct PlainClassifyParams {
    dims: vec3<u32>,
    code_scale: f32,     // codes per stored value
}

@group(0) @binding(0) var<uniform> params: PlainClassifyParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(2) var<storage, read> opacity_table: array<u32>;
@group(0) @binding(3) var target_level: texture_storage_3d<r16unorm, write>;

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id >= params.dims) {
        return;
    }
    let code = u32(textureLoad(value_texture, id, 0).r * params.code_scale + 0.5);
    let opacity = (opacity_table[code >> 1u] >> ((code & 1u) * 16u)) & 0xffffu;
    textureStore(target_level, id, vec4<f32>(f32(opacity) / 65535.0, 0.0, 0.0, 1.0));
}
