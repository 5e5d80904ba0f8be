//! Classification, interpolation and gradients.

use glam::DVec3;
use spao_server::reference::{OpacityField, ValueField, central_difference, offset_normal, voxel_gradients};
use spao_server::scene::{ControlPoint, Rgb, TransferFunction};
use spao_server::volume::CodeMap;

use super::support::{Random, assert_close, random_opacity, values_like};

const WHITE: Rgb = Rgb([1.0; 3]);

fn ramp(opacity_unit_distance: Option<f64>) -> TransferFunction {
    let point = |value, opacity| ControlPoint { value, color: WHITE, opacity };
    TransferFunction { points: vec![point(0.0, 0.0), point(100.0, 1.0)], opacity_unit_distance }
}

#[test]
fn opacity_is_that_of_one_smallest_spacing() {
    let h = 0.5;
    let values = [0.0, 25.0, 50.0, 100.0];
    let default_unit = OpacityField::from_values([4, 1, 1], &values, &ramp(None), h);
    assert_eq!(default_unit.alpha, [0.0, 0.25, 0.5, 1.0]);
    let per_millimetre = OpacityField::from_values([4, 1, 1], &values, &ramp(Some(1.0)), h);
    assert_close(per_millimetre.alpha[1], 1.0 - 0.75_f64.sqrt(), 1e-15);
    assert_eq!(per_millimetre.alpha[3], 1.0);
}

#[test]
fn codes_and_the_values_they_stand_for_give_the_same_fields() {
    let code_map = CodeMap::for_integers(-20.0, 80.0);
    let codes = [0, 30, 70, 100];
    let values = codes.map(|c| f64::from(c) - 20.0);
    let dims = [2, 2, 1];
    let from_codes = ValueField::from_codes(dims, &codes, &code_map);
    assert_eq!(from_codes, ValueField::from_values(dims, &values, &code_map));
    assert_eq!(from_codes.normalised, [0.0, 0.3, 0.7, 1.0]);
    let opacity = OpacityField::from_codes(dims, &codes, &code_map, &ramp(None), 1.0);
    assert_eq!(opacity, OpacityField::from_values(dims, &values, &ramp(None), 1.0));
    assert_ne!(opacity, OpacityField::from_values(dims, &values, &ramp(Some(2.0)), 1.0));
}

#[test]
fn a_constant_volume_has_normalised_value_zero() {
    let field = ValueField::from_codes([2, 1, 1], &[0, 0], &CodeMap::for_integers(7.0, 7.0));
    assert_eq!(field.normalised, [0.0, 0.0]);
}

#[test]
fn x_is_fastest_in_memory() {
    let field = ValueField::from_fn([3, 4, 5], |[i, j, k]| f64::from(i + 10 * j + 100 * k));
    assert_eq!(field.normalised[..4], [0.0, 1.0, 2.0, 10.0]);
    assert_eq!(field.at([2, 3, 4]), 432.0);
    assert_eq!(field.trilinear(DVec3::new(2.5, 3.5, 4.5)), 432.0);
}

#[test]
fn outside_the_volume_opacity_is_zero_and_values_are_the_borders() {
    let opacity = OpacityField::from_fn([2, 2, 2], |_| 1.0);
    assert_eq!(opacity.at([-1, 0, 0]), 0.0);
    assert_eq!(opacity.at([0, 2, 0]), 0.0);
    assert_eq!(opacity.trilinear(DVec3::new(0.0, 1.0, 1.0)), 0.5);
    assert_eq!(opacity.trilinear(DVec3::new(-0.25, 1.0, 1.0)), 0.25);
    assert_eq!(opacity.trilinear(DVec3::new(-0.5, 1.0, 1.0)), 0.0);
    assert_eq!(opacity.trilinear(DVec3::new(1.0, 1.0, 1e300)), 0.0);
    let values = ValueField::from_fn([2, 2, 2], |[i, ..]| f64::from(i));
    assert_eq!(values.trilinear(DVec3::new(-1e300, 1.0, 1.0)), 0.0);
    assert_eq!(values.trilinear(DVec3::new(5.0, -3.0, 1.0)), 1.0);
    assert_eq!(values.trilinear(DVec3::new(1.25, -3.0, 1.0)), 0.75);
}

#[test]
fn interpolation_reproduces_a_trilinear_function() {
    let f = |p: DVec3| 0.1 + 0.2 * p.x - 0.03 * p.y + 0.05 * p.z + 0.01 * p.x * p.y * p.z;
    let dims = [5, 6, 7];
    let field = ValueField::from_fn(dims, |v| f(DVec3::from_array(v.map(f64::from)) + 0.5));
    let mut random = Random::new(3);
    for _ in 0..200 {
        let p = random.position(dims, -0.5);
        assert_close(field.trilinear(p), f(p), 1e-12);
        assert!((field.trilinear(p) - f(p + DVec3::splat(0.01))).abs() > 1e-4);
    }
}

#[test]
fn the_gradient_of_a_linear_field_is_its_slope_inside_and_half_across_the_border() {
    let slope = DVec3::new(0.02, -0.05, 0.03);
    let dims = [6, 7, 8];
    let field = ValueField::from_fn(dims, |v| 0.5 + slope.dot(DVec3::from_array(v.map(f64::from))));
    let inside = DVec3::new(2.8, 3.1, 4.4);
    assert!((central_difference(&field, inside) - slope).length() < 1e-12);
    assert!((offset_normal(&field, inside) + slope).length() < 1e-12);
    let on_border = central_difference(&field, DVec3::new(0.5, 3.5, 3.5));
    assert_close(on_border.x, slope.x / 2.0, 1e-12);
    assert_close(on_border.y, slope.y, 1e-12);
}

#[test]
fn the_offset_normal_is_never_longer_than_one_and_keeps_a_weak_gradient_weak() {
    let checkerboard = ValueField::from_fn([4, 4, 4], |[i, j, k]| f64::from((i / 2 + j / 2 + k / 2) % 2) * 4.0);
    let strong = offset_normal(&checkerboard, DVec3::splat(1.5));
    assert_close(strong.length(), 1.0, 1e-12);
    let step = ValueField::from_fn([4, 4, 4], |[i, ..]| if i < 2 { 1.0 } else { 0.0 });
    assert_eq!(offset_normal(&step, DVec3::new(1.5, 2.0, 2.0)), DVec3::new(0.5, 0.0, 0.0));
}

#[test]
fn gradients_stored_per_voxel_are_the_central_differences_at_voxel_centres() {
    let field = values_like(&random_opacity([4, 5, 3], 5));
    let stored = voxel_gradients(&field);
    for (i, gradient) in stored.iter().enumerate() {
        let centre = DVec3::new((i % 4) as f64, (i / 4 % 5) as f64, (i / 20) as f64) + 0.5;
        assert!((*gradient - central_difference(&field, centre)).length() < 1e-12);
    }
    assert!((stored[7] - central_difference(&field, DVec3::new(2.5, 1.5, 0.5))).length() > 1e-3);
}
