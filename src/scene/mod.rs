//! What is looked at, and how: validated settings of one picture.
//!
//! Architecture Invariant: every value that exists is valid. Untrusted JSON becomes a [`SceneDocument`]
//! (`document/`), which is checked and completed against a volume into a [`Scene`]; the rest of the
//! program sees only `Scene`.

mod automatic;
mod camera;
mod color;
mod document;
mod error;
mod framing;
mod history;
mod merge_patch;
mod presets;
mod settings;
mod transfer_function;
mod transfer_table;

pub use automatic::{automatic_transfer_function, looks_like_hounsfield};
pub use camera::{Camera, Projection, RayBasis};
pub use document::{HistogramView, MAX_CLIP_PLANES, MAX_POINTS, SceneDocument, VolumeFacts};
pub use error::{SceneError, SceneErrorKind};
pub use framing::{DEFAULT_FOV_Y_DEG, framed_camera, framed_camera_with_fov, framed_height};
pub use history::{HistoryError, SceneHistory};
pub use merge_patch::merge_patch_between;
pub use presets::{Preset, PresetPoint, PresetUnits, preset, presets};
pub use settings::{
    AmbientOcclusion, AoMethod, AoStructure, ClipBox, ClipPlane, Lighting, Radius, RenderMode, Rendering, Rgb, Rgba,
    Viewport,
};
pub use transfer_function::{ControlPoint, MAX_VALUE, TransferFunction};
pub use transfer_table::{TransferTable, opacity_table};

use crate::volume::VolumeId;

/// One scene, complete: every default is filled in and every number is in range.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// The volume looked at.
    pub volume: VolumeId,
    /// Colour and opacity over values.
    pub transfer_function: TransferFunction,
    /// Where from.
    pub camera: Camera,
    /// How much of its surroundings a voxel sees.
    pub ambient_occlusion: AmbientOcclusion,
    /// Blinn-Phong terms and the light.
    pub lighting: Lighting,
    /// Compositing, sampling, background and clipping.
    pub rendering: Rendering,
    /// Picture size unless a request names one.
    pub viewport: Viewport,
}

impl Scene {
    /// Whether both scenes have the same accessibility volume: the same volume, opacities and settings that
    /// ambient occlusion is computed from. Colours, camera, light and `strength` do not matter.
    pub fn same_occlusion(&self, other: &Self) -> bool {
        let settings = |scene: &Self| AmbientOcclusion { strength: 1.0, ..scene.ambient_occlusion };
        let opacities = |scene: &Self| -> Vec<[f64; 2]> {
            scene.transfer_function.points.iter().map(|p| [p.value, p.opacity]).collect()
        };
        self.volume == other.volume
            && settings(self) == settings(other)
            && self.transfer_function.opacity_unit_distance == other.transfer_function.opacity_unit_distance
            && opacities(self) == opacities(other)
    }
}
