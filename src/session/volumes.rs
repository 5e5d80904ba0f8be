//! The resident volumes, and who uses them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::{Duration, SystemTime};

use serde_json::{Value, json};

use super::{random_hex, rfc3339};
use crate::error::{ApiError, ErrorCode};
use crate::render_thread::RenderHandle;
use crate::renderer::RenderError;
use crate::scene::{HistogramView, VolumeFacts};
use crate::volume::{GrayPicture, Histogram, Volume, VolumeId};

/// Time between two tries to give a volume back to a busy renderer.
const RELEASE_RETRY: Duration = Duration::from_millis(50);

/// One resident volume and where it came from.
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
    /// What was asked for: `{"upload": ...}`, `{"path": ...}` or `{"procedural": ...}`.
    pub source: Value,
    /// When it became resident.
    pub created_at: SystemTime,
    /// Made when it is asked for first.
    thumbnail: OnceLock<GrayPicture>,
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
    fn to_json(&self, gpu_bytes: Option<u64>) -> Value {
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
    })
}

fn merge(into: &mut Value, from: Value) {
    if let (Value::Object(into), Value::Object(from)) = (into, from) {
        into.extend(from);
    }
}

/// The use of a volume: while it lives, the volume is not deleted without force. It holds no voxels, so a
/// volume that is deleted by force is gone from memory whoever looked at it.
#[derive(Clone, Debug)]
pub struct VolumeLease(#[expect(dead_code, reason = "only counted")] Arc<()>);

#[derive(Debug)]
struct Resident {
    entry: Arc<VolumeEntry>,
    /// One more owner than there are leases.
    users: Arc<()>,
    /// Order of creation.
    sequence: u64,
}

#[derive(Debug, Default)]
struct Inner {
    residents: HashMap<VolumeId, Resident>,
    /// Volumes on their way: they count against the limit.
    pending: usize,
    sequence: u64,
}

/// The resident volumes.
#[derive(Debug)]
pub struct VolumeStore {
    renderer: RenderHandle,
    max_volumes: usize,
    inner: Mutex<Inner>,
}

impl VolumeStore {
    /// An empty store.
    pub fn new(renderer: RenderHandle, max_volumes: usize) -> Arc<Self> {
        Arc::new(Self { renderer, max_volumes, inner: Mutex::default() })
    }

    // Nothing below panics while it holds the lock, so a poisoned one is as good as new.
    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The volumes in the order in which they came.
    pub fn list(&self) -> Vec<Arc<VolumeEntry>> {
        let inner = self.lock();
        let mut residents: Vec<_> = inner.residents.values().map(|r| (r.sequence, r.entry.clone())).collect();
        residents.sort_by_key(|(sequence, _)| *sequence);
        residents.into_iter().map(|(_, entry)| entry).collect()
    }

    /// One volume.
    ///
    /// # Errors
    /// `volume_not_found`.
    pub fn get(&self, id: &str) -> Result<Arc<VolumeEntry>, ApiError> {
        self.lease(&VolumeId(id.to_owned())).map(|(entry, _)| entry)
    }

    /// One volume, kept from deletion.
    ///
    /// # Errors
    /// `volume_not_found`.
    pub fn lease(&self, id: &VolumeId) -> Result<(Arc<VolumeEntry>, VolumeLease), ApiError> {
        let inner = self.lock();
        let resident = inner.residents.get(id).ok_or_else(|| ApiError::volume_not_found(id))?;
        Ok((resident.entry.clone(), VolumeLease(resident.users.clone())))
    }

    /// A volume as the API shows it, wherever it is now.
    pub fn to_json(&self, entry: &VolumeEntry) -> Value {
        entry.to_json(self.renderer.gpu_bytes(&entry.id))
    }

    /// Takes a place for a volume that is about to be loaded.
    ///
    /// # Errors
    /// `too_many`.
    pub fn reserve(self: &Arc<Self>) -> Result<Place, ApiError> {
        let mut inner = self.lock();
        if inner.residents.len() + inner.pending >= self.max_volumes {
            let message = format!("there may be {} volumes; delete one", self.max_volumes);
            return Err(ApiError::new(ErrorCode::TooMany, message).with_details(json!({ "limit": self.max_volumes })));
        }
        inner.pending += 1;
        Ok(Place { store: self.clone() })
    }

    /// Deletes a volume, from the GPU too.
    ///
    /// # Errors
    /// `volume_not_found`; `volume_in_use` without `force`.
    pub async fn delete(&self, id: &str, force: bool) -> Result<(), ApiError> {
        let id = VolumeId(id.to_owned());
        {
            let mut inner = self.lock();
            let resident = inner.residents.get(&id).ok_or_else(|| ApiError::volume_not_found(&id))?;
            // Leases are made under this lock only: the count cannot grow now.
            if !force && Arc::strong_count(&resident.users) > 1 {
                let message = format!("a scene looks at volume `{id}`; delete it first, or use ?force=true");
                return Err(ApiError::new(ErrorCode::VolumeInUse, message));
            }
            inner.residents.remove(&id);
        }
        // Spawned, so that a client that goes away meanwhile does not leave the textures behind.
        let _ = tokio::spawn(release(self.renderer.clone(), id)).await;
        Ok(())
    }
}

/// A place for one more volume, given back when dropped.
#[derive(Debug)]
pub struct Place {
    store: Arc<VolumeStore>,
}

impl Drop for Place {
    fn drop(&mut self) {
        self.store.lock().pending -= 1;
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

/// What is known of a volume before it is resident.
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
    /// See [`VolumeEntry::source`].
    pub source: Value,
}

impl Place {
    /// Uploads to the GPU and lists the volume. Nothing remains when this fails or is dropped half-way.
    ///
    /// # Errors
    /// What the renderer says.
    pub async fn fill(self, new: NewVolume) -> Result<Arc<VolumeEntry>, ApiError> {
        let id = VolumeId(format!("v_{}", random_hex()));
        let (renderer, volume) = (self.store.renderer.clone(), new.volume.clone());
        // A task of its own: an upload goes on to its end whoever waits for it, and must not be forgotten.
        let upload = tokio::spawn(Uploaded::upload(renderer, id.clone(), volume));
        upload.await.map_err(ApiError::internal)??.keep();
        let entry = Arc::new(VolumeEntry {
            id: id.clone(),
            name: new.name,
            volume: new.volume,
            histogram: new.histogram,
            sha256: new.sha256,
            source: new.source,
            created_at: SystemTime::now(),
            thumbnail: OnceLock::new(),
        });
        let mut inner = self.store.lock();
        inner.sequence += 1;
        let sequence = inner.sequence;
        inner.residents.insert(id, Resident { entry: entry.clone(), users: Arc::new(()), sequence });
        Ok(entry)
    }
}

/// A volume on the GPU that nobody knows of yet; taken off again when dropped.
struct Uploaded {
    renderer: RenderHandle,
    id: Option<VolumeId>,
}

impl Uploaded {
    async fn upload(renderer: RenderHandle, id: VolumeId, volume: Arc<Volume>) -> Result<Self, RenderError> {
        renderer.add_volume(id.clone(), volume).await?;
        Ok(Self { renderer, id: Some(id) })
    }

    /// Leaves the volume where it is.
    fn keep(mut self) {
        self.id = None;
    }
}

impl Drop for Uploaded {
    fn drop(&mut self) {
        if let (Some(id), Ok(runtime)) = (self.id.take(), tokio::runtime::Handle::try_current()) {
            runtime.spawn(release(self.renderer.clone(), id));
        }
    }
}

/// Frees a volume on the GPU, however busy the renderer is.
async fn release(renderer: RenderHandle, id: VolumeId) {
    while let Err(RenderError::Busy) = renderer.remove_volume(id.clone()).await {
        tokio::time::sleep(RELEASE_RETRY).await;
    }
}
