// Distribution of accessibility in front of surfaces, from which the exposure of pictures is taken. A voxel counts as
// far as it is clear and has an opaque face neighbour. Every second sample along each axis is taken.
// Twin: reference/ao_surface.rs.
#import common/levels
#import common/tiles

struct SurfaceParams {
    level: LevelInfo,
    dims: vec3<u32>,
    origin: u32,             // cell of the first voxel
    bricks: vec3<u32>,
    first_brick: u32,        // in the list
}

@group(0) @binding(0) var<uniform> params: SurfaceParams;
@group(0) @binding(1) var accessibility: texture_3d<f32>;
@group(0) @binding(2) var<storage, read> level: array<u32>;
@group(0) @binding(3) var<storage, read> list: array<u32>;
@group(0) @binding(4) var<storage, read_write> bins: array<atomic<u32>>;

// Opacity of a cell of level 0, 0 to 65535.
fn opacity(cell: vec3<u32>) -> u32 {
    let word = level[(cell.z - params.level.first_slice) * params.level.slice_words + cell.y * params.level.row_words + (cell.x >> 1u)];
    return select(low_half(word), high_half(word), (cell.x & 1u) == 1u);
}

@compute @workgroup_size(4, 4, 4)
fn main(@builtin(workgroup_id) group: vec3<u32>, @builtin(local_invocation_id) local: vec3<u32>) {
    let brick = list[params.first_brick + group.x] & INDEX;
    let voxel = tile_at(brick, params.bricks) * 8u + 2u * local;
    if any(voxel >= params.dims) {
        return;
    }
    // The cells around the volume are there, and empty.
    let cell = voxel + vec3<u32>(params.origin);
    var densest = max(opacity(cell - vec3<u32>(1u, 0u, 0u)), opacity(cell + vec3<u32>(1u, 0u, 0u)));
    densest = max(densest, max(opacity(cell - vec3<u32>(0u, 1u, 0u)), opacity(cell + vec3<u32>(0u, 1u, 0u))));
    densest = max(densest, max(opacity(cell - vec3<u32>(0u, 0u, 1u)), opacity(cell + vec3<u32>(0u, 0u, 1u))));
    let weight = u32(f32(65535u - opacity(cell)) * f32(densest) * (255.0 / (65535.0 * 65535.0)) + 0.5);
    if weight > 0u {
        // Square roots: small accessibilities are told apart.
        let a = textureLoad(accessibility, vec3<i32>(voxel), 0).r;
        atomicAdd(&bins[u32(sqrt(a) * 255.0 + 0.5)], weight);
    }
}
