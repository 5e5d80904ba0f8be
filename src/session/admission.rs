//! How many volumes may be on their way at once.

use std::sync::Arc;

use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use crate::error::ApiError;

/// Files that may come at once, from clients and from elsewhere: each may be as long as an upload may be, and a slow line
/// must not keep those waiting who need none.
const TRANSFERS: usize = 4;

/// Lets a few volumes be loaded at once, and a few more wait.
#[derive(Debug)]
pub struct Admission {
    waiting: Arc<Semaphore>,
    transfers: Arc<Semaphore>,
    loading: Arc<Semaphore>,
}

/// A place in line; once its turn has come, held by whoever does the work at the moment.
#[derive(Debug)]
pub struct LoadPermit {
    _waiting: OwnedSemaphorePermit,
    transfers: Arc<Semaphore>,
    transfer: Option<OwnedSemaphorePermit>,
    turns: Arc<Semaphore>,
    turn: Option<OwnedSemaphorePermit>,
}

impl Admission {
    /// `loading` at once, `waiting` more in line.
    pub fn new(loading: usize, waiting: usize) -> Self {
        let places = |count| Arc::new(Semaphore::new(count));
        Self { waiting: places(loading + waiting), transfers: places(TRANSFERS), loading: places(loading) }
    }

    /// Stands in line.
    ///
    /// # Errors
    /// `busy` when the line is full.
    pub fn stand_in_line(&self) -> Result<LoadPermit, ApiError> {
        let waiting = self.waiting.clone().try_acquire_owned().map_err(|_| ApiError::busy())?;
        let (transfers, turns) = (self.transfers.clone(), self.loading.clone());
        Ok(LoadPermit { _waiting: waiting, transfers, transfer: None, turns, turn: None })
    }
}

impl LoadPermit {
    /// Waits until its file may come, which is in memory from then on.
    ///
    /// # Errors
    /// `internal`, if the server is at its end.
    pub async fn wait_for_transfer(&mut self) -> Result<(), ApiError> {
        if self.transfer.is_none() {
            self.transfer = Some(self.transfers.clone().acquire_owned().await.map_err(ApiError::internal)?);
        }
        Ok(())
    }

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
