//! The handle: what async code may ask of the render thread.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot, watch};

use super::jobs::{self, Job, Work};
use crate::gpu::GpuOptions;
use crate::renderer::{
    AccessibilityVolume, AoReport, Frame, FrameRequest, MemoryUse, RenderError, Renderer, RendererInfo, Residency,
};
use crate::scene::Scene;
use crate::volume::{LoadWatch, Volume, VolumeId};

/// Jobs that may wait. More than this many pictures ahead of one in line is seconds of delay even on a
/// fast adapter: better to say "busy" at once.
const WAITING_JOBS: usize = 64;

/// Group of jobs that belong to no stream.
const SINGLE_JOBS: &str = "";

/// State that the render thread publishes and handles read without asking it.
#[derive(Debug)]
pub(super) struct Published {
    pub(super) info: RendererInfo,
    pub(super) alive: AtomicBool,
    pub(super) memory: Mutex<MemoryUse>,
    /// Volumes on the GPU and their bytes.
    pub(super) residents: Mutex<Vec<(VolumeId, u64)>>,
    /// Volumes on their way back there, and the share that is there.
    pub(super) arriving: Mutex<Vec<(VolumeId, f64)>>,
}

/// Asks the render thread for work. Cheap to clone.
#[derive(Clone, Debug)]
pub struct RenderHandle {
    jobs: mpsc::Sender<Job>,
    published: Arc<Published>,
}

/// Joins the render thread; ask it to end by dropping every handle.
#[derive(Debug)]
pub struct RenderThread {
    thread: JoinHandle<()>,
}

impl RenderHandle {
    /// Opens the adapter on a new thread and answers once it is usable.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`] or [`RenderError::Device`] when no device can be had.
    pub fn spawn(options: GpuOptions) -> Result<(Self, RenderThread), RenderError> {
        let (job_tx, job_rx) = mpsc::channel(WAITING_JOBS);
        let (ready_tx, ready_rx) = std::sync::mpsc::sync_channel(1);
        let thread = std::thread::Builder::new()
            .name("render".into())
            .spawn(move || {
                let renderer = match Renderer::new(&options) {
                    Ok(renderer) => renderer,
                    Err(error) => {
                        let _ = ready_tx.send(Err(error));
                        return;
                    }
                };
                let published = Arc::new(Published {
                    info: renderer.info().clone(),
                    alive: AtomicBool::new(true),
                    memory: Mutex::new(renderer.memory()),
                    residents: Mutex::default(),
                    arriving: Mutex::default(),
                });
                let _alive = AliveGuard(published.clone());
                if ready_tx.send(Ok(published.clone())).is_ok() {
                    jobs::run(renderer, job_rx, &published);
                }
            })
            .map_err(|e| RenderError::Device(format!("cannot start the render thread: {e}")))?;
        let published = ready_rx.recv().map_err(|_| RenderError::Gone)??;
        Ok((Self { jobs: job_tx, published }, RenderThread { thread }))
    }

    /// The adapter in use.
    pub fn info(&self) -> &RendererInfo {
        &self.published.info
    }

    /// False once the render thread has ended, however it ended.
    pub fn is_alive(&self) -> bool {
        self.published.alive.load(Ordering::Acquire)
    }

    /// GPU memory in use after the last finished job.
    pub fn memory(&self) -> MemoryUse {
        self.published.memory.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Bytes of a volume on the GPU after the last finished job; `None` while it is in host memory only.
    pub fn gpu_bytes(&self, id: &VolumeId) -> Option<u64> {
        let residents = self.published.residents.lock().unwrap_or_else(PoisonError::into_inner);
        residents.iter().find(|r| &r.0 == id).map(|r| r.1)
    }

    /// Share of a volume that is on the GPU again while a job brings it back, in [0, 1].
    pub fn arriving(&self, id: &VolumeId) -> Option<f64> {
        let arriving = self.published.arriving.lock().unwrap_or_else(PoisonError::into_inner);
        arriving.iter().find(|a| &a.0 == id).map(|a| a.1)
    }

    /// Makes a volume resident under `id`, replacing nothing on failure.
    ///
    /// # Errors
    /// [`RenderError::DoesNotFit`], [`RenderError::AxisTooLong`], [`RenderError::Busy`], [`RenderError::Gone`].
    pub async fn add_volume(&self, id: VolumeId, volume: Arc<Volume>) -> Result<Residency, RenderError> {
        self.add_watched_volume(id, volume, Arc::default()).await
    }

    /// [`RenderHandle::add_volume`] that tells how far it is, and may be called off.
    ///
    /// # Errors
    /// As [`RenderHandle::add_volume`], and [`RenderError::Cancelled`].
    pub async fn add_watched_volume(
        &self,
        id: VolumeId,
        volume: Arc<Volume>,
        watch: Arc<LoadWatch>,
    ) -> Result<Residency, RenderError> {
        self.ask(|reply| Work::AddVolume { id, volume, watch, reply }).await
    }

    /// Frees a volume and all that was derived from it; unknown ids are fine.
    ///
    /// # Errors
    /// [`RenderError::Busy`], [`RenderError::Gone`].
    pub async fn remove_volume(&self, id: VolumeId) -> Result<(), RenderError> {
        self.ask(|reply| Work::RemoveVolume { id, reply }).await
    }

    /// Draws one picture, in turn with all other single pictures.
    ///
    /// # Errors
    /// Any [`RenderError`] of this picture.
    pub async fn render(&self, request: FrameRequest) -> Result<Frame, RenderError> {
        self.render_in(SINGLE_JOBS, request).await
    }

    /// Draws one picture of a stream. Groups take turns, whatever the number of jobs in them.
    ///
    /// # Errors
    /// Any [`RenderError`] of this picture.
    pub async fn render_in(&self, group: &str, request: FrameRequest) -> Result<Frame, RenderError> {
        self.ask_in(group, |reply| Work::Frame { request, reply }).await
    }

    /// Computes the ambient occlusion of a scene ahead of its pictures; `progress` gets the share that is done.
    /// Dropping the future ends the work unless somebody else waits for it too.
    ///
    /// # Errors
    /// Any [`RenderError`] of this job.
    pub async fn prepare_in(
        &self,
        group: &str,
        scene: Arc<Scene>,
        progress: watch::Sender<f64>,
    ) -> Result<AoReport, RenderError> {
        self.ask_in(group, |reply| Work::Prepare { scene, progress, reply }).await
    }

    /// The accessibility volume of a scene's ambient-occlusion settings.
    ///
    /// # Errors
    /// Any [`RenderError`] of this job.
    pub async fn accessibility(&self, scene: Arc<Scene>) -> Result<AccessibilityVolume, RenderError> {
        self.ask(|reply| Work::Accessibility { scene, reply }).await
    }

    async fn ask<T>(
        &self,
        work: impl FnOnce(oneshot::Sender<Result<T, RenderError>>) -> Work,
    ) -> Result<T, RenderError> {
        self.ask_in(SINGLE_JOBS, work).await
    }

    async fn ask_in<T>(
        &self,
        group: &str,
        work: impl FnOnce(oneshot::Sender<Result<T, RenderError>>) -> Work,
    ) -> Result<T, RenderError> {
        let (reply, answer) = oneshot::channel();
        let job = Job { work: work(reply), group: group.into(), submitted: Instant::now() };
        self.jobs.try_send(job).map_err(|e| match e {
            mpsc::error::TrySendError::Full(_) => RenderError::Busy,
            mpsc::error::TrySendError::Closed(_) => RenderError::Gone,
        })?;
        answer.await.map_err(|_| RenderError::Gone)?
    }
}

impl RenderThread {
    /// Waits until the thread has ended, at most `deadline`; true when it has.
    pub fn join(self, deadline: Duration) -> bool {
        let until = Instant::now() + deadline;
        while !self.thread.is_finished() {
            if Instant::now() >= until {
                return false;
            }
            std::thread::sleep(Duration::from_millis(5));
        }
        self.thread.join().is_ok()
    }
}

/// Marks the renderer dead however its thread ends, a panic included.
struct AliveGuard(Arc<Published>);

impl Drop for AliveGuard {
    fn drop(&mut self) {
        self.0.alive.store(false, Ordering::Release);
    }
}
