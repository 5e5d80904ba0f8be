//! Reading requests: JSON bodies, query strings and `If-Match`, each with errors that name the culprit.

use std::fmt::Display;
use std::ops::RangeInclusive;
use std::str::FromStr;
use std::time::Duration;

use axum::extract::{FromRequest, FromRequestParts, Query, Request};
use axum::http::request::Parts;
use axum::http::{HeaderMap, header};
use futures_util::StreamExt;
use serde::de::DeserializeOwned;
use serde_json::Value;

use crate::config::Limits;
use crate::error::{ApiError, ErrorCode};

/// A JSON body is small: its pieces follow each other closely.
const JSON_TIMEOUT: Duration = Duration::from_secs(30);

/// Bytes that are reserved on the word of `Content-Length`.
const MAX_TRUSTED_LENGTH: u64 = 64 << 20;

/// A JSON body of at most [`Limits::MAX_JSON_BYTES`], not yet looked into.
pub(super) struct JsonBody(pub(super) Value);

impl<S: Send + Sync> FromRequest<S> for JsonBody {
    type Rejection = ApiError;

    async fn from_request(request: Request, _: &S) -> Result<Self, ApiError> {
        // Browsers send any other type across origins without asking first; requiring this one keeps
        // foreign pages from changing scenes of a server on the user's own machine.
        if !is_json(request.headers()) {
            let message = "the body must be JSON, with `Content-Type: application/json`";
            return Err(ApiError::new(ErrorCode::UnsupportedMediaType, message));
        }
        read_json(request).await.map(Self)
    }
}

/// True when `Content-Type` says JSON or a kind of it, such as `application/merge-patch+json`.
pub(super) fn is_json(headers: &HeaderMap) -> bool {
    let Some(Ok(content_type)) = headers.get(header::CONTENT_TYPE).map(|value| value.to_str()) else {
        return false;
    };
    let essence = content_type.split(';').next().unwrap_or_default().trim().to_ascii_lowercase();
    essence == "application/json" || (essence.starts_with("application/") && essence.ends_with("+json"))
}

/// Reads a JSON body, whatever its announced type.
pub(super) async fn read_json(request: Request) -> Result<Value, ApiError> {
    let bytes = read_body(request, Limits::MAX_JSON_BYTES as u64, JSON_TIMEOUT).await?;
    serde_json::from_slice(&bytes).map_err(|error| ApiError::new(ErrorCode::Malformed, format!("not JSON: {error}")))
}

/// Reads a body of at most `limit` bytes. A longer one is refused before it is read when it says so, and
/// as soon as it shows otherwise.
///
/// # Errors
/// `too_large`; `request_timeout` when nothing comes for `patience`; `malformed` when the client goes away.
pub(super) async fn read_body(request: Request, limit: u64, patience: Duration) -> Result<Vec<u8>, ApiError> {
    let too_large = || ApiError::too_large(format!("the body may have {limit} bytes"), limit);
    let announced = content_length(request.headers());
    if announced.is_some_and(|length| length > limit) {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    // A promise of much data is not yet a reason to set memory aside for it.
    bytes.reserve_exact(announced.unwrap_or(0).min(MAX_TRUSTED_LENGTH) as usize);
    let mut pieces = request.into_body().into_data_stream();
    loop {
        let piece = tokio::time::timeout(patience, pieces.next())
            .await
            .map_err(|_| ApiError::new(ErrorCode::RequestTimeout, "the body stopped coming"))?;
        let Some(piece) = piece else { return Ok(bytes) };
        let piece = piece.map_err(|_| ApiError::new(ErrorCode::Malformed, "the body ended early"))?;
        if bytes.len() as u64 + piece.len() as u64 > limit {
            return Err(too_large());
        }
        bytes.extend_from_slice(&piece);
    }
}

/// The announced length of the body.
fn content_length(headers: &HeaderMap) -> Option<u64> {
    headers.get(header::CONTENT_LENGTH)?.to_str().ok()?.parse().ok()
}

/// Types a JSON value; unknown fields and wrong types are errors that name their path.
pub(super) fn typed<T: DeserializeOwned>(value: Value) -> Result<T, ApiError> {
    if !value.is_object() {
        return Err(ApiError::invalid("$", "expected an object"));
    }
    serde_path_to_error::deserialize(value).map_err(|error| {
        let path = error.path().to_string();
        let path = if path == "." { "$" } else { &path };
        ApiError::invalid(path, error.inner())
    })
}

/// The parameters of a query string, taken one by one; what is left at the end is unknown.
pub(super) struct QueryParams(Vec<(String, String)>);

impl<S: Send + Sync> FromRequestParts<S> for QueryParams {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiError> {
        let Query(pairs) = Query::<Vec<(String, String)>>::try_from_uri(&parts.uri)
            .map_err(|error| ApiError::new(ErrorCode::Malformed, format!("query string: {error}")))?;
        Ok(Self(pairs))
    }
}

impl QueryParams {
    /// The text of a parameter; empty counts as missing.
    pub(super) fn text(&mut self, name: &str) -> Result<Option<String>, ApiError> {
        let mut found = None;
        while let Some(at) = self.0.iter().position(|(key, _)| key == name) {
            let (_, value) = self.0.remove(at);
            if found.replace(value).is_some() {
                return Err(ApiError::invalid(name, "given more than once"));
            }
        }
        Ok(found.filter(|text| !text.is_empty()))
    }

    /// A number within a range.
    pub(super) fn number<T>(&mut self, name: &str, range: RangeInclusive<T>) -> Result<Option<T>, ApiError>
    where
        T: FromStr + PartialOrd + Display,
    {
        let Some(text) = self.text(name)? else { return Ok(None) };
        match text.parse() {
            Ok(number) if range.contains(&number) => Ok(Some(number)),
            _ => Err(ApiError::invalid(
                name,
                format!("expected a number from {} to {}, got `{}`", range.start(), range.end(), shortened(&text)),
            )),
        }
    }

    /// A finite number.
    pub(super) fn finite(&mut self, name: &str) -> Result<Option<f64>, ApiError> {
        let Some(text) = self.text(name)? else { return Ok(None) };
        match text.parse().ok().filter(|number: &f64| number.is_finite()) {
            Some(number) => Ok(Some(number)),
            None => Err(ApiError::invalid(name, format!("expected a finite number, got `{}`", shortened(&text)))),
        }
    }

    /// `true` or `false`; false when missing.
    pub(super) fn flag(&mut self, name: &str) -> Result<bool, ApiError> {
        self.flag_or(name, false)
    }

    /// `true` or `false`; `default` when missing.
    pub(super) fn flag_or(&mut self, name: &str, default: bool) -> Result<bool, ApiError> {
        match self.text(name)?.as_deref() {
            None => Ok(default),
            Some("false" | "0") => Ok(false),
            Some("true" | "1") => Ok(true),
            Some(other) => Err(ApiError::invalid(name, format!("expected true or false, got `{}`", shortened(other)))),
        }
    }

    /// One of the names that `parse` knows.
    pub(super) fn choice<T>(
        &mut self,
        name: &str,
        expected: &str,
        parse: impl Fn(&str) -> Option<T>,
    ) -> Result<Option<T>, ApiError> {
        let Some(text) = self.text(name)? else { return Ok(None) };
        match parse(&text) {
            Some(value) => Ok(Some(value)),
            None => Err(ApiError::invalid(name, format!("expected {expected}, got `{}`", shortened(&text)))),
        }
    }

    /// Refuses parameters that nobody asked for.
    pub(super) fn finish(self) -> Result<(), ApiError> {
        match self.0.first() {
            None => Ok(()),
            Some((name, _)) => Err(ApiError::invalid(&shortened(name), "unknown query parameter")),
        }
    }
}

/// Long input is not repeated in full.
pub(super) fn shortened(text: &str) -> String {
    if text.chars().count() <= 40 { text.to_owned() } else { text.chars().take(40).chain(['…']).collect() }
}

/// `If-Match`: which revisions a change may start from.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum IfMatch {
    /// No header, or `*`.
    Any,
    /// One of these. Weak tags are left out: the comparison is strong (RFC 9110, 13.1.1).
    OneOf(Vec<String>),
}

impl<S: Send + Sync> FromRequestParts<S> for IfMatch {
    type Rejection = ApiError;

    async fn from_request_parts(parts: &mut Parts, _: &S) -> Result<Self, ApiError> {
        Self::from_headers(&parts.headers)
    }
}

impl IfMatch {
    fn from_headers(headers: &HeaderMap) -> Result<Self, ApiError> {
        let malformed = || ApiError::new(ErrorCode::Malformed, "If-Match: expected `*` or tags such as `\"3\"`");
        let mut tags = Vec::new();
        let mut any = !headers.contains_key(header::IF_MATCH);
        for value in headers.get_all(header::IF_MATCH) {
            for item in value.to_str().map_err(|_| malformed())?.split(',').map(str::trim) {
                let (weak, quoted) = item.strip_prefix("W/").map_or((false, item), |rest| (true, rest));
                let tag = quoted.strip_prefix('"').and_then(|rest| rest.strip_suffix('"'));
                match tag {
                    Some(tag) if !tag.contains('"') && !weak => tags.push(tag.to_owned()),
                    Some(tag) if !tag.contains('"') => {}
                    None if item == "*" => any = true,
                    _ => return Err(malformed()),
                }
            }
        }
        Ok(if any { Self::Any } else { Self::OneOf(tags) })
    }

    /// The condition, as a check of the current revision.
    pub(super) fn allows(&self, revision: u64) -> bool {
        match self {
            Self::Any => true,
            Self::OneOf(tags) => tags.iter().any(|tag| *tag == revision.to_string()),
        }
    }
}
