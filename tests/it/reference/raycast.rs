//! Compositing: opacity, background, clipping, occlusion and sampling.

use glam::DVec3;
use spao_server::reference::{Exposure, RaycastInput, Raycaster, ValueField};
use spao_server::scene::{
    Camera, ClipBox, ClipPlane, ControlPoint, Lighting, Projection, RenderMode, Rendering, Rgb, Rgba, Scene,
    TransferFunction, Viewport,
};
use spao_server::volume::{CodeMap, Grid, VolumeId};

use super::support::{ao_settings, assert_close, largest_difference};

/// Looks along -z from far enough above; nothing but the transfer function's own colour, no light.
pub(super) fn flat_scene(points: &[(f64, [f64; 3], f64)], camera: Camera) -> Scene {
    let point = |&(value, rgb, opacity): &(f64, [f64; 3], f64)| ControlPoint { value, color: Rgb(rgb), opacity };
    Scene {
        volume: VolumeId("v_test".into()),
        transfer_function: TransferFunction { points: points.iter().map(point).collect(), opacity_unit_distance: None },
        camera,
        ambient_occlusion: ao_settings(),
        lighting: Lighting {
            ambient: 1.0,
            diffuse: 0.0,
            specular: 0.0,
            shininess: 1.0,
            direction: None,
            color: Rgb([1.0; 3]),
            exposure: None,
        },
        rendering: Rendering {
            mode: RenderMode::Composite,
            sampling_rate: 1.0,
            background: Rgba([0.0; 4]),
            clip_box: None,
            clip_planes: Vec::new(),
        },
        viewport: Viewport { width: 32, height: 32 },
    }
}

/// From above, along -z, towards the middle of a grid; 100.3 from the eye plane to the middle.
fn from_above(grid: &Grid, height: f64) -> Camera {
    let target = grid.center();
    let eye = target + DVec3::Z * 100.3;
    Camera { eye, target, up: DVec3::Y, projection: Projection::Orthographic { height } }
}

const ORANGE: [f64; 3] = [0.9, 0.5, 0.1];

/// A volume of the one value 7, as large as the picture: 8 x 8 x 10 voxels of 1.
struct Slab {
    grid: Grid,
    values: ValueField,
    code_map: CodeMap,
}

impl Slab {
    fn new() -> Self {
        let dims = [8, 8, 10];
        Self {
            grid: Grid::axis_aligned(dims, DVec3::ONE),
            values: ValueField::from_fn(dims, |_| 0.0),
            code_map: CodeMap::for_integers(7.0, 7.0),
        }
    }

    fn scene(&self, opacity: f64) -> Scene {
        flat_scene(&[(0.0, ORANGE, opacity)], from_above(&self.grid, 8.0))
    }

    fn input<'a>(&'a self, scene: &'a Scene) -> RaycastInput<'a> {
        RaycastInput {
            grid: &self.grid,
            values: &self.values,
            code_map: &self.code_map,
            scene,
            accessibility: None,
            exposure: Exposure::NONE,
            width: 8,
            height: 8,
        }
    }

    fn pixel(&self, scene: &Scene) -> [f64; 4] {
        Raycaster::new(self.input(scene)).pixel(3, 4)
    }
}

#[track_caller]
fn assert_pixel(actual: [f64; 4], expected: [f64; 4]) {
    let difference = largest_difference(&actual, &expected);
    assert!(difference < 1e-12, "{actual:?} is not {expected:?}");
}

#[test]
#[should_panic(expected = "is not")]
fn a_pixel_that_is_a_little_off_is_noticed() {
    assert_pixel([0.1, 0.2, 0.3, 0.4], [0.1, 0.2, 0.3, 0.4001]);
}

#[test]
fn a_uniform_slab_has_the_opacity_of_its_thickness_at_any_sampling_rate() {
    let slab = Slab::new();
    let mut scene = slab.scene(0.1);
    let expected = 1.0 - 0.9_f64.powi(10);
    for rate in [0.1, 0.37, 0.5, 1.0, 2.0, 5.0] {
        scene.rendering.sampling_rate = rate;
        assert_pixel(slab.pixel(&scene), [0.9, 0.5, 0.1, expected]);
    }
    scene.transfer_function.opacity_unit_distance = Some(2.0);
    assert_pixel(slab.pixel(&scene), [0.9, 0.5, 0.1, 1.0 - 0.9_f64.powi(5)]);
}

#[test]
fn a_slanted_ray_through_a_slab_goes_a_longer_way() {
    let slab = Slab::new();
    let mut scene = slab.scene(0.05);
    let target = slab.grid.center();
    let direction = DVec3::new(0.0, 0.6, -0.8);
    scene.camera.eye = target - direction * 60.0;
    scene.camera.projection = Projection::Perspective { fov_y_deg: 10.0 };
    // The middle ray leaves 8 voxels of y after 8 / 0.6 and 10 of z after 10 / 0.8 voxels.
    let input = RaycastInput { width: 1, height: 1, ..slab.input(&scene) };
    let alpha = Raycaster::new(input).pixel(0, 0)[3];
    assert_close(alpha, 1.0 - 0.95_f64.powf(12.5), 1e-12);
}

#[test]
fn the_picture_lies_over_the_background_with_straight_alpha() {
    let slab = Slab::new();
    let mut scene = slab.scene(0.1);
    let alpha = 1.0 - 0.9_f64.powi(10);
    scene.rendering.background = Rgba([0.2, 0.4, 1.0, 1.0]);
    let mixed = |c: usize, background: f64| alpha * ORANGE[c] + (1.0 - alpha) * background;
    assert_pixel(slab.pixel(&scene), [mixed(0, 0.2), mixed(1, 0.4), mixed(2, 1.0), 1.0]);
    scene.rendering.background = Rgba([0.2, 0.4, 1.0, 0.5]);
    let out = alpha + (1.0 - alpha) * 0.5;
    let straight = |c: usize, background: f64| (alpha * ORANGE[c] + (1.0 - alpha) * 0.5 * background) / out;
    assert_pixel(slab.pixel(&scene), [straight(0, 0.2), straight(1, 0.4), straight(2, 1.0), out]);
    scene.transfer_function.points[0].opacity = 0.0;
    assert_pixel(slab.pixel(&scene), [0.2, 0.4, 1.0, 0.5]);
    scene.rendering.background = Rgba([0.2, 0.4, 1.0, 0.0]);
    assert_pixel(slab.pixel(&scene), [0.0; 4]);
}

#[test]
fn an_opaque_volume_hides_what_is_behind_and_ends_the_ray() {
    let slab = Slab::new();
    let mut scene = slab.scene(1.0);
    scene.rendering.background = Rgba([0.0, 1.0, 0.0, 1.0]);
    // The upper face is 95.3 away from the eye plane, so the first segment is 0.7 steps long and the next ones 1.
    let over_green = |alpha: f64| [alpha * 0.9, alpha * 0.5 + 1.0 - alpha, alpha * 0.1, 1.0];
    assert_pixel(slab.pixel(&scene), over_green(1.0 - (-0.7 * 20.0_f64).exp()));
    scene.transfer_function.points[0].opacity = 0.99;
    // 0.96 is not the end yet, 0.9996 is.
    assert_pixel(slab.pixel(&scene), over_green(1.0 - 0.01_f64.powf(1.7)));
}

#[test]
fn clipping_removes_exactly_what_is_clipped() {
    let slab = Slab::new();
    let transmittance = |rendering: Rendering| {
        let scene = Scene { rendering, ..slab.scene(0.1) };
        1.0 - slab.pixel(&scene)[3]
    };
    let none = slab.scene(0.1).rendering;
    // The slab's z is -0.5..9.5.
    let below = |z: f64| Rendering {
        clip_box: Some(ClipBox { min: DVec3::splat(-100.0), max: DVec3::new(100.0, 100.0, z) }),
        ..none.clone()
    };
    let above = |z: f64| Rendering { clip_planes: vec![ClipPlane { normal: DVec3::Z, d: -z }], ..none.clone() };
    for z in [2.2, 3.31, 4.8, 5.05, 7.7] {
        assert_close(transmittance(below(z)), 0.9_f64.powf(z + 0.5), 1e-12);
        assert_close(transmittance(above(z)), 0.9_f64.powf(9.5 - z), 1e-12);
    }
    assert_eq!(transmittance(below(-0.6)), 1.0);
    assert_eq!(transmittance(above(9.6)), 1.0);
}

#[test]
fn values_are_interpolated_before_they_are_classified_and_run_linearly_between_samples() {
    let dims = [8, 8, 2];
    let grid = Grid::axis_aligned(dims, DVec3::ONE);
    let values = ValueField::from_fn(dims, |[.., k]| f64::from(k));
    // Only values between those of the two layers are opaque.
    let points = [(40.0, ORANGE, 0.0), (40.0, ORANGE, 0.5), (60.0, ORANGE, 0.5), (60.0, ORANGE, 0.0)];
    let mut scene = flat_scene(&points, from_above(&grid, 8.0));
    let code_map = CodeMap::for_integers(0.0, 100.0);
    let mut alpha_at = |rate: f64| {
        scene.rendering.sampling_rate = rate;
        let input = RaycastInput {
            grid: &grid,
            values: &values,
            code_map: &code_map,
            scene: &scene,
            accessibility: None,
            exposure: Exposure::NONE,
            width: 8,
            height: 8,
        };
        Raycaster::new(input).pixel(4, 4)[3]
    };
    // Values 40..60 fill a fifth of the voxel between the layers' centres.
    assert_close(alpha_at(8.0), 1.0 - 0.5_f64.powf(0.2), 1e-12);
    // Samples at z = 0.8 and -0.2 have the values 80 and 0: a quarter of their segment is within, and no sample is.
    assert_close(alpha_at(1.0), 1.0 - 0.5_f64.powf(0.25), 1e-12);
}

/// A stack of 8 x 8 x 10 voxels of 1 x 1 x 2 with v̂ = `slope` k, opaque from z = 11 downwards.
fn red_of_a_cut_stack(slope: f64, accessibility: &[f64]) -> f64 {
    let dims = [8, 8, 10];
    let grid = Grid::axis_aligned(dims, DVec3::new(1.0, 1.0, 2.0));
    let values = ValueField::from_fn(dims, |[.., k]| slope * f64::from(k));
    let mut scene = flat_scene(&[(0.0, ORANGE, 1.0)], from_above(&grid, 8.0));
    scene.rendering.clip_planes = vec![ClipPlane { normal: DVec3::NEG_Z, d: 11.0 }];
    let input = RaycastInput {
        grid: &grid,
        values: &values,
        code_map: &CodeMap::for_integers(0.0, 100.0),
        scene: &scene,
        accessibility: Some(accessibility),
        exposure: Exposure::NONE,
        width: 8,
        height: 8,
    };
    Raycaster::new(input).pixel(3, 4)[0]
}

#[test]
fn a_surface_is_lit_by_the_accessibility_one_smallest_spacing_in_front_of_it() {
    // A = z / 40 at world z: 2 k / 40 at layer k.
    let rising: Vec<f64> = (0..640).map(|i| f64::from(i / 64) / 20.0).collect();
    // Half of what an opaque volume shows lies within ln 2 / 20 below its face.
    let place = 11.0 - 2.0_f64.ln() / 20.0;
    let lit_at = |z: f64| 0.9 * z / 40.0;
    // A change of v̂ of `slope` per 2 world units: the gradient is slope / 2 long.
    for (slope, lead) in [(0.0, 0.0), (0.01, 0.25), (0.02, 0.5), (0.04, 1.0), (0.1, 1.0), (-0.1, 1.0)] {
        assert_close(red_of_a_cut_stack(slope, &rising), lit_at(place + lead), 1e-5);
    }
}

#[test]
fn accessibility_darkens_by_its_strength_and_exposure_makes_up_for_it() {
    let slab = Slab::new();
    let mut scene = slab.scene(1.0);
    let red = |scene: &Scene, accessibility: Option<&[f64]>, exposure: Exposure| {
        let input = RaycastInput { accessibility, exposure, ..slab.input(scene) };
        Raycaster::new(input).pixel(3, 4)[0]
    };
    let per_layer: Vec<f64> = (0..640).map(|i| if i / 64 == 9 { 0.2 } else { 0.8 }).collect();
    // Right below the upper face, so beyond the centre of layer 9.
    assert_close(red(&scene, Some(&per_layer), Exposure::NONE), 0.9 * 0.2, 1e-12);
    assert_close(red(&scene, Some(&per_layer), Exposure::explicit(3.0)), 0.9 * 0.6, 1e-12);
    assert_close(red(&scene, Some(&per_layer), Exposure::automatic(0.4)), 0.9 * 0.75, 1e-12);
    assert_close(red(&scene, Some(&per_layer), Exposure::automatic(0.2)), 0.9, 1e-12);
    scene.ambient_occlusion.strength = 0.5;
    assert_close(red(&scene, Some(&per_layer), Exposure::NONE), 0.9 * 0.6, 1e-12);
    scene.ambient_occlusion.strength = 0.0;
    assert_close(red(&scene, Some(&per_layer), Exposure::NONE), 0.9, 1e-12);
    assert_close(red(&scene, None, Exposure::explicit(0.5)), 0.45, 1e-12);
}

#[test]
fn halving_the_step_keeps_the_picture_and_forgetting_opacity_correction_does_not() {
    let dims = [24, 24, 24];
    let grid = Grid::axis_aligned(dims, DVec3::ONE);
    let centre = DVec3::splat(11.5);
    let values = ValueField::from_fn(dims, |v| {
        let distance = (DVec3::from_array(v.map(f64::from)) - centre).length();
        (1.0 - distance / 12.0).clamp(0.0, 1.0)
    });
    let points = [(10.0, [0.1, 0.2, 0.9], 0.0), (60.0, [0.9, 0.6, 0.2], 0.1), (100.0, [1.0, 1.0, 0.9], 0.2)];
    let mut scene = flat_scene(&points, from_above(&grid, 26.0));
    scene.lighting = Lighting { ambient: 0.3, diffuse: 0.6, specular: 0.2, shininess: 20.0, ..scene.lighting };
    let code_map = CodeMap::for_integers(0.0, 100.0);
    let picture = |scene: &Scene| {
        let input = RaycastInput {
            grid: &grid,
            values: &values,
            code_map: &code_map,
            scene,
            accessibility: None,
            exposure: Exposure::NONE,
            width: 24,
            height: 24,
        };
        // Premultiplied, so that colours of nearly clear pixels do not count.
        let premultiplied = |[r, g, b, a]: [f64; 4]| [r * a, g * a, b * a, a];
        Raycaster::new(input).picture().into_iter().flat_map(premultiplied).collect::<Vec<f64>>()
    };
    let coarse = picture(&scene);
    let mut finer = scene.clone();
    finer.rendering.sampling_rate = 2.0;
    assert!(coarse.iter().any(|&c| c > 0.5), "nothing to see");
    let difference = largest_difference(&coarse, &picture(&finer));
    assert!(difference < 0.02, "{difference}");
    let mut uncorrected = finer;
    uncorrected.transfer_function.opacity_unit_distance = Some(0.5);
    assert!(largest_difference(&coarse, &picture(&uncorrected)) > 0.1);
}
