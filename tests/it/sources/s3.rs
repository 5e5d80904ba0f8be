//! Files from a store that speaks S3: s3s-fs, a server by others, which checks signatures.

use axum::Router;
use axum::error_handling::HandleError;
use axum::http::StatusCode;
use axum::response::Redirect;
use axum::routing::get;
use s3s::auth::SimpleAuth;
use s3s::service::S3ServiceBuilder;
use s3s_fs::FileSystem;
use serde_json::{Value, json};
use tempfile::TempDir;

use super::elsewhere::file;
use crate::support::process::Process;

const KEY_ID: &str = "AKIDEXAMPLE";
const SECRET: &str = "wJalrXUtnFEMI/K7MDENG+bPxRfiCYEXAMPLEKEY";

/// A store with one bucket and one file, and where it is.
async fn store() -> (TempDir, String) {
    let root = tempfile::tempdir().expect("a folder");
    let folder = root.path().join("volumes/a folder");
    std::fs::create_dir_all(&folder).expect("a bucket is a folder");
    std::fs::write(folder.join("head.nrrd"), file()).expect("a file");
    let mut builder = S3ServiceBuilder::new(FileSystem::new(root.path()).expect("the folder is there"));
    builder.set_auth(SimpleAuth::from_single(KEY_ID, SECRET));
    let failed = async |_: s3s::HttpError| StatusCode::INTERNAL_SERVER_ERROR;
    let routes = Router::new()
        .route("/volumes/elsewhere.nrrd", get(async || Redirect::temporary("/volumes/a%20folder/head.nrrd")))
        .fallback_service(HandleError::new(builder.build(), failed));
    let listener = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a free port");
    let address = listener.local_addr().expect("it is bound");
    tokio::spawn(axum::serve(listener, routes).into_future());
    (root, format!("http://{address}"))
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
    let (_root, endpoint) = store().await;
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
    let (_root, endpoint) = store().await;
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
