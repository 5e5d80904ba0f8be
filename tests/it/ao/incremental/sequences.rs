//! Long sequences of edits on volumes of all kinds.

use std::collections::BTreeMap;
use std::sync::Arc;

use glam::DVec3;
use spao_server::ao::AoWork;
use spao_server::gpu::GpuOptions;
use spao_server::renderer::Coverage;
use spao_server::scene::{AmbientOcclusion, opacity_table};
use spao_server::volume::Volume;

use super::edits::{Editor, Kind};
use super::{Bench, Kept, SMALL_BINDING, State, balls, bytes_of, head_crop, shorts_of};
use crate::ao::support::{hybrid, mipmap, n_buffer};

/// What happened in a sequence.
#[derive(Debug, Default)]
struct Tally {
    kinds: BTreeMap<Kind, u32>,
    updates: u32,
    /// Updates that were dropped, and of these the ones with work left to do.
    dropped: u32,
    half_way: u32,
    compared: u32,
    /// Finished updates that took something from an earlier result, and those that found nothing to do.
    incremental: u32,
    idle: u32,
}

/// Somebody at work: one pyramid for each structure of levels.
struct Session {
    bench: Bench,
    editor: Editor,
    structures: Vec<AmbientOcclusion>,
    kept: Vec<Kept>,
    /// What each pyramid was last updated to, unless an update was dropped since.
    settled: Vec<Option<State>>,
    current: usize,
    state: State,
    tally: Tally,
}

impl Session {
    fn new(volume: Arc<Volume>, structures: &[AmbientOcclusion], seed: u64) -> Self {
        Self::with_options(volume, structures, seed, &GpuOptions::default())
    }

    fn with_options(volume: Arc<Volume>, structures: &[AmbientOcclusion], seed: u64, options: &GpuOptions) -> Self {
        let editor = Editor::new(seed, volume.code_map.value_range());
        let state = State { transfer: editor.usual(), settings: structures[0], coverage: Coverage::Visible };
        let bench = Bench::with_options(volume, options);
        let of = |settings: &AmbientOcclusion| bench.nothing(&State { settings: *settings, ..state.clone() });
        Self {
            kept: structures.iter().map(of).collect(),
            settled: vec![None; structures.len()],
            structures: structures.to_vec(),
            current: 0,
            bench,
            editor,
            state,
            tally: Tally::default(),
        }
    }

    /// Edits `count` times; compares about every `every`-th time.
    fn run(mut self, count: u32, every: u64) -> Tally {
        for n in 0..count {
            let kind = self.editor.edit(&mut self.state);
            *self.tally.kinds.entry(kind).or_default() += 1;
            if self.editor.random.below(12) == 0 {
                self.current = self.editor.random.below(self.structures.len() as u64) as usize;
                let factor = self.state.settings.normal_factor;
                self.state.settings = AmbientOcclusion { normal_factor: factor, ..self.structures[self.current] };
            }
            if self.editor.random.below(5) == 0 {
                self.drop_half_way();
                continue;
            }
            // Nobody may have kept the last result.
            if self.editor.random.below(15) == 0 {
                self.kept[self.current].result = None;
                self.settled[self.current] = None;
            }
            self.update(n, kind);
            if self.editor.random.below(every) == 0 {
                self.compare(&format!("edit {n}, {kind:?}"));
            }
        }
        for structure in 0..self.structures.len() {
            self.current = structure;
            self.state.settings = self.structures[structure];
            self.update(count, Kind::Factor);
            self.compare(&format!("the end of {structure}"));
        }
        self.tally
    }

    fn drop_half_way(&mut self) {
        let turns = self.editor.random.below(4);
        let half_way = self.bench.abandon(&self.kept[self.current], &self.state, turns);
        self.tally.dropped += 1;
        self.tally.half_way += u32::from(half_way && turns > 0);
        self.settled[self.current] = None;
    }

    fn update(&mut self, n: u32, kind: Kind) {
        let work = self.bench.update(&mut self.kept[self.current], &self.state);
        self.tally.updates += 1;
        self.tally.incremental += u32::from(work.incremental);
        let before = self.settled[self.current].replace(self.state.clone());
        let Some(before) = before else { return };
        let table = |state: &State| {
            let grid = &self.bench.volume.grid;
            opacity_table(&state.transfer, &self.bench.volume.code_map, grid.smallest_spacing())
        };
        let (old, new) = (table(&before), table(&self.state));
        let same = |a: &State, b: &State| (a.settings, a.coverage) == (b.settings, b.coverage);
        if old == new && same(&before, &self.state) {
            assert_eq!(work, AoWork { incremental: true, ..AoWork::default() }, "edit {n}, {kind:?}");
            self.tally.idle += 1;
        }
        if kind == Kind::Unused && old[..] != new[..] {
            let volume = &self.bench.volume;
            let occurs = (0..volume.voxels.len()).map(|i| volume.code_map.code_from_value(volume.voxels.value(i)));
            if occurs.map(usize::from).all(|code| old[code] == new[code]) {
                assert_eq!(work.classified, 0, "edit {n}: opacities that no voxel has");
            }
        }
    }

    fn compare(&mut self, what: &str) {
        let (mine, fresh) = (self.bench.bits(&self.kept[self.current]), self.bench.fresh_bits(&self.state));
        let dims = self.bench.volume.grid.dims;
        if let Some(difference) = mine.difference(&fresh) {
            panic!("{dims:?}, {what}: {difference}; {:?}", self.state);
        }
        self.tally.compared += 1;
    }
}

#[track_caller]
fn assert_varied(tally: &Tally, least: u32) {
    for kind in Kind::ALL {
        assert!(tally.kinds.get(&kind).is_some_and(|&count| count >= least), "{kind:?} of {tally:?}");
    }
    assert!(tally.dropped >= least && tally.compared >= least && tally.idle > 0, "{tally:?}");
    assert!(tally.incremental > tally.updates / 2, "{tally:?}");
}

#[test]
fn dense_bytes_of_odd_sizes_end_with_the_bits_of_a_fresh_build_after_any_edits() {
    let volume = bytes_of([37, 29, 41], DVec3::ONE, balls([37, 29, 41], 9, 0.25));
    let tally = Session::new(volume, &[n_buffer(6, 1.0), mipmap(6, 1.0), hybrid(6, 2, 1.0)], 1).run(300, 4);
    assert_varied(&tally, 10);
}

#[test]
fn sparse_shorts_of_unequal_spacing_end_with_the_bits_of_a_fresh_build_after_any_edits() {
    let dims = [83, 25, 34];
    let volume = shorts_of(dims, DVec3::new(0.7, 1.9, 1.0), balls(dims, 4, 0.0));
    let tally = Session::new(volume, &[n_buffer(7, 1.0), mipmap(5, 1.0), hybrid(8, 1, 1.0)], 2).run(250, 4);
    assert_varied(&tally, 10);
}

#[test]
fn a_part_of_a_ct_ends_with_the_bits_of_a_fresh_build_after_any_edits() {
    let volume = head_crop([30, 20, 40], [45, 38, 33]);
    let tally = Session::new(volume, &[n_buffer(6, 1.0), hybrid(5, 1, 1.0)], 3).run(200, 4);
    assert_varied(&tally, 8);
}

#[test]
fn a_slice_and_a_thin_volume_end_with_the_bits_of_a_fresh_build_after_any_edits() {
    let slice = shorts_of([131, 43, 1], DVec3::ONE, balls([131, 43, 1], 6, 0.1));
    let tally = Session::new(slice, &[n_buffer(6, 1.0), mipmap(4, 1.0)], 4).run(125, 3);
    assert_varied(&tally, 4);
    let thin = bytes_of([3, 90, 6], DVec3::ONE, balls([3, 90, 6], 5, 0.1));
    let tally = Session::new(thin, &[n_buffer(8, 1.0), hybrid(4, 4, 1.0)], 5).run(125, 3);
    assert_varied(&tally, 4);
}

/// What is combined again are a few layers of bricks, which are looked up in other slices than all of them are.
#[test]
fn a_tall_volume_of_few_levels_ends_with_the_bits_of_a_fresh_build_after_any_edits() {
    let dims = [21, 26, 150];
    let volume = shorts_of(dims, DVec3::new(1.0, 1.0, 0.6), balls(dims, 12, 0.0));
    let tally = Session::new(volume, &[n_buffer(2, 1.0), mipmap(3, 0.7)], 8).run(120, 3);
    assert_varied(&tally, 4);
}

/// Large enough that updates take several turns.
#[test]
fn updates_that_are_dropped_half_way_leave_nothing_wrong_behind() {
    let session = Session::new(head_crop([20, 20, 10], [88, 72, 56]), &[n_buffer(6, 1.0)], 6);
    let tally = session.run(80, 6);
    assert!(tally.half_way >= 3, "{tally:?}");
}

#[test]
fn adapters_without_16_bit_textures_or_with_small_bindings_end_with_the_bits_of_a_fresh_build_too() {
    let volume = bytes_of([37, 29, 101], DVec3::ONE, balls([37, 29, 101], 9, 0.25));
    let structures = [n_buffer(6, 1.0), hybrid(6, 2, 1.0)];
    let baseline = GpuOptions { baseline_features_only: true, ..GpuOptions::default() };
    let small = GpuOptions { max_storage_binding_bytes: Some(SMALL_BINDING), ..GpuOptions::default() };
    let small_baseline = GpuOptions { max_storage_binding_bytes: Some(SMALL_BINDING), ..baseline.clone() };
    for options in [baseline, small, small_baseline] {
        let tally = Session::with_options(volume.clone(), &structures, 7, &options).run(40, 3);
        assert!(tally.compared >= 8 && tally.incremental >= 8, "{tally:?}");
    }
}
