//! Views of streams that were cut off, for clients that come back.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::random_hex;
use crate::scene::Camera;

/// How long a view is kept.
const KEPT_FOR: Duration = Duration::from_secs(600);

/// Most views kept; the oldest goes first. A view is some 200 bytes.
const MOST_KEPT: usize = 4096;

/// What belongs to one connection alone.
#[derive(Clone, Debug, PartialEq)]
pub struct View {
    /// Instead of the scene's camera.
    pub camera: Option<Camera>,
    /// Pixels across.
    pub width: u32,
    /// Pixels down.
    pub height: u32,
}

#[derive(Debug)]
struct Kept {
    token: String,
    scene: String,
    view: View,
    since: Instant,
}

/// Views by the token that their client holds.
#[derive(Debug, Default)]
pub struct ResumeStore {
    kept: Mutex<VecDeque<Kept>>,
}

impl ResumeStore {
    /// A token for a new connection. Whoever has it gets the view, so it cannot be guessed.
    pub fn token() -> String {
        format!("r_{}{}", random_hex(), random_hex())
    }

    /// Keeps the view of a connection that ended.
    pub fn keep(&self, token: String, scene: &str, view: View) {
        let mut kept = self.lock();
        if kept.len() >= MOST_KEPT {
            kept.pop_front();
        }
        kept.push_back(Kept { token, scene: scene.to_owned(), view, since: Instant::now() });
    }

    /// Takes the view of a token, once.
    pub fn take(&self, token: &str, scene: &str) -> Option<View> {
        let mut kept = self.lock();
        kept.retain(|k| k.since.elapsed() < KEPT_FOR);
        let at = kept.iter().position(|k| k.token == token && k.scene == scene)?;
        kept.remove(at).map(|k| k.view)
    }

    fn lock(&self) -> MutexGuard<'_, VecDeque<Kept>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
