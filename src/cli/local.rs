//! A volume and its scene without a server, for subcommands that make one file.

use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, bail};
use serde_json::{Value, json};

use crate::config::GpuArgs;
use crate::renderer::Renderer;
use crate::scene::{Scene, SceneDocument};
use crate::session::{LoadRequest, NewVolume, Room, volume_facts};
use crate::volume::{Limits, VolumeId};

/// Longest scene file: none that a person wrote is a tenth of this.
const MAX_SCENE_BYTES: u64 = 16 << 20;

/// A volume in host memory, named on the command line; averaged where there is no room for all of it.
pub(super) fn load(argument: &str, room: Option<&Room>) -> anyhow::Result<NewVolume> {
    let load = || LoadRequest::from_argument(argument)?.prepare(&Limits::default(), room);
    load().with_context(|| format!("cannot load {argument}"))
}

/// The scene of a file, or the default one, with `patch` merged into it, of the volume at hand.
pub(super) fn scene(volume: &NewVolume, file: Option<&Path>, patch: &Value) -> anyhow::Result<Arc<Scene>> {
    let mut json = match file {
        None => json!({}),
        Some(path) => read_json(path).with_context(|| format!("cannot read {}", path.display()))?,
    };
    let Value::Object(fields) = &mut json else { bail!("a scene must be a JSON object") };
    // What a server answered names its own ids; here there is one volume.
    fields.retain(|name, _| name != "id" && name != "revision");
    fields.insert("volume".into(), volume_id().0.into());
    json_patch::merge(&mut json, patch);
    let id = volume_id();
    let scene = SceneDocument::from_json(&json)?.complete(&volume_facts(&id, &volume.volume, &volume.histogram))?;
    Ok(Arc::new(scene))
}

/// A renderer with a volume resident that is named on the command line.
pub(super) fn resident(argument: &str, gpu: &GpuArgs) -> anyhow::Result<(Renderer, NewVolume)> {
    let mut renderer = Renderer::new(&gpu.options())?;
    let room = Room::of(renderer.info(), renderer.memory().budget_bytes);
    let volume = load(argument, Some(&room))?;
    renderer.add_volume(volume_id(), volume.volume.clone())?;
    Ok((renderer, volume))
}

fn volume_id() -> VolumeId {
    VolumeId("volume".into())
}

fn read_json(path: &Path) -> anyhow::Result<Value> {
    let length = std::fs::metadata(path)?.len();
    if length > MAX_SCENE_BYTES {
        bail!("{length} bytes are too many for a scene; at most {MAX_SCENE_BYTES}");
    }
    Ok(serde_json::from_slice(&std::fs::read(path)?)?)
}
