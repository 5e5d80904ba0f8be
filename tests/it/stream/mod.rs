//! The stream, against the real program and over a real socket.

mod client;
mod endings;
mod floods;
mod hello;
mod keys;
mod occlusion;
mod pacing;
mod parts;
mod updates;
mod views;

use serde_json::{Value, json};

use crate::support::process::Process;

const HEAD: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/visible-human-head-128.nrrd");

/// The path of the scene that comes with a server's first volume.
const SCENE: &str = "/v1/scenes/default";

/// A server with a small volume, whose pictures are quick.
fn small() -> Process {
    Process::start(&["--volume", "procedural:gyroid:24"])
}

/// A patch of the camera that turns it about the target.
fn turned(camera: &Value, degrees: f64) -> Value {
    let number = |name: &str, axis: usize| camera[name][axis].as_f64().expect("a number");
    let [x, y] = [0, 1].map(|axis| number("eye", axis) - number("target", axis));
    let (sin, cos) = degrees.to_radians().sin_cos();
    let eye = [number("target", 0) + cos * x - sin * y, number("target", 1) + sin * x + cos * y, number("eye", 2)];
    json!({ "camera": { "eye": eye } })
}
