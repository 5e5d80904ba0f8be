//! `ao`: the accessibility volume into a file.

use anyhow::Context;
use serde_json::{Map, Value, json};

use super::local;
use crate::array_file::{ArrayFormat, write_accessibility};
use crate::config::AoArgs;

pub(super) fn run(args: &AoArgs) -> anyhow::Result<()> {
    let format = ArrayFormat::from_path(&args.output).context("the output's name should end in .npy or .nrrd")?;
    let (mut renderer, volume) = local::resident(&args.volume, &args.gpu)?;
    let scene = local::scene(&volume, args.scene.as_deref(), &json!({ "ambient_occlusion": settings(args) }))?;
    let accessibility = renderer.accessibility(scene)?;
    let file = write_accessibility(&accessibility, &volume.volume.grid, format);
    std::fs::write(&args.output, file).with_context(|| format!("cannot write {}", args.output.display()))
}

/// The flags that were given, by their names in a scene; the scene's own checks say what is wrong with them.
fn settings(args: &AoArgs) -> Map<String, Value> {
    let radius =
        args.radius.as_ref().map(|text| text.parse().map_or_else(|_| json!(text), |voxels: f64| json!(voxels)));
    let given = [
        ("method", args.method.as_ref().map(|v| json!(v))),
        ("structure", args.structure.as_ref().map(|v| json!(v))),
        ("levels", args.levels.map(|v| json!(v))),
        ("mip_levels", args.mip_levels.map(|v| json!(v))),
        ("normal_factor", args.normal_factor.map(|v| json!(v))),
        ("rays", args.rays.map(|v| json!(v))),
        ("radius", radius),
    ];
    given.into_iter().filter_map(|(name, value)| Some((name.to_owned(), value?))).collect()
}
