//! Volumes averaged in blocks, and parts of them: against plain loops, and in the world.

use glam::DVec3;
use spao_server::volume::{
    Grid, LoadWatch, Region, Resolution, Volume, VolumeError, VoxelType, Voxels, factor_that_fits, parse_region,
    reduced_dims,
};

use super::assert_names;

/// Numbers that look random, the same in every run.
fn noise(count: usize) -> Vec<u64> {
    let step = |state: &mut u64| {
        *state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        Some(*state ^ (*state >> 29))
    };
    std::iter::repeat_with(|| ()).scan(7, |state, ()| step(state)).take(count).collect()
}

/// Voxels of a type that use its whole width.
fn noisy(voxel_type: VoxelType, count: usize) -> Voxels {
    let bits = noise(count);
    match voxel_type {
        VoxelType::U8 => Voxels::U8(bits.iter().map(|&b| b as u8).collect()),
        VoxelType::I8 => Voxels::I8(bits.iter().map(|&b| b as i8).collect()),
        VoxelType::U16 => Voxels::U16(bits.iter().map(|&b| b as u16).collect()),
        VoxelType::I16 => Voxels::I16(bits.iter().map(|&b| b as i16).collect()),
        VoxelType::U32 => Voxels::U32(bits.iter().map(|&b| b as u32).collect()),
        VoxelType::I32 => Voxels::I32(bits.iter().map(|&b| b as i32).collect()),
        VoxelType::U64 => Voxels::U64(bits),
        VoxelType::I64 => Voxels::I64(bits.iter().map(|&b| b.cast_signed()).collect()),
        VoxelType::F32 => Voxels::F32(bits.iter().map(|&b| (b as f32) * 1e-15 - 3e3).collect()),
        VoxelType::F64 => Voxels::F64(bits.iter().map(|&b| (b as f64) * 1e-15 - 3e3).collect()),
    }
}

/// Unequal spacing, and axes neither the world's nor at right angles.
fn grid(dims: [u32; 3]) -> Grid {
    Grid {
        dims,
        spacing: DVec3::new(0.7, 1.1, 2.3),
        origin: DVec3::new(30.0, -20.0, 5.0),
        direction: [
            DVec3::new(0.9, 0.3, -0.1).normalize(),
            DVec3::new(-0.4, 1.0, 0.2).normalize(),
            DVec3::new(0.1, 0.2, 1.0).normalize(),
        ],
    }
}

fn volume(dims: [u32; 3], voxels: Voxels) -> Volume {
    Volume::new(grid(dims), voxels).expect("a valid volume")
}

fn count(dims: [u32; 3]) -> usize {
    dims.iter().map(|&n| n as usize).product()
}

fn averaged(volume: &Volume, factor: [u32; 3]) -> Volume {
    volume.averaged(factor, &LoadWatch::default()).expect("nobody calls it off")
}

fn cropped(volume: &Volume, region: &Region) -> Result<Volume, VolumeError> {
    volume.cropped(region, &LoadWatch::default())
}

/// Indices of all voxels, x fastest.
fn indices(dims: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    let [nx, ny, nz] = dims;
    (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
}

/// The twin: the mean of a block as anyone would write it down; NaN without values.
fn mean(volume: &Volume, factor: [u32; 3], block: [u32; 3]) -> f64 {
    let dims = volume.grid.dims;
    let range = |axis: usize| block[axis] * factor[axis]..((block[axis] + 1) * factor[axis]).min(dims[axis]);
    let (mut sum, mut count) = (0.0, 0.0);
    for k in range(2) {
        for j in range(1) {
            for i in range(0) {
                let value = volume.voxels.value(((k * dims[1] + j) * dims[0] + i) as usize);
                if !value.is_nan() {
                    sum += value;
                    count += 1.0;
                }
            }
        }
    }
    sum / count
}

/// The largest difference to the twin, in halves of a step for integers and relative to the range for floats.
fn worst(full: &Volume, reduced: &Volume, factor: [u32; 3]) -> f64 {
    let is_integer = full.voxels.voxel_type().is_integer();
    let [lowest, highest] = full.code_map.value_range();
    // A 64-bit integer is not exact in f64.
    let step = if is_integer && full.voxels.voxel_type().bytes() < 8 { 1.0 } else { (highest - lowest) * 1e-6 };
    let differences = indices(reduced.grid.dims).enumerate().map(|(at, block)| {
        let (twin, value) = (mean(full, factor, block), reduced.voxels.value(at));
        let twin = if is_integer { twin.round() } else { twin };
        if twin.is_nan() && value.is_nan() { 0.0 } else { (twin - value).abs() / step }
    });
    differences.fold(0.0, |worst, d| if d.is_nan() { f64::INFINITY } else { f64::max(worst, d) })
}

#[test]
fn blocks_of_every_type_have_the_mean_of_plain_loops() {
    let dims = [7, 6, 5];
    for voxel_type in VoxelType::ALL {
        let full = volume(dims, noisy(voxel_type, count(dims)));
        for factor in [[2, 2, 2], [3, 3, 3], [2, 1, 1], [1, 3, 2], [7, 6, 5], [9, 9, 9]] {
            let reduced = averaged(&full, factor);
            assert_eq!(reduced.grid.dims, std::array::from_fn(|a| dims[a].div_ceil(factor[a])));
            assert_eq!(reduced.voxels.voxel_type(), voxel_type);
            let worst = worst(&full, &reduced, factor);
            assert!(worst <= if voxel_type.is_integer() { 0.5 } else { 1.0 }, "{voxel_type} {factor:?}: {worst}");
        }
        assert_eq!(averaged(&full, [1; 3]).voxels, full.voxels);
    }
}

#[test]
fn the_comparison_with_plain_loops_notices_one_other_voxel_and_another_factor() {
    let dims = [7, 6, 5];
    for voxel_type in VoxelType::ALL {
        let full = volume(dims, noisy(voxel_type, count(dims)));
        let mut other = noisy(voxel_type, count(dims));
        let mut bytes = other.little_endian_bytes().into_owned();
        // The highest byte of the last voxel, which fills a block of its own in a corner.
        let at = bytes.len() - 1;
        bytes[at] ^= 0x04;
        other = Voxels::from_bytes(voxel_type, spao_server::volume::Endian::Little, &bytes).expect("as many");
        let reduced = averaged(&volume(dims, other), [2, 2, 2]);
        assert!(worst(&full, &reduced, [2, 2, 2]) > 1.0, "{voxel_type}");
    }
    let full = volume(dims, noisy(VoxelType::I16, count(dims)));
    assert!(worst(&full, &averaged(&full, [3, 3, 3]), [3, 3, 2]) > 1.0);
}

#[test]
fn means_are_rounded_to_the_nearest_and_halves_away_from_zero() {
    let mean_of = |voxels: Voxels| {
        let n = voxels.len() as u32;
        averaged(&volume([n, 1, 1], voxels), [n, 1, 1]).voxels
    };
    assert_eq!(mean_of(Voxels::U8(vec![1, 2])), Voxels::U8(vec![2]));
    assert_eq!(mean_of(Voxels::U8(vec![255, 254])), Voxels::U8(vec![255]));
    assert_eq!(mean_of(Voxels::U8(vec![1, 1, 2])), Voxels::U8(vec![1]));
    assert_eq!(mean_of(Voxels::I16(vec![-1, -2])), Voxels::I16(vec![-2]));
    assert_eq!(mean_of(Voxels::I16(vec![-1, -1, -2])), Voxels::I16(vec![-1]));
    assert_eq!(mean_of(Voxels::I8(vec![-128, -128])), Voxels::I8(vec![-128]));
    assert_eq!(mean_of(Voxels::U64(vec![u64::MAX, u64::MAX - 1])), Voxels::U64(vec![u64::MAX]));
    assert_eq!(mean_of(Voxels::I64(vec![i64::MIN, i64::MIN + 2])), Voxels::I64(vec![i64::MIN + 1]));
    assert_eq!(mean_of(Voxels::I64(vec![i64::MAX, i64::MIN + 1])), Voxels::I64(vec![0]));
    assert_eq!(mean_of(Voxels::F64(vec![f64::MAX, f64::MAX])), Voxels::F64(vec![f64::MAX]));
    assert_eq!(mean_of(Voxels::F64(vec![f64::MAX, -f64::MAX])), Voxels::F64(vec![0.0]));
    assert_eq!(mean_of(Voxels::F32(vec![f32::MAX, f32::MAX])), Voxels::F32(vec![f32::MAX]));
}

#[test]
fn nan_is_left_out_of_means_and_stays_where_there_is_nothing_else() {
    let nan = f32::NAN;
    let full = volume([6, 1, 1], Voxels::F32(vec![nan, 3.0, nan, nan, 5.0, 8.0]));
    let reduced = averaged(&full, [2, 1, 1]);
    let Voxels::F32(values) = &reduced.voxels else { panic!("{:?}", reduced.voxels) };
    assert!(values[0] == 3.0 && values[1].is_nan() && values[2] == 6.5, "{values:?}");
    assert_eq!((reduced.nan_count, worst(&full, &reduced, [2, 1, 1])), (1, 0.0));
    let notes = |volume: &Volume| volume.about.notes.iter().filter(|note| note.contains("NaN")).cloned().collect();
    let of_reduced: Vec<String> = notes(&reduced);
    assert_eq!(of_reduced, ["1 voxel is NaN and shown as the lowest value"]);
    let of_part: Vec<String> = notes(&cropped(&reduced, &[[2, 0, 0], [3, 1, 1]]).expect("it is inside"));
    assert_eq!(of_part, [""; 0]);
}

#[test]
fn a_ramp_in_the_world_stays_that_ramp() {
    let dims = [8, 9, 6];
    let ramp = |world: DVec3| 3.0 + world.dot(DVec3::new(0.5, -0.25, 2.0));
    let centre = |grid: &Grid, index: [u32; 3]| {
        grid.world_from_index().transform_point3(DVec3::from_array(index.map(|i| f64::from(i) + 0.5)))
    };
    let place = grid(dims);
    let voxels = Voxels::F64(indices(dims).map(|index| ramp(centre(&place, index))).collect());
    let full = volume(dims, voxels);
    for factor in [[2, 3, 2], [2, 2, 2], [4, 3, 1]] {
        let reduced = averaged(&full, factor);
        let whole = |index: &[u32; 3]| (0..3).all(|a| (index[a] + 1) * factor[a] <= dims[a]);
        let error = |grid: &Grid| {
            let blocks = indices(reduced.grid.dims).enumerate().filter(|(_, index)| whole(index));
            blocks.map(|(at, index)| (reduced.voxels.value(at) - ramp(centre(grid, index))).abs()).fold(0.0, f64::max)
        };
        assert!(error(&reduced.grid) < 1e-9, "{factor:?}: {}", error(&reduced.grid));
        // Half a voxel off, and the ramp is another one.
        let mut off = reduced.grid.clone();
        off.origin -= 0.5 * off.spacing.x * off.direction[0];
        assert!(error(&off) > 0.01, "{factor:?}");
    }
}

#[test]
fn what_is_in_a_volume_stays_where_it_is_in_the_world() {
    let dims = [40, 36, 32];
    let place = grid(dims);
    let at = |grid: &Grid, index: [u32; 3]| {
        grid.world_from_index().transform_point3(DVec3::from_array(index.map(|i| f64::from(i) + 0.5)))
    };
    let middle = at(&place, [23, 15, 14]);
    let blob = |world: DVec3| (2000.0 * (-0.05 * world.distance_squared(middle)).exp()) as u16;
    let full = volume(dims, Voxels::U16(indices(dims).map(|index| blob(at(&place, index))).collect()));
    let centre_of_mass = |volume: &Volume| {
        let mass =
            indices(volume.grid.dims).enumerate().map(|(n, index)| (volume.voxels.value(n), at(&volume.grid, index)));
        let (sum, moment) = mass.fold((0.0, DVec3::ZERO), |(sum, moment), (m, p)| (sum + m, moment + m * p));
        moment / sum
    };
    for factor in [[2, 2, 2], [4, 3, 2]] {
        let moved = centre_of_mass(&averaged(&full, factor)).distance(centre_of_mass(&full));
        assert!(moved < 0.01, "{factor:?}: {moved}");
    }
}

#[test]
fn a_region_has_the_voxels_of_its_place() {
    let dims = [7, 6, 5];
    for voxel_type in VoxelType::ALL {
        let full = volume(dims, noisy(voxel_type, count(dims)));
        let region = [[2, 0, 1], [6, 5, 5]];
        let part = cropped(&full, &region).expect("it is inside");
        assert_eq!(part.grid.dims, [4, 5, 4]);
        let expected: Vec<f64> = indices(part.grid.dims).map(|[i, j, k]| full.value_at([i + 2, j, k + 1])).collect();
        let found: Vec<f64> = (0..part.voxels.len()).map(|at| part.voxels.value(at)).collect();
        assert_eq!(found, expected, "{voxel_type}");
        assert_eq!(part.resolution, Resolution { full_dims: dims, factor: [1; 3], region: Some(region) });
        let corner = |grid: &Grid, index: [f64; 3]| grid.world_from_index().transform_point3(index.into());
        let apart = corner(&part.grid, [0.0; 3]).distance(corner(&full.grid, [2.0, 0.0, 1.0]));
        assert!(apart < 1e-12 && part.grid.spacing == full.grid.spacing, "{apart}");
    }
    let full = volume(dims, noisy(VoxelType::U8, count(dims)));
    assert_eq!(cropped(&full, &[[0; 3], dims]).expect("all of it").voxels, full.voxels);
    let both = averaged(&cropped(&full, &[[1, 1, 1], [5, 5, 5]]).expect("it is inside"), [2, 2, 2]);
    assert_eq!((both.resolution.region, both.resolution.factor), (Some([[1, 1, 1], [5, 5, 5]]), [2, 2, 2]));
    assert_eq!(both.resolution.full_dims, dims);
}

#[test]
fn a_region_that_is_empty_or_outside_is_refused_with_the_dims() {
    let full = volume([7, 6, 5], noisy(VoxelType::U8, 210));
    for (region, says) in [
        ([[0, 0, 0], [8, 6, 5]], "0 to 8 along x"),
        ([[0, 3, 0], [7, 3, 5]], "3 to 3 along y"),
        ([[0, 0, 4], [7, 6, 2]], "4 to 2 along z"),
        ([[0, 0, 0], [7, 6, u32::MAX]], "up to 5 in a volume of [7, 6, 5]"),
    ] {
        assert_names(cropped(&full, &region), "region", says);
    }
    assert_eq!(parse_region("1, 2,3,4,5,6").expect("six numbers"), [[1, 2, 3], [4, 5, 6]]);
    for text in ["", "1,2,3", "1,2,3,4,5,6,7", "1,2,3,4,5,-6", "a,2,3,4,5,6", "1;2;3;4;5;6", "1,2,3,4,5,6.5"] {
        assert_names(parse_region(text), "region", "x0,y0,z0,x1,y1,z1");
    }
}

#[test]
fn as_few_voxels_are_averaged_as_there_is_room_for() {
    let roomy = |_: [u32; 3]| true;
    let at_most = |most: u64| move |dims: [u32; 3]| dims.iter().map(|&n| u64::from(n)).product::<u64>() <= most;
    for (dims, max_axis, most, expected) in [
        ([100, 100, 100], 128, u64::MAX, [1, 1, 1]),
        ([300, 100, 100], 128, u64::MAX, [3, 1, 1]),
        ([256, 129, 128], 128, u64::MAX, [2, 2, 1]),
        ([100, 100, 100], 128, 1_000_000, [1, 1, 1]),
        ([100, 100, 100], 128, 999_999, [2, 2, 2]),
        ([100, 100, 100], 128, 124_999, [3, 3, 3]),
        // An axis that must be averaged anyway is not averaged twice.
        ([300, 100, 100], 128, 200_000, [3, 3, 3]),
        ([300, 100, 100], 128, 500_000, [3, 2, 2]),
        ([5, 5, 5], 128, 1, [5, 5, 5]),
        // A block is never longer than the axis: that would save nothing, and move the volume.
        ([100, 100, 3], 128, 300, [6, 6, 3]),
        ([300, 1, 1], 128, 64, [5, 1, 1]),
    ] {
        assert_eq!(factor_that_fits(dims, max_axis, at_most(most)), Some(expected), "{dims:?} {max_axis} {most}");
    }
    assert_eq!(factor_that_fits([5, 5, 5], 128, |_| false), None);
    assert_eq!(factor_that_fits([1, 1, 1], 128, roomy), Some([1, 1, 1]));
    assert_eq!(reduced_dims([7, 6, 5], [2, 2, 5]), [4, 3, 1]);
}

#[test]
fn an_averaged_volume_says_so_and_ends_when_it_is_called_off() {
    let full = volume([7, 6, 5], noisy(VoxelType::U8, 210));
    assert_eq!(full.resolution, Resolution::full([7, 6, 5]));
    assert!(!full.resolution.is_reduced());
    let reduced = averaged(&full, [2, 2, 2]);
    assert!(reduced.resolution.is_reduced());
    let notes = &reduced.about.notes;
    assert!(notes.len() == 1 && notes[0].contains("7 x 6 x 5") && notes[0].contains("2 x 2 x 2"), "{notes:?}");
    let watch = LoadWatch::default();
    watch.cancel();
    assert!(matches!(full.averaged([2; 3], &watch), Err(VolumeError::Cancelled)));
    assert!(matches!(full.cropped(&[[0; 3], [2; 3]], &watch), Err(VolumeError::Cancelled)));
}
