//! The steps of a build: all of it, in order, each of bounded size.

use std::ops::Range;

use spao_server::ao::{LevelLayout, Step, level_layouts, plan};
use spao_server::scene::{AmbientOcclusion, AoMethod, Radius};

use super::support::{hybrid, mipmap, n_buffer, raytraced};

/// Cells of the largest step unless a single slice has more.
const STEP_CELLS: u64 = 4 << 20;

/// Samples of the largest step, which looks up all levels.
const STEP_SAMPLES: u64 = 1 << 20;

/// Bytes of every binding of an adapter that only has what is guaranteed.
const GUARANTEED_BINDING: u64 = 128 << 20;

const SIZES: [[u32; 3]; 9] = [
    [1, 1, 1],
    [1, 64, 3],
    [127, 5, 9],
    [1, 2048, 2048],
    [2048, 3, 2048],
    [128, 128, 105],
    [256, 256, 256],
    [512, 512, 512],
    [1024, 1024, 1024],
];

fn settings() -> [AmbientOcclusion; 6] {
    [n_buffer(6, 1.0), n_buffer(1, 0.0), n_buffer(5, 2.0), mipmap(8, 2.0), hybrid(8, 2, 2.0), raytraced(6, 1.0, 512)]
}

fn steps(dims: [u32; 3], settings: &AmbientOcclusion, binding: u64) -> Option<Vec<Step>> {
    plan(dims, settings, &level_layouts(dims, settings), binding)
}

/// The stage of a step in the order of a build, its range, and the level that it writes.
fn stage(step: &Step) -> (u32, Range<u32>) {
    match step {
        Step::Classify(slices) => (0, slices.clone()),
        Step::Mipmap(level, slices) | Step::NBuffer(level, slices) => (*level, slices.clone()),
        Step::Combine(slices) => (100, slices.clone()),
        Step::Trace(rows) => (200, rows.clone()),
    }
}

/// What is wrong with a plan.
fn faults(dims: [u32; 3], settings: &AmbientOcclusion, steps: &[Step]) -> Vec<String> {
    let layouts = level_layouts(dims, settings);
    let mut expected: Vec<(u32, u32)> = (0..).zip(&layouts).map(|(level, layout)| (level, layout.extent[2])).collect();
    expected.push(match settings.method {
        AoMethod::Raytraced => (200, dims[1] * dims[2]),
        _ => (100, dims[2]),
    });
    let mut found = Vec::new();
    let mut rest = steps.iter();
    let mut next = rest.next();
    for (wanted, end) in expected {
        // Slices of one stage follow each other, from 0 to the end.
        let mut done = 0;
        while let Some((stage, range)) = next.map(stage).filter(|s| s.0 == wanted) {
            if range.start != done || range.is_empty() {
                found.push(format!("{stage}: {range:?} after {done}"));
            }
            done = range.end;
            next = rest.next();
        }
        if done != end {
            found.push(format!("{wanted}: {done} of {end}"));
        }
    }
    if let Some(step) = next {
        found.push(format!("{step:?} out of order"));
    }
    for step in steps {
        let of_mip = |level: u32| layouts[level as usize].shift == level;
        let right = match step {
            Step::Mipmap(level, _) => of_mip(*level),
            Step::NBuffer(level, _) => !of_mip(*level),
            _ => true,
        };
        if !right {
            found.push(format!("{step:?} is of the other kind"));
        }
    }
    found
}

/// Cells that a step writes, or samples with the padding of their rows; rows of rays are cut up later.
fn cells(dims: [u32; 3], layouts: &[LevelLayout], step: &Step) -> u64 {
    let [x, y] = match stage(step).0 {
        100 => [dims[0].next_multiple_of(128), dims[1]],
        200 => return 0,
        level => [layouts[level as usize].extent[0], layouts[level as usize].extent[1]],
    };
    stage(step).1.len() as u64 * u64::from(x) * u64::from(y)
}

#[test]
fn a_plan_covers_every_slice_of_every_level_once_and_in_order() {
    for dims in SIZES {
        for settings in settings() {
            let steps = steps(dims, &settings, u64::MAX).expect("nothing is too large for such an adapter");
            assert_eq!(faults(dims, &settings, &steps), [""; 0], "{dims:?} {settings:?}");
        }
    }
}

#[test]
fn the_check_of_plans_notices_a_missing_a_doubled_a_late_and_a_wrong_step() {
    let (dims, settings) = ([512, 512, 40], hybrid(3, 1, 1.0));
    let good = steps(dims, &settings, u64::MAX).expect("it fits");
    assert!(good.len() > 8);
    let faulty = |change: &dyn Fn(&mut Vec<Step>)| {
        let mut steps = good.clone();
        change(&mut steps);
        faults(dims, &settings, &steps).len()
    };
    assert_eq!(faulty(&|_| ()), 0);
    assert!(faulty(&|steps| steps.truncate(steps.len() - 2)) > 0);
    assert!(faulty(&|steps| steps.retain(|step| step != &good[1])) > 0);
    assert!(faulty(&|steps| steps.insert(1, steps[1].clone())) > 0);
    assert!(faulty(&|steps| steps.rotate_left(1)) > 0);
    let mipmap = |step: &Step| matches!(step, Step::Mipmap(..));
    assert!(
        faulty(&|steps| {
            let at = steps.iter().position(mipmap).expect("one level is halved");
            steps[at] = Step::NBuffer(1, stage(&steps[at]).1);
        }) > 0
    );
}

#[test]
fn no_step_is_larger_than_a_fraction_of_a_second_of_work() {
    let mut several = 0;
    for dims in SIZES {
        for settings in settings() {
            let layouts = level_layouts(dims, &settings);
            let steps = steps(dims, &settings, u64::MAX).expect("nothing is too large for such an adapter");
            for step in &steps {
                let one_slice = stage(step).1.len() == 1;
                let most = if matches!(step, Step::Combine(_)) { STEP_SAMPLES } else { STEP_CELLS };
                assert!(one_slice || cells(dims, &layouts, step) <= most, "{dims:?} {step:?}");
                // A dispatch covers samples row by row, of all slices, in groups of eight.
                if let Step::Combine(slices) = step {
                    assert!((slices.len() as u64 * u64::from(dims[1])).div_ceil(8) <= 65_535, "{dims:?} {step:?}");
                }
                several += usize::from(!one_slice);
            }
        }
    }
    assert!(several > 100);
}

/// Bytes of the largest binding that a step needs; the margins are those of the lookup distances of METHODS 2 and 3.
fn binding_bytes(dims: [u32; 3], settings: &AmbientOcclusion, layouts: &[LevelLayout], step: &Step) -> u64 {
    let bytes =
        |level: usize, slices: u64| slices.min(u64::from(layouts[level].extent[2])) * layouts[level].slice_bytes();
    let (level, slices) = (stage(step).0 as usize, stage(step).1.len() as u64);
    match step {
        Step::Classify(_) => bytes(0, slices),
        Step::Mipmap(..) => bytes(level, slices).max(bytes(level - 1, 2 * slices)),
        Step::NBuffer(..) => bytes(level, slices).max(bytes(level - 1, slices + u64::from(layouts[level].width) / 2)),
        Step::Combine(_) => {
            let samples = slices * u64::from(dims[1]) * u64::from(dims[0].next_multiple_of(128)) * 2;
            let level = |(l, layout): (usize, &LevelLayout)| {
                let cell = f64::from(1_u32 << layout.shift);
                // No gradient of values in [0, 1] is longer than 1/2 along an axis.
                let reach = settings.normal_factor * f64::from(1_u32 << l) * 0.25;
                bytes(l, ((slices as f64 - 1.0 + 2.0 * reach) / cell).ceil() as u64 + 2)
            };
            layouts.iter().enumerate().map(level).fold(samples, u64::max)
        }
        Step::Trace(_) => {
            let reach = match settings.radius {
                Radius::SameAsLevels => f64::from(1_u32 << settings.levels) * 0.5,
                Radius::Voxels(reach) => reach,
                Radius::Unlimited => f64::from(dims[2]),
            };
            bytes(0, (2.0 * reach).ceil() as u64 + 1)
        }
    }
}

#[test]
fn steps_are_so_thin_that_their_windows_fit_the_adapters_bindings() {
    let mut thinner = 0;
    for dims in [[61, 47, 33], [127, 5, 90], [128, 128, 105]] {
        for settings in settings() {
            let layouts = level_layouts(dims, &settings);
            let free = steps(dims, &settings, u64::MAX).expect("nothing is too large for such an adapter");
            let largest = free.iter().map(|s| binding_bytes(dims, &settings, &layouts, s)).max().expect("steps");
            for binding in (1..12).map(|n| largest * n / 12) {
                let Some(steps) = steps(dims, &settings, binding) else { continue };
                assert_eq!(faults(dims, &settings, &steps), [""; 0], "{dims:?} {settings:?} {binding}");
                for step in &steps {
                    let needed = binding_bytes(dims, &settings, &layouts, step);
                    assert!(needed <= binding, "{dims:?} {settings:?}: {step:?} needs {needed} of {binding}");
                }
                thinner += usize::from(steps.len() > free.len());
            }
        }
    }
    assert!(thinner > 20, "{thinner}");
}

#[test]
fn a_build_that_no_cutting_makes_fit_has_no_plan() {
    for dims in SIZES {
        for settings in settings() {
            let one_slice = level_layouts(dims, &settings)[0].slice_bytes();
            assert_eq!(steps(dims, &settings, one_slice - 1), None, "{dims:?}");
            assert_eq!(steps(dims, &settings, 0), None);
        }
    }
    // Rays without an end may need every slice at once.
    let unlimited = AmbientOcclusion { radius: Radius::Unlimited, ..raytraced(6, 1.0, 8) };
    let level = level_layouts([64; 3], &unlimited)[0];
    assert_eq!(steps([64; 3], &unlimited, level.bytes() - 1), None);
    assert!(steps([64; 3], &unlimited, level.bytes()).is_some());
    assert!(steps([64; 3], &raytraced(4, 1.0, 8), level.bytes() / 2).is_some());
}

#[test]
fn usual_volumes_have_a_plan_on_adapters_with_the_guaranteed_bindings_only() {
    for (dims, settings) in [
        ([512, 512, 512], n_buffer(6, 1.0)),
        ([512, 512, 512], n_buffer(7, 0.0)),
        ([512, 512, 512], mipmap(8, 2.0)),
        ([512, 512, 512], hybrid(8, 1, 2.0)),
        ([512, 512, 512], raytraced(6, 1.0, 512)),
        ([256, 256, 256], n_buffer(8, 1.0)),
        ([256, 256, 415], n_buffer(7, 2.0)),
        ([1024, 1024, 1024], mipmap(6, 1.0)),
    ] {
        let steps = steps(dims, &settings, GUARANTEED_BINDING);
        assert!(steps.is_some_and(|s| faults(dims, &settings, &s).is_empty()), "{dims:?} {settings:?}");
    }
}
