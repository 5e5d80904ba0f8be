//! Files from elsewhere: over HTTP and HTTPS, from S3, Google Cloud Storage and Azure.
//!
//! Architecture Invariant: nothing is fetched that the operator has not allowed, and a client cannot make the server call
//! an address inside the operator's network. Each redirect is looked at as the first URL was.

mod address;
mod allow;
mod http;
mod store;

use std::sync::{Arc, OnceLock};
use std::time::Duration;

use futures_util::{Stream, StreamExt};
use reqwest::{Client, Url};
use serde_json::json;

use crate::error::{ApiError, ErrorCode};

pub use address::is_public;
pub use allow::AllowedSource;

/// The field of a request that says where a file is.
const FIELD: &str = "source.url";

/// Time for a connection to be made.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(10);

/// Bytes that are reserved on the word of the other server.
const MAX_TRUSTED_LENGTH: u64 = 64 << 20;

/// What may be fetched, and how.
#[derive(Debug)]
pub struct Sources {
    /// Nothing else is fetched.
    allowed: Vec<AllowedSource>,
    /// Whether addresses of private networks may be called.
    allow_private: bool,
    /// Longest time in which nothing comes.
    patience: Duration,
    client: OnceLock<Client>,
}

/// A file that was fetched.
#[derive(Debug)]
pub struct SourceFile {
    /// All of it.
    pub bytes: Vec<u8>,
    /// What the other server says that it is.
    pub content_type: Option<String>,
}

/// A URL that may be fetched.
#[derive(Clone, Debug)]
pub struct SourceUrl(Url);

/// Gets the bytes that have come, and how many there are in all, if the other server says so.
pub type Told<'t> = &'t (dyn Fn(u64, Option<u64>) + Send + Sync);

impl SourceUrl {
    /// The last part of its path.
    pub fn file_name(&self) -> &str {
        self.0.path_segments().and_then(|mut parts| parts.next_back()).unwrap_or_default()
    }

    /// The URL without its query, which may be a secret.
    pub fn shown(&self) -> String {
        let mut shown = self.0.clone();
        shown.set_query(None);
        shown.set_fragment(None);
        shown.into()
    }
}

impl Sources {
    /// Nothing is connected yet.
    pub fn new(allowed: Vec<AllowedSource>, allow_private: bool, patience: Duration) -> Self {
        Self { allowed, allow_private, patience, client: OnceLock::new() }
    }

    /// Whether anything may be fetched at all.
    pub fn any_allowed(&self) -> bool {
        !self.allowed.is_empty()
    }

    /// Whether a URL may be fetched; nothing is connected.
    ///
    /// # Errors
    /// `invalid` if it is not a URL, or not allowed.
    pub fn admit(&self, url: &str) -> Result<SourceUrl, ApiError> {
        let url = Url::parse(url).map_err(|_| refused("not a URL; expected one such as https://host/head.nrrd"))?;
        self.check(&url)?;
        Ok(SourceUrl(url))
    }

    /// Fetches a file of at most `limit` bytes; `told` gets how many have come and how many there are. Dropped, it ends
    /// at once.
    ///
    /// # Errors
    /// `invalid` if the URL leads to one that is not allowed or has no file, `too_large`, `source_failed` if the other
    /// server fails.
    pub async fn fetch(&self, url: &SourceUrl, limit: u64, told: Told<'_>) -> Result<SourceFile, ApiError> {
        let (bytes, content_type) = match url.0.scheme() {
            "http" | "https" => http::get(self, url.0.clone(), limit, told).await?,
            _ => (store::get(self, &url.0, limit, told).await?, None),
        };
        Ok(SourceFile { bytes, content_type })
    }

    /// Refuses what is not allowed, and addresses that are not public; names are looked at when they are resolved.
    fn check(&self, url: &Url) -> Result<(), ApiError> {
        if self.allowed.is_empty() {
            return Err(refused("this server fetches nothing: it runs without --allow-source"));
        }
        if !self.allowed.iter().any(|allowed| allowed.allows(url)) {
            return Err(refused("expected a URL below one that the operator allows with --allow-source"));
        }
        // Stores are where the operator's environment says, whatever the client asks for.
        if matches!(url.scheme(), "http" | "https") && !self.allow_private && !address::literal_is_public(url) {
            return Err(private());
        }
        Ok(())
    }

    /// The client for files over HTTP: it follows no redirect, uses no proxy, and resolves only to public addresses.
    fn client(&self) -> Result<&Client, ApiError> {
        if let Some(client) = self.client.get() {
            return Ok(client);
        }
        let mut builder = client_builder();
        if !self.allow_private {
            builder = builder.dns_resolver(Arc::new(address::PublicOnly));
        }
        let client = builder.build().map_err(ApiError::internal)?;
        Ok(self.client.get_or_init(|| client))
    }
}

/// What every client has in common.
fn client_builder() -> reqwest::ClientBuilder {
    // Only the first call in the process has an effect; the provider is the same one.
    let _ = rustls::crypto::ring::default_provider().install_default();
    Client::builder()
        .redirect(reqwest::redirect::Policy::none())
        .no_proxy()
        .connect_timeout(CONNECT_TIMEOUT)
        .user_agent(concat!("spao-server/", env!("CARGO_PKG_VERSION")))
}

/// Reads a body of at most `limit` bytes, of which `announced` are promised.
async fn collect<B: AsRef<[u8]>, E>(
    pieces: impl Stream<Item = Result<B, E>>,
    announced: Option<u64>,
    limit: u64,
    patience: Duration,
    told: Told<'_>,
) -> Result<Vec<u8>, ApiError> {
    let too_large = || ApiError::too_large(format!("{FIELD}: the file may have {limit} bytes"), limit);
    if announced.is_some_and(|length| length > limit) {
        return Err(too_large());
    }
    let mut bytes = Vec::new();
    bytes.reserve_exact(announced.unwrap_or(0).min(MAX_TRUSTED_LENGTH) as usize);
    let mut pieces = std::pin::pin!(pieces);
    loop {
        let piece =
            tokio::time::timeout(patience, pieces.next()).await.map_err(|_| failed("the file stopped coming"))?;
        let Some(piece) = piece else { break };
        let piece = piece.map_err(|_| failed("the file ended early"))?;
        if bytes.len() as u64 + piece.as_ref().len() as u64 > limit {
            return Err(too_large());
        }
        bytes.extend_from_slice(piece.as_ref());
        told(bytes.len() as u64, announced);
    }
    Ok(bytes)
}

/// The request is at fault.
fn refused(message: &str) -> ApiError {
    ApiError::invalid(FIELD, message)
}

fn private() -> ApiError {
    refused("leads to an address that is not public; expected one on the internet (or --allow-private-sources)")
}

/// The other server is at fault.
fn failed(message: &str) -> ApiError {
    ApiError::new(ErrorCode::SourceFailed, format!("{FIELD}: {message}")).with_details(json!({ "path": FIELD }))
}
