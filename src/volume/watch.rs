//! How far a load has come, and whether anybody still wants it.

use std::io::{self, BufRead, Read, Seek, SeekFrom};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

use super::VolumeError;

/// Bytes that a reader counts before it tells: a lock for each byte of a text would be felt.
const TOLD_AT_ONCE: u64 = 1 << 16;

/// What is being done.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum LoadStage {
    /// The file comes from another server, or waits for its turn.
    Fetching,
    /// Voxels are read, decoded or computed.
    #[default]
    Reading,
    /// What is derived from the voxels is computed.
    Preparing,
    /// The voxels go to the GPU.
    Uploading,
}

impl LoadStage {
    /// Name in the API.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fetching => "fetching",
            Self::Reading => "reading",
            Self::Preparing => "preparing",
            Self::Uploading => "uploading",
        }
    }
}

/// Where a load is now.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadProgress {
    /// What is being done.
    pub stage: LoadStage,
    /// Share of the stage that is done, in [0, 1]; never falls within a stage.
    pub fraction: f64,
}

/// Shared by whoever loads a volume and whoever waits for it: one tells how far it is, the other may call it off.
#[derive(Debug, Default)]
pub struct LoadWatch {
    state: Mutex<State>,
    cancelled: AtomicBool,
}

#[derive(Debug, Default)]
struct State {
    progress: LoadProgress,
    done: u64,
    total: u64,
}

impl LoadWatch {
    /// A load that begins with `stage`.
    pub fn new(stage: LoadStage) -> Self {
        let watch = Self::default();
        watch.begin(stage, 0);
        watch
    }

    /// Calls the load off: whoever does the work ends it soon.
    pub fn cancel(&self) {
        self.cancelled.store(true, Ordering::Relaxed);
    }

    /// Whether nobody wants the volume any more.
    pub fn is_cancelled(&self) -> bool {
        self.cancelled.load(Ordering::Relaxed)
    }

    /// To be asked often by whoever does the work.
    ///
    /// # Errors
    /// [`VolumeError::Cancelled`].
    pub fn check(&self) -> Result<(), VolumeError> {
        if self.is_cancelled() { Err(VolumeError::Cancelled) } else { Ok(()) }
    }

    /// Where the load is.
    pub fn progress(&self) -> LoadProgress {
        self.lock().progress
    }

    /// Goes on to a stage of `total` units of work.
    pub fn begin(&self, stage: LoadStage, total: u64) {
        *self.lock() = State { progress: LoadProgress { stage, fraction: 0.0 }, done: 0, total };
    }

    /// The stage has more units of work than was known.
    pub fn expect(&self, more: u64) {
        let mut state = self.lock();
        state.total = state.total.saturating_add(more);
    }

    /// So many units of work are done.
    pub fn advance(&self, units: u64) {
        let mut state = self.lock();
        state.done = state.done.saturating_add(units);
        if state.total > 0 {
            let fraction = (state.done as f64 / state.total as f64).min(1.0);
            state.progress.fraction = state.progress.fraction.max(fraction);
        }
    }

    /// [`LoadWatch::advance`] and [`LoadWatch::check`].
    ///
    /// # Errors
    /// [`VolumeError::Cancelled`].
    pub fn step(&self, units: u64) -> Result<(), VolumeError> {
        self.advance(units);
        self.check()
    }

    /// Where the load is, from somebody who knows.
    pub fn report(&self, stage: LoadStage, fraction: f64) {
        let mut state = self.lock();
        let least = if state.progress.stage == stage { state.progress.fraction } else { 0.0 };
        *state = State { progress: LoadProgress { stage, fraction: fraction.clamp(least, 1.0) }, done: 0, total: 0 };
    }

    // Nothing panics under the lock.
    fn lock(&self) -> MutexGuard<'_, State> {
        self.state.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// A reader that counts its bytes as work, and fails once the load is called off.
#[derive(Debug)]
pub(super) struct Watched<'w, R> {
    inner: R,
    watch: Option<&'w LoadWatch>,
    /// Whether the bytes count: those that were counted before do not.
    counts: bool,
    untold: u64,
}

impl<'w, R> Watched<'w, R> {
    pub(super) fn new(inner: R, watch: Option<&'w LoadWatch>) -> Self {
        Self { inner, watch, counts: true, untold: 0 }
    }

    /// Only looks whether the load is called off.
    pub(super) fn uncounted(inner: R, watch: Option<&'w LoadWatch>) -> Self {
        Self { inner, watch, counts: false, untold: 0 }
    }

    fn check(&self) -> io::Result<()> {
        match self.watch {
            // Whatever the reader of the format makes of it: who began the reading looks at the watch again.
            Some(watch) if watch.is_cancelled() => Err(io::Error::other("called off")),
            _ => Ok(()),
        }
    }

    fn count(&mut self, bytes: usize) {
        self.untold += bytes as u64;
        if self.untold >= TOLD_AT_ONCE {
            self.tell();
        }
    }
}

impl<R> Watched<'_, R> {
    fn tell(&mut self) {
        if let (Some(watch), true) = (self.watch, self.counts) {
            watch.advance(self.untold);
        }
        self.untold = 0;
    }
}

impl<R> Drop for Watched<'_, R> {
    fn drop(&mut self) {
        self.tell();
    }
}

impl<R: Read> Read for Watched<'_, R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        self.check()?;
        let got = self.inner.read(bytes)?;
        self.count(got);
        Ok(got)
    }
}

impl<R: BufRead> BufRead for Watched<'_, R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        self.check()?;
        self.inner.fill_buf()
    }

    fn consume(&mut self, bytes: usize) {
        self.inner.consume(bytes);
        self.count(bytes);
    }
}

impl<R: Seek> Seek for Watched<'_, R> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}
