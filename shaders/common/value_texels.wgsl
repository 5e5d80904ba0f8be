// Values in r32float, which not every adapter can filter: eight texels mixed by hand. The variable's name
// tells gpu/pass.rs that the texture need not be filterable.
@group(0) @binding(1) var value_texels: texture_3d<f32>;

fn value_row(corner: vec3<i32>, last: vec3<i32>, x_fraction: f32) -> f32 {
    let at = clamp(corner, vec3<i32>(0), last);
    let next = vec3<i32>(clamp(corner.x + 1, 0, last.x), at.y, at.z);
    return mix(textureLoad(value_texels, at, 0).r, textureLoad(value_texels, next, 0).r, x_fraction);
}

fn sample_value(position: vec3<f32>, inverse_dims: vec3<f32>) -> f32 {
    let last = vec3<i32>(textureDimensions(value_texels)) - vec3<i32>(1);
    let from_centre = position - vec3<f32>(0.5);
    let corner = vec3<i32>(floor(from_centre));
    let fraction = from_centre - floor(from_centre);
    let y0 = mix(value_row(corner, last, fraction.x), value_row(corner + vec3<i32>(0, 1, 0), last, fraction.x), fraction.y);
    let y1 = mix(value_row(corner + vec3<i32>(0, 0, 1), last, fraction.x),
        value_row(corner + vec3<i32>(0, 1, 1), last, fraction.x), fraction.y);
    return mix(y0, y1, fraction.z);
}
