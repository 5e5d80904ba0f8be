//! What pictures are exposed by. That the measure of open surfaces is right, `ao::surface` tests; that pictures use
//! it, `head`.

use serde_json::{Value, json};
use spao_server::renderer::exposure;

use super::support::{Studio, boxes};

#[test]
fn exposure_follows_the_scene_first_and_the_surface_otherwise() {
    let studio = Studio::new(boxes());
    let of = |document: &Value, reference: f64| {
        let chosen = exposure(&studio.scene(document), reference);
        (chosen.factor, chosen.inverse_reference)
    };
    assert_eq!(of(&json!({"lighting": {"exposure": 2.5}}), 0.25), (2.5, 0.0));
    assert_eq!(of(&json!({"ambient_occlusion": {"method": "off"}}), 0.25), (1.0, 0.0));
    assert_eq!(of(&json!({}), 0.25), (1.0, 4.0));
    assert_eq!(of(&json!({"ambient_occlusion": {"strength": 0.5}}), 0.25), (1.0, 1.6));
    assert_eq!(of(&json!({"ambient_occlusion": {"strength": 0.0}}), 0.25), (1.0, 1.0));
    // What is seen is a cavity and looks like one.
    assert_eq!(of(&json!({}), 1e-6), (1.0, 64.0));
}
