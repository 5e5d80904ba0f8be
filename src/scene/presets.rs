//! Ready-made transfer functions.
//!
//! Those for CT are in Hounsfield units and opacities per millimetre, so that a picture does not depend on the
//! resolution of the scan. The others are relative to the volume's value range and opacities per smallest spacing.

use serde::Serialize;

use super::{ControlPoint, Rgb, TransferFunction};

/// What the values of a preset's points mean.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum PresetUnits {
    /// Hounsfield units, used as they are.
    Hounsfield,
    /// 0 is the volume's lowest value, 1 its highest.
    Relative,
}

/// One point of a preset.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PresetPoint {
    /// In the preset's units.
    pub value: f64,
    /// `#rrggbb`.
    pub color: &'static str,
    /// In [0, 1], for a ray of the preset's `opacity_unit_distance`.
    pub opacity: f64,
}

/// A ready-made transfer function; serialises as an item of `GET /v1/presets`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Preset {
    /// Name in scene documents.
    pub id: &'static str,
    /// Name for people.
    pub name: &'static str,
    /// DICOM modality that it is for: `CT`, `MR`, or `OT` for anything.
    pub modality: &'static str,
    /// What it shows.
    pub description: &'static str,
    /// What the values of `points` mean.
    pub units: PresetUnits,
    /// World length that the opacities are for; `None`: the volume's smallest spacing.
    pub opacity_unit_distance: Option<f64>,
    /// Sorted by value.
    pub points: &'static [PresetPoint],
}

impl Preset {
    /// The transfer function for a volume of the given value range.
    pub fn transfer_function(&self, [lowest, highest]: [f64; 2]) -> TransferFunction {
        // A constant volume has no range to be relative to.
        let highest = if highest > lowest { highest } else { lowest + 1.0 };
        let points = self.points.iter().map(|point| ControlPoint {
            value: match self.units {
                PresetUnits::Hounsfield => point.value,
                PresetUnits::Relative => lowest * (1.0 - point.value) + highest * point.value,
            },
            color: Rgb::from_hex(point.color).expect("the colours of presets are well-formed"),
            opacity: point.opacity,
        });
        TransferFunction {
            opacity_unit_distance: self.opacity_unit_distance,
            ..TransferFunction::from_ascending(points)
        }
    }
}

/// All presets.
pub fn presets() -> &'static [Preset] {
    &PRESETS
}

/// The preset of the given id.
pub fn preset(id: &str) -> Option<&'static Preset> {
    PRESETS.iter().find(|preset| preset.id == id)
}

/// The preset that data in Hounsfield units gets when nothing else is asked for.
pub(super) const HOUNSFIELD_DEFAULT: &Preset = &CT_SKIN_BONE;

const fn point(value: f64, color: &'static str, opacity: f64) -> PresetPoint {
    PresetPoint { value, color, opacity }
}

const fn ct(id: &'static str, name: &'static str, description: &'static str, points: &'static [PresetPoint]) -> Preset {
    let (units, opacity_unit_distance) = (PresetUnits::Hounsfield, Some(1.0));
    Preset { id, name, modality: "CT", description, units, opacity_unit_distance, points }
}

const fn relative(
    id: &'static str,
    name: &'static str,
    modality: &'static str,
    description: &'static str,
    points: &'static [PresetPoint],
) -> Preset {
    Preset { id, name, modality, description, units: PresetUnits::Relative, opacity_unit_distance: None, points }
}

const CT_SKIN_BONE: Preset = ct(
    "ct_skin_bone",
    "Skin over bone",
    "Translucent skin and muscle over opaque bone; the default for data in Hounsfield units.",
    &[
        point(-650.0, "#e3ad8c", 0.0),
        point(-400.0, "#e8b898", 0.07),
        point(-200.0, "#efc4a2", 0.12),
        point(-80.0, "#eec39a", 0.015),
        point(20.0, "#c96f5a", 0.012),
        point(90.0, "#b85644", 0.02),
        point(180.0, "#d9ae8c", 0.12),
        point(320.0, "#ecdcc4", 0.6),
        point(700.0, "#f5ebdb", 0.92),
        point(1800.0, "#fdf8ef", 0.98),
    ],
);

const PRESETS: [Preset; 10] = [
    CT_SKIN_BONE,
    ct(
        "ct_bone",
        "Bone",
        "Bone alone, opaque.",
        &[
            point(140.0, "#b98a63", 0.0),
            point(240.0, "#d9b892", 0.12),
            point(400.0, "#eadac2", 0.65),
            point(800.0, "#f4ebdc", 0.93),
            point(1800.0, "#fdf9f1", 0.98),
        ],
    ),
    ct(
        "ct_skin",
        "Skin",
        "The body's surface, opaque.",
        &[
            point(-500.0, "#d69a7c", 0.0),
            point(-350.0, "#e0a98b", 0.35),
            point(-150.0, "#ebbd9f", 0.9),
            point(300.0, "#f3d3b8", 0.96),
        ],
    ),
    ct(
        "ct_muscle",
        "Muscle and bone",
        "Muscle and organs without fat and skin, over bone.",
        &[
            point(-20.0, "#8f2f2a", 0.0),
            point(30.0, "#a63c34", 0.1),
            point(70.0, "#bd5546", 0.3),
            point(130.0, "#c9745c", 0.35),
            point(220.0, "#e3c3a1", 0.6),
            point(500.0, "#f2e6d4", 0.92),
            point(1800.0, "#fdf8ef", 0.98),
        ],
    ),
    ct(
        "ct_soft_tissue",
        "Soft tissue",
        "Fat, muscle and organs as a haze, bone within.",
        &[
            point(-180.0, "#e6c07a", 0.0),
            point(-90.0, "#e9c98c", 0.008),
            point(-20.0, "#d98f6a", 0.006),
            point(40.0, "#bf4f45", 0.03),
            point(100.0, "#cc6a55", 0.05),
            point(250.0, "#ead2b4", 0.25),
            point(700.0, "#f7eddd", 0.8),
        ],
    ),
    ct(
        "ct_lung",
        "Lung",
        "Lung tissue, airway walls and vessels; no bone, no air.",
        &[
            point(-950.0, "#5f7fa3", 0.0),
            point(-850.0, "#7fa3bd", 0.004),
            point(-700.0, "#d9a8a0", 0.02),
            point(-550.0, "#e39a8c", 0.06),
            point(-400.0, "#e8b09c", 0.08),
            point(-250.0, "#f0c8b0", 0.02),
            point(-100.0, "#f3d3bf", 0.0),
        ],
    ),
    ct(
        "ct_vessels",
        "Contrast-filled vessels",
        "CT angiography: vessels with contrast agent, bone pale beside them.",
        &[
            point(110.0, "#7d1414", 0.0),
            point(170.0, "#a81e1a", 0.12),
            point(260.0, "#cf3a26", 0.45),
            point(400.0, "#e58a5a", 0.55),
            point(600.0, "#f0dcc0", 0.7),
            point(1500.0, "#fbf4e6", 0.95),
        ],
    ),
    relative(
        "mr_default",
        "MR tissue",
        "MR",
        "Soft tissue of magnetic resonance images; brighter is denser.",
        &[
            point(0.1, "#4a1f1c", 0.0),
            point(0.22, "#8a4534", 0.04),
            point(0.4, "#c98a66", 0.2),
            point(0.6, "#e8c3a0", 0.5),
            point(0.8, "#f6e6d2", 0.85),
            point(1.0, "#ffffff", 0.95),
        ],
    ),
    relative(
        "mr_vessels",
        "MR angiography",
        "MR",
        "The brightest structures alone: flowing blood.",
        &[
            point(0.3, "#5c0f12", 0.0),
            point(0.45, "#a3211f", 0.25),
            point(0.65, "#d9573a", 0.7),
            point(1.0, "#ffe2bd", 0.97),
        ],
    ),
    relative(
        "gray_ramp",
        "Gray ramp",
        "OT",
        "Brightness and opacity grow with the value.",
        &[point(0.0, "#000000", 0.0), point(1.0, "#ffffff", 0.5)],
    ),
];
