//! The steps of a build or an update: all of it, in order, each of bounded size.

use std::ops::Range;

use spao_server::ao::{Cuts, LevelLayout, Step, WorkLists, level_layouts};
use spao_server::scene::{AmbientOcclusion, AoMethod, Radius};

use super::support::{all_work, hash, hybrid, mipmap, n_buffer, raytraced};

/// Cells of the largest step unless a single tile has more.
const STEP_CELLS: u64 = 4 << 20;

/// Bricks of the largest step that looks up all levels.
const STEP_BRICKS: u32 = (2 << 20) / 512;

/// Bytes of every binding of an adapter that only has what is guaranteed.
const GUARANTEED_BINDING: u64 = 128 << 20;

/// Flags of entries of work lists, and the rest.
const FLAGS: [u32; 4] = [0, 1 << 31, 1 << 30, 3 << 30];
const INDEX: u32 = (1 << 30) - 1;

const SIZES: [[u32; 3]; 8] = [
    [1, 1, 1],
    [1, 64, 3],
    [127, 5, 9],
    [1, 2048, 1024],
    [2048, 3, 1024],
    [128, 128, 105],
    [256, 256, 256],
    [512, 512, 300],
];

fn settings() -> [AmbientOcclusion; 6] {
    [n_buffer(6, 1.0), n_buffer(1, 0.0), n_buffer(5, 2.0), mipmap(8, 2.0), hybrid(8, 2, 2.0), raytraced(6, 1.0, 512)]
}

/// No gradient of values in [0, 1] is longer than 1/2 along an axis.
fn half_offset(settings: &AmbientOcclusion) -> f64 {
    0.25 * settings.normal_factor
}

/// A plan and what it is of.
struct Planned {
    dims: [u32; 3],
    settings: AmbientOcclusion,
    layouts: Vec<LevelLayout>,
    work: WorkLists,
    sampled: bool,
    binding: u64,
    steps: Vec<Step>,
}

/// The plan of `work`, of everything where there is none.
fn planned(
    dims: [u32; 3],
    settings: &AmbientOcclusion,
    binding: u64,
    sampled: bool,
    work: Option<WorkLists>,
) -> Option<Planned> {
    let layouts = level_layouts(dims, settings);
    let work = work.unwrap_or_else(|| all_work(dims, &layouts));
    let cuts = Cuts { dims, layouts: &layouts, largest_binding: binding, sampled, half_offset: half_offset(settings) };
    let steps = cuts.plan(settings, &work)?;
    Some(Planned { dims, settings: *settings, layouts, work, sampled, binding, steps })
}

/// Some of everything, with all kinds of flags.
fn sparse_work(dims: [u32; 3], settings: &AmbientOcclusion, seed: u64) -> WorkLists {
    let layouts = level_layouts(dims, settings);
    let all = all_work(dims, &layouts);
    let some = |list: &[u32]| -> Vec<u32> {
        let one_of = 1 + seed % 50;
        let random = |&index: &u32| hash(seed << 32 | u64::from(index));
        let kept = list.iter().filter(|index| random(index) % one_of == 0);
        kept.map(|index| index | FLAGS[(random(index) >> 32) as usize % 4]).collect()
    };
    let levels = all.levels.iter().map(|list| some(list)).collect();
    WorkLists { levels, bricks: some(&all.bricks), wanted: some(&all.wanted).iter().map(|w| w & INDEX).collect() }
}

impl Planned {
    /// Stage of a step in the order of a build, its layers, and its range of a work list.
    fn stage(&self, step: &Step) -> (u32, Range<u32>, Range<u32>) {
        match step {
            Step::Level { level, layers, candidates } => (*level, layers.clone(), candidates.clone()),
            Step::Combine { layers, candidates } => (100, layers.clone(), candidates.clone()),
            Step::Trace(rows) => (100, 0..1, rows.clone()),
            Step::Surface { layers, bricks } => (200, layers.clone(), bricks.clone()),
        }
    }

    /// The stages, each with its work list and the places of one layer of it.
    fn stages(&self) -> Vec<(u32, Vec<u32>, [u32; 3])> {
        let levels = (0..).zip(self.work.levels.iter().zip(&self.layouts));
        let mut stages: Vec<_> = levels.map(|(level, (list, l))| (level, list.clone(), l.tiles())).collect();
        let bricks = self.dims.map(|n| n.div_ceil(8));
        if self.settings.method == AoMethod::Raytraced {
            let rows = self.dims[1] * self.dims[2];
            stages.push((100, (0..rows).collect(), [rows, 1, 1]));
        } else {
            stages.push((100, self.work.bricks.clone(), bricks));
        }
        stages.push((200, self.work.wanted.clone(), bricks));
        stages
    }

    /// What is wrong with the plan: with order, completeness, or where work lies.
    fn faults(&self) -> Vec<String> {
        let mut found = Vec::new();
        let mut rest = self.steps.iter().map(|step| self.stage(step)).peekable();
        for (stage, list, places) in self.stages() {
            // Ranges of one list follow each other, from 0 to the end.
            let mut done = 0;
            while let Some((_, layers, range)) = rest.next_if(|next| next.0 == stage) {
                if range.start != done || range.is_empty() {
                    found.push(format!("{stage}: {range:?} after {done}"));
                }
                if layers.is_empty() || layers.end > places[2] {
                    found.push(format!("{stage}: {layers:?} of {places:?}"));
                }
                let within = |entry: &u32| layers.contains(&((entry & INDEX) / (places[0] * places[1])));
                let entries = list.get(range.start as usize..range.end as usize);
                if !entries.is_some_and(|entries| entries.iter().all(within)) {
                    found.push(format!("{stage}: {range:?} is not in {layers:?}"));
                }
                done = range.end;
            }
            if done as usize != list.len() {
                found.push(format!("{stage}: {done} of {}", list.len()));
            }
        }
        found.extend(rest.map(|step| format!("{step:?} out of order")));
        found
    }

    /// Bytes of the slices of a level around the positions [low, high] along z, with their neighbours.
    fn slices_around(&self, level: usize, low: f64, high: f64) -> u64 {
        let layout = &self.layouts[level];
        let cell = |z: f64| z / f64::from(1_u32 << layout.shift) + layout.lookup_offset();
        let last = f64::from(layout.extent[2] - 1);
        let slices = cell(high).floor().min(last - 1.0) + 1.0 - cell(low).floor().max(0.0) + 1.0;
        slices.max(1.0) as u64 * layout.slice_bytes()
    }

    /// Bytes of the largest binding that a step needs; the margins are those of the look-ups of METHODS 2 and 3.
    fn binding_bytes(&self, step: &Step) -> u64 {
        let voxels = |layers: &Range<u32>| (layers.start * 8, (layers.end * 8).min(self.dims[2]));
        match step {
            Step::Level { level, layers, .. } => {
                let layout = &self.layouts[*level as usize];
                let slices = layers.start * layout.tile[2]..(layers.end * layout.tile[2]).min(layout.extent[2]);
                let target = slices.len() as u64 * layout.slice_bytes();
                let Some(source) = layout.source else { return target };
                let before = &self.layouts[*level as usize - 1];
                let last = i64::from(before.extent[2]) - 1;
                let cell = |c: i64| (i64::from(source.scale) * c + i64::from(source.offset)).clamp(0, last);
                let count = |reads: Vec<i64>| (reads.iter().max().unwrap() - reads.iter().min().unwrap() + 1) as u64;
                let (distance, shift) = (i64::from(source.distance), i64::from(source.distance / source.scale));
                if shift == 0 {
                    let reads = slices.flat_map(|c| [cell(i64::from(c)), (cell(i64::from(c)) + distance).min(last)]);
                    return target.max(count(reads.collect()) * before.slice_bytes());
                }
                // Of each pair of slices that lie `shift` apart: the window's near half, its middle, its far half.
                let all = i64::from(layers.start * layout.tile[2])..i64::from(layers.end * layout.tile[2]);
                let firsts: Vec<i64> = all.filter(|c| c / shift % 2 == 0).collect();
                let read = |by: i64| {
                    let at = |c: &i64| {
                        (i64::from(source.scale) * (c + by) + i64::from(source.offset) + distance).clamp(0, last)
                    };
                    count(firsts.iter().map(at).collect()) * before.slice_bytes()
                };
                [-shift, 0, shift].map(read).into_iter().fold(target, u64::max)
            }
            Step::Combine { layers, .. } => {
                let (low, high) = voxels(layers);
                let row = u64::from(self.dims[0].div_ceil(2).next_multiple_of(64)) * 4;
                let samples = row * u64::from(self.dims[1]) * u64::from(high - low);
                // Samples go straight to their texture, and levels are in textures.
                if self.sampled {
                    return 0;
                }
                let window = |level: usize| {
                    let reach = half_offset(&self.settings) * f64::from(1_u32 << level);
                    self.slices_around(level, f64::from(low) + 0.5 - reach, f64::from(high) - 0.5 + reach)
                };
                (0..self.layouts.len()).map(window).fold(samples, u64::max)
            }
            Step::Surface { layers, .. } => {
                let (low, high) = voxels(layers);
                u64::from(high - low + 2) * self.layouts[0].slice_bytes()
            }
            Step::Trace(_) => {
                let reach = match self.settings.radius {
                    Radius::SameAsLevels => f64::from(1_u32 << self.settings.levels) * 0.5,
                    Radius::Voxels(reach) => reach,
                    Radius::Unlimited => f64::from(self.dims[2]),
                };
                let middle = f64::from(self.dims[2] / 2) + 0.5;
                self.slices_around(0, middle - reach, middle + reach)
            }
        }
    }
}

#[test]
fn a_plan_covers_every_candidate_once_and_in_order() {
    for dims in SIZES {
        for settings in settings() {
            for sampled in [false, true] {
                let plan = planned(dims, &settings, u64::MAX, sampled, None).expect("nothing is too large");
                assert_eq!(plan.faults(), [""; 0], "{dims:?} {settings:?}");
            }
        }
    }
}

#[test]
fn a_plan_of_an_update_covers_what_there_is_to_do_and_nothing_else() {
    for (seed, dims) in (0..).zip(SIZES.repeat(3)) {
        for settings in settings() {
            let work = sparse_work(dims, &settings, seed);
            let plan = planned(dims, &settings, GUARANTEED_BINDING, true, Some(work)).expect("it fits");
            assert_eq!(plan.faults(), [""; 0], "{dims:?} {settings:?}");
        }
    }
    let settings = n_buffer(6, 1.0);
    let nothing = WorkLists { levels: vec![Vec::new(); 7], ..WorkLists::default() };
    let plan = planned([61, 47, 33], &settings, u64::MAX, true, Some(nothing)).expect("nothing fits anywhere");
    assert_eq!(plan.steps, []);
}

#[test]
fn the_check_of_plans_notices_a_missing_a_doubled_a_late_and_a_wrong_step() {
    let (dims, settings) = ([512, 512, 40], hybrid(3, 1, 1.0));
    let good = planned(dims, &settings, u64::MAX, true, None).expect("it fits");
    assert!(good.steps.len() > 8);
    let faulty = |change: &dyn Fn(&mut Vec<Step>)| {
        let mut plan = planned(dims, &settings, u64::MAX, true, None).expect("it fits");
        change(&mut plan.steps);
        plan.faults().len()
    };
    assert_eq!(faulty(&|_| ()), 0);
    assert!(faulty(&|steps| steps.truncate(steps.len() - 2)) > 0);
    assert!(faulty(&|steps| steps.retain(|step| step != &good.steps[1])) > 0);
    assert!(faulty(&|steps| steps.insert(1, steps[1].clone())) > 0);
    assert!(faulty(&|steps| steps.rotate_left(1)) > 0);
    let of_level_2 = |step: &Step| matches!(step, Step::Level { level: 2, .. });
    let at = good.steps.iter().position(of_level_2).expect("there is a level 2");
    type Change<'a> = &'a dyn Fn(&mut u32, &mut Range<u32>, &mut Range<u32>);
    let with = |change: Change<'_>| {
        faulty(&|steps| {
            let Step::Level { level, layers, candidates } = &mut steps[at] else { panic!("{:?}", steps[at]) };
            change(level, layers, candidates);
        })
    };
    assert_eq!(with(&|_, _, _| ()), 0);
    assert!(with(&|level, _, _| *level = 1) > 0);
    assert!(with(&|_, layers, _| layers.end -= 1) > 0);
    assert!(with(&|_, layers, _| layers.end = 99) > 0);
    assert!(with(&|_, _, candidates| candidates.end -= 1) > 0);
}

#[test]
fn no_step_is_larger_than_a_fraction_of_a_second_of_work() {
    let mut several = 0;
    for dims in SIZES {
        for settings in settings() {
            let plan = planned(dims, &settings, u64::MAX, true, None).expect("nothing is too large");
            for step in &plan.steps {
                let (_, _, range) = plan.stage(step);
                assert!(range.len() <= 65_535 || matches!(step, Step::Trace(_)), "a workgroup each: {step:?}");
                match step {
                    Step::Level { level, .. } => {
                        let cells = range.len() as u64 * plan.layouts[*level as usize].tile_cells();
                        assert!(range.len() == 1 || cells <= STEP_CELLS, "{dims:?} {step:?}");
                    }
                    Step::Combine { .. } => assert!(range.len() as u32 <= STEP_BRICKS, "{dims:?} {step:?}"),
                    Step::Surface { .. } | Step::Trace(_) => {}
                }
                several += usize::from(range.len() > 1);
            }
        }
    }
    assert!(several > 100);
}

#[test]
fn steps_are_so_thin_that_their_windows_fit_the_adapters_bindings() {
    let mut thinner = 0;
    for dims in [[61, 47, 33], [127, 5, 90], [128, 128, 105]] {
        for settings in settings() {
            for sampled in [false, settings.method == AoMethod::Spao] {
                let free = planned(dims, &settings, u64::MAX, sampled, None).expect("nothing is too large");
                let largest = free.steps.iter().map(|s| free.binding_bytes(s)).max().expect("steps");
                for binding in (1..12).map(|n| largest * n / 12) {
                    let Some(plan) = planned(dims, &settings, binding, sampled, None) else { continue };
                    assert_eq!(plan.faults(), [""; 0], "{dims:?} {settings:?} {binding}");
                    for step in &plan.steps {
                        let needed = plan.binding_bytes(step);
                        assert!(needed <= binding, "{dims:?} {settings:?}: {step:?} needs {needed} of {binding}");
                    }
                    thinner += usize::from(plan.steps.len() > free.steps.len());
                }
            }
        }
    }
    assert!(thinner > 20, "{thinner}");
}

#[test]
fn windows_of_levels_are_as_deep_as_any_combination_needs() {
    for dims in [[61, 47, 33], [127, 5, 90], [512, 512, 300], [1024, 1024, 64]] {
        for settings in settings().into_iter().filter(|s| s.method == AoMethod::Spao) {
            for seed in 0..4 {
                let work = sparse_work(dims, &settings, seed);
                let plan = planned(dims, &settings, 4 * GUARANTEED_BINDING, true, Some(work)).expect("it fits");
                let (layouts, half_offset) = (&plan.layouts, half_offset(&settings));
                let cuts = Cuts { dims, layouts, largest_binding: plan.binding, sampled: true, half_offset };
                let most = cuts.combined_layers().expect("it fits");
                for step in &plan.steps {
                    let Step::Combine { layers, .. } = step else { continue };
                    assert_eq!(layers.start / most, (layers.end - 1) / most, "{layers:?} is in two slabs of {most}");
                    for (level, layout) in layouts.iter().enumerate() {
                        let window = cuts.window(level, layers);
                        assert!(window.len() as u32 <= cuts.window_slices(level, most), "{dims:?} {layers:?}");
                        assert!(window.end <= layout.extent[2], "{dims:?} {layers:?}");
                    }
                }
            }
        }
    }
}

#[test]
fn a_build_that_no_cutting_makes_fit_has_no_plan() {
    for dims in SIZES {
        for settings in settings() {
            let level = level_layouts(dims, &settings)[0];
            let one_layer = level.slice_bytes() * u64::from(level.tile[2]);
            for sampled in [false, true] {
                assert!(planned(dims, &settings, one_layer - 1, sampled, None).is_none(), "{dims:?}");
                assert!(planned(dims, &settings, 0, sampled, None).is_none());
            }
        }
    }
    // Rays without an end may need every slice in the volume at once.
    let unlimited = AmbientOcclusion { radius: Radius::Unlimited, ..raytraced(6, 1.0, 8) };
    let level = level_layouts([64; 3], &unlimited)[0];
    let fits = |settings: &AmbientOcclusion, binding| planned([64; 3], settings, binding, false, None).is_some();
    assert!(!fits(&unlimited, level.slice_bytes() * 64));
    assert!(fits(&unlimited, level.bytes()));
    assert!(fits(&raytraced(4, 1.0, 8), level.bytes() / 2));
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
        ([1024, 1024, 256], n_buffer(6, 1.0)),
        ([1024, 1024, 1024], mipmap(6, 1.0)),
    ] {
        for sampled in [false, settings.method == AoMethod::Spao] {
            let plan = planned(dims, &settings, GUARANTEED_BINDING, sampled, None);
            assert!(plan.is_some_and(|plan| plan.faults().is_empty()), "{dims:?} {settings:?} {sampled}");
        }
    }
}
