//! What occurs in bricks against looking at every voxel.

use spao_server::volume::{BRICK, Bricks, Volume, Voxels};

use super::volume;

/// Codes within `apron` voxels around each brick, brick after brick.
fn naive(volume: &Volume, apron: i64) -> Vec<Vec<u16>> {
    let n = volume.grid.dims.map(i64::from);
    let bricks = volume.grid.dims.map(|n| n.div_ceil(BRICK));
    let mut all = Vec::new();
    for bz in 0..bricks[2] {
        for by in 0..bricks[1] {
            for bx in 0..bricks[0] {
                let first = [bx, by, bz].map(|b| i64::from(b * BRICK));
                let inside = |p: [i64; 3]| {
                    (0..3).all(|a| p[a] >= first[a] - apron && p[a] < first[a] + i64::from(BRICK) + apron)
                };
                let codes = (0..volume.voxels.len() as i64)
                    .filter(|i| inside([i % n[0], i / n[0] % n[1], i / n[0] / n[1]]))
                    .map(|i| volume.code_map.code_from_value(volume.voxels.value(i as usize)));
                all.push(codes.collect());
            }
        }
    }
    all
}

fn ranges(codes: &[Vec<u16>]) -> Vec<[u16; 2]> {
    let ends = |codes: &Vec<u16>| [*codes.iter().min().expect("not empty"), *codes.iter().max().expect("not empty")];
    codes.iter().map(ends).collect()
}

fn noise(i: u32) -> u32 {
    i.wrapping_mul(2_654_435_761) >> 7
}

/// Bytes, signed shorts, and floats of which some are no numbers.
fn volumes(dims: [u32; 3]) -> [Volume; 3] {
    let count = dims.iter().product();
    let floats = (0..count).map(|i| if i % 11 == 1 || (50..300).contains(&i) { f32::NAN } else { noise(i) as f32 });
    [
        volume(dims, Voxels::U8((0..count).map(|i| noise(i) as u8).collect())),
        volume(dims, Voxels::I16((0..count).map(|i| noise(i) as i16).collect())),
        volume(dims, Voxels::F32(floats.collect())),
    ]
}

#[test]
fn ranges_are_those_of_every_voxel_of_the_brick_and_its_apron() {
    for dims in [[19, 9, 16], [1, 1, 1], [8, 8, 8], [33, 1, 7]] {
        for volume in volumes(dims) {
            let bricks = volume.bricks();
            assert_eq!(bricks.dims, dims.map(|n| n.div_ceil(8)));
            assert_eq!(bricks.ranges, ranges(&naive(&volume, 1)));
            assert_eq!(bricks.wide_ranges, ranges(&naive(&volume, 3)));
        }
    }
    let bricks = volumes([19, 9, 16])[0].bricks();
    let narrow = ranges(&naive(&volumes([19, 9, 16])[0], 0));
    assert!(bricks.ranges != narrow && bricks.wide_ranges != bricks.ranges, "the comparison does not see the aprons");
}

#[test]
fn a_single_bright_voxel_lights_its_brick_and_those_it_touches() {
    let mut values = vec![0_u8; 24 * 24 * 24];
    values[(8 * 24 + 12) * 24 + 7] = 200;
    let bricks = volume([24; 3], Voxels::U8(values)).bricks();
    assert_eq!(bricks.dims, [3; 3]);
    let lit = |ranges: &[[u16; 2]]| -> Vec<usize> { (0..27).filter(|&b| ranges[b] == [0, 200]).collect() };
    // x = 7 is in brick 0 and in the apron of 1; y = 12 is inside brick 1; z = 8 is in brick 1 and in the apron of 0.
    assert_eq!(lit(&bricks.ranges), [3, 4, 12, 13]);
    assert_eq!(lit(&bricks.wide_ranges), [3, 4, 12, 13]);
    assert!((0..27).all(|b| [3, 4, 12, 13].contains(&b) || bricks.ranges[b] == [0, 0]));
    let set = bricks.code_set(256, |code| code == 200);
    let holding: Vec<usize> = (0..27).filter(|&b| bricks.any_of(b, &set)).collect();
    assert_eq!(holding, [12], "a brick's own voxels only");
}

/// Bricks for which the answer of `any_of` for a set is not whether one of their own codes shares a bucket with it.
fn wrong_answers(volume: &Volume, bricks: &Bricks, holds: impl Fn(usize) -> bool + Copy) -> usize {
    let count = usize::from(volume.code_map.max_code) + 1;
    let set = bricks.code_set(count, holds);
    let bucket = |code: u16| usize::from(code) >> bricks.bucket_shift;
    let buckets: Vec<usize> = (0..count).filter(|&code| holds(code)).map(|c| bucket(c as u16)).collect();
    let truth = |codes: &Vec<u16>| codes.iter().any(|&code| buckets.contains(&bucket(code)));
    naive(volume, 0).iter().map(truth).enumerate().filter(|&(b, truth)| bricks.any_of(b, &set) != truth).count()
}

#[test]
fn the_codes_of_a_brick_are_those_of_its_own_voxels_by_bucket() {
    for volume in volumes([19, 9, 16]) {
        let (bricks, highest) = (volume.bricks(), u32::from(volume.code_map.max_code));
        assert!(highest >> bricks.bucket_shift < 256, "a bucket for every code");
        assert!(bricks.bucket_shift == 0 || highest >> (bricks.bucket_shift - 1) > 255, "no coarser than needed");
        for wanted in [0, 1, 77, 200, 254, 255, 256, 3000, 65534, 65535] {
            assert_eq!(wrong_answers(&volume, &bricks, |code| code == wanted), 0, "{wanted}");
            assert_eq!(wrong_answers(&volume, &bricks, |code| code > wanted), 0, "> {wanted}");
        }
        assert_eq!(wrong_answers(&volume, &bricks, |_| false), 0);
        let mut wrong = bricks.as_ref().clone();
        wrong.codes[3] = Default::default();
        assert!(wrong_answers(&volume, &wrong, |_| true) > 0, "the comparison does not see a brick without codes");
    }
}

#[test]
fn a_volume_smaller_than_a_brick_is_one_brick() {
    let bricks = volume([2, 1, 1], Voxels::U8(vec![10, 12])).bricks();
    // Code 0 is the lowest value.
    let codes = vec![[0b101, 0, 0, 0]];
    let range = vec![[0, 2]];
    let expected = Bricks { dims: [1; 3], ranges: range.clone(), wide_ranges: range, codes, bucket_shift: 0 };
    assert_eq!(*bricks, expected);
}
