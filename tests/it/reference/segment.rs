//! Pre-integration of segments against closed forms and brute force.

use spao_server::reference::OpticalDepth;
use spao_server::scene::{ControlPoint, Rgb, TransferFunction};

use super::support::assert_close;

fn transfer(points: &[(f64, f64)]) -> TransferFunction {
    let point = |&(value, opacity): &(f64, f64)| ControlPoint { value, color: Rgb([1.0; 3]), opacity };
    TransferFunction { points: points.iter().map(point).collect(), opacity_unit_distance: None }
}

/// A ramp, a plateau, a step down and a tent that touches 1.
fn varied() -> TransferFunction {
    transfer(&[(10.0, 0.0), (20.0, 0.6), (30.0, 0.6), (30.0, 0.1), (40.0, 1.0), (50.0, 0.0)])
}

/// Mean of τ by half a million samples.
fn brute_force_mean(transfer: &TransferFunction, unit_distances: f64, a: f64, b: f64) -> f64 {
    let count = 500_000;
    let tau = |i: u32| {
        let value = a + (b - a) * (f64::from(i) + 0.5) / f64::from(count);
        (-unit_distances * (1.0 - transfer.sample(value).1).ln()).min(20.0)
    };
    (0..count).map(tau).sum::<f64>() / f64::from(count)
}

#[test]
fn a_plateau_has_the_optical_depth_of_its_opacity() {
    let plateau = transfer(&[(0.0, 0.36)]);
    for (unit, step, expected) in [(None, 1.0, 0.64), (None, 0.5, 0.8), (Some(2.0), 1.0, 0.8), (Some(0.5), 1.0, 0.4096)]
    {
        let transfer = TransferFunction { opacity_unit_distance: unit, ..plateau.clone() };
        let depth = OpticalDepth::new(&transfer, step, 1.0);
        for tau in [depth.at(3.0), depth.mean(3.0, 3.0), depth.mean(-5.0, 9.0), depth.mean(9.0, -5.0)] {
            assert_close((-tau).exp(), expected, 1e-12);
        }
    }
    assert_eq!(OpticalDepth::new(&transfer(&[(0.0, 1.0)]), 0.3, 1.0).mean(0.0, 1.0), 20.0);
    assert_eq!(OpticalDepth::new(&transfer(&[(0.0, 0.0)]), 0.3, 1.0).mean(0.0, 1.0), 0.0);
}

#[test]
fn the_mean_over_values_is_the_limit_of_a_fine_sum() {
    let transfer = varied();
    for step in [0.25, 1.0, 8.0] {
        let depth = OpticalDepth::new(&transfer, step, 1.0);
        for (a, b) in [(0.0, 60.0), (12.0, 17.0), (25.0, 33.0), (39.0, 41.0), (44.0, 11.0), (28.0, 26.0), (55.0, 70.0)]
        {
            let expected = brute_force_mean(&transfer, step, a, b);
            assert_close(depth.mean(a, b), expected, 1e-4 * expected);
            assert_close(depth.mean(a, b), depth.mean(b, a), 1e-12);
        }
    }
}

#[test]
fn the_fine_sum_notices_a_wrong_step_a_wrong_point_and_a_missing_cap() {
    let transfer = varied();
    let mean = OpticalDepth::new(&transfer, 1.0, 1.0).mean(0.0, 60.0);
    let off = |transfer: &TransferFunction, unit_distances: f64| {
        (brute_force_mean(transfer, unit_distances, 0.0, 60.0) / mean - 1.0).abs()
    };
    assert!(off(&transfer, 1.0) < 1e-4);
    assert!(off(&transfer, 1.01) > 5e-3);
    let mut moved = transfer.clone();
    moved.points[1].opacity = 0.59;
    assert!(off(&moved, 1.0) > 1e-3);
    // The tent's tip is opaque: how deep is limited, and that shows in long steps.
    let steep = OpticalDepth::new(&transfer, 8.0, 1.0).mean(38.0, 42.0);
    let uncapped = |i: u32| -8.0 * (1.0 - transfer.sample(38.0 + 4.0 * (f64::from(i) + 0.5) / 1e5).1).ln();
    let uncapped = (0..100_000).map(uncapped).sum::<f64>() / 1e5;
    assert!(uncapped > 1.05 * steep, "{uncapped} {steep}");
}

#[test]
fn a_value_on_a_step_has_the_upper_points_depth_and_segments_have_both() {
    let step = transfer(&[(5.0, 0.0), (5.0, 0.5)]);
    let depth = OpticalDepth::new(&step, 1.0, 1.0);
    let full = 2.0_f64.ln();
    assert_close(depth.mean(5.0, 5.0), full, 1e-12);
    assert_close(depth.mean(4.0, 5.0), 0.0, 1e-12);
    assert_close(depth.mean(5.0, 6.0), full, 1e-12);
    assert_close(depth.mean(2.0, 6.0), full / 4.0, 1e-12);
}

#[test]
fn half_of_what_a_segment_shows_lies_in_front_of_its_place() {
    let transfer = varied();
    for (step, length) in [(1.0, 1.0), (1.0, 0.3), (0.25, 1.0), (4.0, 0.9)] {
        let depth = OpticalDepth::new(&transfer, step, 1.0);
        for (a, b) in [(0.0, 60.0), (60.0, 0.0), (12.0, 17.0), (33.0, 25.0), (41.0, 39.0), (25.0, 25.0)] {
            let share = depth.half_way(a, b, length);
            let shown =
                |share: f64| 1.0 - (-length * share * brute_force_mean(&transfer, step, a, a + (b - a) * share)).exp();
            assert_close(shown(share), 0.5 * shown(1.0), 2e-4);
        }
    }
}

#[test]
fn the_place_is_the_middle_of_a_faint_segment_the_front_of_an_opaque_one_and_beyond_what_is_empty() {
    let place = |points: &[(f64, f64)], a, b| {
        let transfer = transfer(points);
        OpticalDepth::new(&transfer, 1.0, 1.0).half_way(a, b, 1.0)
    };
    assert_close(place(&[(0.0, 1e-9)], 0.0, 1.0), 0.5, 1e-6);
    assert_close(place(&[(0.0, 1.0)], 0.0, 1.0), 2.0_f64.ln() / 20.0, 1e-8);
    let opaque_from_7 = [(7.0, 0.0), (7.0, 1.0)];
    assert_close(place(&opaque_from_7, 0.0, 10.0), 0.7 + 2.0_f64.ln() / 20.0, 0.002);
    assert_close(place(&opaque_from_7, 10.0, 0.0), 2.0_f64.ln() / 20.0, 0.002);
}
