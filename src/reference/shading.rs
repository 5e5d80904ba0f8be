//! Colour of one sample under the light: Blinn-Phong with ambient occlusion (METHODS 5).

use glam::DVec3;

use crate::scene::{Lighting, Rgb};

/// Gradient length (of v̂ per smallest spacing) from which a sample is lit as a surface.
///
/// Below it there is no surface to speak of; its shading fades to flat light instead of following noise.
const CLEAR_GRADIENT: f64 = 0.02;
/// Shorter gradients are not made unit vectors of: they would be rounding errors.
const SHORTEST_GRADIENT: f64 = 1e-6;

/// How bright a picture is.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Factor on O'; without effect where exposure is automatic.
    pub factor: f64,
    /// Automatic exposure where positive: 1 / O' of an open surface.
    pub inverse_reference: f64,
}

impl Exposure {
    /// The light as it is.
    pub const NONE: Self = Self::explicit(1.0);

    /// A plain factor.
    pub const fn explicit(factor: f64) -> Self {
        Self { factor, inverse_reference: 0.0 }
    }

    /// What turns O' of an open surface, in (0, 1], into full light.
    pub fn automatic(open: f64) -> Self {
        Self { factor: 1.0, inverse_reference: 1.0 / open }
    }
}

/// Factor on the light of a sample: with O' = 1 + `strength` (A - 1), `factor` · O' where exposure is explicit, and
/// where it is automatic x (2 - x), x = min(O' · `inverse_reference`, 1), which is steeper where it is dark and
/// never more than 1.
pub fn openness(accessibility: f64, strength: f64, exposure: Exposure) -> f64 {
    let open = 1.0 + strength * (accessibility - 1.0);
    if exposure.inverse_reference > 0.0 {
        let relative = (open * exposure.inverse_reference).min(1.0);
        relative * (2.0 - relative)
    } else {
        exposure.factor * open
    }
}

/// Unit vector along ± `gradient`, turned to the viewer; zero without a gradient. Two-sided, since both the inside
/// and the outside of a structure may be what is looked at, and light must not depend on which is denser.
pub fn facing_normal(gradient: DVec3, to_viewer: DVec3) -> DVec3 {
    let normal = gradient / gradient.length().max(SHORTEST_GRADIENT);
    if normal.dot(to_viewer) > 0.0 { normal } else { -normal }
}

/// How clear the direction of a gradient is, in [0, 1]; 1 from a change of v̂ of 0.02 per smallest spacing.
pub fn clearness(gradient: DVec3) -> f64 {
    (gradient.length() / CLEAR_GRADIENT).clamp(0.0, 1.0)
}

/// What lights a sample, besides the scene's [`Lighting`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Illumination {
    /// Unit world direction of the ray, away from the eye.
    pub ray_direction: DVec3,
    /// Factor on everything: see [`openness`].
    pub openness: f64,
}

/// The sRGB-encoded colour, each in [0, 1], of a sample of colour `base` with `gradient` = ∇v̂ h in world space
/// (h the smallest spacing, so its length is the change of v̂ over one h).
///
/// With V = -ray direction, L the direction to the light (V for a head light), H = (L + V)/|L + V| (0 when
/// they are opposite), N the [`facing_normal`] and s the [`clearness`] of the gradient:
///
/// `openness · ((ambient + diffuse · mix(1, max(0, N·L), s)) · base · light + specular · s · max(0, N·H)^shininess · light)`
///
/// without the specular term unless N·L > 0.
pub fn illuminate(base: Rgb, gradient: DVec3, lighting: &Lighting, illumination: &Illumination) -> Rgb {
    let to_viewer = -illumination.ray_direction;
    let to_light = lighting.direction.unwrap_or(to_viewer);
    let normal = facing_normal(gradient, to_viewer);
    let clear = clearness(gradient);
    let facing_light = normal.dot(to_light);
    let diffuse = 1.0 + (facing_light.max(0.0) - 1.0) * clear;
    let specular = if facing_light > 0.0 {
        let half_way = (to_light + to_viewer).normalize_or_zero();
        clear * normal.dot(half_way).max(0.0).powf(lighting.shininess)
    } else {
        0.0
    };
    let matte = lighting.ambient + lighting.diffuse * diffuse;
    let gloss = lighting.specular * specular;
    Rgb(std::array::from_fn(|c| {
        (illumination.openness * (matte * base.0[c] + gloss) * lighting.color.0[c]).clamp(0.0, 1.0)
    }))
}
