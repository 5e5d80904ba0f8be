// Distribution of accessibility in front of surfaces, from which the exposure of pictures is taken. A voxel counts as
// far as it is clear and has an opaque face neighbour. Every second sample along each axis is taken.
// Twin: reference/ao_surface.rs.
#import common/levels
#import common/accessibility

struct SurfaceParams {
    level: LevelInfo,
    dims: vec3<u32>,
    first_row: u32,          // rows are counted through the slices: z * dims.y + y
    row_count: u32,
    row_words: u32,          // words between rows of the samples
}

@group(0) @binding(0) var<uniform> params: SurfaceParams;
@group(0) @binding(1) var<storage, read> samples: array<u32>;
@group(0) @binding(2) var<storage, read> level: array<u32>;
@group(0) @binding(3) var<storage, read_write> bins: array<atomic<u32>>;

// Opacity of a cell of level 0, 0 to 65535.
fn opacity(cell: vec3<u32>) -> u32 {
    let word = level[(cell.z - params.level.first_slice) * params.level.slice_words + cell.y * params.level.row_words + (cell.x >> 1u)];
    return select(low_half(word), high_half(word), (cell.x & 1u) == 1u);
}

@compute @workgroup_size(8, 8, 1)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let row = params.first_row + id.y;
    let voxel = vec3<u32>(2u * id.x, row % params.dims.y, row / params.dims.y);
    if voxel.x >= params.dims.x || id.y >= params.row_count || ((voxel.y | voxel.z) & 1u) == 1u {
        return;
    }
    // Cell c holds voxel c - 1; the cells around the volume are there, and empty.
    let cell = voxel + vec3<u32>(1u);
    var densest = max(opacity(cell - vec3<u32>(1u, 0u, 0u)), opacity(cell + vec3<u32>(1u, 0u, 0u)));
    densest = max(densest, max(opacity(cell - vec3<u32>(0u, 1u, 0u)), opacity(cell + vec3<u32>(0u, 1u, 0u))));
    densest = max(densest, max(opacity(cell - vec3<u32>(0u, 0u, 1u)), opacity(cell + vec3<u32>(0u, 0u, 1u))));
    let weight = u32(f32(65535u - opacity(cell)) * f32(densest) * (255.0 / (65535.0 * 65535.0)) + 0.5);
    if weight > 0u {
        let accessibility = unpack_sample(samples[id.y * params.row_words + (voxel.x >> 1u)], voxel.x & 1u);
        // Square roots: small accessibilities are told apart.
        atomicAdd(&bins[u32(sqrt(accessibility) * 255.0 + 0.5)], weight);
    }
}
