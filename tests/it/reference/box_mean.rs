//! Box means against brute force, and the claim about centred N-buffers (METHODS 1).

use glam::DVec3;
use spao_server::reference::{BoxMean, OpacityField};

use super::support::{Random, assert_close, brute_force_box_mean, random_opacity};

#[test]
fn box_means_agree_with_brute_force_at_any_place_and_width() {
    let opacity = random_opacity([9, 6, 7], 11);
    let means = BoxMean::new(&opacity);
    let mut random = Random::new(12);
    let mut largest_effect_of_a_shift: f64 = 0.0;
    for _ in 0..300 {
        let centre = random.position(opacity.dims, 4.0);
        let width = 0.3 + 11.0 * random.unit();
        let expected = brute_force_box_mean(&opacity, centre, width);
        assert_close(means.mean(centre, width), expected, 1e-11);
        let shifted = means.mean(centre + DVec3::new(0.1, 0.0, 0.0), width);
        largest_effect_of_a_shift = largest_effect_of_a_shift.max((shifted - expected).abs());
    }
    assert!(largest_effect_of_a_shift > 1e-3, "the comparison would not notice a shift");
}

#[test]
fn boxes_over_whole_cells_inside_cells_and_outside_are_exact() {
    let opacity = OpacityField::from_fn([4, 4, 4], |[i, ..]| if i == 1 { 1.0 } else { 0.0 });
    let means = BoxMean::new(&opacity);
    assert_eq!(means.mean(DVec3::new(1.5, 1.5, 1.5), 1.0), 1.0);
    assert_eq!(means.mean(DVec3::new(2.0, 2.0, 2.0), 2.0), 0.5);
    assert_eq!(means.mean(DVec3::new(1.25, 2.5, 2.5), 0.5), 1.0);
    assert_eq!(means.mean(DVec3::new(2.0, 2.0, 2.0), 8.0), 16.0 / 512.0);
    assert_eq!(means.mean(DVec3::new(-9.0, 2.0, 2.0), 8.0), 0.0);
}

/// N-buffer level `level` at any integer position, from the definition: level by level with 8 look-ups.
fn n_buffer(opacity: &OpacityField, level: u32, [x, y, z]: [i64; 3]) -> f64 {
    if level == 0 {
        return opacity.at([x, y, z]);
    }
    let half = 1 << (level - 1);
    let child = |c: i64| [x + half * (c & 1), y + half * (c >> 1 & 1), z + half * (c >> 2)];
    (0..8).map(|c| n_buffer(opacity, level - 1, child(c))).sum::<f64>() / 8.0
}

/// Trilinear interpolation of a level whose entry i belongs to the place i + `centre` (on each axis).
fn interpolated_n_buffer(opacity: &OpacityField, level: u32, centre: f64, position: DVec3) -> f64 {
    let from_entry = position - centre;
    let (base, t) = (from_entry.floor(), from_entry - from_entry.floor());
    (0..8)
        .map(|c| {
            let upper = DVec3::new(f64::from(c & 1), f64::from(c >> 1 & 1), f64::from(c >> 2));
            let weight = upper * t + (DVec3::ONE - upper) * (DVec3::ONE - t);
            let entry = (base + upper).to_array().map(|b| b as i64);
            weight.x * weight.y * weight.z * n_buffer(opacity, level, entry)
        })
        .sum()
}

#[test]
fn interpolated_n_buffers_are_box_means_when_entries_belong_to_the_middle_of_their_windows() {
    let opacity = random_opacity([7, 6, 5], 21);
    let means = BoxMean::new(&opacity);
    let mut random = Random::new(22);
    for level in 0..=3 {
        let width = f64::from(1 << level);
        for _ in 0..40 {
            let position = random.position(opacity.dims, 2.0);
            let interpolated = interpolated_n_buffer(&opacity, level, width / 2.0, position);
            assert_close(interpolated, means.mean(position, width), 1e-12);
        }
    }
}

#[test]
fn n_buffers_read_without_centring_are_not_box_means() {
    let opacity = random_opacity([7, 6, 5], 21);
    let means = BoxMean::new(&opacity);
    let mut random = Random::new(22);
    for level in 1..=3 {
        let width = f64::from(1 << level);
        let worst = (0..40)
            .map(|_| {
                let position = random.position(opacity.dims, 0.0);
                let uncentred = interpolated_n_buffer(&opacity, level, 0.5, position);
                (uncentred - means.mean(position, width)).abs()
            })
            .fold(0.0, f64::max);
        assert!(worst > 0.03, "level {level}: un-centred windows differ by only {worst}");
    }
}
