// Front-to-back compositing of one picture. Values are interpolated, then classified (post-interpolation).
// Twin: reference/raycast.rs.
#import common/value_filtered
#import common/shading

struct RaycastParams {
    light: Light,
    // The camera's ray basis in index space (scene/camera.rs)...
    origin: vec4<f32>,
    origin_du: vec4<f32>,
    origin_dv: vec4<f32>,
    forward: vec4<f32>,
    dir_du: vec4<f32>,
    dir_dv: vec4<f32>,
    // ... and its directions in world space.
    world_forward: vec4<f32>,
    world_dir_du: vec4<f32>,
    world_dir_dv: vec4<f32>,
    // World directions of length one smallest spacing to index space.
    index_from_normal: mat3x3<f32>,
    // Straight alpha.
    background: vec4<f32>,
    // Index-space planes; the side where dot(xyz, p) + w >= 0 is kept.
    clip_planes: array<vec4<f32>, 14>,
    inverse_dims: vec3<f32>,
    clip_plane_count: u32,
    dims: vec3<f32>,
    step_length: f32,        // world units between samples
    bricks: vec3<u32>,
    entry_scale: f32,        // table entries per stored value
    size: vec2<u32>,         // picture, pixels
    last_entry: u32,
    gradient_scale: f32,     // longest gradient that the texture can hold
}

const BRICK: f32 = 8.0;
// Opacity at which a ray ends: less than half a display step is left.
const OPAQUE: f32 = 0.999;
// Smallest spacings between a surface and the accessibility it is lit by.
const IN_FRONT: f32 = 1.0;
// In place of a table entry: no sample there.
const NONE: u32 = 0xffffffffu;

override OCCLUDED: bool = true;

@group(0) @binding(0) var<uniform> params: RaycastParams;
@group(0) @binding(2) var linear_sampler: sampler;
@group(0) @binding(3) var gradient_texture: texture_3d<f32>;
@group(0) @binding(4) var accessibility_texture: texture_3d<f32>;
// Chebyshev distance in bricks to the next visible brick, four to a word.
@group(0) @binding(5) var<storage, read> brick_distance: array<u32>;
// Optical depth per step of all entries before this one, as a large and a small part that add up to it.
@group(0) @binding(6) var<storage, read> depth_prefix: array<vec2<f32>>;
// sRGB colour of every table entry, 8 bits each, red lowest.
@group(0) @binding(7) var<storage, read> color_table: array<u32>;
@group(0) @binding(8) var<storage, read_write> picture: array<u32>;

fn distance_at(brick: vec3<i32>) -> i32 {
    let b = vec3<u32>(clamp(brick, vec3<i32>(0), vec3<i32>(params.bricks) - vec3<i32>(1)));
    let index = (b.z * params.bricks.y + b.y) * params.bricks.x + b.x;
    return i32((brick_distance[index >> 2u] >> ((index & 3u) * 8u)) & 0xffu);
}

// Distances [x, y] along the ray that lie inside the volume and the clip planes; empty if y <= x.
fn visible_interval(origin: vec3<f32>, direction: vec3<f32>, inverse: vec3<f32>) -> vec2<f32> {
    let low = -origin * inverse;
    let high = (params.dims - origin) * inverse;
    let entry = min(low, high);
    let exit = max(low, high);
    var near = max(max(entry.x, entry.y), max(entry.z, 0.0));
    var far = min(exit.x, min(exit.y, exit.z));
    // A bound that depends on the ray, too: where a uniform alone bounds a loop, lavapipe compiles the shader anew for
    // every dispatch and keeps what it needed for that.
    let count = select(0u, params.clip_plane_count, near < far);
    for (var i = 0u; i < count; i++) {
        let plane = params.clip_planes[i];
        let start = dot(plane.xyz, origin) + plane.w;
        let slope = dot(plane.xyz, direction);
        // A ray along the plane is kept or dropped as a whole.
        let along = abs(slope) < 1e-20;
        let crossing = -start / select(slope, 1e-20, along);
        near = select(near, max(near, crossing), !along && slope > 0.0);
        far = select(far, min(far, crossing), !along && slope < 0.0);
        far = select(far, -1.0, along && start < 0.0);
    }
    return vec2<f32>(near, far);
}

// Mean optical depth per step over table entries first..=last.
fn mean_depth(first: u32, last: u32) -> f32 {
    let below = depth_prefix[first];
    let up_to = depth_prefix[last + 1u];
    return ((up_to.x - below.x) + (up_to.y - below.y)) / f32(last + 1u - first);
}

fn depth_between(a: u32, b: u32) -> f32 {
    return mean_depth(min(a, b), max(a, b));
}

fn gradient_at(coordinate: vec3<f32>) -> vec3<f32> {
    let encoded = textureSampleLevel(gradient_texture, linear_sampler, coordinate, 0.0).xyz;
    // Lengths are stored as square roots; see gradient.wgsl.
    return encoded * length(encoded) * params.gradient_scale;
}

fn shade(entry: u32, position: vec3<f32>, view: vec3<f32>) -> vec3<f32> {
    let gradient = gradient_at(position * params.inverse_dims);
    let normal = facing_normal(gradient, view);
    let clear = clearness(gradient);
    var accessibility = 1.0;
    if OCCLUDED {
        // Looked up in front of the surface: behind it, accessibility falls to nothing within a voxel, and
        // the picture would show where in its voxel the surface lies.
        let in_front = position + params.index_from_normal * normal * (clear * IN_FRONT);
        accessibility = textureSampleLevel(accessibility_texture, linear_sampler, in_front * params.inverse_dims, 0.0).r;
    }
    let color = unpack4x8unorm(color_table[entry]).rgb;
    return illuminate(color, normal, clear, view, accessibility, params.light);
}

// Share of a segment, in [0, 1], at which half of what it contributes lies in front; values run linearly
// from entry `a` to entry `b`, `depth` is the optical depth of the whole and `alpha` its opacity.
fn half_way(a: u32, b: u32, depth: f32, alpha: f32) -> f32 {
    let wanted = -log(1.0 - 0.5 * alpha) / depth;
    let whole = depth_between(a, b);
    // Shares of the segment, and what of its depth lies in front of them.
    var low = vec2<f32>(0.0, 0.0);
    var high = vec2<f32>(1.0, 1.0);
    for (var i = 0; i < 3; i++) {
        let middle = 0.5 * (low.x + high.x);
        let at_middle = vec2<f32>(middle, middle * depth_between(a, entry_between(a, b, middle)) / whole);
        low = select(low, at_middle, at_middle.y < wanted);
        high = select(at_middle, high, at_middle.y < wanted);
    }
    return mix(low.x, high.x, (wanted - low.y) / (high.y - low.y));
}

fn entry_between(a: u32, b: u32, share: f32) -> u32 {
    return u32(mix(f32(a), f32(b), share) + 0.5);
}

// Premultiplied colour and opacity of a ray. Samples lie at multiples of the step length and at both ends of the
// visible interval; between two of them the value runs linearly and is integrated (pre-integration), so that
// opacity and place of a steep surface do not depend on where samples happen to fall.
fn march(origin: vec3<f32>, direction: vec3<f32>, view: vec3<f32>) -> vec4<f32> {
    let inverse = 1.0 / select(direction, vec3<f32>(1e-20), abs(direction) < vec3<f32>(1e-20));
    let interval = visible_interval(origin, direction, inverse);
    var result = vec4<f32>(0.0);
    if interval.y <= interval.x {
        return result;
    }
    let last = i32(ceil(interval.y / params.step_length));
    var k = i32(floor(interval.x / params.step_length));
    var near_entry = NONE;
    var far_entry = NONE;
    var near = 0.0;
    var far = 0.0;
    var in_visible = false;
    loop {
        // On to the next segment that contributes. A loop of its own, so that neighbouring rays shade together.
        var depth = 0.0;
        loop {
            if k > last {
                break;
            }
            near = far;
            near_entry = far_entry;
            far = clamp(f32(k) * params.step_length, interval.x, interval.y);
            var position = origin + far * direction;
            let brick = vec3<i32>(floor(position / BRICK));
            let empty = distance_at(brick);
            if empty > 0 && !in_visible {
                // All bricks nearer than `empty` are invisible: on to the last sample in front of the others.
                let low = (vec3<f32>(brick - vec3<i32>(empty - 1)) * BRICK - origin) * inverse;
                let high = (vec3<f32>(brick + vec3<i32>(empty)) * BRICK - origin) * inverse;
                let leave = max(low, high);
                let in_front = i32(ceil(min(leave.x, min(leave.y, leave.z)) / params.step_length)) - 1;
                if in_front > k {
                    k = in_front;
                    near_entry = NONE;
                    far = clamp(f32(k) * params.step_length, interval.x, interval.y);
                    position = origin + far * direction;
                }
            }
            in_visible = empty == 0;
            far_entry = min(u32(sample_value(position, params.inverse_dims) * params.entry_scale + 0.5), params.last_entry);
            k += 1;
            // The first sample, and the first behind a leap, end no segment.
            let begin = select(near_entry, far_entry, near_entry == NONE);
            depth = select(depth_between(begin, far_entry) * (far - near) / params.step_length, 0.0, near_entry == NONE);
            if depth > 0.0 {
                break;
            }
        }
        if depth <= 0.0 {
            break;
        }
        let alpha = 1.0 - exp(-depth);
        let share = half_way(near_entry, far_entry, depth, alpha);
        let position = origin + mix(near, far, share) * direction;
        let color = shade(entry_between(near_entry, far_entry, share), position, view);
        let weight = (1.0 - result.a) * alpha;
        result += vec4<f32>(weight * color, weight);
        if result.a > OPAQUE {
            break;
        }
    }
    return result;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if any(id.xy >= params.size) {
        return;
    }
    let uv = (vec2<f32>(id.xy) + vec2<f32>(0.5)) / vec2<f32>(params.size) * 2.0 - vec2<f32>(1.0);
    let u = uv.x;
    let v = -uv.y;
    let world = params.world_forward.xyz + u * params.world_dir_du.xyz + v * params.world_dir_dv.xyz;
    let scale = 1.0 / length(world);
    let origin = params.origin.xyz + u * params.origin_du.xyz + v * params.origin_dv.xyz;
    let direction = (params.forward.xyz + u * params.dir_du.xyz + v * params.dir_dv.xyz) * scale;
    let ray = march(origin, direction, -world * scale);
    let behind = (1.0 - ray.a) * params.background.a;
    let alpha = ray.a + behind;
    // The picture has straight alpha.
    let color = (ray.rgb + behind * params.background.rgb) / max(alpha, 1e-6);
    picture[id.y * params.size.x + id.x] = pack4x8unorm(vec4<f32>(color, alpha));
}
