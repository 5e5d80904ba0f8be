// Ray-traced reference (METHODS 3): mean transmittance over directions, full sphere or cosine hemisphere.
// Twin: reference/ao_raytraced.rs.
#import common/levels
#import common/accessibility

struct RaytracedParams {
    level: LevelInfo,
    dims: vec3<u32>,
    first_row: u32,          // rows are counted through the slices: z * dims.y + y
    bricks: vec3<u32>,
    row_count: u32,
    row_words: u32,          // words between rows of the output, two samples to a word
    first_output_row: u32,
    ray_count: u32,
    hemisphere: u32,         // 1: cosine hemisphere where the normal is clear
    reach: f32,              // max-norm distance in voxels at which rays end
    normalise: f32,
}

const BRICK: f32 = 8.0;
const STEP: f32 = 0.5;

@group(0) @binding(0) var<uniform> params: RaytracedParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(2) var<storage, read_write> accessibility: array<u32>;
@group(0) @binding(3) var<storage, read> level: array<u32>;
// xyz: unit direction.
@group(0) @binding(4) var<storage, read> directions: array<vec4<f32>>;
// Chebyshev distance in bricks to the next brick that is not empty, four to a word.
@group(0) @binding(5) var<storage, read> brick_distance: array<u32>;

fn cell(at: vec3<u32>) -> f32 {
    let word = level[(at.z - params.level.first_slice) * params.level.slice_words + at.y * params.level.row_words + (at.x >> 1u)];
    return f32(select(low_half(word), high_half(word), (at.x & 1u) == 1u));
}

// Opacity between voxel centres; zero half a voxel outside the volume and beyond.
fn opacity(position: vec3<f32>) -> f32 {
    let last = vec3<f32>(params.level.extent - vec3<u32>(1u));
    let at = clamp(position + vec3<f32>(params.level.lookup_offset), vec3<f32>(0.0), last);
    let c = min(vec3<u32>(at), params.level.extent - vec3<u32>(2u));
    let f = at - vec3<f32>(c);
    let x00 = mix(cell(c), cell(c + vec3<u32>(1u, 0u, 0u)), f.x);
    let x10 = mix(cell(c + vec3<u32>(0u, 1u, 0u)), cell(c + vec3<u32>(1u, 1u, 0u)), f.x);
    let x01 = mix(cell(c + vec3<u32>(0u, 0u, 1u)), cell(c + vec3<u32>(1u, 0u, 1u)), f.x);
    let x11 = mix(cell(c + vec3<u32>(0u, 1u, 1u)), cell(c + vec3<u32>(1u, 1u, 1u)), f.x);
    return mix(mix(x00, x10, f.y), mix(x01, x11, f.y), f.z) * (1.0 / 65535.0);
}

fn value(voxel: vec3<i32>) -> f32 {
    let last = vec3<i32>(params.dims) - vec3<i32>(1);
    return textureLoad(value_texture, clamp(voxel, vec3<i32>(0), last), 0).r;
}

fn normal(voxel: vec3<i32>) -> vec3<f32> {
    let difference = vec3<f32>(
        value(voxel - vec3<i32>(1, 0, 0)) - value(voxel + vec3<i32>(1, 0, 0)),
        value(voxel - vec3<i32>(0, 1, 0)) - value(voxel + vec3<i32>(0, 1, 0)),
        value(voxel - vec3<i32>(0, 0, 1)) - value(voxel + vec3<i32>(0, 0, 1)),
    );
    return difference * 0.5 * params.normalise;
}

fn distance_at(brick: vec3<i32>) -> i32 {
    let b = vec3<u32>(clamp(brick, vec3<i32>(0), vec3<i32>(params.bricks) - vec3<i32>(1)));
    let index = (b.z * params.bricks.y + b.y) * params.bricks.x + b.x;
    return i32((brick_distance[index >> 2u] >> ((index & 3u) * 8u)) & 0xffu);
}

// Largest t at which position + t * direction is inside the box.
fn exit(position: vec3<f32>, inverse: vec3<f32>, low: vec3<f32>, high: vec3<f32>) -> f32 {
    let ends = max((low - position) * inverse, (high - position) * inverse);
    return min(ends.x, min(ends.y, ends.z));
}

fn transmittance(origin: vec3<f32>, direction: vec3<f32>) -> f32 {
    let longest = max(abs(direction.x), max(abs(direction.y), abs(direction.z)));
    let inverse = 1.0 / select(direction, vec3<f32>(1e-20), abs(direction) < vec3<f32>(1e-20));
    let begin = 0.5 / longest;
    let leave = exit(origin, inverse, vec3<f32>(-0.5), vec3<f32>(params.dims) + vec3<f32>(0.5));
    let end = min(params.reach / longest, leave);
    let sample_count = i32(max(ceil((end - begin) / STEP - 0.5), 0.0));
    var t = 1.0;
    var k = 0;
    loop {
        if k >= sample_count || t < 0.0002 {
            break;
        }
        let along = begin + (f32(k) + 0.5) * STEP;
        let position = origin + along * direction;
        let brick = vec3<i32>(floor(position / BRICK));
        let empty = distance_at(brick);
        if empty > 0 {
            // All bricks nearer than `empty` are empty: on to the first sample behind them.
            let low = vec3<f32>(brick - vec3<i32>(empty - 1)) * BRICK;
            let high = vec3<f32>(brick + vec3<i32>(empty)) * BRICK;
            k = max(k + 1, i32(ceil((exit(origin, inverse, low, high) - begin) / STEP - 0.5)));
            continue;
        }
        t *= sqrt(1.0 - min(opacity(position), 1.0));
        k += 1;
    }
    return t;
}

fn accessibility_at(voxel: vec3<i32>) -> f32 {
    let position = vec3<f32>(voxel) + vec3<f32>(0.5);
    let n = normal(voxel);
    let clear = params.hemisphere == 1u && length(n) >= 1e-3;
    let axis = n / max(length(n), 1e-6);
    var sum = 0.0;
    var weights = 0.0;
    for (var ray = 0u; ray < params.ray_count; ray++) {
        let direction = directions[ray].xyz;
        let weight = select(1.0, max(dot(axis, direction), 0.0), clear);
        if weight > 0.0 {
            sum += weight * transmittance(position, direction);
            weights += weight;
        }
    }
    // With very few rays none may lie in the hemisphere: nothing seen to block.
    return select(1.0, sum / max(weights, 1e-6), weights > 0.0);
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    if id.x * 2u >= params.dims.x || id.y >= params.row_count {
        return;
    }
    let row = id.y + params.first_row;
    let x = 2u * id.x;
    let y = row % params.dims.y;
    let slice = row / params.dims.y;
    let left = accessibility_at(vec3<i32>(vec3<u32>(x, y, slice)));
    let right = accessibility_at(vec3<i32>(vec3<u32>(min(x + 1u, params.dims.x - 1u), y, slice)));
    accessibility[(row - params.first_output_row) * params.row_words + id.x] = pack_samples(vec2<f32>(left, right));
}
