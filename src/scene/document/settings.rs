//! The sections `ambient_occlusion`, `lighting` and `viewport` of a scene document. None of them depends on the
//! volume, so they become their final types at once; their defaults are those of the types.

use glam::DVec3;
use serde_json::{Number, Value};

use super::check::{self, Interval};
use super::shape::{AmbientOcclusionShape, LightingShape, ViewportShape};
use crate::scene::{AmbientOcclusion, AoMethod, AoStructure, Lighting, Radius, Rgb, SceneError, Viewport};

const METHODS: [(&str, AoMethod); 3] =
    [("off", AoMethod::Off), ("spao", AoMethod::Spao), ("raytraced", AoMethod::Raytraced)];

/// Methods of the contract that do not exist yet.
const METHODS_NOT_YET: [&str; 8] =
    ["directional", "vao_cdf", "vao_gaussian", "vao_penner", "vicinity", "obscurances", "local", "histogram"];

const STRUCTURES: [(&str, AoStructure); 3] =
    [("n_buffer", AoStructure::NBuffer), ("mipmap", AoStructure::Mipmap), ("hybrid", AoStructure::Hybrid)];

/// Ranges of the Blinn-Phong coefficients.
const COEFFICIENT: Interval = Interval::Closed(0.0, 4.0);

/// Largest side of a picture in pixels.
const MAX_SIDE: u32 = 16384;

pub(super) fn ambient_occlusion_from_shape(shape: &AmbientOcclusionShape) -> Result<AmbientOcclusion, SceneError> {
    let default = AmbientOcclusion::default();
    let method = shape.method.as_deref();
    let structure = shape.structure.as_deref();
    let levels = check::whole_number_or("ambient_occlusion.levels", shape.levels.as_ref(), (1, 8), default.levels)?;
    let number = |field: &str, given: &Option<Number>, high: f64, default: f64| {
        check::number_or(&format!("ambient_occlusion.{field}"), given.as_ref(), Interval::Closed(0.0, high), default)
    };
    let color_bleeding = number("color_bleeding", &shape.color_bleeding, 1.0, default.color_bleeding)?;
    if color_bleeding != 0.0 {
        let message = "colour bleeding is known, but this server does not implement it yet; available: 0";
        return Err(SceneError::not_implemented("ambient_occlusion.color_bleeding", message));
    }
    Ok(AmbientOcclusion {
        method: check::implemented_or(
            "ambient_occlusion.method",
            method,
            (&METHODS, &METHODS_NOT_YET),
            default.method,
        )?,
        structure: check::named_or("ambient_occlusion.structure", structure, &STRUCTURES, default.structure)?,
        levels,
        mip_levels: check::whole_number_or(
            "ambient_occlusion.mip_levels",
            shape.mip_levels.as_ref(),
            (0, levels),
            default.mip_levels,
        )?,
        normal_factor: number("normal_factor", &shape.normal_factor, 2.0, default.normal_factor)?,
        strength: number("strength", &shape.strength, 1.0, default.strength)?,
        rays: check::whole_number_or("ambient_occlusion.rays", shape.rays.as_ref(), (1, 4096), default.rays)?,
        radius: radius(shape.radius.as_ref())?,
        falloff: number("falloff", &shape.falloff, 8.0, default.falloff)?,
        color_bleeding,
    })
}

pub(super) fn ambient_occlusion_to_shape(ao: &AmbientOcclusion) -> AmbientOcclusionShape {
    AmbientOcclusionShape {
        method: Some(check::name_of(ao.method, &METHODS).to_owned()),
        structure: Some(check::name_of(ao.structure, &STRUCTURES).to_owned()),
        levels: Some(ao.levels.into()),
        mip_levels: Some(ao.mip_levels.into()),
        normal_factor: Some(check::json_number(ao.normal_factor)),
        strength: Some(check::json_number(ao.strength)),
        rays: Some(ao.rays.into()),
        radius: match ao.radius {
            Radius::SameAsLevels => None,
            Radius::Voxels(voxels) => Some(check::json_number(voxels).into()),
            Radius::Unlimited => Some("unlimited".into()),
        },
        falloff: Some(check::json_number(ao.falloff)),
        color_bleeding: Some(check::json_number(ao.color_bleeding)),
    }
}

fn radius(given: Option<&Value>) -> Result<Radius, SceneError> {
    let path = "ambient_occlusion.radius";
    match given {
        None => Ok(Radius::SameAsLevels),
        Some(Value::Number(voxels)) => check::number(path, voxels, Interval::Closed(1.0, 1024.0)).map(Radius::Voxels),
        Some(Value::String(name)) if name == "unlimited" => Ok(Radius::Unlimited),
        Some(_) => Err(SceneError::invalid(path, "expected null, a number of voxels in [1, 1024] or \"unlimited\"")),
    }
}

pub(super) fn lighting_from_shape(shape: &LightingShape) -> Result<Lighting, SceneError> {
    let default = Lighting::default();
    let number = |field: &str, given: &Option<Number>, range: Interval, default: f64| {
        check::number_or(&format!("lighting.{field}"), given.as_ref(), range, default)
    };
    let direction = |given| -> Result<DVec3, SceneError> {
        let path = "lighting.direction";
        let direction = check::nonzero(path, check::vector(path, given)?)?;
        Ok(direction * check::unit_length_factor(direction))
    };
    let exposure =
        shape.exposure.as_ref().map(|given| check::number("lighting.exposure", given, Interval::Closed(0.0, 16.0)));
    Ok(Lighting {
        ambient: number("ambient", &shape.ambient, COEFFICIENT, default.ambient)?,
        diffuse: number("diffuse", &shape.diffuse, COEFFICIENT, default.diffuse)?,
        specular: number("specular", &shape.specular, COEFFICIENT, default.specular)?,
        shininess: number("shininess", &shape.shininess, Interval::Closed(1.0, 1000.0), default.shininess)?,
        direction: shape.direction.as_ref().map(direction).transpose()?,
        color: check::color("lighting.color", shape.color.as_deref(), Rgb::from_hex, default.color)?,
        exposure: exposure.transpose()?,
    })
}

pub(super) fn lighting_to_shape(lighting: &Lighting) -> LightingShape {
    LightingShape {
        ambient: Some(check::json_number(lighting.ambient)),
        diffuse: Some(check::json_number(lighting.diffuse)),
        specular: Some(check::json_number(lighting.specular)),
        shininess: Some(check::json_number(lighting.shininess)),
        direction: lighting.direction.map(check::json_triple),
        color: Some(lighting.color.to_hex()),
        exposure: lighting.exposure.map(check::json_number),
    }
}

pub(super) fn viewport_from_shape(shape: &ViewportShape) -> Result<Viewport, SceneError> {
    let default = Viewport::default();
    Ok(Viewport {
        width: check::whole_number_or("viewport.width", shape.width.as_ref(), (1, MAX_SIDE), default.width)?,
        height: check::whole_number_or("viewport.height", shape.height.as_ref(), (1, MAX_SIDE), default.height)?,
    })
}

pub(super) fn viewport_to_shape(viewport: &Viewport) -> ViewportShape {
    ViewportShape { width: Some(viewport.width.into()), height: Some(viewport.height.into()) }
}
