//! A volume that is there, and what is told of it.

use std::sync::{Arc, OnceLock};
use std::time::SystemTime;

use serde_json::{Value, json};

use super::rfc3339;
use crate::scene::{HistogramView, VolumeFacts};
use crate::volume::{GrayPicture, Histogram, Volume, VolumeId};

/// One loaded volume and where it came from.
#[derive(Debug)]
pub struct VolumeEntry {
    /// Its name in URLs.
    pub id: VolumeId,
    /// Its name for people.
    pub name: String,
    /// The host copy.
    pub volume: Arc<Volume>,
    /// Values over 256 bins, from which a scene's defaults are derived.
    pub histogram: Histogram,
    /// See [`Volume::sha256_hex`].
    pub sha256: String,
    /// What was asked for: `{"upload": ...}`, `{"path": ...}`, `{"url": ...}` or `{"procedural": ...}`.
    pub source: Value,
    /// When its loading began.
    pub created_at: SystemTime,
    /// Made when it is asked for first.
    pub(super) thumbnail: OnceLock<GrayPicture>,
}

impl VolumeEntry {
    /// See [`Volume::thumbnail`]. The first call reads every voxel: never on an async worker.
    pub fn thumbnail(&self) -> &GrayPicture {
        self.thumbnail.get_or_init(|| self.volume.thumbnail())
    }

    /// What a scene of this volume is completed with.
    pub fn facts(&self) -> VolumeFacts<'_> {
        volume_facts(&self.id, &self.volume, &self.histogram)
    }

    /// The volume as the API shows it, with its bytes on the GPU if it is there.
    pub(super) fn to_json(&self, gpu_bytes: Option<u64>) -> Value {
        let state = if gpu_bytes.is_some() { "resident" } else { "evicted" };
        let mut json = json!({ "id": self.id.0, "name": self.name, "state": state });
        merge(&mut json, describe(&self.volume));
        let rest = json!({
            "gpu_bytes": gpu_bytes.unwrap_or(0),
            "host_bytes": self.volume.host_bytes(),
            "sha256": self.sha256,
            "source": self.source,
            "created_at": rfc3339(self.created_at),
        });
        merge(&mut json, rest);
        if !self.volume.about.notes.is_empty() {
            json["notes"] = json!(self.volume.about.notes);
        }
        json
    }
}

/// Geometry and values of a volume, the part of its JSON that does not depend on where it lives.
pub fn describe(volume: &Volume) -> Value {
    let grid = &volume.grid;
    json!({
        "dims": grid.dims,
        "spacing": grid.spacing.to_array(),
        "origin": grid.origin.to_array(),
        "direction": grid.direction.map(|axis| axis.to_array()),
        "voxel_type": volume.voxels.voxel_type(),
        "value_range": volume.code_map.value_range(),
        "resolution": volume.resolution,
    })
}

/// [`describe`] of a volume of which nothing is known yet.
pub(super) fn describe_nothing() -> Value {
    json!({
        "dims": null, "spacing": null, "origin": null, "direction": null, "voxel_type": null, "value_range": null,
        "resolution": null,
    })
}

/// Adds the fields of one object to another.
pub(super) fn merge(into: &mut Value, from: Value) {
    if let (Value::Object(into), Value::Object(from)) = (into, from) {
        into.extend(from);
    }
}

/// What a scene of a volume is completed with.
pub fn volume_facts<'a>(id: &'a VolumeId, volume: &'a Volume, histogram: &'a Histogram) -> VolumeFacts<'a> {
    VolumeFacts {
        id,
        grid: &volume.grid,
        value_range: volume.code_map.value_range(),
        code_map: &volume.code_map,
        histogram: HistogramView { counts: &histogram.counts, range: histogram.range },
        integer: volume.voxels.voxel_type().is_integer(),
    }
}

/// A volume in host memory, with all that is derived from its voxels.
#[derive(Debug)]
pub struct NewVolume {
    /// For people.
    pub name: String,
    /// The host copy.
    pub volume: Arc<Volume>,
    /// See [`VolumeEntry::histogram`].
    pub histogram: Histogram,
    /// See [`VolumeEntry::sha256`].
    pub sha256: String,
}
