//! Rays through pixels and the intervals on which they see the volume.

use glam::DVec3;
use spao_server::reference::{Interval, Ray, pixel_ray, sample_places, visible_interval};
use spao_server::scene::{Camera, ClipBox, ClipPlane, Projection, RenderMode, Rendering, Rgba};
use spao_server::volume::Grid;

use super::support::assert_close;

fn rendering() -> Rendering {
    Rendering {
        mode: RenderMode::Composite,
        sampling_rate: 1.0,
        background: Rgba([0.0; 4]),
        clip_box: None,
        clip_planes: Vec::new(),
    }
}

#[track_caller]
fn assert_interval(interval: Interval, enter: f64, exit: f64) {
    assert!(!interval.is_empty(), "{interval:?} is empty");
    assert_close(interval.enter, enter, 1e-12);
    assert_close(interval.exit, exit, 1e-12);
}

#[test]
#[should_panic(expected = "is not")]
fn a_wrong_interval_is_noticed() {
    assert_interval(Interval { enter: 1.0, exit: 2.0 }, 1.0, 2.1);
}

#[test]
#[should_panic(expected = "is empty")]
fn an_empty_interval_is_noticed() {
    assert_interval(Interval { enter: 2.0, exit: 2.0 }, 2.0, 2.0);
}

#[test]
fn a_box_is_entered_left_missed_and_seen_from_inside() {
    let clip =
        |origin, direction| Interval::IN_FRONT.clip_to_box(origin, direction, DVec3::ZERO, DVec3::new(2.0, 3.0, 4.0));
    assert_interval(clip(DVec3::new(-5.0, 1.0, 1.0), DVec3::X), 5.0, 7.0);
    assert_interval(clip(DVec3::new(1.0, 9.0, 1.0), DVec3::NEG_Y), 6.0, 9.0);
    assert_interval(clip(DVec3::new(1.0, 1.0, 1.0), DVec3::Z), 0.0, 3.0);
    assert_interval(clip(DVec3::new(-1.0, -1.0, -1.0), DVec3::ONE), 1.0, 3.0);
    assert!(clip(DVec3::new(-5.0, 3.1, 1.0), DVec3::X).is_empty());
    assert!(clip(DVec3::new(5.0, 1.0, 1.0), DVec3::X).is_empty(), "behind the eye");
    assert!(clip(DVec3::new(-1.0, 4.0, 1.0), DVec3::new(1.0, 0.5, 0.0)).is_empty());
}

#[test]
fn a_ray_along_a_face_is_inside_and_one_beside_it_is_outside() {
    let clip = |y| Interval::IN_FRONT.clip_to_box(DVec3::new(-1.0, y, 0.5), DVec3::X, DVec3::ZERO, DVec3::ONE);
    assert_interval(clip(0.0), 1.0, 2.0);
    assert_interval(clip(1.0), 1.0, 2.0);
    assert!(clip(-1e-9).is_empty() && clip(1.0 + 1e-9).is_empty());
}

#[test]
fn a_plane_keeps_the_side_where_it_is_positive() {
    let origin = DVec3::new(0.0, 0.0, -10.0);
    let whole = Interval { enter: 2.0, exit: 20.0 };
    assert_interval(whole.clip_to_plane(origin, DVec3::Z, DVec3::Z, -1.0), 11.0, 20.0);
    assert_interval(whole.clip_to_plane(origin, DVec3::Z, DVec3::NEG_Z, 1.0), 2.0, 11.0);
    assert_interval(whole.clip_to_plane(origin, DVec3::Z, DVec3::X, 0.0), 2.0, 20.0);
    assert!(whole.clip_to_plane(origin, DVec3::Z, DVec3::X, -1.0).is_empty());
    assert!(whole.clip_to_plane(origin, DVec3::Z, DVec3::NEG_Z, -9.0).is_empty());
}

#[test]
fn the_visible_interval_is_in_world_units_and_within_volume_box_clip_box_and_planes() {
    // 10 x 10 x 10 voxels of 1 x 2 x 3, from (-0.5, -1, -1.5).
    let grid = Grid::axis_aligned([10; 3], DVec3::new(1.0, 2.0, 3.0));
    let ray = Ray { origin: DVec3::new(3.0, 3.0, -11.5), direction: DVec3::Z };
    assert_interval(visible_interval(&ray, &grid, &rendering()), 10.0, 40.0);
    let clip_box = Some(ClipBox { min: DVec3::new(0.0, 0.0, -0.5), max: DVec3::new(5.0, 5.0, 20.5) });
    let clipped = Rendering { clip_box, ..rendering() };
    assert_interval(visible_interval(&ray, &grid, &clipped), 11.0, 32.0);
    let plane = ClipPlane { normal: DVec3::NEG_Z, d: 8.5 };
    let cut = Rendering { clip_planes: vec![plane], ..clipped };
    assert_interval(visible_interval(&ray, &grid, &cut), 11.0, 20.0);
    let aside = Ray { origin: DVec3::new(6.0, 3.0, -11.5), ..ray };
    assert!(visible_interval(&aside, &grid, &cut).is_empty());
}

#[test]
fn an_oblique_grid_is_entered_through_its_own_faces() {
    let mut grid = Grid::axis_aligned([4, 4, 4], DVec3::ONE);
    grid.direction = [DVec3::new(1.0, 1.0, 0.0).normalize(), DVec3::new(-1.0, 1.0, 0.0).normalize(), DVec3::Z];
    let middle = grid.center();
    let ray = Ray { origin: middle - DVec3::X * 50.0, direction: DVec3::X };
    // Through the middle of a square turned by 45 degrees: its diagonal.
    let half = 2.0 * 2.0_f64.sqrt();
    assert_interval(visible_interval(&ray, &grid, &rendering()), 50.0 - half, 50.0 + half);
}

#[test]
fn rays_go_through_pixel_centres_with_y_from_the_top() {
    let camera = |projection| Camera { eye: DVec3::new(0.0, 0.0, 10.0), target: DVec3::ZERO, up: DVec3::Y, projection };
    let (width, height) = (4, 2);
    let flat = camera(Projection::Orthographic { height: 2.0 }).ray_basis(width, height);
    let first = pixel_ray(&flat, 0, 0, width, height);
    assert!((first.origin - DVec3::new(-1.5, 0.5, 10.0)).length() < 1e-12, "{first:?}");
    assert_eq!(first.direction, DVec3::NEG_Z);
    let last = pixel_ray(&flat, 3, 1, width, height);
    assert!((last.origin - DVec3::new(1.5, -0.5, 10.0)).length() < 1e-12, "{last:?}");
    let deep = camera(Projection::Perspective { fov_y_deg: 90.0 }).ray_basis(width, height);
    let first = pixel_ray(&deep, 0, 0, width, height);
    assert_eq!(first.origin, DVec3::new(0.0, 0.0, 10.0));
    assert!((first.direction - DVec3::new(-1.5, 0.5, -1.0).normalize()).length() < 1e-12, "{first:?}");
}

fn places(enter: f64, exit: f64, step: f64) -> Vec<f64> {
    sample_places(Interval { enter, exit }, step).collect()
}

#[test]
fn samples_lie_at_multiples_of_the_step_from_the_eye_and_at_both_ends() {
    assert_eq!(places(0.25, 1.75, 0.5), [0.25, 0.5, 1.0, 1.5, 1.75]);
    assert_eq!(places(0.0, 1.2, 0.5), [0.0, 0.5, 1.0, 1.2]);
    assert_eq!(places(10.0, 11.0, 0.5), [10.0, 10.5, 11.0]);
    assert_eq!(places(10.1, 10.2, 0.5), [10.1, 10.2]);
    // Moving the entry takes samples away and moves no other.
    assert_eq!(places(0.9, 1.75, 0.5)[1..], places(0.25, 1.75, 0.5)[2..]);
}

#[test]
fn an_eye_so_far_away_that_steps_vanish_in_rounding_still_gets_a_finite_number_of_samples() {
    let places = places(1e17, 1e17 + 64.0, 1.0);
    assert!(places.len() <= 65 && places.is_sorted(), "{places:?}");
    assert_eq!((places[0], places[places.len() - 1]), (1e17, 1e17 + 64.0));
}
