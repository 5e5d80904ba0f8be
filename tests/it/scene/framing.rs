//! Cameras that frame a volume show all of it.

use glam::{DMat3, DVec3};
use spao_server::scene::{Camera, Projection, framed_camera, framed_camera_with_fov, framed_height};
use spao_server::volume::Grid;

const ASPECTS: [(u32, u32); 4] = [(1024, 768), (100, 100), (300, 1200), (1920, 400)];

fn grids() -> Vec<Grid> {
    let oblique = DMat3::from_axis_angle(DVec3::new(1.0, 2.0, -0.5).normalize(), 0.7);
    let sheared = [DVec3::X, DVec3::new(0.3, 1.0, 0.0).normalize(), DVec3::new(0.0, -0.4, 1.0).normalize()];
    let turned = |dims| Grid {
        dims,
        spacing: DVec3::new(0.5, 0.75, 2.5),
        origin: DVec3::new(-200.0, 50.0, 1500.0),
        direction: [oblique.x_axis, oblique.y_axis, oblique.z_axis],
    };
    let mut grids = vec![
        Grid::axis_aligned([256, 256, 210], DVec3::ONE),
        Grid::axis_aligned([512, 512, 30], DVec3::new(0.4, 0.4, 5.0)),
        Grid::axis_aligned([1, 1, 1], DVec3::splat(1e-6)),
        Grid { direction: sheared, ..Grid::axis_aligned([64, 128, 32], DVec3::new(1.0, 2.0, 3.0)) },
        turned([256, 256, 100]),
        turned([300, 1, 100]),
    ];
    for axis in 0..3 {
        let mut dims = [200, 150, 100];
        dims[axis] = 1;
        grids.push(Grid::axis_aligned(dims, DVec3::ONE));
    }
    grids.push(Grid::axis_aligned([1, 1, 500], DVec3::ONE));
    grids
}

/// The largest |u| or |v| of the volume's corners in the picture: 1 at its border. Infinite behind the eye.
fn largest_picture_coordinate(camera: &Camera, grid: &Grid, (width, height): (u32, u32)) -> f64 {
    let rays = camera.ray_basis(width, height);
    let coordinates = grid.corners().map(|corner| {
        let offset = corner - rays.origin;
        let (uvw, in_front) = match camera.projection {
            Projection::Perspective { .. } => {
                let uvw = DMat3::from_cols(rays.dir_du, rays.dir_dv, rays.forward).inverse() * offset;
                (uvw / uvw.z, uvw.z > 0.0)
            }
            Projection::Orthographic { .. } => {
                let uvw = DMat3::from_cols(rays.origin_du, rays.origin_dv, rays.forward).inverse() * offset;
                (uvw, uvw.z > 0.0)
            }
        };
        if in_front { uvw.x.abs().max(uvw.y.abs()) } else { f64::INFINITY }
    });
    coordinates.into_iter().fold(0.0, f64::max)
}

fn aspect((width, height): (u32, u32)) -> f64 {
    f64::from(width) / f64::from(height)
}

#[test]
fn a_framed_volume_fills_the_picture_and_stays_inside() {
    for grid in grids() {
        for size in ASPECTS {
            for fov in [1.0, 40.0, 120.0, 175.0] {
                let camera = framed_camera_with_fov(&grid, aspect(size), fov);
                let largest = largest_picture_coordinate(&camera, &grid, size);
                assert!((0.9..1.0).contains(&largest), "{largest} at {fov} degrees of {grid:?}");
            }
        }
    }
}

#[test]
fn a_framed_orthographic_picture_fills_the_picture_and_stays_inside() {
    for grid in grids() {
        for size in ASPECTS {
            let mut camera = framed_camera(&grid, aspect(size));
            let height = framed_height(&grid, aspect(size), camera.target - camera.eye, camera.up);
            camera.projection = Projection::Orthographic { height };
            let largest = largest_picture_coordinate(&camera, &grid, size);
            assert!((0.9..1.0).contains(&largest), "{largest} of {grid:?}");
        }
    }
}

#[test]
fn a_camera_nearer_by_a_tenth_or_behind_the_volume_is_noticed() {
    let grid = Grid::axis_aligned([256, 256, 210], DVec3::ONE);
    let framed = framed_camera(&grid, aspect(ASPECTS[0]));
    let mut nearer = framed.clone();
    nearer.eye = nearer.target + (nearer.eye - nearer.target) * 0.9;
    assert!(largest_picture_coordinate(&nearer, &grid, ASPECTS[0]) > 1.0);
    let mut away = framed.clone();
    away.target = away.eye * 2.0 - away.target;
    assert!(largest_picture_coordinate(&away, &grid, ASPECTS[0]) > 1.0);
}

#[test]
fn a_patient_is_seen_from_the_front_his_head_up() {
    let grid = Grid::axis_aligned([256, 256, 210], DVec3::ONE);
    let camera = framed_camera(&grid, 4.0 / 3.0);
    let to_eye = (camera.eye - camera.target).normalize();
    assert!(to_eye.y < -0.8 && to_eye.x > 0.3 && to_eye.z > 0.1, "{to_eye}");
    assert_eq!((camera.up, camera.target), (DVec3::Z, grid.center()));
}

#[test]
fn a_sheet_is_seen_from_its_flat_side() {
    for axis in 0..3 {
        let mut dims = [200, 150, 100];
        dims[axis] = 1;
        let camera = framed_camera(&Grid::axis_aligned(dims, DVec3::ONE), 1.0);
        let to_eye = (camera.eye - camera.target).normalize();
        assert!(to_eye[axis].abs() > 0.8, "{dims:?}: {to_eye}");
    }
}
