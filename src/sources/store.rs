//! Files from object stores: S3 and what speaks like it, Google Cloud Storage, Azure Blob Storage.
//!
//! Endpoints, regions and credentials are those of the environment (`AWS_*`, `GOOGLE_*`, `AZURE_*`), as the
//! `object_store` crate reads them. A client names only a bucket that is allowed and a key, so addresses are the
//! operator's choice and may be private.

use std::time::Duration;

use object_store::aws::AmazonS3Builder;
use object_store::azure::MicrosoftAzureBuilder;
use object_store::client::{HttpClient, HttpConnector};
use object_store::gcp::GoogleCloudStorageBuilder;
use object_store::path::Path;
use object_store::{ClientConfigKey, ClientOptions, Error, ObjectStore, ObjectStoreExt, RetryConfig};
use reqwest::Url;

use super::{Sources, Told, client_builder, collect, failed, refused};
use crate::error::ApiError;

/// A client waits: better an error soon than a file late.
const RETRIES: usize = 2;

/// Time for all tries of one request.
const RETRY_TIMEOUT: Duration = Duration::from_secs(20);

/// Connections that follow no redirect, and are encrypted unless the environment says otherwise (`AWS_ALLOW_HTTP`).
#[derive(Debug)]
struct Connector;

impl HttpConnector for Connector {
    fn connect(&self, options: &ClientOptions) -> object_store::Result<HttpClient> {
        let allow_http = options.get_config_value(&ClientConfigKey::AllowHttp).is_some_and(|value| value == "true");
        let client = client_builder().https_only(!allow_http).build();
        let client = client.map_err(|source| Error::Generic { store: "client", source: source.into() })?;
        Ok(HttpClient::new(client))
    }
}

/// The file.
pub(super) async fn get(sources: &Sources, url: &Url, limit: u64, told: Told<'_>) -> Result<Vec<u8>, ApiError> {
    let bucket = url.host_str().unwrap_or_default();
    let plain = |b: u8| b.is_ascii_alphanumeric() || b"-._".contains(&b);
    let key = Path::from_url_path(url.path()).ok().filter(|key| !key.as_ref().is_empty());
    let (true, Some(key), None, None) = (bucket.bytes().all(plain), key, url.port(), url.query()) else {
        return Err(refused("expected a bucket and a key, such as s3://bucket/folder/head.nrrd"));
    };
    let store = open(url.scheme(), bucket).map_err(|cause| {
        tracing::info!(%cause, "a store is not set up");
        failed(&format!("this server is not set up for {} sources", url.scheme()))
    })?;
    let answer = tokio::time::timeout(sources.patience, store.get(&key)).await;
    let answer = answer.map_err(|_| failed("the store does not answer"))?.map_err(store_error)?;
    let announced = Some(answer.meta.size);
    collect(answer.into_stream(), announced, limit, sources.patience, told).await
}

fn open(scheme: &str, bucket: &str) -> object_store::Result<Box<dyn ObjectStore>> {
    let retry = RetryConfig { max_retries: RETRIES, retry_timeout: RETRY_TIMEOUT, ..RetryConfig::default() };
    Ok(match scheme {
        "s3" => {
            let builder = AmazonS3Builder::from_env().with_bucket_name(bucket);
            Box::new(builder.with_retry(retry).with_http_connector(Connector).build()?)
        }
        "gs" => {
            let builder = GoogleCloudStorageBuilder::from_env().with_bucket_name(bucket);
            Box::new(builder.with_retry(retry).with_http_connector(Connector).build()?)
        }
        _ => {
            let builder = MicrosoftAzureBuilder::from_env().with_container_name(bucket);
            Box::new(builder.with_retry(retry).with_http_connector(Connector).build()?)
        }
    })
}

fn store_error(error: Error) -> ApiError {
    match error {
        Error::NotFound { .. } => refused("the store has no such file"),
        Error::PermissionDenied { .. } | Error::Unauthenticated { .. } => {
            refused("the store does not give the file to this server")
        }
        other => {
            tracing::info!(cause = %other, "a store fails");
            failed("the store fails")
        }
    }
}
