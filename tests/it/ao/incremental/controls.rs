//! That what the comparison of updates with fresh builds is to find, it finds.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use glam::DVec3;
use spao_server::ao::{AoBuild, AoSource, Pyramid, TileSet};
use spao_server::gpu::{Category, GpuOptions, GpuTexture};
use spao_server::renderer::{Coverage, Renderer};
use spao_server::scene::AmbientOcclusion;
use spao_server::volume::{Bricks, Grid, Volume, Voxels};

use super::edits::Editor;
use super::{Bench, Bits, Kept, State, balls, bits_of, bytes_of};
use crate::ao::support::n_buffer;

const DIMS: [u32; 3] = [40, 24, 17];

/// A volume whose voxels all have code 0, on a renderer.
struct Flat {
    renderer: Renderer,
    values: Rc<GpuTexture>,
    contents: Bricks,
    settings: AmbientOcclusion,
}

impl Flat {
    fn new() -> Self {
        let renderer = Renderer::new(&GpuOptions::default()).expect("tests need an adapter; a software one will do");
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let (gpu, _) = renderer.ao_tools();
        let values = gpu.texture_3d("values", Category::Volume, DIMS, wgpu::TextureFormat::R8Unorm, usage);
        let values = Rc::new(values.expect("it fits"));
        let zeros = Voxels::U8(vec![0; DIMS.iter().product::<u32>() as usize]);
        let contents = Volume::new(Grid::axis_aligned(DIMS, DVec3::ONE), zeros).expect("a valid volume").bricks();
        let contents = contents.as_ref().clone();
        Self { renderer, values, contents, settings: n_buffer(4, 1.0) }
    }

    fn source(&self, opacity: u16, contents: &Bricks) -> AoSource {
        AoSource {
            values: self.values.clone(),
            code_scale: 255.0,
            max_code: 0,
            opacity_table: Rc::new(vec![opacity]),
            contents: Arc::new(contents.clone()),
            brick_distance: Rc::new(Vec::new()),
        }
    }

    fn nothing(&self) -> Kept {
        let (gpu, _) = self.renderer.ao_tools();
        let pyramid = Pyramid::new(gpu, &self.source(0, &self.contents), &self.settings).expect("it fits");
        Kept { pyramid: Rc::new(RefCell::new(pyramid)), result: None }
    }

    fn update(&self, kept: &mut Kept, opacity: u16, contents: &Bricks) {
        let (gpu, stages) = self.renderer.ao_tools();
        let (pyramid, source) = (kept.pyramid.clone(), self.source(opacity, contents));
        let wanted = TileSet::full(self.contents.dims);
        let mut build = AoBuild::new(gpu, stages, pyramid, source, self.settings, wanted, 0.0).expect("it fits");
        while !build.advance(gpu, stages).expect("the device works") {}
        kept.result = Some(build.finish(gpu, 1).expect("the device works").expect("all is done").0);
    }

    fn bits(&self, kept: &Kept) -> Bits {
        bits_of(&self.renderer, kept)
    }
}

#[test]
fn a_brick_of_which_it_is_not_known_what_it_holds_is_noticed() {
    let flat = Flat::new();
    let mut fresh = flat.nothing();
    flat.update(&mut fresh, 3000, &flat.contents);
    let fresh = flat.bits(&fresh);
    assert!(fresh.levels.iter().all(|words| words.iter().any(|&word| word != 0)));

    let updated = |contents: &Bricks| {
        let mut kept = flat.nothing();
        flat.update(&mut kept, 500, &flat.contents);
        flat.update(&mut kept, 3000, contents);
        flat.bits(&kept).difference(&fresh)
    };
    assert_eq!(updated(&flat.contents), None);
    // A tile of level 0 holds four bricks along x: all of them have to be forgotten.
    let [x, y, z] = flat.contents.dims.map(|n| n as usize);
    for row in [0, 1, y * z - 1] {
        let mut wrong = flat.contents.clone();
        wrong.codes[row * x..(row + 1) * x].fill(Default::default());
        assert!(updated(&wrong).is_some(), "row {row} of bricks");
    }
}

#[test]
fn one_bit_of_a_word_or_of_a_sample_is_noticed() {
    let bench = Bench::new(bytes_of(DIMS, DVec3::ONE, balls(DIMS, 5, 0.2)));
    let editor = Editor::new(0, bench.volume.code_map.value_range());
    let state = State { transfer: editor.usual(), settings: n_buffer(6, 1.0), coverage: Coverage::Visible };
    let fresh = bench.fresh_bits(&state);
    assert_eq!(bench.fresh_bits(&state).difference(&fresh), None);
    for level in 0..fresh.levels.len() {
        for at in [0, fresh.levels[level].len() / 2, fresh.levels[level].len() - 1] {
            let mut wrong = fresh.clone();
            wrong.levels[level][at] ^= 1;
            assert!(wrong.difference(&fresh).is_some_and(|d| d.starts_with(&format!("level {level}: 1 words"))));
        }
    }
    let mut wrong = fresh.clone();
    wrong.samples[12_345] ^= 1;
    assert!(wrong.difference(&fresh).is_some_and(|d| d.starts_with("samples: 1 words")));
    let mut wrong = fresh.clone();
    wrong.surface_reference ^= 1;
    assert!(wrong.difference(&fresh).is_some());
    let mut wrong = fresh.clone();
    wrong.levels[3].pop();
    assert!(wrong.difference(&fresh).is_some());
}

#[test]
fn other_opacities_factors_and_coverages_have_other_bits() {
    let bench = Bench::new(bytes_of(DIMS, DVec3::ONE, balls(DIMS, 5, 0.2)));
    let editor = Editor::new(0, bench.volume.code_map.value_range());
    let state = State { transfer: editor.usual(), settings: n_buffer(6, 1.0), coverage: Coverage::Visible };
    let fresh = bench.fresh_bits(&state);
    let mut nudged = state.clone();
    nudged.transfer.points[2].opacity += 1e-4;
    let everywhere = State { coverage: Coverage::Everywhere, ..state.clone() };
    for other in [nudged, State { settings: n_buffer(6, 0.5), ..state.clone() }, everywhere] {
        assert!(bench.fresh_bits(&other).difference(&fresh).is_some(), "{other:?}");
    }
}
