// A word for each tile of all levels: it has changed since the last update that was finished.
@group(0) @binding(2) var<storage, read> changed: array<u32>;

// Whether a tile from `low` to `high`, both included, of the level whose marks begin at `first` has changed.
fn any_marked(low: vec3<u32>, high: vec3<u32>, tiles: vec3<u32>, first: u32) -> bool {
    var found = 0u;
    for (var z = low.z; z <= high.z; z++) {
        for (var y = low.y; y <= high.y; y++) {
            for (var x = low.x; x <= high.x; x++) {
                found |= changed[first + (z * tiles.y + y) * tiles.x + x];
            }
        }
    }
    return found != 0u;
}
