//! What every handler can reach.

use std::ops::Deref;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::{OwnedSemaphorePermit, Semaphore, SemaphorePermit, watch};

use super::ApiKeys;
use crate::config::{Limits, ServeArgs};
use crate::error::{ApiError, ErrorCode};
use crate::render_thread::RenderHandle;
use crate::session::{Admission, ResumeStore, Room, SceneStore, VolumeStore};
use crate::sources::Sources;
use crate::volume;

/// Bytes of the largest voxel type.
const LARGEST_VOXEL_BYTES: u64 = 8;

/// Shared state of the server; cheap to clone.
#[derive(Clone, Debug)]
pub struct AppState(Arc<Shared>);

/// See [`AppState`].
#[derive(Debug)]
pub struct Shared {
    /// Asks the render thread.
    pub renderer: RenderHandle,
    /// Resident volumes.
    pub volumes: Arc<VolumeStore>,
    /// Scenes.
    pub scenes: SceneStore,
    /// What clients may ask for at most.
    pub limits: Limits,
    /// Keys that open the server.
    pub keys: ApiKeys,
    /// Origins that browsers may call from.
    pub allow_origins: Vec<String>,
    /// Where `source.path` starts.
    pub data_dir: Option<PathBuf>,
    /// What may be fetched from elsewhere.
    pub sources: Sources,
    /// Whether what may name a patient is shown.
    pub keep_identity: bool,
    /// Starting, serving, draining.
    pub lifecycle: Lifecycle,
    /// Bounds the volumes that are being loaded.
    pub loads: Admission,
    /// Views of streams that were cut off.
    pub resume: ResumeStore,
    renders: Semaphore,
    streams: Arc<Semaphore>,
}

impl Deref for AppState {
    type Target = Shared;

    fn deref(&self) -> &Shared {
        &self.0
    }
}

impl AppState {
    /// A server without volumes and scenes, in the phase [`Phase::Starting`].
    pub fn new(config: &ServeArgs, renderer: RenderHandle) -> Self {
        let limits = config.limits.clone();
        let volumes = VolumeStore::new(renderer.clone(), limits.max_volumes);
        Self(Arc::new(Shared {
            scenes: SceneStore::new(volumes.clone(), limits.max_scenes),
            volumes,
            renderer,
            keys: ApiKeys::new(&config.api_keys),
            allow_origins: config.allow_origins.clone(),
            data_dir: config.data_dir.clone(),
            sources: Sources::new(config.allow_sources.clone(), config.allow_private_sources, limits.request_timeout),
            keep_identity: config.keep_identity,
            lifecycle: Lifecycle::default(),
            loads: Admission::new(Limits::CONCURRENT_LOADS, Limits::WAITING_LOADS),
            resume: ResumeStore::default(),
            renders: Semaphore::new(Limits::CONCURRENT_RENDERS),
            streams: Arc::new(Semaphore::new(Limits::CONCURRENT_STREAMS)),
            limits,
        }))
    }

    /// Takes one of the places for pictures in progress.
    ///
    /// # Errors
    /// `busy`.
    pub fn render_slot(&self) -> Result<SemaphorePermit<'_>, ApiError> {
        self.renders.try_acquire().map_err(|_| ApiError::busy())
    }

    /// Takes one of the places for streams, for as long as the connection lives.
    ///
    /// # Errors
    /// `busy`.
    pub fn stream_place(&self) -> Result<OwnedSemaphorePermit, ApiError> {
        self.streams.clone().try_acquire_owned().map_err(|_| ApiError::busy())
    }

    /// `Err` with the reason while the server cannot work.
    ///
    /// # Errors
    /// `not_ready`.
    pub fn ready(&self) -> Result<(), ApiError> {
        let (reason, message) = match self.lifecycle.phase() {
            Phase::Starting => ("starting", "the server is starting"),
            Phase::Draining => ("draining", "the server is shutting down"),
            Phase::Serving if !self.renderer.is_alive() => ("renderer_gone", "the renderer is gone"),
            Phase::Serving => return Ok(()),
        };
        Err(ApiError::new(ErrorCode::NotReady, message).with_details(json!({ "reason": reason })))
    }

    /// The limits of the volume readers: an axis that the adapter cannot take is refused before anything is read.
    pub fn volume_limits(&self) -> volume::Limits {
        let max_voxels = self.limits.max_voxels;
        let max_axis = self.renderer.info().max_volume_axis;
        volume::Limits { max_axis, max_voxels, max_bytes: max_voxels.saturating_mul(LARGEST_VOXEL_BYTES) }
    }

    /// What the GPU has room for, if nothing else were there.
    pub fn room(&self) -> Room {
        Room::of(self.renderer.info(), self.renderer.memory().budget_bytes)
    }

    /// The limits as `GET /v1/server` shows them.
    pub fn limits_json(&self) -> Value {
        let limits = &self.limits;
        json!({
            "max_upload_bytes": limits.max_upload_bytes,
            "max_voxels": limits.max_voxels,
            "max_volume_axis": self.renderer.info().max_volume_axis,
            "max_image_axis": limits.max_image_axis,
            "max_volumes": limits.max_volumes,
            "max_scenes": limits.max_scenes,
            "max_json_bytes": Limits::MAX_JSON_BYTES,
            "max_histogram_bins": Limits::MAX_HISTOGRAM_BINS,
            "request_timeout_s": limits.request_timeout.as_secs_f64(),
        })
    }
}

/// What the server is doing as a whole.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Phase {
    /// Volumes of the command line are being loaded.
    Starting,
    /// Open.
    Serving,
    /// No new work; requests in flight finish.
    Draining,
}

/// The phase, and how many requests are in flight.
#[derive(Debug)]
pub struct Lifecycle {
    phase: watch::Sender<Phase>,
    in_flight: watch::Sender<usize>,
}

impl Default for Lifecycle {
    fn default() -> Self {
        Self { phase: watch::Sender::new(Phase::Starting), in_flight: watch::Sender::new(0) }
    }
}

impl Lifecycle {
    /// What the server is doing.
    pub fn phase(&self) -> Phase {
        *self.phase.borrow()
    }

    /// Goes on to a later phase; an earlier one is ignored, so that a drain during the start stays one.
    pub fn enter(&self, phase: Phase) {
        self.phase.send_if_modified(|current| {
            let later = phase > *current;
            *current = phase.max(*current);
            later
        });
    }

    /// Tells every new phase, for connections that outlive a request.
    pub fn watch(&self) -> watch::Receiver<Phase> {
        self.phase.subscribe()
    }

    /// Counts a request until the answer is dropped.
    pub fn count_request(&self) -> InFlight<'_> {
        self.in_flight.send_modify(|n| *n += 1);
        InFlight(self)
    }

    /// Waits until nothing is in flight, at most `deadline`; true when it is so.
    pub async fn idle(&self, deadline: Duration) -> bool {
        let mut in_flight = self.in_flight.subscribe();
        tokio::time::timeout(deadline, in_flight.wait_for(|&n| n == 0)).await.is_ok()
    }
}

/// One request in flight.
#[derive(Debug)]
pub struct InFlight<'a>(&'a Lifecycle);

impl Drop for InFlight<'_> {
    fn drop(&mut self) {
        self.0.in_flight.send_modify(|n| *n -= 1);
    }
}
