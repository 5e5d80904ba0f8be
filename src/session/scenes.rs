//! The scenes: each under its own lock, with its history and a channel that tells its revision.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};
use tokio::sync::watch;

use super::entry::VolumeEntry;
use super::random_hex;
use super::volumes::{VolumeLease, VolumeStore};
use crate::error::{ApiError, ErrorCode};
use crate::scene::{HistoryError, Scene, SceneDocument, SceneHistory};
use crate::volume::VolumeId;

/// A scene as it was at one revision.
#[derive(Clone, Debug)]
pub struct SceneSnapshot {
    /// Its name in URLs.
    pub id: String,
    /// Grows with every change.
    pub revision: u64,
    /// What is looked at.
    pub scene: Arc<Scene>,
}

impl SceneSnapshot {
    /// `id` and `revision`, then the complete document.
    pub fn to_json(&self) -> Value {
        let mut json = json!({ "id": self.id, "revision": self.revision });
        if let (Value::Object(json), Value::Object(scene)) = (&mut json, self.scene.to_json()) {
            json.extend(scene);
        }
        json
    }
}

/// How a scene is to change.
#[derive(Clone, Copy, Debug)]
pub enum SceneChange<'a> {
    /// A whole document.
    Replace(&'a Value),
    /// A JSON Merge Patch (RFC 7396).
    Patch(&'a Value),
    /// A merge patch that continues the change which made a revision: undo takes both back at once. Where the scene
    /// has moved on since, it is a change of its own.
    Amend(&'a Value, u64),
    /// One change back.
    Undo,
    /// One undo back.
    Redo,
}

/// One scene.
#[derive(Debug)]
pub struct SceneEntry {
    id: String,
    /// Order of creation.
    sequence: u64,
    state: Mutex<State>,
    revision: watch::Sender<u64>,
}

#[derive(Debug)]
struct State {
    history: SceneHistory,
    /// Held for as long as the scene looks at the volume.
    _lease: VolumeLease,
}

impl SceneEntry {
    /// Told in place of a revision when the scene is deleted.
    pub const DELETED: u64 = u64::MAX;

    // A panic under the lock leaves the state as it was: changes are assigned last.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The scene as it is now.
    pub fn snapshot(&self) -> SceneSnapshot {
        self.snapshot_of(&self.lock())
    }

    /// Its name in URLs.
    pub fn id(&self) -> &str {
        &self.id
    }

    /// Tells every new revision; [`SceneEntry::DELETED`] is the last.
    pub fn watch(&self) -> watch::Receiver<u64> {
        self.revision.subscribe()
    }

    fn snapshot_of(&self, state: &State) -> SceneSnapshot {
        SceneSnapshot { id: self.id.clone(), revision: state.history.revision(), scene: state.history.scene().clone() }
    }

    /// Changes the scene if `allowed` says so of the revision it has; on failure it stays what it was.
    ///
    /// # Errors
    /// `revision_mismatch`, `volume_not_found`, `nothing_to_undo`, or what is wrong with the document.
    pub fn change(
        &self,
        volumes: &VolumeStore,
        allowed: impl Fn(u64) -> bool,
        change: SceneChange<'_>,
    ) -> Result<SceneSnapshot, ApiError> {
        let mut state = self.lock();
        let revision = state.history.revision();
        if !allowed(revision) {
            return Err(revision_mismatch(revision));
        }
        let mut history = state.history.clone();
        let lease = match change {
            SceneChange::Replace(json) => {
                let (scene, lease) = complete(&SceneDocument::from_json(json)?, volumes)?;
                history.replace(scene);
                lease
            }
            SceneChange::Patch(patch) | SceneChange::Amend(patch, _) => {
                let (scene, lease) = complete(&history.scene().patched_document(patch)?, volumes)?;
                if matches!(change, SceneChange::Amend(_, continued) if continued == revision) {
                    history.amend(scene);
                } else {
                    history.replace(scene);
                }
                lease
            }
            SceneChange::Undo | SceneChange::Redo => {
                let mut passed_over = None;
                loop {
                    let moved = if matches!(change, SceneChange::Undo) { history.undo() } else { history.redo() };
                    let nothing = |error: HistoryError| ApiError::new(ErrorCode::NothingToUndo, error.to_string());
                    moved.map_err(|error| passed_over.take().unwrap_or_else(|| nothing(error)))?;
                    // What the scene was of a volume that has been deleted since is passed over.
                    match lease(volumes, &history.scene().volume, "volume") {
                        Err(error) if error.code == ErrorCode::VolumeNotFound => passed_over = Some(error),
                        leased => break leased?.1,
                    }
                }
            }
        };
        *state = State { history, _lease: lease };
        let snapshot = self.snapshot_of(&state);
        self.revision.send_replace(snapshot.revision);
        Ok(snapshot)
    }
}

/// Fills in a document's defaults from its volume, and keeps the volume from deletion.
fn complete(document: &SceneDocument, volumes: &VolumeStore) -> Result<(Scene, VolumeLease), ApiError> {
    let (entry, lease) = lease(volumes, document.volume(), "volume")?;
    Ok((document.complete(&entry.facts())?, lease))
}

/// A scene's volume; that it is missing is the fault of the field `volume`.
fn lease(volumes: &VolumeStore, id: &VolumeId, path: &str) -> Result<(Arc<VolumeEntry>, VolumeLease), ApiError> {
    volumes.lease(id).map_err(|error| error.with_detail("path", path))
}

#[derive(Debug, Default)]
struct Inner {
    scenes: HashMap<String, Arc<SceneEntry>>,
    sequence: u64,
}

/// The scenes.
#[derive(Debug)]
pub struct SceneStore {
    volumes: Arc<VolumeStore>,
    max_scenes: usize,
    inner: Mutex<Inner>,
}

impl SceneStore {
    /// An empty store.
    pub fn new(volumes: Arc<VolumeStore>, max_scenes: usize) -> Self {
        Self { volumes, max_scenes, inner: Mutex::default() }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The scenes in the order in which they came.
    pub fn list(&self) -> Vec<Arc<SceneEntry>> {
        let mut scenes: Vec<_> = self.lock().scenes.values().cloned().collect();
        scenes.sort_by_key(|scene| scene.sequence);
        scenes
    }

    /// One scene.
    ///
    /// # Errors
    /// `scene_not_found`.
    pub fn get(&self, id: &str) -> Result<Arc<SceneEntry>, ApiError> {
        self.lock().scenes.get(id).cloned().ok_or_else(|| ApiError::scene_not_found(id))
    }

    /// The complete scene of a document that is the field `parent` of another, not kept.
    ///
    /// # Errors
    /// `volume_not_found`, or what is wrong with the document.
    pub fn complete(&self, json: &Value, parent: &str) -> Result<Arc<Scene>, ApiError> {
        let document = SceneDocument::from_json(json).map_err(|error| error.under(parent))?;
        let (entry, _) = lease(&self.volumes, document.volume(), &format!("{parent}.volume"))?;
        let scene = document.complete(&entry.facts()).map_err(|error| error.under(parent))?;
        Ok(Arc::new(scene))
    }

    /// Makes a scene from a document.
    ///
    /// # Errors
    /// `too_many`, `volume_not_found`, or what is wrong with the document.
    pub fn create(&self, json: &Value) -> Result<SceneSnapshot, ApiError> {
        self.create_as(format!("s_{}", random_hex()), json)
    }

    /// As [`SceneStore::create`], under an id that is not taken.
    ///
    /// # Errors
    /// As [`SceneStore::create`].
    pub fn create_as(&self, id: String, json: &Value) -> Result<SceneSnapshot, ApiError> {
        let (scene, lease) = complete(&SceneDocument::from_json(json)?, &self.volumes)?;
        let mut inner = self.lock();
        if inner.scenes.len() >= self.max_scenes {
            let message = format!("there may be {} scenes; delete one", self.max_scenes);
            return Err(ApiError::new(ErrorCode::TooMany, message).with_details(json!({ "limit": self.max_scenes })));
        }
        inner.sequence += 1;
        let history = SceneHistory::new(scene);
        let entry = Arc::new(SceneEntry {
            id,
            sequence: inner.sequence,
            revision: watch::Sender::new(history.revision()),
            state: Mutex::new(State { history, _lease: lease }),
        });
        inner.scenes.insert(entry.id.clone(), entry.clone());
        Ok(entry.snapshot())
    }

    /// Changes a scene; see [`SceneEntry::change`].
    ///
    /// # Errors
    /// `scene_not_found`, and those of [`SceneEntry::change`].
    pub fn change(
        &self,
        id: &str,
        allowed: impl Fn(u64) -> bool,
        change: SceneChange<'_>,
    ) -> Result<SceneSnapshot, ApiError> {
        self.get(id)?.change(&self.volumes, allowed, change)
    }

    /// Deletes a scene if `allowed` says so of its revision.
    ///
    /// # Errors
    /// `scene_not_found`, `revision_mismatch`.
    pub fn delete(&self, id: &str, allowed: impl Fn(u64) -> bool) -> Result<(), ApiError> {
        let mut inner = self.lock();
        let revision = inner.scenes.get(id).ok_or_else(|| ApiError::scene_not_found(id))?.snapshot().revision;
        if !allowed(revision) {
            return Err(revision_mismatch(revision));
        }
        if let Some(entry) = inner.scenes.remove(id) {
            entry.revision.send_replace(SceneEntry::DELETED);
        }
        Ok(())
    }

    /// Ids of the scenes that look at a volume.
    pub fn using(&self, volume: &str) -> Vec<String> {
        let scenes = self.list().into_iter().map(|scene| scene.snapshot());
        scenes.filter(|scene| scene.scene.volume.0 == volume).map(|scene| scene.id).collect()
    }
}

fn revision_mismatch(revision: u64) -> ApiError {
    ApiError::new(ErrorCode::RevisionMismatch, format!("the scene is at revision {revision} now"))
        .with_details(json!({ "revision": revision }))
}
