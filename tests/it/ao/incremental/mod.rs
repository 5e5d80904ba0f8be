//! Updates of ambient occlusion: whatever was edited, in whatever order, and wherever an update was broken off, the
//! bits are those of a build from nothing (METHODS 7).

mod adapters;
mod bounds;
mod controls;
mod edits;
mod reports;
mod sequences;

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;
use spao_server::ao::{Accessibility, AoBuild, AoWork, Pyramid};
use spao_server::gpu::GpuOptions;
use spao_server::renderer::{Coverage, Renderer};
use spao_server::scene::{AmbientOcclusion, TransferFunction};
use spao_server::volume::{Grid, Volume, VolumeId, Voxels};

use super::support::{hash, scene_of};

/// What accessibility is computed for.
#[derive(Clone, Debug, PartialEq)]
struct State {
    transfer: TransferFunction,
    settings: AmbientOcclusion,
    coverage: Coverage,
}

/// A renderer with one volume, for builds past all that it keeps.
struct Bench {
    renderer: Renderer,
    volume: Arc<Volume>,
    id: VolumeId,
}

/// A pyramid from update to update, with the result that the next one begins with.
struct Kept {
    pyramid: Rc<RefCell<Pyramid>>,
    result: Option<Rc<Accessibility>>,
}

/// All that an update leaves behind.
#[derive(Clone, Debug, PartialEq)]
struct Bits {
    levels: Vec<Vec<u32>>,
    samples: Vec<u32>,
    surface_reference: u64,
}

impl Bits {
    /// Where two differ first.
    fn difference(&self, other: &Self) -> Option<String> {
        let parts = self.levels.iter().chain([&self.samples]).zip(other.levels.iter().chain([&other.samples]));
        for (part, (mine, theirs)) in parts.enumerate() {
            let name = if part < self.levels.len() { format!("level {part}") } else { "samples".to_owned() };
            if mine.len() != theirs.len() {
                return Some(format!("{name}: {} and {} words", mine.len(), theirs.len()));
            }
            let wrong = mine.iter().zip(theirs).filter(|(a, b)| a != b).count();
            if let Some(at) = mine.iter().zip(theirs).position(|(a, b)| a != b) {
                return Some(format!("{name}: {wrong} words, first {at}: {:x} and {:x}", mine[at], theirs[at]));
            }
        }
        (self != other).then(|| format!("surface: {:x} and {:x}", self.surface_reference, other.surface_reference))
    }
}

impl Bench {
    fn new(volume: Arc<Volume>) -> Self {
        Self::with_options(volume, &GpuOptions::default())
    }

    fn with_options(volume: Arc<Volume>, options: &GpuOptions) -> Self {
        let mut renderer = Renderer::new(options).expect("tests need an adapter; a software one will do");
        let id = VolumeId("v_1".into());
        renderer.add_volume(id.clone(), volume.clone()).expect("the volume fits");
        Self { renderer, volume, id }
    }

    /// A pyramid that holds nothing yet.
    fn nothing(&self, state: &State) -> Kept {
        let scene = scene_of(&self.id, &self.volume, &state.transfer, state.settings);
        Kept { pyramid: self.renderer.new_pyramid(&scene).expect("it fits"), result: None }
    }

    fn begin(&self, kept: &Kept, state: &State) -> AoBuild {
        let scene = scene_of(&self.id, &self.volume, &state.transfer, state.settings);
        self.renderer.ao_update(&scene, state.coverage, kept.pyramid.clone()).expect("it fits")
    }

    fn complete(&self, build: &mut AoBuild) -> (Rc<Accessibility>, AoWork) {
        let (gpu, stages) = self.renderer.ao_tools();
        while !build.advance(gpu, stages).expect("the device works") {}
        build.finish(gpu, 1).expect("the device works").expect("all is done")
    }

    /// Updates what is kept, to the end.
    fn update(&self, kept: &mut Kept, state: &State) -> AoWork {
        let (result, work) = self.complete(&mut self.begin(kept, state));
        kept.result = Some(result);
        work
    }

    /// Begins an update that nobody waits for: after so many steps its build is dropped. True if it had not come to
    /// its end by then.
    fn abandon(&self, kept: &Kept, state: &State, turns: u64) -> bool {
        let mut build = self.begin(kept, state);
        let (gpu, stages) = self.renderer.ao_tools();
        (0..turns).all(|_| !build.step(gpu, stages).expect("the device works"))
    }

    fn bits(&self, kept: &Kept) -> Bits {
        bits_of(&self.renderer, kept)
    }

    /// What a build from nothing leaves.
    fn fresh_bits(&self, state: &State) -> Bits {
        let mut kept = self.nothing(state);
        self.update(&mut kept, state);
        self.bits(&kept)
    }
}

fn bits_of(renderer: &Renderer, kept: &Kept) -> Bits {
    let (gpu, _) = renderer.ao_tools();
    let pyramid = kept.pyramid.borrow();
    let levels = 0..pyramid.level_bytes().len();
    let result = kept.result.as_ref().expect("an update has been finished");
    let samples = renderer.read_accessibility(result).expect("it can be read");
    Bits {
        levels: levels.map(|level| pyramid.read_level(gpu, level).expect("it can be read")).collect(),
        samples: samples.into_iter().map(f32::to_bits).collect(),
        surface_reference: result.surface_reference.to_bits(),
    }
}

/// Numbers as good as random, the same for the same seed.
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 = hash(self.0);
        self.0
    }

    fn below(&mut self, end: u64) -> u64 {
        self.next() % end
    }

    /// In [0, 1).
    fn share(&mut self) -> f64 {
        (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }
}

/// Less than some levels of the volumes that it is used with take.
const SMALL_BINDING: u64 = 2 << 20;

/// Where no values are, as shares of the range.
const GAP: [f64; 2] = [0.3, 0.45];

/// Some balls with soft edges, in [0, 1], with no value inside the gap; `noise` is the largest share of noise.
fn balls(dims: [u32; 3], count: u64, noise: f64) -> impl Fn([u32; 3]) -> f64 {
    let size = DVec3::from(dims.map(f64::from));
    let mut random = Random(u64::from(dims[0]) << 32 | count);
    let balls: Vec<(DVec3, f64, f64)> = (0..count)
        .map(|_| {
            let center = DVec3::new(random.share(), random.share(), random.share()) * size;
            (center, (0.1 + 0.2 * random.share()) * size.max_element(), 0.6 + 0.4 * random.share())
        })
        .collect();
    move |[i, j, k]| {
        let at = DVec3::new(f64::from(i), f64::from(j), f64::from(k));
        let grain = noise * Random(u64::from((k * 4096 + j) * 4096 + i)).share();
        let ball = |b: &(DVec3, f64, f64)| b.2 * (1.0 - at.distance(b.0) / b.1).clamp(0.0, 1.0);
        let value = (balls.iter().map(ball).fold(0.0, f64::max) + grain).min(1.0);
        if (GAP[0]..GAP[1]).contains(&value) { GAP[1] } else { value }
    }
}

fn bytes_of(dims: [u32; 3], spacing: DVec3, value: impl Fn([u32; 3]) -> f64) -> Arc<Volume> {
    let voxels = places(dims).map(|at| (255.0 * value(at)).round() as u8).collect();
    Arc::new(Volume::new(Grid::axis_aligned(dims, spacing), Voxels::U8(voxels)).expect("a valid volume"))
}

fn shorts_of(dims: [u32; 3], spacing: DVec3, value: impl Fn([u32; 3]) -> f64) -> Arc<Volume> {
    let voxels = places(dims).map(|at| (40_000.0 * value(at)).round() as u16).collect();
    Arc::new(Volume::new(Grid::axis_aligned(dims, spacing), Voxels::U16(voxels)).expect("a valid volume"))
}

/// A part of the CT head, Hounsfield units in 16 signed bits.
fn head_crop(first: [u32; 3], dims: [u32; 3]) -> Arc<Volume> {
    let head = super::support::ct_head();
    let voxels = places(dims).map(|at| head.value_at([0, 1, 2].map(|a| first[a] + at[a])) as i16).collect();
    Arc::new(Volume::new(Grid::axis_aligned(dims, head.grid.spacing), Voxels::I16(voxels)).expect("a valid volume"))
}

/// All voxels, x fastest.
fn places([nx, ny, nz]: [u32; 3]) -> impl Iterator<Item = [u32; 3]> {
    (0..nz).flat_map(move |k| (0..ny).flat_map(move |j| (0..nx).map(move |i| [i, j, k])))
}
