//! How bright a picture is.

use crate::scene::{AoMethod, Scene};

/// Least reference: beyond it, what is visible is a cavity and should look like one.
const DARKEST_REFERENCE: f64 = 1.0 / 64.0;

/// What the illumination O' = 1 + strength (O - 1) of a sample is turned into.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Exposure {
    /// Plain factor; the scene's own, else 1.
    pub factor: f64,
    /// Automatic exposure where positive: 1 / O' of an open surface. The factor is then x (2 - x) with
    /// x = min(O' * inverse_reference, 1): full light for an open surface, and never more.
    pub inverse_reference: f64,
}

/// The exposure of a scene whose surfaces have the accessibility `surface_reference` where they are open.
///
/// Half of what surrounds a flat surface is the object itself, and a product over shells counts that half once
/// per shell: on an opaque half-space SPAO leaves 2^-L (METHODS 2), where rays would leave one half. So pictures
/// are exposed by the accessibility that most of the surface does not exceed; it depends on the volume, the
/// opacities and the settings, never on the camera.
pub fn exposure(scene: &Scene, surface_reference: f64) -> Exposure {
    let occlusion = &scene.ambient_occlusion;
    match (scene.lighting.exposure, occlusion.method) {
        (Some(factor), _) => Exposure { factor, inverse_reference: 0.0 },
        (None, AoMethod::Off) => Exposure { factor: 1.0, inverse_reference: 0.0 },
        (None, AoMethod::Spao | AoMethod::Raytraced) => {
            let open = 1.0 + occlusion.strength * (surface_reference.max(DARKEST_REFERENCE) - 1.0);
            Exposure { factor: 1.0, inverse_reference: 1.0 / open }
        }
    }
}
