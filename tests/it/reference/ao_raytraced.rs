//! The ray-traced reference against closed forms.

use std::f64::consts::PI;

use glam::DVec3;
use spao_server::reference::{OpacityField, RaytracedAo, ValueField, fibonacci_directions, offset_normal};
use spao_server::scene::{AmbientOcclusion, AoMethod, Radius};

use super::support::{Random, ao_settings, assert_close, largest_difference, random_opacity, values_like};

fn rays() -> AmbientOcclusion {
    AmbientOcclusion { method: AoMethod::Raytraced, ..ao_settings() }
}

fn flat(dims: [u32; 3]) -> ValueField {
    ValueField::from_fn(dims, |_| 0.0)
}

#[test]
fn directions_are_unit_even_and_as_documented() {
    let directions = fibonacci_directions(512);
    assert!(directions.iter().all(|d| (d.length() - 1.0).abs() < 1e-12));
    let mean = directions.iter().sum::<DVec3>() / 512.0;
    assert!(mean.length() < 0.005, "{mean}");
    // Evenly spread: the second moment is a third along every axis.
    let second = directions.iter().map(|&d| d * d).sum::<DVec3>() / 512.0;
    assert!((second - 1.0 / 3.0).abs().max_element() < 0.005, "{second}");
    assert_eq!(directions[0].z, 1.0 - 1.0 / 512.0);
    assert_close(directions[1].y.atan2(directions[1].x), PI * (3.0 - 5.0_f64.sqrt()), 1e-12);
    assert_eq!(fibonacci_directions(1), [DVec3::X]);
}

#[test]
fn an_empty_volume_is_fully_open() {
    let empty = OpacityField::from_fn([6, 5, 4], |_| 0.0);
    let (values, sloped) = (flat(empty.dims), ValueField::from_fn(empty.dims, |[i, ..]| f64::from(i) / 5.0));
    for radius in [Radius::SameAsLevels, Radius::Voxels(3.0), Radius::Unlimited] {
        let settings = AmbientOcclusion { radius, ..rays() };
        assert!(RaytracedAo::new(&empty, &values, &settings).at_voxel_centres().iter().all(|&a| a == 1.0));
        let hemisphere = AmbientOcclusion { normal_factor: 1.0, ..settings };
        assert!(RaytracedAo::new(&empty, &sloped, &hemisphere).at_voxel_centres().iter().all(|&a| a == 1.0));
    }
}

#[test]
fn a_ray_takes_one_sample_in_the_middle_of_each_half_voxel_between_start_and_reach() {
    let fog = OpacityField::from_fn([40, 40, 40], |_| 0.2);
    let values = flat(fog.dims);
    let x = DVec3::splat(20.0);
    let t = |radius: f64, direction: DVec3| {
        let settings = AmbientOcclusion { radius: Radius::Voxels(radius), ..rays() };
        RaytracedAo::new(&fog, &values, &settings).transmittance(x, direction.normalize())
    };
    let after = |samples: i32| 0.8_f64.powf(0.5 * f64::from(samples));
    // 0.5 + (k + 1/2)/2 < 8: k = 0..=14.
    assert_close(t(8.0, DVec3::X), after(15), 1e-12);
    assert_close(t(8.0, DVec3::NEG_Z), after(15), 1e-12);
    // A partial step counts whole once its middle is reached: 8.25 is not < 8.25, but < 8.26.
    assert_close(t(8.25, DVec3::X), after(15), 1e-12);
    assert_close(t(8.26, DVec3::X), after(16), 1e-12);
    // Along the diagonal, 7.5 √3 = 12.99 voxels: middles 0.25 .. 12.75 make 26 samples.
    assert_close(t(8.0, DVec3::ONE), after(26), 1e-12);
}

#[test]
fn opacity_is_interpolated_between_voxel_centres_along_a_ray() {
    let slab = OpacityField::from_fn([12, 12, 12], |[.., k]| if k == 8 { 0.9 } else { 0.0 });
    let values = flat(slab.dims);
    let reference = RaytracedAo::new(&slab, &values, &rays());
    // From z = 6 the samples lie at 6.75, 7.25, ...; the hat of voxel 8 spans 7.5 .. 9.5 with its top at 8.5.
    let expected: f64 = [0.25, 0.75, 0.75, 0.25].iter().map(|hat| (1.0_f64 - 0.9 * hat).sqrt()).product();
    assert_close(reference.transmittance(DVec3::splat(6.0), DVec3::Z), expected, 1e-12);
    assert_eq!(reference.transmittance(DVec3::splat(6.0), DVec3::NEG_Z), 1.0);
    let outside = reference.transmittance(DVec3::new(6.0, 6.0, 14.0), DVec3::NEG_Z);
    assert_close(outside, expected, 1e-12);
}

#[test]
fn a_ray_counts_the_half_voxel_outside_over_which_opacity_fades() {
    let fog = OpacityField::from_fn([12, 12, 12], |_| 0.2);
    let values = flat(fog.dims);
    let unlimited = AmbientOcclusion { radius: Radius::Unlimited, ..rays() };
    let reference = RaytracedAo::new(&fog, &values, &unlimited);
    // Samples 1.25 and 0.75 inside the face, then 0.25 inside and 0.25 outside.
    let expected: f64 = [1.0, 1.0, 0.75, 0.25].iter().map(|hat| (1.0_f64 - 0.2 * hat).sqrt()).product();
    assert_close(reference.transmittance(DVec3::new(6.0, 6.0, 2.0), DVec3::NEG_Z), expected, 1e-12);
    assert_close(reference.transmittance(DVec3::new(6.0, 10.0, 6.0), DVec3::Y), expected, 1e-12);
}

#[test]
fn the_hemisphere_is_the_cosine_weighted_mean_of_transmittances() {
    let opacity = random_opacity([9, 8, 7], 54);
    let values = values_like(&opacity);
    let settings = AmbientOcclusion { normal_factor: 1.0, ..rays() };
    let reference = RaytracedAo::new(&opacity, &values, &settings);
    let weighted_by = |x: DVec3, weight: fn(f64) -> f64| {
        let normal = offset_normal(&values, x).normalize();
        let weighed =
            fibonacci_directions(512).into_iter().map(|d| (weight(normal.dot(d)), reference.transmittance(x, d)));
        let (open, total) = weighed.fold((0.0, 0.0), |(open, total), (w, t)| (open + w * t, total + w));
        open / total
    };
    let points = [DVec3::new(4.2, 3.1, 3.7), DVec3::new(1.5, 6.5, 2.5), DVec3::new(7.5, 2.5, 5.5)];
    let actual = points.map(|x| reference.accessibility(x));
    let cosine = points.map(|x| weighted_by(x, |cosine| cosine.max(0.0)));
    let uniform = points.map(|x| weighted_by(x, |cosine| if cosine > 0.0 { 1.0 } else { 0.0 }));
    assert!(largest_difference(&actual, &cosine) < 1e-12);
    assert!(largest_difference(&actual, &uniform) > 0.005);
}

/// (1/4π) ∫ (1 - α)^length over the directions from a cube's centre to its faces, by summing over one face.
fn fog_in_a_cube(alpha: f64, half_width: f64) -> f64 {
    let n = 200;
    let mut sum = 0.0;
    for i in 0..n {
        for j in 0..n {
            let at = |i: i32| (f64::from(i) + 0.5) / f64::from(n) * 2.0 - 1.0;
            let slant = (1.0 + at(i).powi(2) + at(j).powi(2)).sqrt();
            sum += (1.0 - alpha).powf((half_width - 0.5) * slant) * slant.powi(-3) * 4.0 / f64::from(n * n);
        }
    }
    6.0 * sum / (4.0 * PI)
}

#[test]
fn inside_homogeneous_fog_accessibility_is_the_integral_over_the_cube() {
    let fog = OpacityField::from_fn([20, 20, 20], |_| 0.1);
    let values = flat(fog.dims);
    let actual = RaytracedAo::new(&fog, &values, &rays()).accessibility(DVec3::splat(10.0));
    // The integral's length is exact, a ray's a multiple of half a voxel: 0.1 · 0.25 at most, and less on average.
    assert_close(actual, fog_in_a_cube(0.1, 8.0), 0.003);
    assert!((actual - fog_in_a_cube(0.1, 9.0)).abs() > 0.02);
    assert!((actual - fog_in_a_cube(0.11, 8.0)).abs() > 0.02);
}

/// Opaque where z < 32.
fn half_space() -> OpacityField {
    OpacityField::from_fn([64, 64, 64], |[.., k]| if k < 32 { 1.0 } else { 0.0 })
}

#[test]
fn the_obscurance_on_an_opaque_half_space_is_one_half() {
    let opacity = half_space();
    let values = flat(opacity.dims);
    let reference = RaytracedAo::new(&opacity, &values, &AmbientOcclusion { radius: Radius::Voxels(31.0), ..rays() });
    // The lowest centre that interpolation leaves empty. All rays upwards are open; of those downwards only
    // the ones end early that sink less than a voxel within the radius: |z| < 1/31, a share of 1/62.
    let actual = reference.accessibility(DVec3::new(32.0, 32.0, 32.5));
    assert!((0.5..0.5 + 1.0 / 62.0).contains(&actual), "{actual}");
    assert_eq!(reference.accessibility(DVec3::new(32.0, 32.0, 16.0)), 0.0);
    assert!(reference.accessibility(DVec3::new(32.0, 32.0, 40.0)) > 0.55);
}

#[test]
fn the_cosine_hemisphere_over_an_opaque_half_space_is_open_and_under_a_roof_it_is_closed() {
    let opacity = half_space();
    let settings = AmbientOcclusion { normal_factor: 1.0, ..rays() };
    let surface = DVec3::new(32.0, 32.0, 32.5);
    let up = values_like(&opacity);
    assert_eq!(RaytracedAo::new(&opacity, &up, &settings).accessibility(surface), 1.0);
    let down = ValueField::from_fn(opacity.dims, |[.., k]| if k < 32 { 0.0 } else { 1.0 });
    // Rays that do not sink by a voxel within 8: ∫ 2 z dz up to 1/8, at most.
    assert!(RaytracedAo::new(&opacity, &down, &settings).accessibility(surface) < 1.0 / 64.0);
}

#[test]
fn the_hemisphere_weighs_directions_by_their_cosine() {
    // A wall to one side of a point on the ground: open directions have x < 0.
    let wall = OpacityField::from_fn([40, 40, 40], |[i, ..]| if i >= 21 { 1.0 } else { 0.0 });
    let x = DVec3::new(20.0, 20.0, 20.0);
    let accessibility = |normal: DVec3| {
        let values =
            ValueField::from_fn(wall.dims, |v| 0.5 - normal.dot(DVec3::from_array(v.map(f64::from)) - 20.0) / 40.0);
        let settings = AmbientOcclusion { normal_factor: 1.0, radius: Radius::Voxels(16.0), ..rays() };
        RaytracedAo::new(&wall, &values, &settings).accessibility(x)
    };
    // (1/π) ∫ max(0, n·ω) over the half-space about m is (1 + n·m) / 2; the wall's grazing rays make it a bit more.
    for (normal, expected) in [(DVec3::Z, 0.5), (DVec3::NEG_X, 1.0), (DVec3::X, 0.0)] {
        assert_close(accessibility(normal), expected, 0.04);
    }
    let slanted = DVec3::new(-1.0, 0.0, 1.0).normalize();
    assert_close(accessibility(slanted), 0.5 * (1.0 + 0.5_f64.sqrt()), 0.04);
}

#[test]
fn without_a_gradient_the_hemisphere_is_the_full_sphere() {
    let opacity = half_space();
    let x = DVec3::new(32.0, 32.0, 32.5);
    let faint = |slope: f64| ValueField::from_fn(opacity.dims, move |[.., k]| 0.5 - slope * f64::from(k));
    let accessibility = |values: &ValueField, normal_factor| {
        RaytracedAo::new(&opacity, values, &AmbientOcclusion { normal_factor, ..rays() }).accessibility(x)
    };
    assert_eq!(accessibility(&faint(0.0009), 1.0), accessibility(&faint(0.0009), 0.0));
    assert_ne!(accessibility(&faint(0.0011), 1.0), accessibility(&faint(0.0011), 0.0));
}

#[test]
fn the_centre_of_a_closed_opaque_shell_is_not_accessible() {
    let shell = |open: bool| {
        OpacityField::from_fn([16, 16, 16], |v| {
            let far = v.iter().map(|&c| (f64::from(c) - 7.5).abs()).fold(0.0, f64::max);
            let in_hole = open && v[0] > 8 && (6..10).contains(&v[1]) && (6..10).contains(&v[2]);
            if far > 2.0 && far < 5.0 && !in_hole { 1.0 } else { 0.0 }
        })
    };
    let values = flat([16; 3]);
    let accessibility =
        |opacity: &OpacityField| RaytracedAo::new(opacity, &values, &rays()).accessibility(DVec3::splat(8.0));
    assert_eq!(accessibility(&shell(false)), 0.0);
    assert!(accessibility(&shell(true)) > 0.02);
}

#[test]
fn a_single_opaque_voxel_blocks_the_cone_under_which_it_is_seen() {
    let opacity = OpacityField::from_fn([40, 40, 40], |v| if v == [20, 20, 20] { 1.0 } else { 0.0 });
    let values = flat(opacity.dims);
    let reference = RaytracedAo::new(&opacity, &values, &rays());
    let centre = DVec3::splat(20.5);
    let blocked = |away: f64| 1.0 - reference.accessibility(centre + DVec3::new(0.0, away, 0.0));
    // Interpolation blurs the voxel over a width of 2, so between its own solid angle and the blurred one's.
    let solid_angle = |width: f64, away: f64| (width / away).powi(2) / (4.0 * PI);
    assert!(blocked(4.0) > 0.5 * solid_angle(1.0, 4.0) && blocked(4.0) < solid_angle(2.0, 4.0), "{}", blocked(4.0));
    assert!(blocked(2.0) > 2.0 * blocked(4.0));
    assert_eq!(blocked(10.0), 0.0);
    let unlimited = AmbientOcclusion { radius: Radius::Unlimited, rays: 4096, ..rays() };
    let far = RaytracedAo::new(&opacity, &values, &unlimited).accessibility(centre + DVec3::new(0.0, 10.0, 0.0));
    assert!(far < 1.0 && far > 0.995, "{far}");
}

#[test]
fn unlimited_rays_end_where_the_volume_ends() {
    let opacity = random_opacity([9, 8, 7], 51);
    let values = values_like(&opacity);
    let unlimited = RaytracedAo::new(&opacity, &values, &AmbientOcclusion { radius: Radius::Unlimited, ..rays() });
    let long = AmbientOcclusion { radius: Radius::Voxels(1024.0), ..rays() };
    let long = RaytracedAo::new(&opacity, &values, &long);
    let short = AmbientOcclusion { radius: Radius::Voxels(3.0), ..rays() };
    let short = RaytracedAo::new(&opacity, &values, &short);
    let mut random = Random::new(52);
    for _ in 0..5 {
        let x = random.position(opacity.dims, 0.0);
        assert_eq!(unlimited.accessibility(x), long.accessibility(x));
        assert!(unlimited.accessibility(x) < short.accessibility(x));
    }
}

#[test]
fn turning_the_volume_turns_its_accessibility_up_to_the_directions_chosen() {
    let opacity = random_opacity([6, 9, 7], 53);
    let turned = OpacityField::from_fn([7, 6, 9], |[a, b, c]| opacity.at([b, c, a].map(i64::from)));
    let (values, turned_values) = (values_like(&opacity), values_like(&turned));
    let reference = RaytracedAo::new(&opacity, &values, &rays());
    let turned_reference = RaytracedAo::new(&turned, &turned_values, &rays());
    let x = DVec3::new(2.5, 6.5, 3.5);
    for &d in &fibonacci_directions(40) {
        let expected = reference.transmittance(x, d);
        assert_close(
            turned_reference.transmittance(DVec3::new(x.z, x.x, x.y), DVec3::new(d.z, d.x, d.y)),
            expected,
            1e-12,
        );
    }
    let same = turned_reference.accessibility(DVec3::new(x.z, x.x, x.y));
    assert_close(same, reference.accessibility(x), 0.01);
    assert!((turned_reference.accessibility(x) - same).abs() > 0.01);
}
