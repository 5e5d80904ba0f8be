//! Light on one sample.

use glam::DVec3;
use spao_server::reference::{Exposure, Illumination, clearness, facing_normal, illuminate, openness};
use spao_server::scene::{Lighting, Rgb};

use super::support::assert_close;

const BASE: Rgb = Rgb([0.8, 0.4, 0.2]);

fn lighting() -> Lighting {
    Lighting {
        ambient: 0.2,
        diffuse: 0.5,
        specular: 0.0,
        shininess: 10.0,
        direction: None,
        color: Rgb([1.0; 3]),
        exposure: None,
    }
}

fn illumination() -> Illumination {
    Illumination { ray_direction: DVec3::NEG_Z, openness: 1.0 }
}

/// The first channel of a surface with the given gradient.
fn red(gradient: DVec3, lighting: &Lighting) -> f64 {
    illuminate(BASE, gradient, lighting, &illumination()).0[0]
}

#[test]
fn the_diffuse_term_follows_the_cosine() {
    let tilted = DVec3::new(0.0, 0.6, 0.8);
    assert_close(red(DVec3::Z, &lighting()), 0.8 * 0.7, 1e-12);
    assert_close(red(tilted, &lighting()), 0.8 * (0.2 + 0.5 * 0.8), 1e-12);
    assert_close(red(DVec3::X, &lighting()), 0.8 * 0.2, 1e-12);
    let from_above = Lighting { direction: Some(DVec3::Y), ..lighting() };
    assert_close(red(tilted, &from_above), 0.8 * (0.2 + 0.5 * 0.6), 1e-12);
}

#[test]
fn normals_are_turned_to_the_viewer_and_not_to_the_light() {
    assert_eq!(red(DVec3::Z, &lighting()), red(DVec3::NEG_Z, &lighting()));
    let from_behind = Lighting { direction: Some(DVec3::NEG_Z), ..lighting() };
    assert_close(red(DVec3::Z, &from_behind), 0.8 * 0.2, 1e-12);
}

#[test]
fn a_weak_gradient_is_lit_flat_and_a_missing_one_too() {
    let across = |length: f64| red(DVec3::X * length, &lighting());
    assert_close(across(0.0), 0.8 * 0.7, 1e-12);
    assert_close(across(0.01), 0.8 * (0.2 + 0.5 * 0.5), 1e-12);
    assert_close(across(0.02), 0.8 * 0.2, 1e-12);
    let shiny = Lighting { specular: 1.0, ambient: 0.0, diffuse: 0.0, ..lighting() };
    assert_eq!(red(DVec3::ZERO, &shiny), 0.0);
    assert_close(red(DVec3::Z * 0.01, &shiny), 0.5, 1e-12);
}

#[test]
fn the_specular_term_has_the_lights_colour_and_needs_light() {
    let shiny = Lighting { specular: 0.5, ambient: 0.0, diffuse: 0.0, color: Rgb([1.0, 0.5, 0.0]), ..lighting() };
    let color = illuminate(BASE, DVec3::Z, &shiny, &illumination());
    assert_eq!(color, Rgb([0.5, 0.25, 0.0]));
    let half_way = DVec3::new(0.0, 0.5_f64.sqrt(), 0.5_f64.sqrt());
    let from_above = Lighting { direction: Some(DVec3::Y), ..shiny };
    assert_close(red(half_way, &from_above), 0.5, 1e-12);
    assert_close(red(DVec3::new(0.0, 0.6, 0.8), &from_above), 0.5 * (1.4 * 0.5_f64.sqrt()).powi(10), 1e-12);
    let from_below = Lighting { direction: Some(DVec3::NEG_Y), ..shiny };
    assert_eq!(red(half_way, &from_below), 0.0);
    let opposite = Lighting { direction: Some(DVec3::NEG_Z), ..shiny };
    assert_eq!(red(DVec3::new(0.0, 1.0, 1e-9), &opposite), 0.0);
}

#[test]
fn openness_scales_all_terms_and_the_result_stays_in_range() {
    let shiny = Lighting { specular: 0.1, ..lighting() };
    let with = |openness| illuminate(BASE, DVec3::Z, &shiny, &Illumination { openness, ..illumination() }).0;
    let full = with(1.0);
    for (c, &base) in BASE.0.iter().enumerate() {
        assert_close(full[c], base * 0.7 + 0.1, 1e-12);
        assert_close(with(0.25)[c], full[c] * 0.25, 1e-12);
    }
    assert_eq!(with(16.0), [1.0; 3]);
    assert_eq!(with(0.0), [0.0; 3]);
}

#[test]
fn explicit_exposure_is_a_factor_on_what_strength_leaves_of_occlusion() {
    let explicit = |accessibility, strength, factor| openness(accessibility, strength, Exposure::explicit(factor));
    assert_close(explicit(0.3, 1.0, 1.0), 0.3, 1e-12);
    assert_close(explicit(0.3, 0.5, 1.0), 0.65, 1e-12);
    assert_close(explicit(0.3, 0.0, 1.0), 1.0, 1e-12);
    assert_close(explicit(0.3, 0.5, 4.0), 2.6, 1e-12);
    assert_eq!(Exposure::NONE, Exposure::explicit(1.0));
}

#[test]
fn automatic_exposure_gives_an_open_surface_full_light_and_nothing_more() {
    let automatic = |accessibility, strength| openness(accessibility, strength, Exposure::automatic(0.25));
    assert_close(automatic(0.25, 1.0), 1.0, 1e-12);
    assert_close(automatic(0.9, 1.0), 1.0, 1e-12);
    assert_close(automatic(0.125, 1.0), 0.75, 1e-12);
    assert_close(automatic(0.0, 1.0), 0.0, 1e-12);
    // O' = 0.625 is beyond 0.25.
    assert_close(automatic(0.25, 0.5), 1.0, 1e-12);
    assert_close(openness(0.25, 0.5, Exposure::automatic(0.625)), 1.0, 1e-12);
    // Steepest in the dark: twice the slope of the plain quotient.
    assert_close(automatic(1e-6, 1.0), 8e-6, 1e-10);
}

#[test]
fn normals_and_their_clearness_come_from_the_gradient() {
    let to_viewer = DVec3::new(0.0, 0.6, 0.8);
    let normal = DVec3::new(0.6, 0.0, 0.8);
    assert!((facing_normal(normal * 0.3, to_viewer) - normal).length() < 1e-12);
    assert!((facing_normal(normal * -0.3, to_viewer) - normal).length() < 1e-12);
    assert_eq!(facing_normal(DVec3::ZERO, to_viewer).length(), 0.0);
    assert!(facing_normal(normal * 1e-8, to_viewer).length() < 0.02);
    for (length, clear) in [(0.0, 0.0), (0.005, 0.25), (0.02, 1.0), (0.8, 1.0)] {
        assert_close(clearness(normal * length), clear, 1e-12);
    }
}
