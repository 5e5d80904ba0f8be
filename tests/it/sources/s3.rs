//! Files from a store that speaks like S3: a small one of our own, which checks signatures (AWS Signature Version 4) by
//! the text of the standard. The real program was also run against s3s-fs 0.14.1, an S3 server by others, with the same
//! results; it is no dependency of the tests since it needs a newer Rust than this package.

use std::sync::Arc;

use axum::Router;
use axum::extract::State;
use axum::http::{HeaderMap, StatusCode, Uri, header};
use axum::response::{IntoResponse, Response};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};

use super::elsewhere::file;
use crate::support::process::Process;

const KEY_ID: &str = "AKIDEXAMPLE";
const SECRET: &str = "wJalrXUtnFEMI/K7MDENG+bPxRfiCYEXAMPLEKEY";

/// HMAC with SHA-256 (RFC 2104) of a key that is not longer than a block.
fn hmac(key: &[u8], message: &[u8]) -> Vec<u8> {
    let pad = |byte: u8| -> Vec<u8> {
        let padded = key.iter().copied().chain(std::iter::repeat(0)).take(64);
        padded.map(|k| k ^ byte).collect()
    };
    let inner = Sha256::digest([&pad(0x36)[..], message].concat());
    Sha256::digest([&pad(0x5c)[..], &inner[..]].concat()).to_vec()
}

fn hex(bytes: &[u8]) -> String {
    bytes.iter().map(|byte| format!("{byte:02x}")).collect()
}

/// The signature that a GET should have.
fn signature(path: &str, headers: &HeaderMap, scope: &str, signed: &str) -> String {
    let text = |name: &str| headers.get(name).and_then(|value| value.to_str().ok()).unwrap_or_default().trim();
    let lines: String = signed.split(';').map(|name| format!("{name}:{}\n", text(name))).collect();
    let canonical = format!("GET\n{path}\n\n{lines}\n{signed}\n{}", text("x-amz-content-sha256"));
    let hashed = hex(&Sha256::digest(canonical));
    let to_sign = format!("AWS4-HMAC-SHA256\n{}\n{scope}\n{hashed}", text("x-amz-date"));
    let key = scope.split('/').fold(format!("AWS4{SECRET}").into_bytes(), |key, part| hmac(&key, part.as_bytes()));
    hex(&hmac(&key, to_sign.as_bytes()))
}

/// Whether a request is signed by the owner of the key.
fn is_signed(path: &str, headers: &HeaderMap) -> bool {
    let authorization = headers.get(header::AUTHORIZATION).and_then(|value| value.to_str().ok()).unwrap_or_default();
    let part = |name: &str| {
        let (_, rest) = authorization.split_once(name)?;
        rest.split([',', ' ']).next()
    };
    let (Some(credential), Some(signed), Some(got)) = (part("Credential="), part("SignedHeaders="), part("Signature="))
    else {
        return false;
    };
    let scope = credential.strip_prefix(KEY_ID).and_then(|rest| rest.strip_prefix('/')).unwrap_or_default();
    ["host", "x-amz-date"].iter().all(|name| signed.split(';').any(|header| header == *name))
        && got == signature(path, headers, scope, signed)
}

async fn answer(State(file): State<Arc<Vec<u8>>>, uri: Uri, headers: HeaderMap) -> Response {
    let error = |status: StatusCode, code: &str| {
        let body = format!("<?xml version=\"1.0\"?><Error><Code>{code}</Code><Message>no</Message></Error>");
        (status, [(header::CONTENT_TYPE, "application/xml")], body).into_response()
    };
    if !is_signed(uri.path(), &headers) {
        return error(StatusCode::FORBIDDEN, "SignatureDoesNotMatch");
    }
    match uri.path() {
        "/volumes/a%20folder/head.nrrd" => {
            let tags = [(header::ETAG, "\"1\""), (header::LAST_MODIFIED, "Wed, 12 Oct 2022 17:50:00 GMT")];
            (tags, file.to_vec()).into_response()
        }
        "/volumes/elsewhere.nrrd" => {
            (StatusCode::TEMPORARY_REDIRECT, [(header::LOCATION, "/volumes/a%20folder/head.nrrd")]).into_response()
        }
        _ => error(StatusCode::NOT_FOUND, "NoSuchKey"),
    }
}

/// A store, and where it is.
async fn store() -> String {
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    let routes = Router::new().fallback(answer).with_state(Arc::new(file()));
    tokio::spawn(axum::serve(listener, routes).into_future());
    format!("http://{address}")
}

/// Status and body of a request for a volume.
fn load(process: &Process, url: &str) -> (u16, Value) {
    let agent: ureq::Agent = ureq::Agent::config_builder().http_status_as_error(false).build().into();
    let body = json!({ "source": { "url": url } }).to_string();
    let request = agent.post(process.url("/v1/volumes")).header("content-type", "application/json");
    let mut answer = request.send(body).expect("an answer");
    let text = answer.body_mut().read_to_string().expect("a text");
    (answer.status().as_u16(), serde_json::from_str(&text).expect("JSON"))
}

fn start(endpoint: &str, secret: &str) -> Process {
    let environment = [
        ("AWS_ENDPOINT", endpoint),
        ("AWS_ALLOW_HTTP", "true"),
        ("AWS_REGION", "eu-central-1"),
        ("AWS_ACCESS_KEY_ID", KEY_ID),
        ("AWS_SECRET_ACCESS_KEY", secret),
    ];
    let arguments = ["--allow-source", "s3://volumes/", "--max-upload", "10000"];
    Process::start_with(&arguments, &environment)
}

#[tokio::test(flavor = "multi_thread")]
async fn a_file_comes_from_a_store_with_the_credentials_of_the_environment() {
    let endpoint = store().await;
    let work = tokio::task::spawn_blocking(move || {
        let process = start(&endpoint, SECRET);
        let (status, volume) = load(&process, "s3://volumes/a%20folder/head.nrrd");
        assert_eq!((status, &volume["dims"]), (201, &json!([4, 3, 2])), "{volume}");
        assert_eq!(volume["source"], json!({ "url": "s3://volumes/a%20folder/head.nrrd" }));
        for (url, status, code, message) in [
            ("s3://volumes/none.nrrd", 422, "invalid", "has no such file"),
            ("s3://volumes/", 422, "invalid", "a bucket and a key"),
            ("s3://volumes/a?versionId=1", 422, "invalid", "a bucket and a key"),
            ("s3://other/a%20folder/head.nrrd", 422, "invalid", "--allow-source"),
            ("gs://volumes/head.nrrd", 422, "invalid", "--allow-source"),
            ("s3://volumes/elsewhere.nrrd", 502, "source_failed", "the store fails"),
        ] {
            let (got, body) = load(&process, url);
            assert_eq!((got, body["error"]["code"].as_str()), (status, Some(code)), "{url}: {body}");
            assert!(body["error"]["message"].as_str().is_some_and(|text| text.contains(message)), "{url}: {body}");
            assert_eq!(body["error"]["details"]["path"], "source.url", "{url}");
        }
        process.stop_clean();
    });
    work.await.expect("no panic");
}

#[tokio::test(flavor = "multi_thread")]
async fn a_store_that_refuses_the_credentials_is_told_from_one_without_the_file() {
    let endpoint = store().await;
    let work = tokio::task::spawn_blocking(move || {
        let process = start(&endpoint, "another secret");
        let (status, body) = load(&process, "s3://volumes/a%20folder/head.nrrd");
        assert_eq!((status, body["error"]["code"].as_str()), (422, Some("invalid")), "{body}");
        assert!(
            body.to_string().contains("does not give the file") && !body.to_string().contains("Signature"),
            "{body}"
        );
        process.stop_clean();
    });
    work.await.expect("no panic");
}
