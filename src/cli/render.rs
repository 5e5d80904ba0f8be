//! `render`: one picture into a file.

use anyhow::Context;
use serde_json::json;

use super::local;
use crate::config::RenderArgs;
use crate::encode::{ImageFormat, encode};
use crate::renderer::{AoPolicy, FrameRequest};

pub(super) fn run(args: &RenderArgs) -> anyhow::Result<()> {
    let format = args.format.or_else(|| ImageFormat::from_path(&args.output));
    let format = format.context("the output's name should end in .png, .jpg or .webp, or --format say which")?;
    let (mut renderer, volume) = local::resident(&args.volume, &args.gpu)?;
    let scene = local::scene(&volume, args.scene.as_deref(), &json!({}))?;
    let width = args.width.unwrap_or(scene.viewport.width);
    let height = args.height.unwrap_or(scene.viewport.height);
    let background = scene.rendering.background;
    let frame = renderer.render(&FrameRequest { scene, width, height, ao_policy: AoPolicy::Exact })?;
    let bytes = encode(&frame, format, background)?;
    std::fs::write(&args.output, bytes).with_context(|| format!("cannot write {}", args.output.display()))
}
