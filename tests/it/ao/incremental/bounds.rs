//! That an update costs what an edit changes, and not what the volume has.

use glam::DVec3;
use spao_server::ao::AoWork;
use spao_server::renderer::Coverage;
use spao_server::scene::TransferFunction;

use super::{Bench, State, bytes_of};
use crate::ao::support::{n_buffer, opacities};

const DIMS: [u32; 3] = [160, 72, 64];

/// Voxels of the blob: within one brick.
const BLOB: [std::ops::Range<u32>; 3] = [73..78, 33..38, 25..30];

const WALL: f64 = 60.0;
const BLOB_VALUE: f64 = 200.0;

/// Nothing but a wall at one end, and a small blob in the middle.
fn wall_and_blob() -> Bench {
    Bench::new(bytes_of(DIMS, DVec3::ONE, |at| {
        let in_blob = (0..3).all(|axis| BLOB[axis].contains(&at[axis]));
        // The highest code is elsewhere, so that the range is all of it.
        match at {
            [0, 0, 0] => 1.0,
            [_, 0..4, _] => WALL / 255.0,
            _ if in_blob => BLOB_VALUE / 255.0,
            _ => 0.0,
        }
    }))
}

/// Opacities of the wall and of the blob, in 1/65535.
fn transfer(wall: u16, blob: u16) -> TransferFunction {
    let of = |table: u16| f64::from(table) / 65535.0;
    opacities(&[
        (WALL - 10.0, 0.0),
        (WALL, of(wall)),
        (WALL + 10.0, 0.0),
        (BLOB_VALUE - 10.0, 0.0),
        (BLOB_VALUE, of(blob)),
        (BLOB_VALUE + 10.0, 0.0),
    ])
}

fn state(levels: u32, transfer: TransferFunction) -> State {
    State { transfer, settings: n_buffer(levels, 1.0), coverage: Coverage::Everywhere }
}

/// Work of the update from one state to another, which must end with the bits of a fresh build.
fn work(bench: &Bench, from: &State, to: &State) -> AoWork {
    let mut kept = bench.nothing(from);
    bench.update(&mut kept, from);
    let work = bench.update(&mut kept, to);
    assert_eq!(bench.bits(&kept).difference(&bench.fresh_bits(to)), None);
    work
}

const BRICKS: u64 = (DIMS[0] / 8 * DIMS[1] / 8 * DIMS[2] / 8) as u64;

/// Bricks no farther from the blob than so many voxels along each axis.
fn bricks_near(reach: [f64; 3]) -> u64 {
    let mut count = 0;
    for z in 0..DIMS[2] / 8 {
        for y in 0..DIMS[1] / 8 {
            for x in 0..DIMS[0] / 8 {
                let near = |axis: usize, brick: u32| {
                    let (low, high) = (f64::from(8 * brick), f64::from(8 * brick + 8));
                    low <= f64::from(BLOB[axis].end) + reach[axis] && high >= f64::from(BLOB[axis].start) - reach[axis]
                };
                count += u64::from(near(0, x) && near(1, y) && near(2, z));
            }
        }
    }
    count
}

/// How far accessibility over `levels` levels can see what happens to a voxel: half the widest window, the offset of
/// its look-up and the interpolation, and as far as a tile of levels reaches, within which changes are not told apart.
fn reach(levels: u32) -> [f64; 3] {
    let width = f64::from(1_u32 << levels);
    [31.0, width.max(8.0) - 1.0, width.max(8.0) - 1.0].map(|tile| tile + 0.5 * width + 0.25 * width + 2.0)
}

#[test]
fn a_small_blob_costs_the_bricks_around_it() {
    let bench = wall_and_blob();
    for levels in [1, 3] {
        let near = bricks_near(reach(levels));
        assert!(near < BRICKS / 4, "{near} of {BRICKS}");
        for (from, to) in [(0, 30_000), (30_000, 0), (30_000, 65_535)] {
            let done = work(&bench, &state(levels, transfer(9000, from)), &state(levels, transfer(9000, to)));
            assert!(done.incremental);
            // A tile of level 0 has four bricks.
            assert!((1..=4).contains(&done.classified), "{done:?}");
            // At least the brick of the blob itself.
            assert!((1..=near).contains(&done.recomputed), "{levels}: {done:?}, near: {near}");
        }
    }
}

#[test]
fn the_first_build_and_other_factors_cost_all_bricks() {
    let bench = wall_and_blob();
    let first = state(3, transfer(9000, 30_000));
    let mut kept = bench.nothing(&first);
    let full = bench.update(&mut kept, &first);
    assert!(!full.incremental && full.recomputed == BRICKS && full.classified > 0, "{full:?}");
    let other = State { settings: n_buffer(3, 0.5), ..first.clone() };
    let of_factor = bench.update(&mut kept, &other);
    assert!(!of_factor.incremental, "{of_factor:?}");
    assert_eq!((of_factor.classified, of_factor.recomputed), (0, BRICKS));
    kept.result = None;
    let lost = bench.update(&mut kept, &other);
    assert_eq!((lost.incremental, lost.classified, lost.tiles, lost.recomputed), (false, 0, 0, BRICKS));
}

#[test]
fn opacities_of_codes_that_do_not_occur_and_colours_cost_nothing() {
    let bench = wall_and_blob();
    let before = state(6, transfer(9000, 30_000));
    let mut kept = bench.nothing(&before);
    bench.update(&mut kept, &before);
    let nothing = AoWork { incremental: true, ..AoWork::default() };
    let mut unused = before.clone();
    let spike = opacities(&[(100.0, 0.0), (120.0, 0.7), (140.0, 0.0)]);
    unused.transfer.points.splice(3..3, spike.points);
    assert_eq!(bench.update(&mut kept, &unused), nothing);
    let mut colored = unused.clone();
    colored.transfer.points.iter_mut().for_each(|p| p.color.0[1] = 0.25);
    assert_eq!(bench.update(&mut kept, &colored), nothing);
    assert_eq!(bench.update(&mut kept, &before), nothing);
    assert_eq!(bench.bits(&kept).difference(&bench.fresh_bits(&before)), None);
}

#[test]
fn a_change_too_small_for_coarse_levels_goes_no_farther_than_the_fine_ones() {
    let bench = wall_and_blob();
    let before = state(6, transfer(9000, 30_000));
    let large = work(&bench, &before, &state(6, transfer(9000, 60_000)));
    let small = work(&bench, &before, &state(6, transfer(9000, 30_001)));
    assert_eq!(small.classified, large.classified);
    assert!(small.tiles < large.tiles && 2 * small.recomputed < large.recomputed, "{small:?} {large:?}");
    assert!(small.recomputed <= bricks_near(reach(4)), "{small:?}");
}

/// Samples at an edge look along its normal, at the widest level 8 voxels away: with it they see half a voxel of a sheet
/// that they would not meet without.
#[test]
fn what_only_normals_lead_to_is_computed_again() {
    const SHEET: f64 = 100.0;
    let bench = Bench::new(bytes_of([16, 16, 64], DVec3::ONE, |at| match at {
        [_, _, 0..20] => 1.0,
        [_, _, 36] => SHEET / 255.0,
        _ => 0.0,
    }));
    let state = |sheet: f64| State {
        transfer: opacities(&[(SHEET - 5.0, 0.0), (SHEET, sheet), (SHEET + 5.0, 0.0), (250.0, 0.0), (255.0, 0.5)]),
        settings: n_buffer(4, 2.0),
        coverage: Coverage::Everywhere,
    };
    let done = work(&bench, &state(0.2), &state(0.9));
    assert!(done.incremental && done.recomputed < 4 * 8, "{done:?}");
}

#[test]
fn what_is_dropped_before_it_began_costs_no_more_than_the_edits_on_the_way() {
    let bench = wall_and_blob();
    let states = [30_000, 65_535, 30_000].map(|blob| state(3, transfer(9000, blob)));
    let mut kept = bench.nothing(&states[0]);
    bench.update(&mut kept, &states[0]);
    bench.abandon(&kept, &states[1], 0);
    // Back where it was: the tile is looked at, and nothing has changed.
    let done = bench.update(&mut kept, &states[2]);
    assert!(done.classified <= 4 && (done.tiles, done.recomputed) == (0, 0), "{done:?}");
    assert_eq!(bench.bits(&kept).difference(&bench.fresh_bits(&states[2])), None);
}
