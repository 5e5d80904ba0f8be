//! Who may ask: API keys (`Authorization: Bearer KEY`, compared in constant time) and the origins of pages.

use axum::extract::{MatchedPath, Request, State};
use axum::http::{HeaderMap, Method, header};
use axum::middleware::Next;
use axum::response::Response;
use sha2::{Digest, Sha256};
use subtle::{Choice, ConstantTimeEq};

use super::AppState;
use crate::error::{ApiError, ErrorCode};

/// Routes that need no key: an orchestrator's probes have none, and the viewer has to come before it can ask for one.
const OPEN_ROUTES: [&str; 4] = ["/livez", "/readyz", "/", "/viewer/{*path}"];

/// Routes that look for a key themselves: a browser cannot give a WebSocket a header.
const OWN_CHECK: &str = "/v1/scenes/{id}/stream";

/// The keys that open the server; none means that no key is needed.
#[derive(Clone, Default)]
pub struct ApiKeys(Vec<[u8; 32]>);

impl std::fmt::Debug for ApiKeys {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ApiKeys({})", self.0.len())
    }
}

impl ApiKeys {
    /// Keeps only digests: equal lengths make the comparison independent of the key's own length.
    pub fn new(keys: &[String]) -> Self {
        Self(keys.iter().map(|key| Sha256::digest(key).into()).collect())
    }

    /// True when no key is needed.
    pub fn is_open(&self) -> bool {
        self.0.is_empty()
    }

    /// Compares with every key, whichever fits.
    pub fn accepts(&self, key: &[u8]) -> bool {
        let digest: [u8; 32] = Sha256::digest(key).into();
        self.0.iter().fold(Choice::from(0), |found, known| found | known.ct_eq(&digest)).into()
    }
}

/// Lets a request pass when it carries a key, or needs none.
pub(super) async fn require_key(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Result<Response, ApiError> {
    let route = request.extensions().get::<MatchedPath>().map(MatchedPath::as_str);
    let open = route.is_some_and(|route| OPEN_ROUTES.contains(&route) || route == OWN_CHECK);
    if state.keys.is_open() || open {
        return Ok(next.run(request).await);
    }
    match bearer(request.headers()) {
        Some(key) if state.keys.accepts(key) => Ok(next.run(request).await),
        Some(_) => Err(ApiError::new(ErrorCode::Unauthorized, "this key is not known")),
        None => Err(ApiError::new(ErrorCode::Unauthorized, "a key is needed: `Authorization: Bearer KEY`")),
    }
}

pub(super) fn bearer(headers: &HeaderMap) -> Option<&[u8]> {
    let value = headers.get(header::AUTHORIZATION)?.as_bytes();
    let (scheme, key) = value.split_at_checked(7)?;
    scheme.eq_ignore_ascii_case(b"bearer ").then(|| key.trim_ascii())
}

/// Refuses what a page of another origin asks for: everything that changes something. A browser lets any page send
/// simple requests to a server on the same machine, whose only protection may be that nobody else reaches it.
pub(super) async fn refuse_foreign_pages(
    State(state): State<AppState>,
    request: Request,
    next: Next,
) -> Result<Response, ApiError> {
    if !matches!(*request.method(), Method::GET | Method::HEAD | Method::OPTIONS) {
        check_origin(request.headers(), &state.allow_origins)?;
    }
    Ok(next.run(request).await)
}

/// A page may change things and open streams if it comes from this server or from an allowed origin. Browsers ask
/// nobody before they open a WebSocket, so the server has to look. Programs send no origin.
pub(super) fn check_origin(headers: &HeaderMap, allowed: &[String]) -> Result<(), ApiError> {
    let Some(origin) = headers.get(header::ORIGIN) else { return Ok(()) };
    let origin = origin.to_str().unwrap_or("");
    let host = headers.get(header::HOST).and_then(|h| h.to_str().ok()).unwrap_or("");
    let own = ["http://", "https://"].iter().any(|scheme| origin.strip_prefix(scheme) == Some(host));
    if own || allowed.iter().any(|a| a == "*" || a == origin) {
        return Ok(());
    }
    Err(ApiError::new(ErrorCode::ForbiddenOrigin, "pages of this origin may not do this; see --allow-origin"))
}
