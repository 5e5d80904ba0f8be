//! How many volumes may be on their way at once.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::error::ApiError;

/// Lets a few volumes be loaded at once, and a few more wait.
#[derive(Debug)]
pub struct Admission {
    waiting: Arc<Semaphore>,
    loading: Arc<Semaphore>,
}

/// A place in line; once its turn has come, held by whoever does the work at the moment.
#[derive(Debug)]
pub struct LoadPermit {
    _waiting: OwnedSemaphorePermit,
    turns: Arc<Semaphore>,
    turn: Option<OwnedSemaphorePermit>,
}

impl Admission {
    /// `loading` at once, `waiting` more in line.
    pub fn new(loading: usize, waiting: usize) -> Self {
        Self { waiting: Arc::new(Semaphore::new(loading + waiting)), loading: Arc::new(Semaphore::new(loading)) }
    }

    /// Stands in line.
    ///
    /// # Errors
    /// `busy` when the line is full.
    pub fn stand_in_line(&self) -> Result<LoadPermit, ApiError> {
        let waiting = self.waiting.clone().try_acquire_owned().map_err(|_| ApiError::busy())?;
        Ok(LoadPermit { _waiting: waiting, turns: self.loading.clone(), turn: None })
    }
}

impl LoadPermit {
    /// Waits for its turn, unless it has come.
    ///
    /// # Errors
    /// `internal`, if the server is at its end.
    pub async fn wait_for_turn(&mut self) -> Result<(), ApiError> {
        if self.turn.is_none() {
            self.turn = Some(self.turns.clone().acquire_owned().await.map_err(ApiError::internal)?);
        }
        Ok(())
    }
}
