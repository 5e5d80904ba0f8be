//! Views of streams, for clients that come back after they were cut off.

use std::collections::HashMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use super::random_hex;
use crate::scene::Camera;

/// How long the view of a stream that ended is kept.
const KEPT_FOR: Duration = Duration::from_secs(600);

/// Most views of streams that ended; the oldest goes first. A view is some 200 bytes.
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
    scene: String,
    view: View,
    /// None while the stream lives.
    ended: Option<Instant>,
}

/// Views by the token that their client holds.
///
/// A view is here from the start of its stream: the client of a broken line comes back long before the server
/// knows that the line is broken.
#[derive(Debug, Default)]
pub struct ResumeStore {
    kept: Mutex<HashMap<String, Kept>>,
}

impl ResumeStore {
    /// Keeps the view of a new stream; the token for its client. Whoever has it gets the view, so it cannot be
    /// guessed.
    pub fn begin(&self, scene: &str, view: View) -> String {
        let token = format!("r_{}{}", random_hex(), random_hex());
        self.lock().insert(token.clone(), Kept { scene: scene.to_owned(), view, ended: None });
        token
    }

    /// The stream's view is another one now.
    pub fn update(&self, token: &str, view: &View) {
        if let Some(kept) = self.lock().get_mut(token) {
            kept.view = view.clone();
        }
    }

    /// The stream has ended: from now on its view is kept for a while only.
    pub fn end(&self, token: &str) {
        let mut kept = self.lock();
        if let Some(stream) = kept.get_mut(token) {
            stream.ended = Some(Instant::now());
        }
        kept.retain(|_, k| k.ended.is_none_or(|at| at.elapsed() < KEPT_FOR));
        let ended: Vec<(Instant, &String)> = kept.iter().filter_map(|(token, k)| Some((k.ended?, token))).collect();
        if ended.len() > MOST_KEPT {
            let oldest = ended.into_iter().min().map(|(_, token)| token.clone());
            oldest.and_then(|token| kept.remove(&token));
        }
    }

    /// Takes the view of a token, once.
    pub fn take(&self, token: &str, scene: &str) -> Option<View> {
        let mut kept = self.lock();
        kept.get(token).filter(|k| k.scene == scene && k.ended.is_none_or(|at| at.elapsed() < KEPT_FOR))?;
        kept.remove(token).map(|k| k.view)
    }

    fn lock(&self) -> MutexGuard<'_, HashMap<String, Kept>> {
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
