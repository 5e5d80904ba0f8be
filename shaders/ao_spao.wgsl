// Accessibility from box means: the product over shells of what they let through (SPAO 1.2.2, METHODS 2).
// Twin: reference/ao_spao.rs.
#import common/levels
#import common/accessibility

struct SpaoParams {
    levels: array<LevelInfo, 9>,
    dims: vec3<u32>,
    first_slice: u32,
    slice_count: u32,
    row_words: u32,          // words between rows of the output, two samples to a word
    normalise: f32,          // normalised value per stored value
    normal_factor: f32,
}

// False saves the gradient where normal_factor is 0.
override OFFSET_BY_NORMAL: bool = true;

@group(0) @binding(0) var<uniform> params: SpaoParams;
@group(0) @binding(1) var value_texture: texture_3d<f32>;
@group(0) @binding(2) var<storage, read_write> accessibility: array<u32>;

#repeat L 0..=LEVELS
@group(0) @binding(1@L@) var<storage, read> level_@L@: array<u32>;

// Mean of the two rows' cells at `word`, mixed along x.
fn row_@L@(start: u32, odd: bool, fraction: f32) -> f32 {
    let first = level_@L@[start];
    let second = level_@L@[start + 1u];
    let near = select(low_half(first), high_half(first), odd);
    let far = select(high_half(first), low_half(second), odd);
    return mix(f32(near), f32(far), fraction);
}

// M of width 2^@L@ at an index-space position, as a fraction of 65535.
fn box_mean_@L@(position: vec3<f32>) -> f32 {
    let info = params.levels[@L@];
    let cell = clamp(position * info.inverse_scale + vec3<f32>(0.5 * info.width), vec3<f32>(0.0), vec3<f32>(info.extent - vec3<u32>(1u)));
    let corner = vec3<u32>(cell);
    let fraction = cell - vec3<f32>(corner);
    let odd = (corner.x & 1u) == 1u;
    let start = (corner.z - info.first_slice) * info.slice_words + corner.y * info.row_words + (corner.x >> 1u);
    let y0 = mix(row_@L@(start, odd, fraction.x), row_@L@(start + info.row_words, odd, fraction.x), fraction.y);
    let next = start + info.slice_words;
    let y1 = mix(row_@L@(next, odd, fraction.x), row_@L@(next + info.row_words, odd, fraction.x), fraction.y);
    return mix(y0, y1, fraction.z);
}
#end

fn value(voxel: vec3<i32>) -> f32 {
    let last = vec3<i32>(params.dims) - vec3<i32>(1);
    return textureLoad(value_texture, clamp(voxel, vec3<i32>(0), last), 0).r;
}

// -grad of the normalised value by central differences, of length at most 1 (SPAO 1.3, METHODS 2).
fn normal(voxel: vec3<i32>) -> vec3<f32> {
    let difference = vec3<f32>(
        value(voxel - vec3<i32>(1, 0, 0)) - value(voxel + vec3<i32>(1, 0, 0)),
        value(voxel - vec3<i32>(0, 1, 0)) - value(voxel + vec3<i32>(0, 1, 0)),
        value(voxel - vec3<i32>(0, 0, 1)) - value(voxel + vec3<i32>(0, 0, 1)),
    );
    let n = difference * 0.5 * params.normalise;
    return n / max(length(n), 1.0);
}

fn accessibility_at(voxel: vec3<i32>) -> f32 {
    let position = vec3<f32>(voxel) + vec3<f32>(0.5);
    var half_offset = vec3<f32>(0.0);
    if OFFSET_BY_NORMAL {
        half_offset = normal(voxel) * (params.normal_factor * 0.5);
    }
    var product = 1.0;
    var inner = box_mean_0(position + half_offset);
#repeat L 1..=LEVELS
    let mean_@L@ = box_mean_@L@(position + half_offset * f32(1u << @L@u));
    product *= 1.0 - clamp((8.0 * mean_@L@ - inner) * (1.0 / (7.0 * 65535.0)), 0.0, 1.0);
    inner = mean_@L@;
#end
    return product;
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let slice = id.z + params.first_slice;
    if id.x * 2u >= params.dims.x || id.y >= params.dims.y || id.z >= params.slice_count {
        return;
    }
    let x = 2u * id.x;
    let left = accessibility_at(vec3<i32>(vec3<u32>(x, id.y, slice)));
    let right = accessibility_at(vec3<i32>(vec3<u32>(min(x + 1u, params.dims.x - 1u), id.y, slice)));
    accessibility[(id.z * params.dims.y + id.y) * params.row_words + id.x] = pack_samples(vec2<f32>(left, right));
}
