//! The render thread's loop: jobs take turns, one slice of work each.

use std::sync::Arc;
use std::sync::PoisonError;
use std::time::{Duration, Instant};

use tokio::sync::{mpsc, oneshot, watch};

use super::handle::Published;
use super::turns::Turns;
use crate::renderer::{
    AccessibilityJob, AccessibilityVolume, AoReport, Frame, FrameJob, FrameRequest, PrepareJob, RenderError, Renderer,
    Residency, StageTimings, Turn, UploadJob,
};
use crate::scene::Scene;
use crate::volume::{LoadStage, LoadWatch, Volume, VolumeId};

/// Jobs that take turns; the others wait in the channel. Enough for a job of every group on a busy server, few
/// enough that their scratch memory stays bounded.
const ACTIVE_JOBS: usize = 32;

type Reply<T> = oneshot::Sender<Result<T, RenderError>>;

/// What is asked.
#[derive(Debug)]
pub(super) enum Work {
    AddVolume { id: VolumeId, volume: Arc<Volume>, watch: Arc<LoadWatch>, reply: Reply<Residency> },
    RemoveVolume { id: VolumeId, reply: Reply<()> },
    Frame { request: FrameRequest, reply: Reply<Frame> },
    Accessibility { scene: Arc<Scene>, reply: Reply<AccessibilityVolume> },
    Prepare { scene: Arc<Scene>, progress: watch::Sender<f64>, reply: Reply<AoReport> },
}

/// A request and when it was made.
#[derive(Debug)]
pub(super) struct Job {
    pub(super) work: Work,
    pub(super) group: Arc<str>,
    pub(super) submitted: Instant,
}

/// A job that has had its first turn.
enum Active {
    Upload(UploadJob, Arc<LoadWatch>, Reply<Residency>),
    Frame(FrameJob, Reply<Frame>, Instant),
    Accessibility(AccessibilityJob, Reply<AccessibilityVolume>, Instant),
    Prepare(PrepareJob, watch::Sender<f64>, Reply<AoReport>),
}

/// Serves jobs until every handle is dropped, or the device is lost.
pub(super) fn run(mut renderer: Renderer, mut jobs: mpsc::Receiver<Job>, published: &Published) {
    let mut turns = Turns::default();
    loop {
        if turns.is_empty() {
            let Some(job) = jobs.blocking_recv() else { return };
            begin(job, &mut renderer, &mut turns);
        }
        while turns.len() < ACTIVE_JOBS {
            let Ok(job) = jobs.try_recv() else { break };
            begin(job, &mut renderer, &mut turns);
        }
        let outcome = turns.pop().map(|(group, job)| (group, take_turn(job, &mut renderer)));
        // Before the answer: whoever has it reads what is in use now.
        *published.memory.lock().unwrap_or_else(PoisonError::into_inner) = renderer.memory();
        *published.residents.lock().unwrap_or_else(PoisonError::into_inner) = renderer.residents();
        *published.arriving.lock().unwrap_or_else(PoisonError::into_inner) = renderer.arriving();
        match outcome {
            Some((group, Outcome::Unfinished(job))) => turns.push(group, *job),
            Some((_, Outcome::Answered(answer))) => answer(),
            None => {}
        }
        if renderer.is_lost() {
            // The handle's `is_alive` turns false with this thread; waiting jobs are answered `Gone`.
            tracing::error!("the graphics device is lost; the render thread ends");
            return;
        }
    }
}

fn begin(job: Job, renderer: &mut Renderer, turns: &mut Turns<Active>) {
    let submitted = job.submitted;
    let active = match job.work {
        Work::AddVolume { id, volume, watch, reply } => Active::Upload(UploadJob::new(id, volume), watch, reply),
        Work::RemoveVolume { id, reply } => {
            renderer.remove_volume(&id);
            let _ = reply.send(Ok(()));
            return;
        }
        Work::Frame { request, reply } => Active::Frame(FrameJob::new(request), reply, submitted),
        Work::Accessibility { scene, reply } => Active::Accessibility(AccessibilityJob::new(scene), reply, submitted),
        Work::Prepare { scene, progress, reply } => Active::Prepare(PrepareJob::new(scene), progress, reply),
    };
    turns.push(job.group, active);
}

/// What a turn came to.
enum Outcome {
    /// The job needs more turns.
    Unfinished(Box<Active>),
    /// The job is over; to be called to tell its client.
    Answered(Box<dyn FnOnce()>),
}

/// Advances a job whose client still waits.
fn take_turn(job: Active, renderer: &mut Renderer) -> Outcome {
    match job {
        // An upload that was called off leaves nothing. One whose client merely left goes on to its end: the
        // client's side then removes the volume, which it can only do for one that is there.
        Active::Upload(_, watch, reply) if watch.is_cancelled() => answer(reply, Err(RenderError::Cancelled)),
        Active::Upload(mut job, watch, reply) => match job.advance(renderer) {
            Ok(Turn::Pending(fraction)) => {
                watch.report(LoadStage::Uploading, fraction);
                Outcome::Unfinished(Box::new(Active::Upload(job, watch, reply)))
            }
            Ok(Turn::Done(residency)) => answer(reply, Ok(residency)),
            Err(error) => answer(reply, Err(error)),
        },
        Active::Frame(mut job, reply, submitted) if !reply.is_closed() => match job.advance(renderer) {
            Ok(Turn::Pending(_)) => Outcome::Unfinished(Box::new(Active::Frame(job, reply, submitted))),
            Ok(Turn::Done(mut frame)) => {
                frame.timings.queue = waited(submitted, &frame.timings);
                answer(reply, Ok(frame))
            }
            Err(error) => answer(reply, Err(error)),
        },
        Active::Accessibility(mut job, reply, submitted) if !reply.is_closed() => match job.advance(renderer) {
            Ok(Turn::Pending(_)) => Outcome::Unfinished(Box::new(Active::Accessibility(job, reply, submitted))),
            Ok(Turn::Done(mut volume)) => {
                volume.timings.queue = waited(submitted, &volume.timings);
                answer(reply, Ok(volume))
            }
            Err(error) => answer(reply, Err(error)),
        },
        Active::Prepare(mut job, progress, reply) if !reply.is_closed() => match job.advance(renderer) {
            Ok(Turn::Pending(fraction)) => {
                progress.send_replace(fraction);
                Outcome::Unfinished(Box::new(Active::Prepare(job, progress, reply)))
            }
            Ok(Turn::Done(report)) => answer(reply, Ok(report)),
            Err(error) => answer(reply, Err(error)),
        },
        // Whoever asked has left.
        Active::Frame(..) | Active::Accessibility(..) | Active::Prepare(..) => Outcome::Answered(Box::new(|| ())),
    }
}

fn answer<T: 'static>(reply: Reply<T>, result: Result<T, RenderError>) -> Outcome {
    Outcome::Answered(Box::new(move || drop(reply.send(result))))
}

/// Time in which others had their turns.
fn waited(submitted: Instant, timings: &StageTimings) -> Duration {
    submitted.elapsed().saturating_sub(timings.ao + timings.raycast + timings.readback)
}
