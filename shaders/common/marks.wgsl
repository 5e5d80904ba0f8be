// A word for each block of 32 x 8 x 8 cells of all levels: it has changed since the last update that was finished.
// Tiles of coarse levels are larger, but what an edit changes is not. Twin: ao/levels.rs.
const BLOCK: vec3<u32> = vec3<u32>(32u, 8u, 8u);

@group(0) @binding(2) var<storage, read> changed: array<u32>;

// Whether any of the cells from `low` to `high`, both included, is in a block that has changed, of the level whose
// marks begin at `first`.
fn any_marked(low_cell: vec3<u32>, high_cell: vec3<u32>, blocks: vec3<u32>, first: u32) -> bool {
    let low = low_cell / BLOCK;
    let high = high_cell / BLOCK;
    var found = 0u;
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                found |= changed[first + (z * blocks.y + y) * blocks.x + x];
            }
        }
    }
    return found != 0u;
}
