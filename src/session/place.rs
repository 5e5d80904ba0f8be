//! A place among the volumes for one that is on its way, and what becomes of it.

use std::sync::{Arc, OnceLock};
use std::time::{Duration, SystemTime};

use serde_json::{Value, json};
use tokio::sync::Notify;

use super::entry::{NewVolume, VolumeEntry, describe, describe_nothing, merge};
use super::rfc3339;
use super::volumes::VolumeStore;
use crate::error::{ApiError, ErrorCode};
use crate::render_thread::RenderHandle;
use crate::renderer::RenderError;
use crate::volume::{LoadProgress, LoadStage, LoadWatch, Volume, VolumeId};

/// Time between two tries to give a volume back to a busy renderer.
const RELEASE_RETRY: Duration = Duration::from_millis(50);

/// Who waits for a volume.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Waiting {
    /// Whoever asked: a failure is the answer, and leaves no trace.
    Asker,
    /// Nobody: a failure is listed until it is deleted.
    Nobody,
}

/// A volume on its way.
#[derive(Debug)]
pub struct Loading {
    pub(super) id: VolumeId,
    pub(super) name: String,
    pub(super) source: Value,
    pub(super) created_at: SystemTime,
    pub(super) waiting: Waiting,
    watch: Arc<LoadWatch>,
    /// Wakes whoever waits for more than the watch can end.
    cancelled: Notify,
    /// What the volume's JSON says, once it is known.
    known: OnceLock<Value>,
}

impl Loading {
    pub(super) fn new(id: VolumeId, name: String, source: Value, waiting: Waiting) -> Self {
        Self {
            id,
            name,
            source,
            created_at: SystemTime::now(),
            waiting,
            watch: Arc::new(LoadWatch::new(LoadStage::Fetching)),
            cancelled: Notify::new(),
            known: OnceLock::new(),
        }
    }

    /// Its name in URLs, now and later.
    pub fn id(&self) -> &VolumeId {
        &self.id
    }

    /// How far it is.
    pub fn watch(&self) -> &Arc<LoadWatch> {
        &self.watch
    }

    /// From now on it is known what the volume is.
    pub fn reveal(&self, volume: &Volume) {
        let mut json = describe(volume);
        merge(&mut json, json!({ "host_bytes": volume.host_bytes() }));
        let _ = self.known.set(json);
    }

    /// Ends once the load is called off.
    pub async fn cancelled(&self) {
        if !self.watch.is_cancelled() {
            self.cancelled.notified().await;
        }
    }

    /// Calls the load off.
    pub(super) fn cancel(&self) {
        self.watch.cancel();
        // Kept until somebody waits for it.
        self.cancelled.notify_one();
    }

    /// The volume as the API shows it.
    pub fn to_json(&self) -> Value {
        let mut json = json!({ "id": self.id.0, "name": self.name, "state": "loading" });
        json["progress"] = progress_json(self.watch.progress());
        merge(&mut json, unloaded(&self.source, self.created_at));
        if let Some(known) = self.known.get() {
            merge(&mut json, known.clone());
        }
        json
    }

    /// Why it cannot be used yet.
    pub(super) fn not_ready(&self) -> ApiError {
        let progress = self.watch.progress();
        let percent = (100.0 * progress.fraction).round();
        let message = format!("volume `{}` is being loaded ({}, {percent} %)", self.id, progress.stage.name());
        let details = json!({ "volume": self.id.0, "state": "loading", "progress": progress_json(progress) });
        ApiError::new(ErrorCode::VolumeNotReady, message).with_details(details)
    }
}

fn progress_json(progress: LoadProgress) -> Value {
    json!({ "what": progress.stage.name(), "fraction": progress.fraction })
}

/// What is told of a volume that is not there.
fn unloaded(source: &Value, created_at: SystemTime) -> Value {
    let mut json = describe_nothing();
    let rest = json!({
        "gpu_bytes": 0, "host_bytes": 0, "sha256": null, "source": source, "created_at": rfc3339(created_at),
    });
    merge(&mut json, rest);
    json
}

/// A volume that could not be loaded, and that nobody waited for.
#[derive(Debug)]
pub(super) struct Failed {
    loading: Arc<Loading>,
    error: ApiError,
}

impl Failed {
    /// The volume as the API shows it.
    pub(super) fn to_json(&self) -> Value {
        let Loading { id, name, source, created_at, .. } = &*self.loading;
        let mut json = json!({ "id": id.0, "name": name, "state": "failed", "error": self.error.to_json() });
        merge(&mut json, unloaded(source, *created_at));
        json
    }

    /// Why it cannot be used.
    pub(super) fn not_ready(&self) -> ApiError {
        let message = format!("volume `{}` could not be loaded: {}", self.loading.id, self.error);
        let details = json!({ "volume": self.loading.id.0, "state": "failed", "error": self.error.to_json() });
        ApiError::new(ErrorCode::VolumeNotReady, message).with_details(details)
    }
}

/// A place for one more volume. Dropped before it is filled, it is given back, and the load called off.
#[derive(Debug)]
pub struct Place {
    pub(super) store: Arc<VolumeStore>,
    pub(super) loading: Arc<Loading>,
}

impl Place {
    /// The volume that is to come.
    pub fn loading(&self) -> &Arc<Loading> {
        &self.loading
    }

    /// Uploads to the GPU and keeps the volume. Nothing remains on the GPU when this fails or is dropped half-way.
    ///
    /// # Errors
    /// What the renderer says; `volume_cancelled`.
    pub async fn fill(&self, new: NewVolume) -> Result<Arc<VolumeEntry>, ApiError> {
        let Loading { id, source, created_at, watch, .. } = &*self.loading;
        watch.report(LoadStage::Uploading, 0.0);
        let upload = Uploaded::upload(self.store.renderer.clone(), id.clone(), new.volume.clone(), watch.clone());
        // A task of its own: it must not be forgotten what lies on the GPU, whoever waits for it.
        let uploaded = tokio::spawn(upload).await.map_err(ApiError::internal)??;
        let entry = Arc::new(VolumeEntry {
            id: id.clone(),
            name: new.name,
            volume: new.volume,
            histogram: new.histogram,
            sha256: new.sha256,
            source: source.clone(),
            created_at: *created_at,
            thumbnail: OnceLock::new(),
        });
        if !self.store.settle(entry.clone()) {
            return Err(ApiError::volume_cancelled());
        }
        uploaded.keep();
        Ok(entry)
    }

    /// Gives the place up because of a failure, which stays listed, unless the volume was deleted meanwhile.
    pub fn fail(self, error: ApiError) {
        self.store.keep_failure(Failed { loading: self.loading.clone(), error }, &self.loading.id);
    }
}

impl Drop for Place {
    fn drop(&mut self) {
        self.loading.cancel();
        self.store.forget_loading(&self.loading.id);
    }
}

/// A volume on the GPU that nobody knows of yet; taken off again when dropped.
struct Uploaded {
    renderer: RenderHandle,
    id: Option<VolumeId>,
}

impl Uploaded {
    async fn upload(
        renderer: RenderHandle,
        id: VolumeId,
        volume: Arc<Volume>,
        watch: Arc<LoadWatch>,
    ) -> Result<Self, RenderError> {
        renderer.add_watched_volume(id.clone(), volume, watch).await?;
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
pub(super) async fn release(renderer: RenderHandle, id: VolumeId) {
    while let Err(RenderError::Busy) = renderer.remove_volume(id.clone()).await {
        tokio::time::sleep(RELEASE_RETRY).await;
    }
}
