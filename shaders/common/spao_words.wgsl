// Box means from the packed words, eight cells mixed by hand, and samples into words: for adapters without 16-bit
// normalised textures.
#import common/accessibility

@group(0) @binding(2) var<storage, read_write> accessibility: array<u32>;

#repeat L 0..=LEVELS
@group(0) @binding(1@L@) var<storage, read> level_@L@: array<u32>;

// Two cells of a row, mixed along x.
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
    let cell = clamp(position * info.inverse_scale + vec3<f32>(info.lookup_offset), vec3<f32>(0.0), vec3<f32>(info.extent - vec3<u32>(1u)));
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

// A word holds two samples: the invocation of the first makes both.
fn put(voxel: vec3<u32>, clear: bool) {
    if (voxel.x & 1u) == 1u {
        return;
    }
    let left = accessibility_at(vec3<i32>(voxel));
    let right = accessibility_at(vec3<i32>(vec3<u32>(min(voxel.x + 1u, params.dims.x - 1u), voxel.yz)));
    let both = select(pack_samples(vec2<f32>(left, right)), 0u, clear);
    accessibility[((voxel.z - params.first_slice) * params.dims.y + voxel.y) * params.row_words + (voxel.x >> 1u)] = both;
}
