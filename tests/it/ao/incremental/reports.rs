//! What pictures say about how their accessibility came about.

use std::sync::Arc;

use glam::DVec3;
use spao_server::gpu::GpuOptions;
use spao_server::renderer::{AoPolicy, AoReport, AoState, AoUpdate, Frame, FrameRequest, Renderer};
use spao_server::scene::{AmbientOcclusion, AoMethod, Rgb, Scene};
use spao_server::volume::{Volume, VolumeId};

use super::edits::Editor;
use super::{balls, bytes_of};
use crate::ao::support::{mipmap, n_buffer, raytraced, scene_of};

const DIMS: [u32; 3] = [61, 44, 37];
const BRICKS: u64 = 8 * 6 * 5;

struct Viewer {
    renderer: Renderer,
    volume: Arc<Volume>,
    id: VolumeId,
}

impl Viewer {
    fn new() -> Self {
        let mut renderer =
            Renderer::new(&GpuOptions::default()).expect("tests need an adapter; a software one will do");
        let (volume, id) = (bytes_of(DIMS, DVec3::ONE, balls(DIMS, 6, 0.1)), VolumeId("v_1".into()));
        renderer.add_volume(id.clone(), volume.clone()).expect("the volume fits");
        Self { renderer, volume, id }
    }

    fn scene(&self, settings: AmbientOcclusion) -> Scene {
        let editor = Editor::new(0, self.volume.code_map.value_range());
        scene_of(&self.id, &self.volume, &editor.usual(), settings)
    }

    fn frame(&mut self, scene: &Scene, ao_policy: AoPolicy) -> Frame {
        let request = FrameRequest { scene: Arc::new(scene.clone()), width: 32, height: 24, ao_policy };
        self.renderer.render(&request).expect("the picture is drawn")
    }

    fn report(&mut self, scene: &Scene) -> AoReport {
        self.frame(scene, AoPolicy::Exact).ao
    }
}

/// `scene` with another opacity at one point.
fn edited(scene: &Scene, opacity: f64) -> Scene {
    let mut scene = scene.clone();
    scene.transfer_function.points[2].opacity = opacity;
    scene
}

/// State, update, and whether bricks were classified and recomputed.
fn summary(report: &AoReport) -> (AoState, AoUpdate, bool, bool) {
    assert_eq!(report.bricks, BRICKS);
    assert!(report.bricks_classified <= BRICKS && report.bricks_recomputed <= BRICKS, "{report:?}");
    (report.state, report.update, report.bricks_classified > 0, report.bricks_recomputed > 0)
}

const CACHED: (AoState, AoUpdate, bool, bool) = (AoState::Exact, AoUpdate::Cached, false, false);

#[test]
fn the_first_picture_is_a_full_build_edits_are_updates_and_undo_comes_from_the_cache() {
    let mut viewer = Viewer::new();
    let first = viewer.scene(n_buffer(5, 1.0));
    let report = viewer.report(&first);
    assert_eq!(summary(&report), (AoState::Exact, AoUpdate::Full, true, true));
    assert_eq!(report.version, 1);
    let second = edited(&first, 0.35);
    let report = viewer.report(&second);
    assert_eq!(summary(&report), (AoState::Exact, AoUpdate::Incremental, true, true));
    assert_eq!(report.version, 2);
    for (scene, version) in [(&first, 1), (&second, 2), (&first, 1)] {
        let report = viewer.report(scene);
        assert_eq!((summary(&report), report.version), (CACHED, version));
    }
    // From where the cache has led back to.
    let report = viewer.report(&edited(&first, 0.36));
    assert_eq!((summary(&report).1, report.version), (AoUpdate::Incremental, 3));
}

#[test]
fn colours_cameras_and_light_are_no_edits_for_ambient_occlusion() {
    let mut viewer = Viewer::new();
    let first = viewer.scene(n_buffer(4, 1.0));
    viewer.report(&first);
    let mut colored = first.clone();
    colored.transfer_function.points[3].color = Rgb([0.9, 0.1, 0.2]);
    let mut moved = first.clone();
    moved.camera.eye.x += 20.0;
    let mut lit = first.clone();
    lit.lighting.ambient = 0.9;
    let mut weaker = first.clone();
    weaker.ambient_occlusion.strength = 0.4;
    for scene in [colored, moved, lit, weaker] {
        let report = viewer.report(&scene);
        assert_eq!((summary(&report), report.version), (CACHED, 1));
    }
}

#[test]
fn other_levels_are_built_from_nothing_and_other_factors_from_the_same_levels() {
    let mut viewer = Viewer::new();
    viewer.report(&viewer.scene(n_buffer(5, 1.0)));
    for other in [n_buffer(4, 1.0), mipmap(5, 1.0)] {
        let report = viewer.report(&viewer.scene(other));
        assert_eq!(summary(&report), (AoState::Exact, AoUpdate::Full, true, true), "{other:?}");
    }
    let report = viewer.report(&viewer.scene(n_buffer(5, 0.5)));
    assert_eq!(summary(&report), (AoState::Exact, AoUpdate::Full, false, true));
}

#[test]
fn every_ray_is_traced_again_after_an_edit() {
    let mut viewer = Viewer::new();
    let first = viewer.scene(raytraced(3, 1.0, 8));
    assert_eq!(summary(&viewer.report(&first)).1, AoUpdate::Full);
    let report = viewer.report(&edited(&first, 0.35));
    assert_eq!((summary(&report).1, report.bricks_recomputed), (AoUpdate::Full, BRICKS));
}

#[test]
fn without_ambient_occlusion_nothing_is_done() {
    let mut viewer = Viewer::new();
    let off = AmbientOcclusion { method: AoMethod::Off, ..n_buffer(5, 1.0) };
    let report = viewer.report(&viewer.scene(off));
    assert_eq!((summary(&report), report.version), ((AoState::Off, AoUpdate::Off, false, false), 0));
}

#[test]
fn what_is_at_hand_after_an_edit_is_older_and_says_so() {
    let mut viewer = Viewer::new();
    let first = viewer.scene(n_buffer(4, 1.0));
    let ao = viewer.frame(&first, AoPolicy::AtHand).ao;
    assert_eq!((ao.state, ao.update, ao.version), (AoState::Refining, AoUpdate::Off, 0));
    viewer.report(&first);
    let ao = viewer.frame(&edited(&first, 0.5), AoPolicy::AtHand).ao;
    assert_eq!((ao.state, ao.update, ao.version), (AoState::Refining, AoUpdate::Cached, 1));
    let ao = viewer.frame(&first, AoPolicy::AtHand).ao;
    assert_eq!((ao.state, ao.update, ao.version), (AoState::Exact, AoUpdate::Cached, 1));
}

#[test]
fn pictures_after_many_edits_are_those_of_a_renderer_that_knows_nothing() {
    let mut viewer = Viewer::new();
    let mut scene = viewer.scene(n_buffer(5, 1.0));
    let mut editor = Editor::new(11, viewer.volume.code_map.value_range());
    let mut updates = 0;
    for n in 0..40 {
        let mut state = super::State {
            transfer: scene.transfer_function.clone(),
            settings: scene.ambient_occlusion,
            coverage: spao_server::renderer::Coverage::Visible,
        };
        editor.edit(&mut state);
        (scene.transfer_function, scene.ambient_occlusion) = (state.transfer, state.settings);
        let frame = viewer.frame(&scene, AoPolicy::Exact);
        updates += u32::from(frame.ao.update == AoUpdate::Incremental);
        if n % 8 == 7 {
            let mut other = Viewer::new();
            assert!(other.frame(&scene, AoPolicy::Exact).rgba == frame.rgba, "edit {n}");
        }
    }
    assert!(updates > 8, "{updates}");
}
