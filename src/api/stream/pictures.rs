//! Making one picture of a stream, and the ambient occlusion of the ones to come.

use std::sync::Arc;
use std::time::{Duration, Instant};

use axum::body::Bytes;
use tokio::sync::watch;
use tokio::task::JoinHandle;

use crate::api::AppState;
use crate::encode::{ImageFormat, encode};
use crate::error::ApiError;
use crate::renderer::{AoPolicy, AoReport, FrameRequest, StageTimings};
use crate::scene::Scene;

/// What a picture shows and how it is made.
#[derive(Clone, Debug)]
pub(super) struct Order {
    pub(super) scene: Arc<Scene>,
    pub(super) revision: u64,
    pub(super) seq: u64,
    pub(super) dropped: u64,
    pub(super) size: [u32; 2],
    pub(super) encoding: ImageFormat,
    pub(super) moving: bool,
    /// As large as the view.
    pub(super) full_size: bool,
}

/// A finished picture.
#[derive(Debug)]
pub(super) struct Picture {
    pub(super) order: Order,
    pub(super) bytes: Bytes,
    pub(super) ao: AoReport,
    pub(super) timings: StageTimings,
    pub(super) encode: Duration,
}

/// Work that ends when nobody waits for it any more.
#[derive(Debug)]
pub(super) struct Task<T>(JoinHandle<T>);

impl<T: Send + 'static> Task<T> {
    fn spawn(work: impl Future<Output = T> + Send + 'static) -> Self {
        Self(tokio::spawn(work))
    }

    /// Waits for the result; may be called again if the future is dropped before it is done.
    pub(super) async fn result(&mut self) -> Result<T, ApiError> {
        (&mut self.0).await.map_err(ApiError::internal)
    }
}

impl<T> Drop for Task<T> {
    fn drop(&mut self) {
        self.0.abort();
    }
}

/// Draws and encodes. The group is the scene: scenes take turns, whoever watches.
pub(super) fn draw(state: &AppState, group: &str, order: Order) -> Task<Result<Picture, ApiError>> {
    let (state, group) = (state.clone(), group.to_owned());
    Task::spawn(async move {
        let request = FrameRequest {
            scene: order.scene.clone(),
            width: order.size[0],
            height: order.size[1],
            ao_policy: if order.moving { AoPolicy::AtHand } else { AoPolicy::Exact },
        };
        let frame = state.renderer.render_in(&group, request).await?;
        let (ao, timings) = (frame.ao, frame.timings);
        let (encoding, background) = (order.encoding, order.scene.rendering.background);
        let encoded = tokio::task::spawn_blocking(move || {
            let begin = Instant::now();
            encode(&frame, encoding, background).map(|bytes| (Bytes::from(bytes), begin.elapsed()))
        });
        let (bytes, encode) = encoded.await.map_err(ApiError::internal)??;
        Ok(Picture { order, bytes, ao, timings, encode })
    })
}

/// Ambient occlusion that is being computed.
#[derive(Debug)]
pub(super) struct Preparation {
    pub(super) scene: Arc<Scene>,
    pub(super) task: Task<Result<AoReport, ApiError>>,
    pub(super) progress: watch::Receiver<f64>,
    pub(super) begun: tokio::time::Instant,
}

impl Preparation {
    pub(super) fn start(state: &AppState, group: &str, scene: Arc<Scene>) -> Self {
        let (sender, progress) = watch::channel(0.0);
        let (state, group, wanted) = (state.clone(), group.to_owned(), scene.clone());
        let task = Task::spawn(async move { Ok(state.renderer.prepare_in(&group, wanted, sender).await?) });
        Self { scene, task, progress, begun: tokio::time::Instant::now() }
    }
}
