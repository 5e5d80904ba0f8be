//! Voxels of every type: bytes, statistics, codes, checksums.

use glam::DVec3;
use spao_server::volume::{CodeMap, Endian, Grid, Volume, VoxelType, Voxels, bytes_needed};

use super::{assert_names, sample_voxels, volume};

#[test]
fn every_type_is_read_from_both_byte_orders() {
    for voxel_type in VoxelType::ALL {
        for endian in [Endian::Little, Endian::Big] {
            let (expected, bytes) = sample_voxels(voxel_type, endian);
            let voxels = Voxels::from_bytes(voxel_type, endian, &bytes).expect("whole voxels");
            assert_eq!(voxels, expected);
            assert_eq!((voxels.len(), voxels.voxel_type()), (24, voxel_type));
            assert_eq!(voxels.bytes(), bytes.len() as u64);
            let (_, little) = sample_voxels(voxel_type, Endian::Little);
            assert_eq!(voxels.little_endian_bytes(), little);
        }
    }
    let (expected, bytes) = sample_voxels(VoxelType::I16, Endian::Big);
    assert_ne!(Voxels::from_bytes(VoxelType::I16, Endian::Little, &bytes).expect("whole voxels"), expected);
}

#[test]
fn half_a_voxel_is_an_error() {
    assert_names(Voxels::from_bytes(VoxelType::F32, Endian::Little, &[0; 7]), "voxels", "7 bytes");
}

#[test]
fn statistics_ignore_nan_and_count_it() {
    // Several chunks of parallel work, the first of them all NaN.
    let mut values = vec![f32::NAN; 200_000];
    values[150_000..].fill(1.0);
    values[170_000] = -3.5;
    values[199_999] = 8.25;
    values[160_000] = f32::NAN;
    let statistics = Voxels::F32(values).statistics().expect("no infinite value");
    assert_eq!(statistics.range, Some([-3.5, 8.25]));
    assert_eq!(statistics.nan_count, 150_001);
}

#[test]
fn an_infinite_value_is_an_error_that_says_where_it_is_first() {
    let mut values = vec![0.0_f64; 200_000];
    values[190_000] = f64::INFINITY;
    values[123_456] = f64::NEG_INFINITY;
    let grid = Grid::axis_aligned([200, 1000, 1], DVec3::ONE);
    assert_names(Volume::new(grid, Voxels::F64(values)), "voxels", "infinite value at index 123456");
}

#[test]
fn a_volume_of_nothing_but_nan_is_an_error() {
    let grid = Grid::axis_aligned([2, 1, 1], DVec3::ONE);
    assert_names(Volume::new(grid, Voxels::F32(vec![f32::NAN; 2])), "voxels", "NaN");
}

#[test]
fn nan_voxels_count_as_the_lowest_value() {
    let volume = volume([3, 1, 1], Voxels::F32(vec![f32::NAN, -2.0, 4.0]));
    assert_eq!(volume.nan_count, 1);
    assert_eq!(volume.code_map.value_range(), [-2.0, 4.0]);
    assert_eq!([0, 1, 2].map(|i| volume.value_at([i, 0, 0])), [-2.0, -2.0, 4.0]);
    let mut codes = Vec::new();
    volume.write_codes(0..1, &mut codes);
    assert_eq!(codes, [0, 0, 0, 0, 255, 255]);
}

#[test]
fn voxels_must_fill_the_dims() {
    let grid = |dims| Grid::axis_aligned(dims, DVec3::ONE);
    assert_names(Volume::new(grid([2, 2, 2]), Voxels::U8(vec![0; 7])), "voxels", "[2, 2, 2]");
    assert_names(Volume::new(grid([0, 2, 2]), Voxels::U8(vec![])), "dims", "at least 1");
    assert_names(Volume::new(grid([u32::MAX; 3]), Voxels::U8(vec![0])), "voxels", "fill");
}

#[test]
fn a_grid_that_does_not_map_to_the_world_is_an_error() {
    let good = Grid::axis_aligned([1, 1, 1], DVec3::ONE);
    let check = |grid: Grid, field| assert_names(Volume::new(grid, Voxels::U8(vec![0])), field, "");
    for spacing in [0.0, -1.0, f64::NAN, f64::INFINITY, 1e13] {
        check(Grid { spacing: DVec3::new(1.0, spacing, 1.0), ..good.clone() }, "spacing");
    }
    check(Grid { origin: DVec3::new(0.0, 0.0, f64::NAN), ..good.clone() }, "origin");
    check(Grid { direction: [DVec3::X, DVec3::X, DVec3::Z], ..good.clone() }, "direction");
    check(Grid { direction: [DVec3::X * 2.0, DVec3::Y, DVec3::Z], ..good.clone() }, "direction");
    check(Grid { direction: [DVec3::NAN, DVec3::Y, DVec3::Z], ..good }, "direction");
}

#[test]
fn codes_written_slab_by_slab_are_those_of_every_voxel() {
    for voxel_type in VoxelType::ALL {
        let (voxels, _) = sample_voxels(voxel_type, Endian::Little);
        let volume = volume([2, 3, 4], voxels);
        let codes = slab_codes(&volume, 3);
        let expected = naive_codes(&volume, &volume.code_map);
        assert_eq!(codes, expected, "{voxel_type}");
        assert_eq!(codes.len() as u64, volume.code_bytes());
        let shifted = CodeMap { lowest: volume.code_map.lowest - volume.code_map.step, ..volume.code_map };
        assert_ne!(codes, naive_codes(&volume, &shifted), "the comparison sees nothing");
    }
}

/// All codes, in slabs of so many slices.
fn slab_codes(volume: &Volume, thickness: u32) -> Vec<u8> {
    let mut slab = Vec::new();
    let mut codes = Vec::new();
    for z in (0..volume.grid.dims[2]).step_by(thickness as usize) {
        volume.write_codes(z..z + thickness, &mut slab);
        codes.extend_from_slice(&slab);
    }
    codes
}

fn naive_codes(volume: &Volume, map: &CodeMap) -> Vec<u8> {
    let bytes = map.bytes_per_voxel() as usize;
    (0..volume.voxels.len())
        .flat_map(|i| map.code_from_value(volume.voxels.value(i)).to_le_bytes().into_iter().take(bytes))
        .collect()
}

#[test]
fn slices_beyond_the_volume_have_no_codes() {
    let volume = volume([1, 1, 2], Voxels::U8(vec![3, 9]));
    let mut codes = vec![1; 10];
    volume.write_codes(1..7, &mut codes);
    assert_eq!(codes, [6]);
    volume.write_codes(5..7, &mut codes);
    assert!(codes.is_empty());
}

#[test]
fn the_checksum_is_of_everything_that_makes_a_volume() {
    let grid = Grid::axis_aligned([2, 1, 1], DVec3::ONE);
    let sum = |grid: &Grid, voxels| Volume::new(grid.clone(), voxels).expect("a valid volume").sha256_hex();
    let sums = [
        sum(&grid, Voxels::U8(vec![1, 2])),
        sum(&grid, Voxels::U8(vec![1, 3])),
        sum(&grid, Voxels::I8(vec![1, 2])),
        sum(&Grid { dims: [1, 2, 1], ..grid.clone() }, Voxels::U8(vec![1, 2])),
        sum(&Grid { spacing: DVec3::splat(2.0), ..grid.clone() }, Voxels::U8(vec![1, 2])),
        sum(&Grid { origin: DVec3::X, ..grid.clone() }, Voxels::U8(vec![1, 2])),
        sum(&Grid { direction: [DVec3::Y, DVec3::X, DVec3::Z], ..grid.clone() }, Voxels::U8(vec![1, 2])),
    ];
    for (i, a) in sums.iter().enumerate() {
        assert!(a.len() == 64 && a.bytes().all(|b| b.is_ascii_hexdigit()), "{a}");
        assert!(sums[..i].iter().all(|b| a != b), "{i}");
    }
    let negative_zero = Grid { origin: DVec3::splat(-0.0), ..grid };
    assert_eq!(sums[0], sum(&negative_zero, Voxels::U8(vec![1, 2])));
}

#[test]
fn bytes_needed_does_not_overflow() {
    assert_eq!(bytes_needed([512, 512, 234], VoxelType::I16), Some(122_683_392));
    assert_eq!(bytes_needed([u32::MAX; 3], VoxelType::U8), None);
}
