//! Loading: from what was asked for to a volume on the GPU, waited for or not.

use std::io::ErrorKind;
use std::sync::{Arc, LazyLock};

use rayon::{ThreadPool, ThreadPoolBuilder};
use serde_json::{Value, json};
use tracing::Instrument;

use super::AppState;
use crate::config::Limits;
use crate::error::{ApiError, ErrorCode};
use crate::session::{Extent, LoadPermit, LoadRequest, NewVolume, Place, VolumeEntry, VolumeSource};
use crate::sources::{SourceUrl, Told};
use crate::volume::format::bare_name;
use crate::volume::{Choice, Format, LoadStage, VolumeError};

/// A volume as it was asked for.
pub(super) struct Wanted {
    /// For people.
    pub(super) name: Option<String>,
    pub(super) origin: Origin,
    pub(super) extent: Extent,
}

/// Where it is.
pub(super) enum Origin {
    /// At hand.
    Here(VolumeSource),
    /// To be fetched.
    Elsewhere { url: SourceUrl, choice: Choice },
}

impl Wanted {
    /// What the volume is called.
    pub(super) fn name(&self) -> String {
        let default_name = || match &self.origin {
            Origin::Here(source) => source.default_name(),
            Origin::Elsewhere { url, .. } => bare_name(url.file_name()).to_owned(),
        };
        self.name.clone().unwrap_or_else(default_name)
    }

    /// The source as the API shows it.
    pub(super) fn to_json(&self) -> Value {
        self.extent.add_to(match &self.origin {
            Origin::Here(source) => source.to_json(),
            Origin::Elsewhere { url, .. } => json!({ "url": url.shown() }),
        })
    }

    /// The same with its file at hand.
    ///
    /// # Errors
    /// Those of the other server; `unknown_format`.
    pub(super) async fn fetch(
        self,
        state: &AppState,
        permit: &mut LoadPermit,
        told: Told<'_>,
    ) -> Result<LoadRequest, ApiError> {
        let extent = self.extent;
        let (url, choice) = match self.origin {
            Origin::Here(source) => return Ok(LoadRequest { source, extent }),
            Origin::Elsewhere { url, choice } => (url, choice),
        };
        permit.wait_for_transfer().await?;
        let file = state.sources.fetch(&url, state.limits.max_upload_bytes, told).await?;
        let (name, content_type, bytes) = (url.file_name().to_owned(), file.content_type.clone(), file.bytes.clone());
        // An archive is looked into; not on the threads of loads, which may all be at work.
        let format = move || Format::of_fetched(&name, content_type.as_deref(), &bytes);
        let format = tokio::task::spawn_blocking(format).await.map_err(ApiError::internal)??;
        let source = VolumeSource::Fetched { url: url.shown(), bytes: file.bytes, format, choice };
        Ok(LoadRequest { source, extent })
    }
}

/// Loads a volume that nobody waits for; what goes wrong is listed in its place.
pub(super) fn start(state: AppState, place: Place, wanted: Wanted, permit: LoadPermit) {
    let load = async move {
        let late = |_| Err(ApiError::new(ErrorCode::RequestTimeout, "loading the volume took too long"));
        let loading = tokio::time::timeout(Limits::MAX_UPLOAD_TIME, run(&state, &place, wanted, permit));
        if let Err(error) = loading.await.unwrap_or_else(late) {
            tracing::info!(volume = place.loading().id().0, %error, "a volume cannot be loaded");
            place.fail(error);
        }
    };
    // In the span of the request, so that the log has its id.
    tokio::spawn(load.in_current_span());
}

/// Loads a volume into its place. Dropped, it ends, and whatever works for it soon after.
///
/// # Errors
/// What is wrong with the source, what the renderer says, `volume_cancelled`.
pub(super) async fn run(
    state: &AppState,
    place: &Place,
    wanted: Wanted,
    permit: LoadPermit,
) -> Result<Arc<VolumeEntry>, ApiError> {
    tokio::select! {
        biased;
        () = place.loading().cancelled() => Err(ApiError::volume_cancelled()),
        outcome = async {
            let (prepared, _permit) = prepare(state, place, wanted, permit).await?;
            place.fill(prepared).await
        } => outcome,
    }
}

/// Brings a volume into host memory; the permit is for as long as there are two copies of it.
async fn prepare(
    state: &AppState,
    place: &Place,
    wanted: Wanted,
    mut permit: LoadPermit,
) -> Result<(NewVolume, LoadPermit), ApiError> {
    let loading = place.loading().clone();
    let watch = loading.watch().clone();
    let told = move |come: u64, all: Option<u64>| {
        let fraction = all.map_or(0.0, |all| come as f64 / all.max(1) as f64);
        watch.report(LoadStage::Fetching, fraction);
    };
    let request = wanted.fetch(state, &mut permit, &told).await?;
    permit.wait_for_turn().await?;
    let (limits, room, blame) = (state.volume_limits(), state.room(), Blame::of(&request.source));
    // The permit goes with the work, which goes on for a moment after whoever waits for it has left.
    let (prepared, permit) = blocking(move || (request.prepare_for(&loading, &limits, &room), permit)).await?;
    Ok((prepared.map_err(|error| blame.error(error))?, permit))
}

/// Threads of loads alone: slices, which take milliseconds, must not stand in line behind what takes seconds.
static LOAD_THREADS: LazyLock<Option<ThreadPool>> =
    LazyLock::new(|| ThreadPoolBuilder::new().thread_name(|n| format!("load {n}")).build().ok());

/// The work of a load, which an async worker must not do.
pub(super) async fn blocking<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> Result<T, ApiError> {
    let in_pool = || match &*LOAD_THREADS {
        Some(pool) => pool.install(work),
        None => work(),
    };
    tokio::task::spawn_blocking(in_pool).await.map_err(ApiError::internal)
}

/// What of a request its volume errors are about.
#[derive(Clone, Copy)]
pub(super) enum Blame {
    Body,
    Url,
    Path,
    Procedural,
}

impl Blame {
    pub(super) fn of(source: &VolumeSource) -> Self {
        match source {
            VolumeSource::Upload { .. } => Self::Body,
            VolumeSource::Fetched { .. } => Self::Url,
            VolumeSource::Path { .. } => Self::Path,
            VolumeSource::Procedural(_) => Self::Procedural,
        }
    }

    /// A field of the JSON body is invalid where a file is malformed.
    pub(super) fn error(self, error: VolumeError) -> ApiError {
        match (self, error) {
            (Self::Body, VolumeError::Malformed { field, message }) if field == "region" => {
                ApiError::invalid("region", message)
            }
            (_, VolumeError::Malformed { field, message }) if field == "region" => {
                ApiError::invalid("source.region", message)
            }
            (Self::Procedural, VolumeError::Malformed { field, message }) => {
                ApiError::invalid(&format!("source.procedural.{field}"), message)
            }
            (Self::Path, VolumeError::Malformed { field, message })
                if matches!(field.as_str(), "path" | "series" | "channel" | "scale") =>
            {
                ApiError::invalid(&format!("source.{field}"), message)
            }
            (Self::Body | Self::Url, VolumeError::Malformed { field, message })
                if matches!(field.as_str(), "series" | "channel" | "scale") =>
            {
                ApiError::invalid(&field, message)
            }
            // Only the kind: the system's message may say more than the client should know.
            (Self::Path, VolumeError::Io { field, source }) if field == "path" => {
                ApiError::invalid("source.path", source.kind())
            }
            // A file that a header names.
            (Self::Path, VolumeError::Io { field, source })
                if matches!(
                    source.kind(),
                    ErrorKind::NotFound | ErrorKind::PermissionDenied | ErrorKind::IsADirectory
                ) =>
            {
                ApiError::invalid("source.path", format!("{field}: {}", source.kind()))
            }
            (_, other) => other.into(),
        }
    }
}
