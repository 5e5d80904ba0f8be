//! One client's connection: its state, and what happens when.

use std::collections::VecDeque;
use std::sync::Arc;
use std::time::Duration;

use axum::extract::ws::{Message, WebSocket};
use futures_util::stream::{SplitSink, SplitStream};
use futures_util::{SinkExt as _, StreamExt as _};
use serde_json::{Value, json};
use tokio::sync::{mpsc, watch};
use tokio::time::{Instant, Interval, interval, sleep_until, timeout};

use super::messages::{self, FrameHeader, Hello, Incoming, PROTOCOL, Update};
use super::pictures::{Order, Picture, Preparation, Task, draw};
use super::quality::Quality;
use super::view::{patched, seen_through, side};
use crate::api::{AppState, Phase};
use crate::encode::ImageFormat;
use crate::error::{ApiError, ErrorCode};
use crate::renderer::AoState;
use crate::scene::merge_patch_between;
use crate::session::{ResumeStore, SceneChange, SceneEntry, SceneSnapshot, View};

/// Messages that may wait to be written. Pictures among them are bounded by what the client acknowledges.
const OUTBOX: usize = 32;
/// Room that one event may need.
const ROOM: usize = 4;
/// A client that takes nothing for so long is gone.
const WRITE_TIMEOUT: Duration = Duration::from_secs(40);
/// Two missed: closed.
const PING: Duration = Duration::from_secs(20);
/// Input has stopped when nothing came for so long; the final picture follows.
const SETTLED: Duration = Duration::from_millis(200);
/// Ambient occlusion is computed when opacities have not changed for so long.
const OPACITIES_SETTLED: Duration = Duration::from_millis(120);
/// Changes of one client that follow each other within this time are one step of undo.
const SAME_GESTURE: Duration = Duration::from_millis(700);
/// Time between two tries when the renderer is busy.
const RETRY: Duration = Duration::from_millis(100);
/// Time between two `progress` messages.
const PROGRESS: Duration = Duration::from_millis(200);
/// Most pictures on their way to a client, whatever it asks for: what it does not take is memory here.
const MOST_IN_FLIGHT: u32 = 8;

pub(super) struct Connection {
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
    opacities_changed: Instant,
    /// The last picture was drawn with accessibility that is not what the scene asks for.
    refining: bool,
    retry_at: Option<Instant>,
    progress_at: Instant,
    drawing: Option<(bool, Task<Result<Picture, ApiError>>)>,
    preparation: Option<Preparation>,
    quality: Quality,
}

/// What a connection waits for.
enum Event {
    Message(Option<Result<Message, axum::Error>>),
    Revision(u64),
    Picture(Result<Picture, ApiError>),
    Prepared(Result<(), ApiError>),
    Progress,
    Due,
    Ping,
    Draining,
    /// The writer has ended.
    Unwritable,
}

/// Why a connection ends; sent as `goodbye` where there is a reason.
struct End(Option<&'static str>);

impl Connection {
    pub(super) fn new(state: AppState, entry: Arc<SceneEntry>, hello: Hello) -> Result<Self, ApiError> {
        let told = entry.snapshot();
        let max_axis = state.limits.max_image_axis;
        let viewport = told.scene.viewport;
        let mut view = View {
            camera: None,
            width: hello.width.unwrap_or(viewport.width.min(max_axis)),
            height: hello.height.unwrap_or(viewport.height.min(max_axis)),
        };
        if let Some(kept) = hello.resume.as_ref().and_then(|token| state.resume.take(token, &told.id)) {
            view = View {
                camera: kept.camera,
                width: hello.width.unwrap_or(kept.width),
                height: hello.height.unwrap_or(kept.height),
            };
        }
        view.width = side("width", view.width, max_axis)?;
        view.height = side("height", view.height, max_axis)?;
        let max_in_flight = hello.max_in_flight.unwrap_or(2);
        if max_in_flight == 0 {
            return Err(ApiError::invalid("max_in_flight", "expected at least 1"));
        }
        let quality = Quality::new(state.renderer.info().software);
        let now = Instant::now();
        Ok(Self {
            state,
            entry,
            resume_token: ResumeStore::token(),
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
            opacities_changed: now,
            refining: false,
            retry_at: None,
            progress_at: now,
            drawing: None,
            preparation: None,
            quality,
        })
    }

    /// Serves the client until either side ends it.
    pub(super) async fn run(mut self, socket: WebSocket) {
        let (sink, mut incoming) = socket.split();
        let (out, outbox) = mpsc::channel(OUTBOX);
        let writer = tokio::spawn(write(sink, outbox));
        let mut revisions = self.entry.watch();
        let mut phases = self.state.lifecycle.watch();
        let mut ping = interval(PING);
        ping.reset();
        let mut heard = Instant::now();
        say(&out, self.welcome());
        let end = loop {
            self.begin_work();
            let event = self.next_event(&mut incoming, &out, &mut revisions, &mut phases, &mut ping).await;
            match event {
                Event::Message(_) => heard = Instant::now(),
                Event::Ping if heard.elapsed() > 2 * PING => break End(Some("timeout")),
                _ => {}
            }
            if let Err(end) = self.handle(event, &out) {
                break end;
            }
        };
        if let Some(reason) = end.0 {
            say(&out, messages::goodbye(reason));
            let _ = out.try_send(Message::Close(None));
        }
        drop(out);
        self.drawing = None;
        self.preparation = None;
        let scene = self.entry.id().to_owned();
        self.state.resume.keep(self.resume_token, &scene, self.view);
        // What is in the outbox may still go out, but nobody waits long for that.
        let _ = timeout(Duration::from_secs(2), writer).await;
    }

    async fn next_event(
        &mut self,
        incoming: &mut SplitStream<WebSocket>,
        out: &mpsc::Sender<Message>,
        revisions: &mut watch::Receiver<u64>,
        phases: &mut watch::Receiver<Phase>,
        ping: &mut Interval,
    ) -> Event {
        if out.capacity() < ROOM {
            // The client does not read. Nothing can be said to it, so it is not listened to either.
            return match out.reserve_many(ROOM).await {
                Ok(_) => Event::Due,
                Err(_) => Event::Unwritable,
            };
        }
        let due = self.due();
        let (drawing, preparation) = (&mut self.drawing, &mut self.preparation);
        let (prepared, progress) = match preparation {
            Some(p) => (Some(&mut p.task), Some(&mut p.progress)),
            None => (None, None),
        };
        tokio::select! {
            message = incoming.next() => Event::Message(message),
            Ok(()) = revisions.changed() => Event::Revision(*revisions.borrow_and_update()),
            Some(result) = optional(drawing.as_mut().map(|d| d.1.result())) => Event::Picture(result.and_then(|r| r)),
            Some(result) = optional(prepared.map(Task::result)) => Event::Prepared(result.and_then(|r| r)),
            Some(Ok(())) = optional(progress.map(watch::Receiver::changed)) => Event::Progress,
            () = sleep_until(due.unwrap_or_else(far_away)), if due.is_some() => Event::Due,
            _ = ping.tick() => Event::Ping,
            Ok(_) = phases.wait_for(|&phase| phase == Phase::Draining) => Event::Draining,
            () = out.closed() => Event::Unwritable,
        }
    }

    fn handle(&mut self, event: Event, out: &mpsc::Sender<Message>) -> Result<(), End> {
        match event {
            Event::Message(None | Some(Err(_)) | Some(Ok(Message::Close(_)))) | Event::Unwritable => {
                return Err(End(None));
            }
            Event::Message(Some(Ok(Message::Text(text)))) => {
                if let Err((error, seq)) = self.hear(&text, out) {
                    say(out, messages::error(&error, seq));
                }
            }
            Event::Message(Some(Ok(Message::Binary(_)))) => {
                let error = ApiError::new(ErrorCode::Invalid, "expected text, got a binary message");
                say(out, messages::error(&error, None));
            }
            Event::Message(Some(Ok(Message::Ping(_) | Message::Pong(_)))) | Event::Due => {}
            Event::Revision(SceneEntry::DELETED) => return Err(End(Some("scene_deleted"))),
            Event::Revision(_) => self.catch_up(&self.entry.snapshot(), None, out),
            Event::Picture(Ok(picture)) => self.show(picture, out),
            Event::Picture(Err(error)) => self.picture_failed(&error, out),
            Event::Prepared(result) => {
                self.preparation = None;
                match result {
                    Ok(()) => say(out, messages::progress(1.0)),
                    Err(error) if error.code == ErrorCode::Busy => self.retry_at = Some(Instant::now() + RETRY),
                    // The final picture meets the same error and tells it.
                    Err(_) => self.refining = false,
                }
            }
            Event::Progress => self.tell_progress(out),
            Event::Ping => drop(out.try_send(Message::Ping(axum::body::Bytes::new()))),
            Event::Draining => return Err(End(Some("draining"))),
        }
        Ok(())
    }

    /// Starts what is due: a picture, and ambient occlusion for the next ones.
    fn begin_work(&mut self) {
        let now = Instant::now();
        if self.retry_at.is_some_and(|at| at > now) {
            return;
        }
        self.retry_at = None;
        if self.preparation.as_ref().is_some_and(|p| !p.scene.same_occlusion(&self.told.scene)) {
            self.preparation = None;
        }
        if self.refining && self.preparation.is_none() && self.opacities_changed + OPACITIES_SETTLED <= now {
            self.refining = false;
            let scene = self.told.scene.clone();
            self.preparation = Some(Preparation::start(&self.state, self.entry.id(), scene));
        }
        // A final picture that is out of date already is not worth its wait.
        if self.stale && self.drawing.as_ref().is_some_and(|d| !d.0) {
            self.drawing = None;
        }
        if self.drawing.is_some() || !self.visible || self.unacknowledged.len() >= self.max_in_flight {
            return;
        }
        if self.stale {
            self.order(true);
        } else if self.final_due && self.last_input + SETTLED <= now {
            self.order(false);
        }
    }

    fn order(&mut self, moving: bool) {
        let view = [self.view.width, self.view.height];
        let size = if moving { self.quality.moving_size(view[0], view[1]) } else { view };
        let order = Order {
            scene: seen_through(&self.told.scene, &self.view),
            revision: self.told.revision,
            seq: self.seq,
            dropped: self.updates.saturating_sub(1),
            size,
            encoding: if moving { self.encoding } else { ImageFormat::Png },
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
        let settle = (self.final_due && !self.stale && self.drawing.is_none()).then(|| self.last_input + SETTLED);
        let settle = settle.filter(|_| self.visible && self.unacknowledged.len() < self.max_in_flight);
        let prepare = (self.refining && self.preparation.is_none()).then(|| self.opacities_changed + OPACITIES_SETTLED);
        [settle, prepare, self.retry_at].into_iter().flatten().min()
    }

    fn hear(&mut self, text: &str, out: &mpsc::Sender<Message>) -> Result<(), (ApiError, Option<u64>)> {
        match messages::parse(text)? {
            Incoming::Hello(_) => {
                return Err((ApiError::new(ErrorCode::Invalid, "`hello` was said already"), None));
            }
            Incoming::Update(update) => {
                let seq = update.seq;
                self.update(update, out).map_err(|error| (error, Some(seq)))?;
            }
            Incoming::Ack { frame } => {
                if frame >= self.next_frame {
                    return Err((ApiError::invalid("frame", format!("there is no frame {frame} yet")), None));
                }
                self.unacknowledged.retain(|&sent| sent > frame);
            }
            Incoming::Visibility { visible } => {
                self.stale |= visible && !self.visible;
                self.visible = visible;
            }
            Incoming::Refresh {} => self.stale = true,
        }
        Ok(())
    }

    fn update(&mut self, update: Update, out: &mpsc::Sender<Message>) -> Result<(), ApiError> {
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
            let continues = self
                .own_change
                .filter(|(at, revision)| at.elapsed() < SAME_GESTURE && *revision == self.told.revision)
                .is_some();
            let change = if continues { SceneChange::Amend(patch) } else { SceneChange::Patch(patch) };
            let snapshot = self.entry.change(&self.state.volumes, |_| true, change).map_err(|mut error| {
                // Paths of a message begin at the message.
                if let Some(path) = error.details.as_mut().and_then(|d| d.get_mut("path")) {
                    *path = format!("scene.{}", path.as_str().unwrap_or("$")).into();
                }
                error
            })?;
            self.own_change = Some((Instant::now(), snapshot.revision));
            self.catch_up(&snapshot, Some(patch), out);
        }
        self.view = view.unwrap_or_else(|| self.view.clone());
        self.seq = update.seq;
        self.updates += 1;
        self.input();
        Ok(())
    }

    /// Takes the scene's state over, and tells the client what it cannot know by itself: everything but `own`,
    /// the patch that it has just sent.
    fn catch_up(&mut self, now: &SceneSnapshot, own: Option<&Value>, out: &mpsc::Sender<Message>) {
        if now.revision <= self.told.revision {
            return;
        }
        if own.is_none() || now.revision > self.told.revision + 1 {
            let mut known = self.told.scene.to_json();
            if let Some(own) = own {
                json_patch::merge(&mut known, own);
            }
            let patch = merge_patch_between(&known, &now.scene.to_json());
            say(out, json!({ "type": "scene", "revision": now.revision, "patch": patch }));
            self.input();
        }
        if !now.scene.same_occlusion(&self.told.scene) {
            self.opacities_changed = Instant::now();
        }
        self.told = now.clone();
    }

    fn input(&mut self) {
        self.last_input = Instant::now();
        self.stale = true;
    }

    fn show(&mut self, picture: Picture, out: &mpsc::Sender<Message>) {
        self.drawing = None;
        let Picture { order, bytes, ao, timings, encode } = picture;
        if order.moving {
            self.quality.observe(timings.raycast + timings.readback + encode);
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
        say(out, header.to_json());
        let _ = out.try_send(Message::Binary(bytes));
        self.unacknowledged.push_back(self.next_frame);
        self.next_frame += 1;
    }

    fn picture_failed(&mut self, error: &ApiError, out: &mpsc::Sender<Message>) {
        let moving = self.drawing.take().is_some_and(|d| d.0);
        if error.code == ErrorCode::Busy {
            self.retry_at = Some(Instant::now() + RETRY);
            self.stale |= moving;
            self.final_due = true;
        } else {
            // Trying again would fail again; the next change is another matter.
            self.final_due = false;
            say(out, messages::error(error, Some(self.seq).filter(|&seq| seq > 0)));
        }
    }

    fn tell_progress(&mut self, out: &mpsc::Sender<Message>) {
        if let Some(preparation) = &self.preparation
            && self.progress_at.elapsed() >= PROGRESS
        {
            self.progress_at = Instant::now();
            say(out, messages::progress(*preparation.progress.borrow()));
        }
    }

    fn welcome(&self) -> Value {
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
}

/// Puts a message into the outbox. There is room for what one event says, see [`ROOM`].
fn say(out: &mpsc::Sender<Message>, message: Value) {
    let _ = out.try_send(Message::Text(message.to_string().into()));
}

/// Writes the outbox to the socket; ends when the client takes nothing any more.
async fn write(mut sink: SplitSink<WebSocket, Message>, mut outbox: mpsc::Receiver<Message>) {
    while let Some(message) = outbox.recv().await {
        let last = matches!(message, Message::Close(_));
        match timeout(WRITE_TIMEOUT, sink.send(message)).await {
            Ok(Ok(())) if !last => {}
            _ => return,
        }
    }
}

/// Waits for a future if there is one, and for ever otherwise.
async fn optional<F: Future>(future: Option<F>) -> Option<F::Output> {
    match future {
        Some(future) => Some(future.await),
        None => std::future::pending().await,
    }
}

fn far_away() -> Instant {
    Instant::now() + Duration::from_secs(3600)
}
