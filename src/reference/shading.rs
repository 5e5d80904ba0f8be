//! Colour of one sample under the light: Blinn-Phong with ambient occlusion (METHODS 5).

use glam::DVec3;

use crate::scene::{Lighting, Rgb};

/// Gradient length (of v̂ per smallest spacing) from which a sample is lit as a surface.
///
/// Below it there is no surface to speak of; its shading fades to flat light instead of following noise.
const SURFACE_GRADIENT: f64 = 0.02;
/// Shortest gradient that has a direction.
const SHORTEST_GRADIENT: f64 = 1e-6;

/// What lights a sample, besides the scene's [`Lighting`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Illumination {
    /// Unit world direction of the ray, away from the eye.
    pub ray_direction: DVec3,
    /// O' = 1 + strength (A - 1), in [0, 1].
    pub occlusion: f64,
    /// Factor on everything.
    pub exposure: f64,
}

/// The sRGB-encoded colour, each in [0, 1], of a sample of colour `base` with `normal` = -∇v̂ h in world space
/// (h the smallest spacing, so its length is the change of v̂ over one h).
///
/// With V = -ray direction, L the direction to the light (V for a head light), H = (L + V)/|L + V| (0 when
/// they are opposite), N = normal/|normal| turned to the viewer and s = clamp(|normal| / 0.02, 0, 1):
///
/// `exposure · O' · ((ambient + diffuse · mix(1, max(0, N·L), s)) · base · light + specular · s · max(0, N·H)^shininess · light)`
///
/// without the specular term unless N·L > 0. N is two-sided since both the inside and the outside of a
/// structure may be what is looked at, and the ambient and diffuse light must not depend on which is denser.
pub fn illuminate(base: Rgb, normal: DVec3, lighting: &Lighting, illumination: &Illumination) -> Rgb {
    let to_viewer = -illumination.ray_direction;
    let to_light = lighting.direction.unwrap_or(to_viewer);
    let (diffuse, specular) = surface_terms(normal, to_viewer, to_light, lighting.shininess);
    let matte = lighting.ambient + lighting.diffuse * diffuse;
    let gloss = lighting.specular * specular;
    let scale = illumination.exposure * illumination.occlusion;
    Rgb(std::array::from_fn(|c| {
        (scale * (matte * base.0[c] + gloss) * lighting.color.0[c]).clamp(0.0, 1.0)
    }))
}

/// Diffuse and specular terms, each in [0, 1].
fn surface_terms(normal: DVec3, to_viewer: DVec3, to_light: DVec3, shininess: f64) -> (f64, f64) {
    let length = normal.length();
    if length <= SHORTEST_GRADIENT {
        return (1.0, 0.0);
    }
    let surface = (length / SURFACE_GRADIENT).clamp(0.0, 1.0);
    let facing = if normal.dot(to_viewer) < 0.0 {
        -normal / length
    } else {
        normal / length
    };
    let towards_light = facing.dot(to_light).max(0.0);
    let diffuse = 1.0 + (towards_light - 1.0) * surface;
    if towards_light == 0.0 {
        return (diffuse, 0.0);
    }
    let half_way = (to_light + to_viewer).normalize_or_zero();
    (diffuse, surface * facing.dot(half_way).max(0.0).powf(shininess))
}
