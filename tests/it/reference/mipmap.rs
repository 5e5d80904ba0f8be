//! Mip levels and the hybrid structure against their definitions.

use glam::DVec3;
use spao_server::reference::{HybridMeans, MipPyramid, OpacityField};

use super::support::{Random, assert_close, brute_force_box_mean, random_opacity};

#[test]
fn every_mip_cell_is_the_mean_of_the_padded_cells_below_it() {
    let opacity = random_opacity([9, 6, 1], 31);
    let pyramid = MipPyramid::new(&opacity, 5);
    let sizes: Vec<_> = pyramid.levels.iter().map(|level| level.dims).collect();
    assert_eq!(sizes, [[9, 6, 1], [5, 3, 1], [3, 2, 1], [2, 1, 1], [1, 1, 1], [1, 1, 1]]);
    for (l, level) in pyramid.levels.iter().enumerate() {
        let width = f64::from(1 << l);
        for (i, &alpha) in level.alpha.iter().enumerate() {
            let [nx, ny, _] = level.dims.map(|n| n as usize);
            let cell = DVec3::new((i % nx) as f64, (i / nx % ny) as f64, (i / nx / ny) as f64);
            assert_close(alpha, brute_force_box_mean(&opacity, (cell + 0.5) * width, width), 1e-12);
        }
    }
}

#[test]
fn padding_with_the_edge_would_be_noticed() {
    let opacity = OpacityField::from_fn([3, 1, 1], |_| 1.0);
    let pyramid = MipPyramid::new(&opacity, 1);
    assert_eq!(pyramid.levels[1].alpha, [0.25, 0.125]);
}

#[test]
fn a_mip_look_up_interpolates_between_cell_centres_and_fades_to_zero_outside() {
    let opacity = random_opacity([8, 8, 8], 32);
    let pyramid = MipPyramid::new(&opacity, 3);
    for l in 0..=2 {
        let width = f64::from(1 << l);
        let centre = DVec3::new(1.5, 0.5, 1.5) * width;
        assert_close(pyramid.look_up(centre, l), pyramid.levels[l as usize].at([1, 0, 1]), 1e-15);
        let between = centre + DVec3::new(0.0, 0.25 * width, 0.0);
        let expected =
            0.75 * pyramid.levels[l as usize].at([1, 0, 1]) + 0.25 * pyramid.levels[l as usize].at([1, 1, 1]);
        assert_close(pyramid.look_up(between, l), expected, 1e-15);
    }
    let whole = pyramid.levels[3].alpha[0];
    assert_close(pyramid.look_up(DVec3::new(0.0, 4.0, 4.0), 3), whole / 2.0, 1e-15);
    assert_eq!(pyramid.look_up(DVec3::new(-4.0, 4.0, 4.0), 3), 0.0);
}

#[test]
fn hybrid_means_are_mip_look_ups_first_and_box_means_on_the_last_mip_level_after() {
    let opacity = random_opacity([13, 9, 10], 33);
    let mip_levels = 2;
    let pyramid = MipPyramid::new(&opacity, mip_levels);
    let hybrid = HybridMeans::new(&opacity, mip_levels);
    let mut random = Random::new(34);
    for _ in 0..100 {
        let p = random.position(opacity.dims, 3.0);
        for level in 0..=mip_levels {
            assert_eq!(hybrid.look_up(p, level), pyramid.look_up(p, level));
        }
        for level in 3..=5 {
            let width = f64::from(1 << (level - mip_levels));
            let expected = brute_force_box_mean(&pyramid.levels[2], p / 4.0, width);
            assert_close(hybrid.look_up(p, level), expected, 1e-12);
        }
    }
}

#[test]
fn hybrid_without_mip_levels_is_exact_and_with_them_is_not() {
    let opacity = random_opacity([13, 9, 10], 33);
    let p = DVec3::new(5.3, 4.1, 6.6);
    let exact = brute_force_box_mean(&opacity, p, 8.0);
    assert_close(HybridMeans::new(&opacity, 0).look_up(p, 3), exact, 1e-12);
    assert!((HybridMeans::new(&opacity, 2).look_up(p, 3) - exact).abs() > 1e-4);
}
