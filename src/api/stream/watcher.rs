//! One client's view of a scene: what it has been told, what it shall see next, and when.

use std::cell::Cell;
use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};
use tokio::sync::watch;
use tokio::time::{Instant, sleep_until};

use super::messages::{self, Ack, Awaited, FrameHeader, Hello, Incoming, PROTOCOL, Update, Visibility};
use super::outbox::Outbox;
use super::pictures::{Order, Picture, Preparation, Task, draw};
use super::quality::Quality;
use super::view::{patched, seen_through, side};
use crate::api::AppState;
use crate::encode::ImageFormat;
use crate::error::{ApiError, ErrorCode};
use crate::renderer::{AoReport, AoState, AoUpdate};
use crate::scene::merge_patch_between;
use crate::session::{SceneChange, SceneEntry, SceneSnapshot, View};

/// Input has stopped when nothing came for so long; the final picture follows.
const SETTLED: Duration = Duration::from_millis(200);
/// An update of ambient occlusion that an edit has overtaken may go on for so long, counted from its beginning: it is
/// nearer to what is wanted than what is there, and if each edit ended it none would ever be done while a slider moves.
const OVERTAKEN: Duration = Duration::from_secs(2);
/// Changes of one client that follow each other within this time are one step of undo.
const SAME_GESTURE: Duration = Duration::from_millis(700);
/// Time between two tries when the renderer is busy.
const RETRY: Duration = Duration::from_millis(100);
/// Time between two `progress` messages.
const PROGRESS: Duration = Duration::from_millis(200);
/// Most pictures on their way to a client, whatever it asks for: what it does not take is memory here.
const MOST_IN_FLIGHT: u32 = 8;

pub(super) struct Watcher {
    state: AppState,
    entry: Arc<SceneEntry>,
    resume_token: String,
    encoding: ImageFormat,
    max_in_flight: usize,
    view: View,
    /// The last update that was applied.
    seq: u64,
    /// Updates since the last picture was begun.
    updates: u64,
    visible: bool,
    /// The scene as the client knows it.
    told: SceneSnapshot,
    /// When this client last changed the scene, and to which revision.
    own_change: Option<(Instant, u64)>,
    next_frame: u64,
    unacknowledged: VecDeque<u64>,
    /// Something is to be seen that no picture shows or is being drawn to show.
    stale: bool,
    final_due: bool,
    last_input: Instant,
    /// The last picture was drawn with accessibility that is not what the scene asks for.
    refining: bool,
    retry_at: Option<Instant>,
    progress_at: Instant,
    /// When to look whether the picture waits for its volume, and whether that was told.
    volume_at: Instant,
    volume_told: bool,
    /// A picture, and whether it is a moving one.
    drawing: Option<(bool, Task<Result<Picture, ApiError>>)>,
    preparation: Option<Preparation>,
    /// What was computed for pictures to come, until one tells it.
    prepared: Option<AoReport>,
    /// The last accessibility whose work a picture has told.
    told_version: u64,
    quality: Quality,
}

/// What comes of the work that a watcher has begun.
pub(super) enum Work {
    Picture(Result<Picture, ApiError>),
    Prepared(Result<AoReport, ApiError>),
    Progress,
    /// A picture is not there yet.
    Drawing,
    /// It is time for something.
    Due,
}

impl Drop for Watcher {
    fn drop(&mut self) {
        self.state.resume.end(&self.resume_token);
    }
}

impl Watcher {
    pub(super) fn new(state: AppState, entry: Arc<SceneEntry>, hello: &Hello) -> Result<Self, ApiError> {
        let told = entry.snapshot();
        let max_axis = state.limits.max_image_axis;
        let max_in_flight = hello.max_in_flight.unwrap_or(2);
        if max_in_flight == 0 {
            return Err(ApiError::invalid("max_in_flight", "expected at least 1"));
        }
        // Before the token is spent.
        for (name, pixels) in [("width", hello.width), ("height", hello.height)] {
            pixels.map_or(Ok(1), |pixels| side(name, pixels, max_axis))?;
        }
        let kept = hello.resume.as_ref().and_then(|token| state.resume.take(token, &told.id));
        let viewport = told.scene.viewport;
        let view = kept.unwrap_or(View {
            camera: None,
            width: viewport.width.min(max_axis),
            height: viewport.height.min(max_axis),
        });
        let view =
            View { width: hello.width.unwrap_or(view.width), height: hello.height.unwrap_or(view.height), ..view };
        let quality = Quality::new(state.renderer.info().software);
        let resume_token = state.resume.begin(&told.id, view.clone());
        let now = Instant::now();
        Ok(Self {
            state,
            entry,
            resume_token,
            encoding: hello.encodings.iter().find_map(|name| ImageFormat::from_name(name)).unwrap_or(ImageFormat::Png),
            max_in_flight: max_in_flight.min(MOST_IN_FLIGHT) as usize,
            view,
            seq: 0,
            updates: 0,
            visible: true,
            told,
            own_change: None,
            next_frame: 1,
            unacknowledged: VecDeque::new(),
            stale: true,
            final_due: true,
            last_input: now,
            refining: false,
            retry_at: None,
            progress_at: now,
            volume_at: now,
            volume_told: false,
            drawing: None,
            preparation: None,
            prepared: None,
            told_version: 0,
            quality,
        })
    }

    pub(super) fn welcome(&self) -> Value {
        let info = self.state.renderer.info();
        let seen = seen_through(&self.told.scene, &self.view);
        json!({
            "type": "welcome",
            "protocol": PROTOCOL,
            "scene": self.told.to_json(),
            "revision": self.told.revision,
            "view": {
                "camera": seen.to_json()["camera"],
                "width": self.view.width,
                "height": self.view.height,
            },
            "server": {
                "version": env!("CARGO_PKG_VERSION"),
                "adapter": info.adapter,
                "software": info.software,
            },
            "max_in_flight": self.max_in_flight,
            "resume_token": self.resume_token,
        })
    }

    /// Starts what is due: a picture, and ambient occlusion for the next ones.
    pub(super) fn begin_work(&mut self) {
        let now = Instant::now();
        if self.retry_at.is_some_and(|at| at > now) {
            return;
        }
        self.retry_at = None;
        let overtaken = |p: &Preparation| !p.scene.same_occlusion(&self.told.scene);
        if self.preparation.as_ref().is_some_and(|p| overtaken(p) && p.begun + OVERTAKEN <= now) {
            self.preparation = None;
            self.refining = true;
        }
        if self.refining && self.preparation.is_none() {
            self.refining = false;
            let scene = self.told.scene.clone();
            self.preparation = Some(Preparation::start(&self.state, self.entry.id(), scene));
        }
        // A final picture that is out of date already is not worth its wait.
        if self.stale && self.drawing.as_ref().is_some_and(|d| !d.0) {
            self.drawing = None;
        }
        if !self.may_draw() {
            return;
        }
        if self.stale {
            self.order(true);
        } else if self.final_due && self.last_input + SETTLED <= now {
            // What it needs goes on from where an overtaken update is, and would wait for that.
            let wanted = &self.told.scene;
            self.preparation.take_if(|p| !p.scene.same_occlusion(wanted));
            self.order(false);
        }
    }

    /// Whether a picture may be begun.
    fn may_draw(&self) -> bool {
        self.drawing.is_none() && self.visible && self.unacknowledged.len() < self.max_in_flight
    }

    fn order(&mut self, moving: bool) {
        let view = [self.view.width, self.view.height];
        let size = if moving { self.quality.moving_size(view[0], view[1]) } else { view };
        // A still picture is lossless; one that lets a page shine through must at least have an alpha channel.
        let transparent = self.told.scene.rendering.background.0[3] < 1.0;
        let encoding = match self.encoding {
            ImageFormat::Jpeg if transparent => ImageFormat::Png,
            preferred if moving => preferred,
            _ => ImageFormat::Png,
        };
        let order = Order {
            scene: seen_through(&self.told.scene, &self.view),
            revision: self.told.revision,
            seq: self.seq,
            dropped: self.updates.saturating_sub(1),
            size,
            encoding,
            moving,
            full_size: size == view,
        };
        self.updates = 0;
        self.stale = false;
        self.final_due = moving;
        self.drawing = Some((moving, draw(&self.state, self.entry.id(), order)));
    }

    /// When there is something to do without anything happening.
    fn due(&self) -> Option<Instant> {
        if self.retry_at.is_some() {
            return self.retry_at;
        }
        (self.final_due && !self.stale && self.may_draw()).then(|| self.last_input + SETTLED)
    }

    /// Waits for work in progress, or until some is due. May be dropped and called again.
    pub(super) async fn work(&mut self) -> Work {
        let due = self.due();
        let look = self.drawing.is_some().then_some(self.volume_at + PROGRESS);
        let (prepared, progress) = match &mut self.preparation {
            Some(p) => (Some(&mut p.task), Some(&mut p.progress)),
            None => (None, None),
        };
        tokio::select! {
            result = optional(self.drawing.as_mut().map(|d| d.1.result())) => Work::Picture(result.and_then(|r| r)),
            result = optional(prepared.map(Task::result)) => Work::Prepared(result.and_then(|r| r)),
            Ok(()) = optional(progress.map(watch::Receiver::changed)) => Work::Progress,
            () = optional(due.map(sleep_until)) => Work::Due,
            () = optional(look.map(sleep_until)) => Work::Drawing,
        }
    }

    /// Takes over what [`Watcher::work`] has waited for.
    pub(super) fn worked(&mut self, work: Work, out: &Outbox) {
        match work {
            Work::Picture(Ok(picture)) => self.show(picture, out),
            Work::Picture(Err(error)) => self.picture_failed(&error, out),
            Work::Prepared(result) => {
                // What was overtaken is followed by what is wanted now.
                let done = self.preparation.take();
                self.refining |= done.is_some_and(|p| !p.scene.same_occlusion(&self.told.scene));
                match result {
                    Ok(report) => {
                        let is_news = report.update != AoUpdate::Cached && report.version > self.told_version;
                        self.prepared = Some(report).filter(|_| is_news);
                        out.say(&messages::progress(Awaited::AmbientOcclusion, 1.0));
                    }
                    Err(error) if error.code == ErrorCode::Busy => {
                        self.refining = true;
                        self.retry_at = Some(Instant::now() + RETRY);
                    }
                    // The final picture meets the same error and tells it.
                    Err(_) => {}
                }
            }
            Work::Progress => self.tell_progress(out),
            Work::Drawing => self.tell_volume(out),
            Work::Due => {}
        }
    }

    /// Does what the client says; an error comes with the `seq` that it belongs to.
    pub(super) fn hear(&mut self, text: &str, out: &Outbox) -> Result<(), (ApiError, Option<u64>)> {
        match messages::parse(text)? {
            Incoming::Hello(_) => {
                return Err((ApiError::new(ErrorCode::Invalid, "`hello` was said already"), None));
            }
            Incoming::Update(update) => {
                let seq = update.seq;
                self.update(update, out).map_err(|error| (error, Some(seq)))?;
            }
            Incoming::Ack(Ack { frame }) => {
                if frame >= self.next_frame {
                    return Err((ApiError::invalid("frame", format!("there is no frame {frame} yet")), None));
                }
                self.unacknowledged.retain(|&sent| sent > frame);
            }
            Incoming::Visibility(Visibility { visible }) => {
                self.stale |= visible && !self.visible;
                self.visible = visible;
            }
            Incoming::Refresh => self.stale = true,
        }
        Ok(())
    }

    fn update(&mut self, update: Update, out: &Outbox) -> Result<(), ApiError> {
        if update.seq <= self.seq {
            return Err(ApiError::invalid("seq", format!("expected more than {}, got {}", self.seq, update.seq)));
        }
        let view = match update.view {
            None => None,
            Some(view) => {
                let scene = &self.told.scene;
                let volume = self.state.volumes.get(&scene.volume.0)?;
                Some(patched(&self.view, view, scene, &volume, self.state.limits.max_image_axis)?)
            }
        };
        if let Some(patch) = &update.scene {
            self.change_scene(patch, out)?;
        }
        if let Some(view) = view {
            self.state.resume.update(&self.resume_token, &view);
            self.view = view;
        }
        self.seq = update.seq;
        self.updates += 1;
        self.input();
        Ok(())
    }

    fn change_scene(&mut self, patch: &Value, out: &Outbox) -> Result<(), ApiError> {
        let gesture = self.own_change.filter(|(at, _)| at.elapsed() < SAME_GESTURE);
        let change = match gesture {
            Some((_, revision)) => SceneChange::Amend(patch, revision),
            None => SceneChange::Patch(patch),
        };
        let before = Cell::new(0);
        let told_before = |revision| {
            before.set(revision);
            true
        };
        let snapshot = self.entry.change(&self.state.volumes, told_before, change).map_err(|mut error| {
            // Paths of a message begin at the message.
            if let Some(path) = error.details.as_mut().and_then(|d| d.get_mut("path")) {
                *path = match path.as_str() {
                    None | Some("$") => "scene".into(),
                    Some(inner) => format!("scene.{inner}").into(),
                };
            }
            error
        })?;
        // A patch that changes nothing begins no gesture: what follows must not continue somebody else's change, of which
        // this client may not have been told yet.
        if snapshot.revision > before.get() {
            self.own_change = Some((Instant::now(), snapshot.revision));
        }
        self.catch_up(&snapshot, Some(patch), out);
        Ok(())
    }

    /// Takes the scene's state over, and tells the client what it cannot know by itself: everything but `own`,
    /// the patch that it has just sent.
    pub(super) fn catch_up(&mut self, now: &SceneSnapshot, own: Option<&Value>, out: &Outbox) {
        if now.revision <= self.told.revision {
            return;
        }
        if own.is_none() || now.revision > self.told.revision + 1 {
            let mut known = self.told.scene.to_json();
            if let Some(own) = own {
                json_patch::merge(&mut known, own);
            }
            let patch = merge_patch_between(&known, &now.scene.to_json());
            out.say(&json!({ "type": "scene", "revision": now.revision, "patch": patch }));
        }
        self.told = now.clone();
        self.input();
    }

    fn input(&mut self) {
        self.last_input = Instant::now();
        self.stale = true;
    }

    fn show(&mut self, picture: Picture, out: &Outbox) {
        self.drawing = None;
        if std::mem::take(&mut self.volume_told) {
            out.say(&messages::progress(Awaited::Volume, 1.0));
        }
        let Picture { order, bytes, mut ao, timings, encode } = picture;
        // The picture has found in the cache what was computed for it beforehand.
        let prepared = self.prepared.take_if(|report| report.version == ao.version);
        if let (Some(report), AoUpdate::Cached) = (prepared, ao.update) {
            ao = AoReport { state: ao.state, ..report };
        }
        if ao.update != AoUpdate::Cached {
            self.told_version = self.told_version.max(ao.version);
        }
        if order.moving {
            // With its wait for others: where many share the device, each gets smaller pictures instead of fewer.
            self.quality.observe(timings.queue + timings.raycast + timings.readback + encode);
        }
        self.refining |= ao.state == AoState::Refining;
        let header = FrameHeader {
            frame: self.next_frame,
            seq: order.seq,
            scene_revision: order.revision,
            width: order.size[0],
            height: order.size[1],
            encoding: order.encoding,
            bytes: bytes.len(),
            moving: order.moving,
            exact: order.full_size && order.encoding != ImageFormat::Jpeg && ao.state != AoState::Refining,
            dropped: order.dropped,
            ao,
            timings,
            encode,
        };
        out.say(&header.to_json());
        out.picture(bytes);
        self.unacknowledged.push_back(self.next_frame);
        self.next_frame += 1;
    }

    fn picture_failed(&mut self, error: &ApiError, out: &Outbox) {
        let moving = self.drawing.take().is_some_and(|d| d.0);
        if error.code == ErrorCode::Busy {
            self.retry_at = Some(Instant::now() + RETRY);
            self.stale |= moving;
            self.final_due = true;
        } else {
            // Trying again would fail again; the next change is another matter.
            self.final_due = false;
            out.say(&messages::error(error, Some(self.seq).filter(|&seq| seq > 0)));
        }
    }

    fn tell_progress(&mut self, out: &Outbox) {
        if let Some(preparation) = &self.preparation
            && self.progress_at.elapsed() >= PROGRESS
        {
            self.progress_at = Instant::now();
            out.say(&messages::progress(Awaited::AmbientOcclusion, *preparation.progress.borrow()));
        }
    }

    /// A volume that had made room for another takes seconds to come back.
    fn tell_volume(&mut self, out: &Outbox) {
        self.volume_at = Instant::now();
        let fraction = self.state.renderer.arriving(&self.told.scene.volume);
        if let Some(fraction) = fraction.or_else(|| self.volume_told.then_some(1.0)) {
            out.say(&messages::progress(Awaited::Volume, fraction));
        }
        self.volume_told = fraction.is_some();
    }
}

/// Waits for a future if there is one, and for ever otherwise.
async fn optional<F: Future>(future: Option<F>) -> F::Output {
    match future {
        Some(future) => future.await,
        None => std::future::pending().await,
    }
}
