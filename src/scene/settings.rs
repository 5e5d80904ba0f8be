//! Ambient occlusion, lighting, rendering and viewport settings. `default()` is what a document that says nothing
//! means.

use glam::DVec3;

/// sRGB-encoded colour, each in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgb(pub [f64; 3]);

/// sRGB-encoded colour with straight alpha, each in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rgba(pub [f64; 4]);

/// Which accessibility is computed (METHODS 2 and 3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AoMethod {
    /// Accessibility is 1 everywhere.
    Off,
    /// Smooth probabilistic ambient occlusion.
    Spao,
    /// Ray-traced reference.
    Raytraced,
}

/// What box means are looked up in (METHODS 2).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum AoStructure {
    /// Full-resolution levels.
    NBuffer,
    /// Halved levels.
    Mipmap,
    /// Mip levels first, N-buffers over the last of them.
    Hybrid,
}

/// How far reference rays go.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Radius {
    /// As far as SPAO sees: max-norm distance 2^(levels - 1) voxels.
    SameAsLevels,
    /// A max-norm distance in voxels, 1..=1024.
    Voxels(f64),
    /// To the volume's border.
    Unlimited,
}

/// Ambient-occlusion settings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AmbientOcclusion {
    /// Method.
    pub method: AoMethod,
    /// Structure of `spao`.
    pub structure: AoStructure,
    /// L of METHODS 2: shells 1..=L, cubes up to 2^L wide. 1..=8.
    pub levels: u32,
    /// m of METHODS 2 for `hybrid`: 0..=levels.
    pub mip_levels: u32,
    /// f of METHODS 2: 0..=2.
    pub normal_factor: f64,
    /// O' = 1 + strength (O - 1): 0..=1.
    pub strength: f64,
    /// Directions of the reference: 1..=4096.
    pub rays: u32,
    /// Reach of the reference.
    pub radius: Radius,
    /// Exponent of `obscurances`, 0..=8. Accepted and kept; no method that reads it exists yet.
    pub falloff: f64,
    /// Only 0 is accepted yet.
    pub color_bleeding: f64,
}

impl AmbientOcclusion {
    /// Levels that are made by halving: m of METHODS 2.
    pub fn halved_levels(&self) -> u32 {
        match self.structure {
            AoStructure::NBuffer => 0,
            AoStructure::Mipmap => self.levels,
            AoStructure::Hybrid => self.mip_levels,
        }
    }
}

/// Blinn-Phong terms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lighting {
    /// Ambient coefficient, 0..=4.
    pub ambient: f64,
    /// Diffuse coefficient, 0..=4.
    pub diffuse: f64,
    /// Specular coefficient, 0..=4.
    pub specular: f64,
    /// Blinn-Phong exponent, 1..=1000.
    pub shininess: f64,
    /// World direction *towards* the light, unit length; `None` is a head light.
    pub direction: Option<DVec3>,
    /// Colour of the light.
    pub color: Rgb,
    /// Factor on the illumination, 0..=16. `None` compensates what ambient occlusion takes away from an open surface.
    pub exposure: Option<f64>,
}

/// How samples along a ray become a colour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RenderMode {
    /// Front-to-back compositing.
    Composite,
}

/// World box, min < max on each axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipBox {
    /// Lower corner.
    pub min: DVec3,
    /// Upper corner.
    pub max: DVec3,
}

/// Keeps the side n.p + d >= 0; `normal` has unit length (d scaled along).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ClipPlane {
    /// Unit normal.
    pub normal: DVec3,
    /// Offset.
    pub d: f64,
}

/// Compositing, sampling, background and clipping.
#[derive(Clone, Debug, PartialEq)]
pub struct Rendering {
    /// Mode.
    pub mode: RenderMode,
    /// Samples per smallest spacing, 0.1..=8.
    pub sampling_rate: f64,
    /// Background with straight alpha.
    pub background: Rgba,
    /// World box outside of which nothing is drawn.
    pub clip_box: Option<ClipBox>,
    /// At most 8.
    pub clip_planes: Vec<ClipPlane>,
}

/// Picture size in pixels, each 1..=16384 (the server's `--max-image` may be lower).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Viewport {
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

impl Default for AmbientOcclusion {
    fn default() -> Self {
        Self {
            method: AoMethod::Spao,
            structure: AoStructure::NBuffer,
            levels: 6,
            mip_levels: 0,
            normal_factor: 1.0,
            strength: 1.0,
            rays: 512,
            radius: Radius::SameAsLevels,
            falloff: 0.5,
            color_bleeding: 0.0,
        }
    }
}

impl Default for Lighting {
    fn default() -> Self {
        Self {
            ambient: 0.5,
            diffuse: 0.6,
            specular: 0.2,
            shininess: 30.0,
            direction: None,
            color: Rgb::WHITE,
            exposure: None,
        }
    }
}

impl Default for Rendering {
    fn default() -> Self {
        Self {
            mode: RenderMode::Composite,
            sampling_rate: 1.0,
            background: Rgba([0.0, 0.0, 0.0, 1.0]),
            clip_box: None,
            clip_planes: Vec::new(),
        }
    }
}

impl Default for Viewport {
    fn default() -> Self {
        Self { width: 1024, height: 768 }
    }
}
