//! The render thread's loop: jobs take turns, one slice of work each.

use std::collections::VecDeque;
use std::sync::Arc;
use std::sync::PoisonError;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot};

use super::handle::Published;
use crate::renderer::{
    AccessibilityJob, AccessibilityVolume, Frame, FrameJob, FrameRequest, RenderError, Renderer, Residency, Turn,
    UploadJob,
};
use crate::scene::Scene;
use crate::volume::{Volume, VolumeId};

/// Jobs that take turns. More would only make each of them slower; the others wait in the channel.
const ACTIVE_JOBS: usize = 8;

type Reply<T> = oneshot::Sender<Result<T, RenderError>>;

/// What is asked.
#[derive(Debug)]
pub(super) enum Work {
    AddVolume { id: VolumeId, volume: Arc<Volume>, reply: Reply<Residency> },
    RemoveVolume { id: VolumeId, reply: Reply<()> },
    Frame { request: FrameRequest, reply: Reply<Frame> },
    Accessibility { scene: Arc<Scene>, reply: Reply<AccessibilityVolume> },
}

/// A request and when it was made.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) work: Work,
    pub(super) submitted: Instant,
}

/// A job that has had its first turn.
enum Active {
    Upload(UploadJob, Reply<Residency>),
    Frame(FrameJob, Reply<Frame>, Duration),
    Accessibility(AccessibilityJob, Reply<AccessibilityVolume>, Duration),
}

/// Serves jobs until every handle is dropped, or the device is lost.
pub(super) fn run(mut renderer: Renderer, mut jobs: mpsc::Receiver<Job>, published: &Published) {
    let mut active: VecDeque<Active> = VecDeque::new();
    loop {
        if active.is_empty() {
            let Some(job) = jobs.blocking_recv() else { return };
            active.extend(begin(job, &mut renderer));
        }
        while active.len() < ACTIVE_JOBS {
            let Ok(job) = jobs.try_recv() else { break };
            active.extend(begin(job, &mut renderer));
        }
        if let Some(job) = active.pop_front() {
            active.extend(take_turn(job, &mut renderer));
        }
        *published.memory.lock().unwrap_or_else(PoisonError::into_inner) = renderer.memory();
        if renderer.is_lost() {
            // The handle's `is_alive` turns false with this thread; waiting jobs are answered `Gone`.
            tracing::error!("the graphics device is lost; the render thread ends");
            return;
        }
    }
}

fn begin(job: Job, renderer: &mut Renderer) -> Option<Active> {
    let waited = job.submitted.elapsed();
    match job.work {
        Work::AddVolume { id, volume, reply } => Some(Active::Upload(UploadJob::new(id, volume), reply)),
        Work::RemoveVolume { id, reply } => {
            renderer.remove_volume(&id);
            let _ = reply.send(Ok(()));
            None
        }
        Work::Frame { request, reply } => Some(Active::Frame(FrameJob::new(request), reply, waited)),
        Work::Accessibility { scene, reply } => {
            Some(Active::Accessibility(AccessibilityJob::new(scene), reply, waited))
        }
    }
}

/// Advances a job; gives it back if it needs more turns and its client still waits.
fn take_turn(job: Active, renderer: &mut Renderer) -> Option<Active> {
    match job {
        Active::Upload(mut job, reply) => {
            // An upload whose client left goes on to its end: the client's side then removes the volume,
            // which it can only do for one that is there.
            match job.advance(renderer) {
                Ok(Turn::Pending(_)) => return Some(Active::Upload(job, reply)),
                Ok(Turn::Done(residency)) => drop(reply.send(Ok(residency))),
                Err(error) => drop(reply.send(Err(error))),
            }
        }
        Active::Frame(mut job, reply, waited) if !reply.is_closed() => match job.advance(renderer) {
            Ok(Turn::Pending(_)) => return Some(Active::Frame(job, reply, waited)),
            Ok(Turn::Done(mut frame)) => {
                frame.timings.queue = waited;
                drop(reply.send(Ok(frame)));
            }
            Err(error) => drop(reply.send(Err(error))),
        },
        Active::Accessibility(mut job, reply, waited) if !reply.is_closed() => match job.advance(renderer) {
            Ok(Turn::Pending(_)) => return Some(Active::Accessibility(job, reply, waited)),
            Ok(Turn::Done(mut volume)) => {
                volume.timings.queue = waited;
                drop(reply.send(Ok(volume)));
            }
            Err(error) => drop(reply.send(Err(error))),
        },
        Active::Frame(..) | Active::Accessibility(..) => {}
    }
    None
}
