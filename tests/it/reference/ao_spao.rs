//! SPAO against closed forms and against its formula written out with brute-force box means.

use glam::DVec3;
use spao_server::reference::{OpacityField, SpaoAo, ValueField, offset_normal};
use spao_server::scene::{AmbientOcclusion, AoStructure};

use super::support::{
    Random, ao_settings, assert_close, brute_force_box_mean, largest_difference, random_opacity, values_like,
};

const STRUCTURES: [AoStructure; 3] = [AoStructure::NBuffer, AoStructure::Mipmap, AoStructure::Hybrid];

fn with_structure(structure: AoStructure) -> AmbientOcclusion {
    AmbientOcclusion { structure, mip_levels: 2, ..ao_settings() }
}

fn flat(dims: [u32; 3]) -> ValueField {
    ValueField::from_fn(dims, |_| 0.0)
}

#[test]
fn an_empty_volume_is_fully_open() {
    let empty = OpacityField::from_fn([6, 5, 4], |_| 0.0);
    let values = flat(empty.dims);
    for structure in STRUCTURES {
        let spao = SpaoAo::new(&empty, &values, &with_structure(structure));
        assert!(spao.at_voxel_centres().iter().all(|&a| a == 1.0));
    }
}

#[test]
fn inside_homogeneous_fog_every_shell_lets_one_minus_alpha_through() {
    let alpha = 0.07;
    let fog = OpacityField::from_fn([40, 40, 40], |_| alpha);
    let values = flat(fog.dims);
    for structure in STRUCTURES {
        // Half the widest cube is 8 voxels; a mip look-up reaches a whole cell of 16 more.
        let spao = SpaoAo::new(&fog, &values, &with_structure(structure));
        let expected = (1.0_f64 - alpha).powi(4);
        assert_close(spao.accessibility(DVec3::new(20.3, 21.0, 19.8)), expected, 1e-12);
        assert!((spao.accessibility(DVec3::new(1.0, 21.0, 19.8)) - expected).abs() > 1e-3);
    }
}

/// Opaque where z < 32 in a volume wide enough that no cube meets the sides.
fn half_space() -> OpacityField {
    OpacityField::from_fn([64, 64, 64], |[.., k]| if k < 32 { 1.0 } else { 0.0 })
}

#[test]
fn over_an_opaque_half_space_every_shell_is_half_full_less_the_height_above_it() {
    let opacity = half_space();
    let values = flat(opacity.dims);
    let spao = SpaoAo::new(&opacity, &values, &ao_settings());
    for height in [0.0, 0.2, 0.5] {
        // M_w = 1/2 - height/w, so (8 M_{2^l} - M_{2^(l-1)}) / 7 = 1/2 - (6/7) height / 2^l.
        let expected: f64 = (1..=4).map(|l| 0.5 + 6.0 / 7.0 * height / f64::from(1 << l)).product();
        let actual = spao.accessibility(DVec3::new(32.0, 32.0, 32.0 + height));
        assert_close(actual, expected, 1e-12);
    }
    // What the product of shells makes of obscurance 1/2: the papers' darkening.
    assert_close(spao.accessibility(DVec3::splat(32.0)), 1.0 / 16.0, 1e-12);
}

#[test]
fn the_normal_moves_cubes_out_of_an_opaque_half_space() {
    let opacity = half_space();
    // v̂ falls by 0.8 over the two voxels about the surface: n = 0.4 along z.
    let values = ValueField::from_fn(opacity.dims, |[.., k]| if k < 32 { 0.8 } else { 0.0 });
    let at_surface = DVec3::splat(32.0);
    assert!((offset_normal(&values, at_surface) - DVec3::new(0.0, 0.0, 0.4)).length() < 1e-12);
    for factor in [0.0, 0.5, 1.0, 2.0] {
        let spao = SpaoAo::new(&opacity, &values, &AmbientOcclusion { normal_factor: factor, ..ao_settings() });
        // Each cube holds (1 - 0.4 f) / 2 of opacity: offset by 0.4 f of half its width.
        let expected = (1.0 - (1.0 - 0.4 * factor) / 2.0).powi(4);
        assert_close(spao.accessibility(at_surface), expected, 1e-12);
    }
    let full = ValueField::from_fn(opacity.dims, |[.., k]| if k < 32 { 1.0 } else { 0.0 });
    let spao = SpaoAo::new(&opacity, &full, &AmbientOcclusion { normal_factor: 2.0, ..ao_settings() });
    assert_eq!(spao.accessibility(at_surface), 1.0);
}

#[test]
fn the_centre_of_a_closed_opaque_shell_is_not_accessible() {
    let shell = |open: bool| {
        OpacityField::from_fn([16, 16, 16], |v| {
            let far = v.iter().map(|&c| (f64::from(c) - 7.5).abs()).fold(0.0, f64::max);
            let in_hole = open && v[0] > 8 && v[1] == 8;
            if far > 2.0 && far < 4.0 && !in_hole { 1.0 } else { 0.0 }
        })
    };
    let values = flat([16; 3]);
    let centre = DVec3::splat(8.0);
    assert_eq!(SpaoAo::new(&shell(false), &values, &ao_settings()).accessibility(centre), 0.0);
    assert!(SpaoAo::new(&shell(true), &values, &ao_settings()).accessibility(centre) > 0.01);
}

#[test]
fn a_single_opaque_voxel_darkens_one_shell_of_its_neighbour_and_not_itself() {
    let opacity = OpacityField::from_fn([40, 40, 40], |v| if v == [20, 20, 20] { 1.0 } else { 0.0 });
    let values = flat(opacity.dims);
    let spao = SpaoAo::new(&opacity, &values, &ao_settings());
    let centre = DVec3::splat(20.5);
    assert_close(spao.accessibility(centre), 1.0, 1e-12);
    // Three voxels away it lies between the cubes of half-width 2 and 4: one of 8³ - 4³ = 448 voxels.
    assert_close(spao.accessibility(centre + DVec3::new(3.0, 0.0, 0.0)), 1.0 - 1.0 / 448.0, 1e-12);
    assert_close(spao.accessibility(centre + DVec3::new(0.0, -10.0, 0.0)), 1.0, 1e-12);
}

#[test]
fn accessibility_is_the_formula_of_the_paper_written_out() {
    let opacity = random_opacity([11, 9, 10], 41);
    let values = values_like(&opacity);
    let (levels, factor) = (4, 1.5);
    let settings = AmbientOcclusion { normal_factor: factor, levels, ..ao_settings() };
    let spao = SpaoAo::new(&opacity, &values, &settings);
    let written_out = |x: DVec3, factor: f64| {
        let n = offset_normal(&values, x);
        let mean = |l: u32| {
            let width = 2.0_f64.powi(l as i32);
            brute_force_box_mean(&opacity, x + n * factor * width / 2.0, width)
        };
        let shell = |l: u32| ((8.0 * mean(l) - mean(l - 1)) / 7.0).clamp(0.0, 1.0);
        (1..=levels).map(|l| 1.0 - shell(l)).product::<f64>()
    };
    let mut random = Random::new(42);
    let points: Vec<DVec3> = (0..60).map(|_| random.position(opacity.dims, 1.0)).collect();
    let actual: Vec<f64> = points.iter().map(|&x| spao.accessibility(x)).collect();
    let expected: Vec<f64> = points.iter().map(|&x| written_out(x, factor)).collect();
    let perturbed: Vec<f64> = points.iter().map(|&x| written_out(x, 1.4)).collect();
    assert!(largest_difference(&actual, &expected) < 1e-11);
    assert!(largest_difference(&actual, &perturbed) > 1e-3);
}

#[test]
fn voxel_centres_come_x_fastest_at_plus_one_half() {
    let opacity = random_opacity([4, 3, 5], 43);
    let values = values_like(&opacity);
    let spao = SpaoAo::new(&opacity, &values, &ao_settings());
    let all = spao.at_voxel_centres();
    assert_eq!(all.len(), 60);
    assert_eq!(all[(4 * 3 + 2) * 4 + 1], spao.accessibility(DVec3::new(1.5, 2.5, 4.5)));
    assert_ne!(all[(4 * 3 + 2) * 4 + 1], spao.accessibility(DVec3::new(1.0, 2.0, 4.0)));
}

#[test]
fn turning_the_volume_turns_its_accessibility() {
    let opacity = random_opacity([6, 9, 7], 44);
    // (x, y, z) -> (z, x, y)
    let turned = OpacityField::from_fn([7, 6, 9], |[a, b, c]| opacity.at([b, c, a].map(i64::from)));
    let (values, turned_values) = (values_like(&opacity), values_like(&turned));
    for structure in STRUCTURES {
        let settings = AmbientOcclusion { normal_factor: 1.0, ..with_structure(structure) };
        let plain = SpaoAo::new(&opacity, &values, &settings).at_voxel_centres();
        let result = SpaoAo::new(&turned, &turned_values, &settings).at_voxel_centres();
        let field = OpacityField { dims: opacity.dims, alpha: plain };
        let expected = OpacityField::from_fn([7, 6, 9], |[a, b, c]| field.at([b, c, a].map(i64::from)));
        assert!(largest_difference(&result, &expected.alpha) < 1e-12);
        let mirrored = OpacityField::from_fn([7, 6, 9], |[a, b, c]| field.at([5 - b, c, a].map(i64::from)));
        assert!(largest_difference(&result, &mirrored.alpha) > 0.01);
    }
}
