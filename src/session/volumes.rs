//! The volumes: those that are there, those that are on their way, and who uses them.

use std::collections::HashMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use serde_json::{Value, json};

use super::entry::VolumeEntry;
use super::place::{Failed, Loading, Place, Waiting, release};
use super::random_hex;
use crate::error::{ApiError, ErrorCode};
use crate::render_thread::RenderHandle;
use crate::volume::VolumeId;

/// Failed volumes that stay listed; the oldest goes first. Each is a few hundred bytes.
const MOST_FAILURES: usize = 16;

/// The use of a volume: while it lives, the volume is not deleted without force. It holds no voxels, so a
/// volume that is deleted by force is gone from memory whoever looked at it.
#[derive(Clone, Debug)]
pub struct VolumeLease(#[expect(dead_code, reason = "only counted")] Arc<()>);

/// What is known under an id.
#[derive(Debug)]
enum State {
    Loading(Arc<Loading>),
    /// One more owner of the second than there are leases.
    Loaded(Arc<VolumeEntry>, Arc<()>),
    Failed(Failed),
}

#[derive(Debug)]
struct Known {
    state: State,
    /// In the order in which their loading began.
    sequence: u64,
}

#[derive(Debug, Default)]
struct Inner {
    known: HashMap<VolumeId, Known>,
    sequence: u64,
}

impl Inner {
    fn in_order(&self) -> Vec<(&VolumeId, &State)> {
        let mut known: Vec<_> = self.known.iter().collect();
        known.sort_by_key(|(_, known)| known.sequence);
        known.into_iter().map(|(id, known)| (id, &known.state)).collect()
    }
}

/// How many volumes there are.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct VolumeCounts {
    /// On their way.
    pub loading: usize,
    /// There, on the GPU or in host memory.
    pub loaded: usize,
    /// Not to be had.
    pub failed: usize,
}

/// The volumes.
#[derive(Debug)]
pub struct VolumeStore {
    pub(super) renderer: RenderHandle,
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

    /// The loaded volumes in the order in which they came.
    pub fn list(&self) -> Vec<Arc<VolumeEntry>> {
        let loaded = |(_, state): (&VolumeId, &State)| match state {
            State::Loaded(entry, _) => Some(entry.clone()),
            State::Loading(_) | State::Failed(_) => None,
        };
        self.lock().in_order().into_iter().filter_map(loaded).collect()
    }

    /// How many volumes there are of each kind.
    pub fn counts(&self) -> VolumeCounts {
        let mut counts = VolumeCounts::default();
        for known in self.lock().known.values() {
            match known.state {
                State::Loading(_) => counts.loading += 1,
                State::Loaded(..) => counts.loaded += 1,
                State::Failed(_) => counts.failed += 1,
            }
        }
        counts
    }

    /// One loaded volume.
    ///
    /// # Errors
    /// `volume_not_found`, `volume_not_ready`.
    pub fn get(&self, id: &str) -> Result<Arc<VolumeEntry>, ApiError> {
        self.lease(&VolumeId(id.to_owned())).map(|(entry, _)| entry)
    }

    /// One loaded volume, kept from deletion.
    ///
    /// # Errors
    /// `volume_not_found`, `volume_not_ready`.
    pub fn lease(&self, id: &VolumeId) -> Result<(Arc<VolumeEntry>, VolumeLease), ApiError> {
        match self.lock().known.get(id).map(|known| &known.state) {
            Some(State::Loaded(entry, users)) => Ok((entry.clone(), VolumeLease(users.clone()))),
            Some(State::Loading(loading)) => Err(loading.not_ready()),
            Some(State::Failed(failed)) => Err(failed.not_ready()),
            None => Err(ApiError::volume_not_found(id)),
        }
    }

    /// A loaded volume as the API shows it, wherever it is now.
    pub fn to_json(&self, entry: &VolumeEntry) -> Value {
        entry.to_json(self.renderer.gpu_bytes(&entry.id))
    }

    fn state_json(&self, state: &State) -> Value {
        match state {
            State::Loading(loading) => loading.to_json(),
            State::Loaded(entry, _) => self.to_json(entry),
            State::Failed(failed) => failed.to_json(),
        }
    }

    /// Every volume as the API shows it, in the order in which they were asked for.
    pub fn list_json(&self) -> Vec<Value> {
        self.lock().in_order().into_iter().map(|(_, state)| self.state_json(state)).collect()
    }

    /// A volume as the API shows it, whatever its state.
    ///
    /// # Errors
    /// `volume_not_found`.
    pub fn get_json(&self, id: &str) -> Result<Value, ApiError> {
        let inner = self.lock();
        let known = inner.known.get(&VolumeId(id.to_owned())).ok_or_else(|| ApiError::volume_not_found(&id))?;
        Ok(self.state_json(&known.state))
    }

    /// Takes a place for a volume that is about to be loaded; it is listed from now on.
    ///
    /// # Errors
    /// `too_many`.
    pub fn reserve(self: &Arc<Self>, name: String, source: Value, waiting: Waiting) -> Result<Place, ApiError> {
        let mut inner = self.lock();
        let counted = inner.known.values().filter(|known| !matches!(known.state, State::Failed(_))).count();
        if counted >= self.max_volumes {
            let message = format!("there may be {} volumes; delete one", self.max_volumes);
            return Err(ApiError::new(ErrorCode::TooMany, message).with_details(json!({ "limit": self.max_volumes })));
        }
        inner.sequence += 1;
        let sequence = inner.sequence;
        let id = VolumeId(format!("v_{}", random_hex()));
        let loading = Arc::new(Loading::new(id.clone(), name, source, waiting));
        inner.known.insert(id, Known { state: State::Loading(loading.clone()), sequence });
        Ok(Place { store: self.clone(), loading })
    }

    /// Deletes a volume, from the GPU too. One that is on its way is called off.
    ///
    /// # Errors
    /// `volume_not_found`; `volume_in_use` without `force`.
    pub async fn delete(&self, id: &str, force: bool) -> Result<(), ApiError> {
        let id = VolumeId(id.to_owned());
        {
            let mut inner = self.lock();
            match inner.known.get(&id).map(|known| &known.state) {
                None => return Err(ApiError::volume_not_found(&id)),
                // Leases are made under this lock only: the count cannot grow now.
                Some(State::Loaded(_, users)) if !force && Arc::strong_count(users) > 1 => {
                    let message = format!("a scene looks at volume `{id}`; delete it first, or use ?force=true");
                    return Err(ApiError::new(ErrorCode::VolumeInUse, message));
                }
                Some(State::Loading(loading)) => loading.cancel(),
                Some(State::Loaded(..) | State::Failed(_)) => {}
            }
            let was = inner.known.remove(&id);
            if !matches!(was, Some(Known { state: State::Loaded(..), .. })) {
                // What is on the GPU of a volume on its way is taken off by whoever loads it.
                return Ok(());
            }
        }
        // Spawned, so that a client that goes away meanwhile does not leave the textures behind.
        let _ = tokio::spawn(release(self.renderer.clone(), id)).await;
        Ok(())
    }

    /// Calls off the loads that only those wait for who are named; all of them with `None`.
    pub fn cancel_loads(&self, waiting: Option<Waiting>) {
        for known in self.lock().known.values() {
            if let State::Loading(loading) = &known.state
                && waiting.is_none_or(|who| who == loading.waiting)
            {
                loading.cancel();
            }
        }
    }

    /// The volume on its way is there now; false where it was deleted meanwhile.
    pub(super) fn settle(&self, entry: Arc<VolumeEntry>) -> bool {
        match self.lock().known.get_mut(&entry.id) {
            Some(known) => {
                known.state = State::Loaded(entry, Arc::default());
                true
            }
            None => false,
        }
    }

    /// Lists a failure where the volume on its way was, unless that was deleted.
    pub(super) fn keep_failure(&self, failed: Failed, id: &VolumeId) {
        let mut inner = self.lock();
        let Some(known) = inner.known.get_mut(id) else { return };
        known.state = State::Failed(failed);
        let is_failed = |known: &&Known| matches!(known.state, State::Failed(_));
        if inner.known.values().filter(is_failed).count() > MOST_FAILURES {
            let oldest = inner.known.iter().filter(|(_, known)| is_failed(known)).min_by_key(|(_, k)| k.sequence);
            let oldest = oldest.map(|(id, _)| id.clone());
            oldest.and_then(|id| inner.known.remove(&id));
        }
    }

    /// Gives the place of a volume back that is not coming.
    pub(super) fn forget_loading(&self, id: &VolumeId) {
        let mut inner = self.lock();
        if inner.known.get(id).is_some_and(|known| matches!(known.state, State::Loading(_))) {
            inner.known.remove(id);
        }
    }
}
