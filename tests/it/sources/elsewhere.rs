//! Another server: it has files, redirects, and behaves badly where it is asked to.

use std::net::SocketAddr;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::time::Duration;

use axum::Router;
use axum::body::{Body, Bytes};
use axum::extract::{Path, RawQuery, State};
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use axum::routing::get;
use futures_util::{StreamExt, stream};

/// Bytes of a file that is too large.
pub(super) const LARGE: usize = 100_000;

/// What happened on the other server.
#[derive(Debug, Default)]
pub(super) struct Seen {
    pub(super) requests: AtomicUsize,
    pub(super) left: AtomicBool,
}

/// The other server.
#[derive(Clone, Debug)]
pub(super) struct Elsewhere {
    pub(super) address: SocketAddr,
    pub(super) seen: Arc<Seen>,
}

/// A small volume.
pub(super) fn file() -> Vec<u8> {
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 4 3 2\nencoding: raw\n\n";
    [header.as_bytes().to_vec(), (0..24).collect()].concat()
}

impl Elsewhere {
    pub(super) async fn start() -> Self {
        let seen = Arc::new(Seen::default());
        let routes = Router::new()
            .route("/files/{name}", get(answer))
            .route("/secret/{name}", get(answer))
            .with_state(seen.clone());
        let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a free port");
        let address = listener.local_addr().expect("it is bound");
        tokio::spawn(axum::serve(listener, routes).into_future());
        Self { address, seen }
    }

    pub(super) fn url(&self, path: &str) -> String {
        format!("http://{}/{path}", self.address)
    }

    pub(super) fn requests(&self) -> usize {
        self.seen.requests.load(Ordering::SeqCst)
    }

    /// Whether a reader of a file has gone, after a moment.
    pub(super) async fn is_left(&self) -> bool {
        for _ in 0..200 {
            if self.seen.left.load(Ordering::SeqCst) {
                return true;
            }
            tokio::time::sleep(Duration::from_millis(10)).await;
        }
        false
    }
}

/// Notes that a body is read no longer.
struct Leaves(Arc<Seen>);

impl Drop for Leaves {
    fn drop(&mut self) {
        self.0.left.store(true, Ordering::SeqCst);
    }
}

async fn answer(State(seen): State<Arc<Seen>>, Path(name): Path<String>, RawQuery(query): RawQuery) -> Response {
    seen.requests.fetch_add(1, Ordering::SeqCst);
    let query = query.unwrap_or_default();
    let redirect = |to: String| (StatusCode::FOUND, [(header::LOCATION, to)]).into_response();
    let pieces = |count: usize| stream::iter((0..count).map(|_| Ok::<_, std::io::Error>(Bytes::from(vec![0; 1000]))));
    match name.as_str() {
        "small.nrrd" | "small" => file().into_response(),
        "typed" => ([(header::CONTENT_TYPE, "application/x-nrrd")], file()).into_response(),
        "picture.png" => b"\x89PNG\r\n\x1a\n".to_vec().into_response(),
        "broken.nrrd" => b"NRRD0004\ntype: chair\n\n".to_vec().into_response(),
        "large.nrrd" => vec![0; LARGE].into_response(),
        "large_unsaid.nrrd" => Body::from_stream(pieces(LARGE / 1000)).into_response(),
        "slow.nrrd" => {
            let leaves = Leaves(seen);
            let rest = stream::pending().map(move |piece| {
                let _ = &leaves;
                piece
            });
            Body::from_stream(pieces(1).chain(rest)).into_response()
        }
        "early.nrrd" => {
            // A pause, or the failure would come before the head of the answer.
            let end = stream::once(async {
                tokio::time::sleep(Duration::from_millis(50)).await;
                Err(std::io::Error::other("the end"))
            });
            Body::from_stream(pieces(1).chain(end)).into_response()
        }
        "never" => std::future::pending().await,
        "redirect" => redirect(query),
        "steps" => match query.parse::<usize>() {
            Ok(0) | Err(_) => redirect("small.nrrd".into()),
            Ok(n) => redirect(format!("steps?{}", n - 1)),
        },
        "nowhere" => StatusCode::FOUND.into_response(),
        code => code
            .parse()
            .ok()
            .and_then(|code| StatusCode::from_u16(code).ok())
            .unwrap_or(StatusCode::NOT_FOUND)
            .into_response(),
    }
}
