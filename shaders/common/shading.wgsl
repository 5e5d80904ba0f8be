// Blinn-Phong on the gradient, with accessibility on the illumination (METHODS 5, "Illumination").
// Twin: reference/shading.rs.
struct Light {
    // xyz: towards the light, world space; w: 1 for a head light.
    direction: vec4<f32>,
    // rgb; w: exposure.
    color: vec4<f32>,
    // ambient, diffuse, specular, shininess.
    terms: vec4<f32>,
    // x: ambient-occlusion strength; y: with automatic exposure 1 / O' of an open surface, else 0.
    occlusion: vec4<f32>,
}

// Gradients shorter than this fade from lit to flat: they have no clear direction.
const CLEAR_GRADIENT: f32 = 0.02;

// Unit normal of a dimensionless world gradient, turned to the viewer: a cavity's wall is lit as well as an outer
// surface. Zero without a gradient.
fn facing_normal(gradient: vec3<f32>, view: vec3<f32>) -> vec3<f32> {
    let normal = gradient / max(length(gradient), 1e-6);
    return select(-normal, normal, dot(normal, view) > 0.0);
}

// How clear the direction of a gradient is, 0 to 1.
fn clearness(gradient: vec3<f32>) -> f32 {
    return clamp(length(gradient) / CLEAR_GRADIENT, 0.0, 1.0);
}

// Factor on the illumination. Automatic exposure gives an open surface all light and nothing more than that.
fn openness(accessibility: f32, light: Light) -> f32 {
    let open = 1.0 + light.occlusion.x * (accessibility - 1.0);
    let relative = min(open * light.occlusion.y, 1.0);
    return select(light.color.w * open, relative * (2.0 - relative), light.occlusion.y > 0.0);
}

// Colour of a lit sample; `view` points to the eye.
fn illuminate(color: vec3<f32>, normal: vec3<f32>, clear: f32, view: vec3<f32>, accessibility: f32, light: Light) -> vec3<f32> {
    let towards = select(light.direction.xyz, view, light.direction.w > 0.5);
    let halfway = normalize(towards + view);
    let facing = dot(normal, towards);
    let diffuse = mix(1.0, max(facing, 0.0), clear);
    let shine = pow(max(dot(normal, halfway), 1e-6), light.terms.w);
    let specular = select(0.0, clear * shine, facing > 0.0);
    let lit = (light.terms.x + light.terms.y * diffuse) * color + light.terms.z * specular;
    return clamp(openness(accessibility, light) * lit * light.color.rgb, vec3<f32>(0.0), vec3<f32>(1.0));
}
