// Work lists. An entry is the index of a tile, x fastest, with flags. Twin: ao/tiles.rs.
const MUST: u32 = 0x80000000u;      // to be done whether its inputs changed or not
const CLEAR: u32 = 0x40000000u;     // to become zero: it no longer holds anything
const INDEX: u32 = 0x3fffffffu;

fn tile_at(index: u32, tiles: vec3<u32>) -> vec3<u32> {
    return vec3<u32>(index % tiles.x, (index / tiles.x) % tiles.y, index / (tiles.x * tiles.y));
}
