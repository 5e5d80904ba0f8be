//! Where things appear in the picture, and which way normals point: nothing is flipped or skewed.

use glam::DVec3;
use spao_server::reference::{Exposure, RaycastInput, Raycaster, ValueField};
use spao_server::scene::{Camera, Projection, Scene};
use spao_server::volume::{CodeMap, Grid};

use super::raycast::flat_scene;
use super::support::assert_close;

const DIMS: [u32; 3] = [9, 7, 5];
const WIDTH: u32 = 96;
const HEIGHT: u32 = 64;

/// Unequal spacing and axes that are neither the world's nor at right angles to each other.
fn oblique_grid() -> Grid {
    Grid {
        dims: DIMS,
        spacing: DVec3::new(1.0, 1.4, 2.2),
        origin: DVec3::new(30.0, -20.0, 5.0),
        direction: [
            DVec3::new(0.9, 0.3, -0.1).normalize(),
            DVec3::new(-0.4, 1.0, 0.2).normalize(),
            DVec3::new(0.1, 0.2, 1.0).normalize(),
        ],
    }
}

fn cameras(grid: &Grid) -> [Camera; 3] {
    let target = grid.center() + DVec3::new(1.0, -0.5, 0.3);
    let camera = |away: DVec3, up: DVec3, projection| Camera { eye: target + away, target, up, projection };
    [
        camera(DVec3::new(8.0, -35.0, 12.0), DVec3::Z, Projection::Perspective { fov_y_deg: 35.0 }),
        camera(DVec3::new(18.0, 9.0, -16.0), DVec3::new(0.2, 1.0, 0.1), Projection::Perspective { fov_y_deg: 50.0 }),
        camera(DVec3::new(-9.0, 21.0, 22.0), DVec3::new(0.0, 0.3, 1.0), Projection::Orthographic { height: 20.0 }),
    ]
}

/// Pixel coordinates of a world point, by textbook projection.
fn projected(camera: &Camera, point: DVec3) -> [f64; 2] {
    let forward = (camera.target - camera.eye).normalize();
    let right = forward.cross(camera.up).normalize();
    let up = right.cross(forward);
    let from_eye = point - camera.eye;
    let half_height = match camera.projection {
        Projection::Perspective { fov_y_deg } => from_eye.dot(forward) * (fov_y_deg.to_radians() / 2.0).tan(),
        Projection::Orthographic { height } => height / 2.0,
    };
    let (width, height) = (f64::from(WIDTH), f64::from(HEIGHT));
    [
        width / 2.0 + from_eye.dot(right) / half_height * height / 2.0,
        height / 2.0 - from_eye.dot(up) / half_height * height / 2.0,
    ]
}

fn input<'a>(grid: &'a Grid, values: &'a ValueField, code_map: &'a CodeMap, scene: &'a Scene) -> RaycastInput<'a> {
    RaycastInput {
        grid,
        values,
        code_map,
        scene,
        accessibility: None,
        exposure: Exposure::NONE,
        width: WIDTH,
        height: HEIGHT,
    }
}

/// Where the alpha of a picture has its centre of mass, in pixels; pixel centres are at +0.5.
fn centre_of_mass(picture: &[[f64; 4]]) -> [f64; 2] {
    let (mut x, mut y, mut sum) = (0.0, 0.0, 0.0);
    for (i, [.., alpha]) in picture.iter().enumerate() {
        x += alpha * (f64::from(i as u32 % WIDTH) + 0.5);
        y += alpha * (f64::from(i as u32 / WIDTH) + 0.5);
        sum += alpha;
    }
    [x / sum, y / sum]
}

fn distance(a: [f64; 2], b: [f64; 2]) -> f64 {
    (a[0] - b[0]).hypot(a[1] - b[1])
}

#[test]
fn one_bright_voxel_appears_where_it_projects_to_and_nowhere_mirrored() {
    let grid = oblique_grid();
    let code_map = CodeMap::for_integers(0.0, 100.0);
    for voxel in [[7, 1, 3], [1, 5, 1], [6, 4, 2]] {
        let values = ValueField::from_fn(DIMS, |v| if v == voxel { 1.0 } else { 0.0 });
        for camera in cameras(&grid) {
            let mut scene = flat_scene(&[(30.0, [1.0; 3], 0.0), (100.0, [1.0; 3], 0.3)], camera.clone());
            scene.rendering.sampling_rate = 4.0;
            let found = centre_of_mass(&Raycaster::new(input(&grid, &values, &code_map, &scene)).picture());
            let pixel_of = |v: [u32; 3]| {
                let centre = DVec3::from_array(v.map(f64::from)) + 0.5;
                projected(&camera, grid.world_from_index().transform_point3(centre))
            };
            let off = distance(found, pixel_of(voxel));
            assert!(off < 0.15, "{voxel:?}: found at {found:?}, expected at {:?}", pixel_of(voxel));
            // A neighbour, a mirrored axis or swapped axes would be seen.
            let [x, y, z] = voxel;
            for wrong in [[8 - x, y, z], [x, 6 - y, z], [x, y, z + 1], [x - 1, y, z], [y, x, z]] {
                assert!(distance(found, pixel_of(wrong)) > 0.8, "{voxel:?} cannot be told from {wrong:?}");
            }
        }
    }
}

#[test]
fn the_world_gradient_of_a_ramp_is_its_slope_whatever_the_grid() {
    let grid = oblique_grid();
    let world_from_index = grid.world_from_index();
    // v̂ changes by 0.01 per world unit along this direction.
    let slope = DVec3::new(0.6, -0.64, 0.48) * 0.01;
    let values = ValueField::from_fn(DIMS, |v| {
        let centre = DVec3::from_array(v.map(f64::from)) + 0.5;
        0.5 + slope.dot(world_from_index.transform_point3(centre) - grid.center())
    });
    let scene = flat_scene(&[(0.0, [1.0; 3], 1.0)], cameras(&grid)[0].clone());
    let code_map = CodeMap::for_integers(0.0, 100.0);
    let gradient = Raycaster::new(input(&grid, &values, &code_map, &scene)).world_gradient(DVec3::new(4.2, 3.3, 2.4));
    assert!((gradient - slope * grid.smallest_spacing()).length() < 1e-12, "{gradient}");
    assert!((gradient - slope * grid.spacing.y).length() > 1e-3);
}

#[test]
fn gradients_are_interpolated_as_square_roots_and_have_a_greatest_length() {
    let code_map = CodeMap::for_integers(0.0, 100.0);
    let length_at = |grid: &Grid, value: fn(u32) -> f64, z: f64| {
        let values = ValueField::from_fn(DIMS, |[.., k]| value(k));
        let scene = flat_scene(&[(0.0, [1.0; 3], 1.0)], cameras(grid)[0].clone());
        Raycaster::new(input(grid, &values, &code_map, &scene)).world_gradient(DVec3::new(4.5, 3.5, z)).length()
    };
    let unit = Grid::axis_aligned(DIMS, DVec3::ONE);
    // Central differences are 0 at layer 1, 0.05 at layer 2, 0.1 at layer 3.
    let bend = |k: u32| 0.1 * f64::from(k.max(2) - 2);
    assert_close(length_at(&unit, bend, 1.5), 0.0, 1e-12);
    assert_close(length_at(&unit, bend, 2.5), 0.05, 1e-12);
    assert_close(length_at(&unit, bend, 2.0), 0.05 / 4.0, 1e-12);
    assert_close(length_at(&unit, bend, 3.0), ((0.05_f64.sqrt() + 0.1_f64.sqrt()) / 2.0).powi(2), 1e-12);
    // A jump of half the range per voxel along one axis is 0.5 long, and more in a sheared grid, but never too much.
    let jump = |k: u32| 0.5 * f64::from(k.min(2));
    assert_close(length_at(&unit, jump, 1.5), 0.5, 1e-12);
    let mut sheared = unit.clone();
    sheared.direction[2] = DVec3::new(0.96, 0.0, 0.28);
    assert_close(length_at(&sheared, jump, 1.5), 0.75_f64.sqrt(), 1e-12);
    assert_close(length_at(&sheared, bend, 2.5), 0.05 / 0.28, 1e-12);
}

#[test]
fn a_ball_is_brightest_towards_the_light() {
    let dims = [20, 20, 20];
    let grid = Grid::axis_aligned(dims, DVec3::ONE);
    let centre = DVec3::splat(9.5);
    let values = ValueField::from_fn(dims, |v| {
        let from_centre = DVec3::from_array(v.map(f64::from)) - centre;
        (0.5 + (7.0 - from_centre.length()) / 4.0).clamp(0.0, 1.0)
    });
    let target = grid.center();
    let projection = Projection::Orthographic { height: 20.0 };
    let camera = Camera { eye: target - DVec3::Y * 50.0, target, up: DVec3::Z, projection };
    let mut scene = flat_scene(&[(45.0, [0.8; 3], 0.0), (55.0, [0.8; 3], 1.0)], camera);
    scene.lighting.ambient = 0.1;
    scene.lighting.diffuse = 0.9;
    scene.rendering.sampling_rate = 4.0;
    let code_map = CodeMap::for_integers(0.0, 100.0);
    let brightness = |scene: &Scene, x: u32, y: u32| {
        let square = RaycastInput { width: 20, height: 20, ..input(&grid, &values, &code_map, scene) };
        Raycaster::new(square).pixel(x, y)[0]
    };
    // Seen along +y with z up, the world's x points to the right.
    let head_light = [[10, 10], [15, 10], [4, 10], [10, 4], [10, 15]].map(|[x, y]| brightness(&scene, x, y));
    assert!(head_light[1..].iter().all(|&b| b < head_light[0] - 0.1), "{head_light:?}");
    assert_close(head_light[1], head_light[2], 0.01);
    scene.lighting.direction = Some(DVec3::X);
    assert!(brightness(&scene, 15, 10) > brightness(&scene, 10, 10) + 0.3);
    assert_close(brightness(&scene, 4, 10), 0.08, 0.02);
    scene.lighting.direction = Some(DVec3::Z);
    assert!(brightness(&scene, 10, 4) > brightness(&scene, 10, 15) + 0.3);
}
