//! Code ranges of bricks against looking at every voxel.

use spao_server::volume::{BrickRanges, Volume, Voxels};

use super::volume;

/// Lowest and highest code within `apron` voxels around each brick.
fn naive(volume: &Volume, brick: u32, apron: i64) -> BrickRanges {
    let n = volume.grid.dims.map(i64::from);
    let dims = volume.grid.dims.map(|n| n.div_ceil(brick));
    let mut ranges = Vec::new();
    for bz in 0..dims[2] {
        for by in 0..dims[1] {
            for bx in 0..dims[0] {
                let first = [bx, by, bz].map(|b| i64::from(b * brick));
                let inside = |p: [i64; 3]| {
                    (0..3).all(|a| p[a] >= first[a] - apron && p[a] < first[a] + i64::from(brick) + apron)
                };
                let codes = (0..volume.voxels.len() as i64)
                    .filter(|i| inside([i % n[0], i / n[0] % n[1], i / n[0] / n[1]]))
                    .map(|i| volume.code_map.code_from_value(volume.voxels.value(i as usize)));
                let codes: Vec<u16> = codes.collect();
                ranges.push([*codes.iter().min().expect("not empty"), *codes.iter().max().expect("not empty")]);
            }
        }
    }
    BrickRanges { dims, ranges }
}

fn noise(i: u32) -> u32 {
    i.wrapping_mul(2_654_435_761) >> 7
}

#[test]
fn ranges_are_those_of_every_voxel_of_the_brick_and_its_apron() {
    let dims = [19, 9, 16];
    let count = dims.iter().product();
    let bytes = volume(dims, Voxels::U8((0..count).map(|i| noise(i) as u8).collect()));
    let shorts = volume(dims, Voxels::I16((0..count).map(|i| noise(i) as i16).collect()));
    let floats = (0..count).map(|i| if i % 11 < 2 || i < 300 { f32::NAN } else { noise(i) as f32 });
    let floats = volume(dims, Voxels::F32(floats.collect()));
    for volume in [bytes, shorts, floats] {
        for brick in [1, 4, 8, 64] {
            assert_eq!(volume.brick_ranges(brick), naive(&volume, brick, 1), "bricks of {brick}");
        }
        assert_ne!(volume.brick_ranges(4), naive(&volume, 4, 0), "the comparison does not see the apron");
    }
}

#[test]
fn a_single_bright_voxel_lights_its_brick_and_those_it_touches() {
    let mut values = vec![0_u8; 24 * 24 * 24];
    values[(8 * 24 + 12) * 24 + 7] = 200;
    let bricks = volume([24; 3], Voxels::U8(values)).brick_ranges(8);
    assert_eq!(bricks.dims, [3; 3]);
    let lit: Vec<usize> = (0..27).filter(|&b| bricks.ranges[b] == [0, 200]).collect();
    // x = 7 is in brick 0 and in the apron of 1; y = 12 is inside brick 1; z = 8 is in brick 1 and in the apron of 0.
    assert_eq!(lit, [3, 4, 12, 13]);
    assert!((0..27).all(|b| lit.contains(&b) || bricks.ranges[b] == [0, 0]));
}

#[test]
fn a_brick_larger_than_any_volume_is_one_brick() {
    let bricks = volume([2, 1, 1], Voxels::U8(vec![10, 12])).brick_ranges(u32::MAX);
    assert_eq!(bricks, BrickRanges { dims: [1; 3], ranges: vec![[0, 2]] });
}
