//! A scene's revisions, with undo and redo.

use std::collections::VecDeque;
use std::sync::Arc;

use super::Scene;

/// Most steps back. A scene is at most some 60 kB (1,024 control points), so a history is at most some 12 MB.
const MAX_STEPS: usize = 100;

/// Why a history cannot move.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
pub enum HistoryError {
    /// The scene is the oldest one remembered.
    #[error("there is nothing to undo")]
    NothingToUndo,
    /// The scene is the newest one.
    #[error("there is nothing to redo")]
    NothingToRedo,
}

/// The current scene, its revision, and what it was before.
///
/// Every change, undo and redo too, makes a new revision: a revision names one content for ever, so that a client
/// who holds an old one cannot mistake it for the current.
#[derive(Clone, Debug)]
pub struct SceneHistory {
    scene: Arc<Scene>,
    revision: u64,
    undo: VecDeque<Arc<Scene>>,
    redo: Vec<Arc<Scene>>,
}

impl SceneHistory {
    /// Revision 1.
    pub fn new(scene: Scene) -> Self {
        Self { scene: Arc::new(scene), revision: 1, undo: VecDeque::new(), redo: Vec::new() }
    }

    /// The current scene.
    pub fn scene(&self) -> &Arc<Scene> {
        &self.scene
    }

    /// The current revision.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Makes another scene the current one, forgets what could be redone, and returns the new revision. An equal
    /// scene changes nothing: the revision stays, and what could be redone still can.
    pub fn replace(&mut self, scene: Scene) -> u64 {
        if scene != *self.scene {
            if self.undo.len() == MAX_STEPS {
                self.undo.pop_front();
            }
            self.redo.clear();
            let before = self.advance(Arc::new(scene));
            self.undo.push_back(before);
        }
        self.revision
    }

    /// Makes another scene the current one without a step of its own: undo goes back to before the last change, of
    /// which this one is a part (a slider that is still being dragged). Otherwise as [`SceneHistory::replace`].
    pub fn amend(&mut self, scene: Scene) -> u64 {
        if self.undo.is_empty() {
            return self.replace(scene);
        }
        if scene != *self.scene {
            self.redo.clear();
            self.advance(Arc::new(scene));
        }
        self.revision
    }

    /// Goes back one change and returns the new revision.
    ///
    /// # Errors
    /// [`HistoryError::NothingToUndo`].
    pub fn undo(&mut self) -> Result<u64, HistoryError> {
        let before = self.undo.pop_back().ok_or(HistoryError::NothingToUndo)?;
        let undone = self.advance(before);
        self.redo.push(undone);
        Ok(self.revision)
    }

    /// Takes back one undo and returns the new revision.
    ///
    /// # Errors
    /// [`HistoryError::NothingToRedo`].
    pub fn redo(&mut self) -> Result<u64, HistoryError> {
        let after = self.redo.pop().ok_or(HistoryError::NothingToRedo)?;
        let before = self.advance(after);
        self.undo.push_back(before);
        Ok(self.revision)
    }

    /// Sets the current scene under a new revision and returns the last one.
    fn advance(&mut self, scene: Arc<Scene>) -> Arc<Scene> {
        self.revision += 1;
        std::mem::replace(&mut self.scene, scene)
    }
}
