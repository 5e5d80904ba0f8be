// An N-buffer level in its plain form, for comparison: one texture of the volume's size for each level, eight look-ups
// for each texel, windows centred on the texel's lower corner. What lies outside the texture counts as 0.
struct PlainLevelParams {
    dims: vec3<u32>,
    far: i32,            // texels to the lower and to the upper windows that are averaged
    near: i32,
}

@group(0) @binding(0) var<uniform> params: PlainLevelParams;
@group(0) @binding(1) var source: texture_3d<f32>;
@group(0) @binding(2) var target_level: texture_storage_3d<r16unorm, write>;

fn window(at: vec3<i32>) -> f32 {
    let inside = all(at >= vec3<i32>(0)) && all(at < vec3<i32>(params.dims));
    return select(0.0, textureLoad(source, at, 0).r, inside);
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id >= params.dims) {
        return;
    }
    let low = vec3<i32>(id) + vec3<i32>(params.far);
    let high = vec3<i32>(id) + vec3<i32>(params.near);
    var sum = window(low) + window(vec3<i32>(high.x, low.yz)) + window(vec3<i32>(low.x, high.y, low.z));
    sum += window(vec3<i32>(high.xy, low.z)) + window(vec3<i32>(low.xy, high.z)) + window(vec3<i32>(high.x, low.y, high.z));
    sum += window(vec3<i32>(low.x, high.yz)) + window(high);
    textureStore(target_level, id, vec4<f32>(sum * 0.125, 0.0, 0.0, 1.0));
}
