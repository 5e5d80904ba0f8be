//! The outermost middleware: request ids, the one log line per request, and the one place that writes error bodies.
//!
//! Architecture Invariant: every response with status 400 or above leaves here with the envelope, whoever
//! made it: a handler, the router (404, 405), the panic catcher.

use std::time::Instant;

use axum::Json;
use axum::body::Body;
use axum::extract::{MatchedPath, Request};
use axum::http::{HeaderValue, Method, StatusCode, header};
use axum::middleware::Next;
use axum::response::{IntoResponse, Response};
use serde_json::json;

use crate::error::{ApiError, ErrorCode};
use crate::session::random_hex;

/// Header that carries the request id both ways.
const REQUEST_ID: &str = "x-request-id";

/// Longest request id that is taken over from a client: it goes into every log line.
const MAX_REQUEST_ID_LENGTH: usize = 128;

impl IntoResponse for ApiError {
    /// Status and headers only: the body needs the request id, which `observe` knows.
    fn into_response(self) -> Response {
        let (_, status) = self.code.name_and_status();
        let status = StatusCode::from_u16(status).expect("the table holds valid statuses");
        let mut response = status.into_response();
        if let Some(seconds) = self.retry_after_seconds() {
            response.headers_mut().insert(header::RETRY_AFTER, HeaderValue::from(seconds));
        }
        if self.code == ErrorCode::Unauthorized {
            response.headers_mut().insert(header::WWW_AUTHENTICATE, HeaderValue::from_static("Bearer"));
        }
        response.extensions_mut().insert(self);
        response
    }
}

/// Gives the request an id, logs its outcome in one line and completes error responses.
pub(super) async fn observe(request: Request, next: Next) -> Response {
    let started = Instant::now();
    let method = request.method().clone();
    // The pattern, not the path: ids would make every line unique and may be secrets of their own.
    let route =
        request.extensions().get::<MatchedPath>().map_or("unmatched".to_owned(), |path| path.as_str().to_owned());
    let id = request_id(&request);
    let span = tracing::info_span!("request", id = id.to_str().unwrap_or_default());
    let response = {
        use tracing::Instrument;
        next.run(request).instrument(span).await
    };
    let mut response = complete(response, &id, &method, &route);
    let headers = response.headers_mut();
    headers.insert(REQUEST_ID, id.clone());
    headers.insert(header::X_CONTENT_TYPE_OPTIONS, HeaderValue::from_static("nosniff"));
    tracing::info!(
        %method,
        route,
        status = response.status().as_u16(),
        ms = started.elapsed().as_micros() as f64 / 1e3,
        request_id = id.to_str().unwrap_or_default(),
        "request"
    );
    response
}

/// The client's id if it is sane, else a fresh one.
fn request_id(request: &Request) -> HeaderValue {
    let sane = |value: &&HeaderValue| {
        (1..=MAX_REQUEST_ID_LENGTH).contains(&value.len()) && value.as_bytes().iter().all(u8::is_ascii_graphic)
    };
    request
        .headers()
        .get(REQUEST_ID)
        .filter(sane)
        .cloned()
        .unwrap_or_else(|| HeaderValue::from_str(&random_hex()).expect("hexadecimal digits are a valid header"))
}

/// Puts the envelope into error responses.
fn complete(response: Response, id: &HeaderValue, method: &Method, route: &str) -> Response {
    let status = response.status();
    if status.as_u16() < 400 {
        return response;
    }
    let (mut parts, _) = response.into_parts();
    let error = parts.extensions.remove::<ApiError>().unwrap_or_else(|| from_status(status, method, route));
    let mut body = error.to_json();
    body["request_id"] = id.to_str().unwrap_or_default().into();
    let mut response = Json(json!({ "error": body })).into_response();
    *response.status_mut() = status;
    // Allow, Retry-After and the CORS headers stay; what described the old body goes.
    for (name, value) in &parts.headers {
        if name != header::CONTENT_TYPE && name != header::CONTENT_LENGTH {
            response.headers_mut().append(name, value.clone());
        }
    }
    if method == Method::HEAD {
        *response.body_mut() = Body::empty();
    }
    response
}

/// The error behind a response that no handler of ours made.
fn from_status(status: StatusCode, method: &Method, route: &str) -> ApiError {
    match status {
        StatusCode::NOT_FOUND => ApiError::new(ErrorCode::NotFound, "there is no such route"),
        StatusCode::METHOD_NOT_ALLOWED => {
            ApiError::new(ErrorCode::MethodNotAllowed, format!("{route} has no method {method}"))
        }
        StatusCode::PAYLOAD_TOO_LARGE => ApiError::new(ErrorCode::TooLarge, "the body is too long"),
        status if status.is_client_error() => ApiError::new(ErrorCode::Malformed, "the request cannot be understood"),
        _ => ApiError::internal(format!("a response of status {status} without an error")),
    }
}

/// What [`tower_http::catch_panic`] answers: the panic's message goes to the log alone.
pub(super) fn from_panic(panic: Box<dyn std::any::Any + Send>) -> Response {
    let message = panic
        .downcast_ref::<String>()
        .map(String::as_str)
        .or_else(|| panic.downcast_ref::<&str>().copied())
        .unwrap_or("no message");
    ApiError::internal(format!("panic in a handler: {message}")).into_response()
}
