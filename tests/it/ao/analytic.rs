//! Cases whose answer is known without any reference.

use std::f64::consts::PI;
use std::sync::Arc;

use glam::DVec3;
use spao_server::scene::{AmbientOcclusion, Radius};
use spao_server::volume::Volume;

use super::support::{Subject, boxes, hybrid, mipmap, n_buffer, opacities, raytraced, volume_of};

/// Half a step of the sixteen bits of a result.
const ROUNDING: f64 = 0.5 / 65535.0;

fn accessibility_at(subject: &Subject, result: &[f32], [x, y, z]: [u32; 3]) -> f64 {
    let [nx, ny, _] = subject.volume.grid.dims;
    f64::from(result[((z * ny + y) * nx + x) as usize])
}

#[track_caller]
fn assert_close(actual: f64, expected: f64, tolerance: f64) {
    assert!((actual - expected).abs() <= tolerance, "{actual} is not {expected} within {tolerance}");
}

/// Opaque voxels among transparent ones.
fn opaque_where(dims: [u32; 3], opaque: impl Fn([u32; 3]) -> bool) -> Arc<Volume> {
    volume_of(dims, DVec3::ONE, |voxel| if opaque(voxel) { 1000 } else { 0 })
}

#[test]
fn where_nothing_is_visible_everything_is_open() {
    let subject = Subject::new(boxes());
    let transparent = opacities(&[(0.0, 0.0), (255.0, 0.0)]);
    for settings in [n_buffer(6, 1.0), mipmap(6, 0.0), hybrid(6, 2, 2.0), raytraced(6, 0.0, 16), raytraced(6, 1.0, 16)]
    {
        assert!(subject.accessibility(&transparent, settings).iter().all(|&a| a == 1.0), "{settings:?}");
    }
    let visible = opacities(&[(0.0, 0.0), (255.0, 0.01)]);
    assert!(subject.accessibility(&visible, n_buffer(6, 1.0)).iter().any(|&a| a != 1.0));
}

#[test]
fn the_centre_of_a_closed_opaque_shell_is_not_accessible() {
    let shell = |open: bool| {
        opaque_where([17, 17, 17], move |v| {
            let far = v.iter().map(|&c| c.abs_diff(8)).max().unwrap_or(0);
            let in_hole = open && v[0] > 8 && (7..10).contains(&v[1]) && (7..10).contains(&v[2]);
            (3..6).contains(&far) && !in_hole
        })
    };
    let transfer = opacities(&[(0.0, 0.0), (1000.0, 1.0)]);
    for settings in [raytraced(4, 0.0, 256), n_buffer(4, 0.0), mipmap(4, 0.0)] {
        let centre = |open| {
            let subject = Subject::new(shell(open));
            accessibility_at(&subject, &subject.accessibility(&transfer, settings), [8, 8, 8])
        };
        assert!(centre(true) > centre(false) + 0.002, "{settings:?}");
    }
    let subject = Subject::new(shell(false));
    assert_eq!(accessibility_at(&subject, &subject.accessibility(&transfer, raytraced(4, 0.0, 256)), [8, 8, 8]), 0.0);
}

#[test]
fn over_an_opaque_half_space_half_of_all_directions_is_open() {
    let radius = 11.0;
    let subject = Subject::new(opaque_where([26, 26, 26], |[.., z]| z < 13));
    let transfer = opacities(&[(0.0, 0.0), (1000.0, 1.0)]);
    let traced = |factor, rays| AmbientOcclusion { radius: Radius::Voxels(radius), ..raytraced(4, factor, rays) };
    // The lowest centre that interpolation leaves empty. Of the rays downwards only those end early that sink less
    // than a voxel within the radius.
    let sphere = accessibility_at(&subject, &subject.accessibility(&transfer, traced(0.0, 400)), [13, 13, 13]);
    assert!((0.5..0.5 + 0.5 / radius).contains(&sphere), "{sphere}");
    // Values grow towards the opaque half: n points away from it.
    let hemisphere = accessibility_at(&subject, &subject.accessibility(&transfer, traced(1.0, 100)), [13, 13, 13]);
    assert_eq!(hemisphere, 1.0);
    // Each cube at the lowest empty centre is half full less the share of its half voxel of height: METHODS 2.
    let spao = accessibility_at(&subject, &subject.accessibility(&transfer, n_buffer(4, 0.0)), [13, 13, 13]);
    let expected: f64 = (1..=4).map(|l| 0.5 + 6.0 / 7.0 * 0.5 / f64::from(1 << l)).product();
    assert_close(spao, expected, 8.0 * ROUNDING);
}

/// (1/4π) ∫ (1 - α)^length over the directions from a cube's centre to its faces, by summing over one face.
fn fog_in_a_cube(alpha: f64, half_width: f64) -> f64 {
    let n = 200;
    let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let sum: f64 = pairs
        .map(|(i, j)| (1.0 + at(i).powi(2) + at(j).powi(2)).sqrt())
        .map(|slant| (1.0 - alpha).powf((half_width - 0.5) * slant) * slant.powi(-3))
        .sum();
    6.0 * sum * 4.0 / f64::from(n * n) / (4.0 * PI)
}

#[test]
fn inside_homogeneous_fog_accessibility_is_a_power_or_an_integral() {
    // One value, so one code.
    let subject = Subject::new(volume_of([23, 21, 22], DVec3::ONE, |_| 7));
    let alpha = 0.1;
    let transfer = opacities(&[(7.0, alpha)]);
    let middle = |settings| accessibility_at(&subject, &subject.accessibility(&transfer, settings), [11, 10, 11]);
    for (levels, settings) in
        [(3, n_buffer(3, 0.0)), (4, n_buffer(4, 1.0)), (2, mipmap(2, 1.0)), (3, hybrid(3, 1, 1.0))]
    {
        assert_close(middle(settings), (1.0 - alpha).powi(levels), 8.0 * ROUNDING);
    }
    // The integral's length is exact, a ray's is a multiple of half a voxel.
    assert_close(middle(raytraced(4, 0.0, 400)), fog_in_a_cube(alpha, 8.0), 0.003);
    assert!((middle(raytraced(4, 0.0, 400)) - fog_in_a_cube(alpha, 9.0)).abs() > 0.02);
}

#[test]
fn a_single_opaque_voxel_darkens_one_shell_of_its_neighbour_and_not_itself() {
    let subject = Subject::new(opaque_where([21, 19, 20], |v| v == [10, 9, 10]));
    let transfer = opacities(&[(0.0, 0.0), (1000.0, 1.0)]);
    let result = subject.accessibility(&transfer, n_buffer(4, 0.0));
    let at = |voxel| accessibility_at(&subject, &result, voxel);
    // Its own level 0 is full and every larger cube holds just that.
    assert_close(at([10, 9, 10]), 1.0, 12.0 * ROUNDING);
    // Three voxels away it lies between the cubes of half-width 2 and 4: one of 8³ - 4³ voxels.
    for voxel in [[13, 9, 10], [7, 9, 10], [10, 12, 10], [10, 6, 10], [10, 9, 13], [10, 9, 7]] {
        assert_close(at(voxel), 1.0 - 1.0 / 448.0, 12.0 * ROUNDING);
    }
    assert_eq!(at([10, 18, 10]), 1.0);
}
