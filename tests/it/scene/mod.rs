//! Scene documents, transfer functions, cameras and history.

mod automatic;
mod defaults;
mod framing;
mod history;
mod patch;
mod presets;
mod refused;
mod round_trip;
mod transfer_table;

use glam::DVec3;
use serde_json::{Value, json};
use spao_server::scene::{HistogramView, Scene, SceneDocument, SceneError, VolumeFacts};
use spao_server::volume::{CodeMap, Grid, VolumeId};

/// Owns what [`VolumeFacts`] borrows.
struct TestVolume {
    id: VolumeId,
    grid: Grid,
    code_map: CodeMap,
    counts: Vec<u64>,
    integer: bool,
}

impl TestVolume {
    /// Bin i of `counts` is centred on the i-th of as many values spread over `[lowest, highest]`.
    fn new(lowest: f64, highest: f64, counts: Vec<u64>, integer: bool) -> Self {
        let grid = Grid::axis_aligned([40, 30, 20], DVec3::new(1.0, 2.0, 3.0));
        let code_map =
            if integer { CodeMap::for_integers(lowest, highest) } else { CodeMap::for_floats(lowest, highest) };
        Self { id: VolumeId("v_1".into()), grid, code_map, counts, integer }
    }

    /// An 8-bit ramp: every value as often as any other.
    fn eight_bit() -> Self {
        Self::new(0.0, 255.0, vec![10; 256], true)
    }

    fn facts(&self) -> VolumeFacts<'_> {
        let [lowest, highest] = self.code_map.value_range();
        VolumeFacts {
            id: &self.id,
            grid: &self.grid,
            value_range: [lowest, highest],
            code_map: &self.code_map,
            histogram: HistogramView { counts: &self.counts, range: [lowest, highest] },
            integer: self.integer,
        }
    }
}

/// Reads and completes a document against the 8-bit test volume.
fn scene(json: &Value) -> Result<Scene, SceneError> {
    let volume = TestVolume::eight_bit();
    SceneDocument::from_json(json)?.complete(&volume.facts())
}

/// The scene of a document that says nothing.
fn default_scene() -> Scene {
    scene(&json!({"volume": "v_1"})).expect("a volume is all that is required")
}
