//! Files over HTTP, from a server on this machine.

use std::time::Duration;

use axum::body::Body;
use axum::http::Method;
use serde_json::{Value, json};

use super::elsewhere::Elsewhere;
use crate::api::{Answer, Server, request};

fn from(url: &str) -> Value {
    json!({ "source": { "url": url } })
}

/// The server that is tested, allowed to fetch files of the other one.
fn allowed(elsewhere: &Elsewhere, arguments: &[&str]) -> Server {
    let files = elsewhere.url("files/");
    Server::new(&[&["--allow-source", files.as_str(), "--allow-private-sources"], arguments].concat())
}

async fn load(server: &Server, url: &str) -> Answer {
    server.post("/v1/volumes", &from(url)).await
}

/// Nothing remains of a volume that could not be fetched, not even its place in the line.
async fn assert_nothing_remains(server: &Server) {
    assert_eq!(server.get("/v1/volumes").await.json(), json!({ "volumes": [] }));
    server.volume().await;
}

#[tokio::test]
async fn a_file_is_fetched_and_its_query_is_not_told() {
    let elsewhere = Elsewhere::start().await;
    let server = allowed(&elsewhere, &[]);
    for (name, called) in [("small.nrrd", "small"), ("small", "small"), ("typed", "typed")] {
        let answer = load(&server, &elsewhere.url(&format!("files/{name}?signature=secret"))).await;
        assert_eq!(answer.status, 201, "{answer:?}");
        let volume = answer.json();
        assert_eq!((&volume["dims"], &volume["value_range"]), (&json!([4, 3, 2]), &json!([0.0, 23.0])));
        assert_eq!(volume["source"], from(&elsewhere.url(&format!("files/{name}")))["source"]);
        assert_eq!(volume["name"], called);
    }
    let answer = server.post("/v1/volumes?dry_run=true", &from(&elsewhere.url("files/small.nrrd"))).await;
    assert_eq!((answer.status.as_u16(), &answer.json()["dims"]), (200, &json!([4, 3, 2])));
    assert_eq!(server.get("/v1/volumes").await.json()["volumes"].as_array().map(Vec::len), Some(3));
}

#[tokio::test]
async fn what_is_wrong_with_a_source_is_told() {
    let elsewhere = Elsewhere::start().await;
    let server = allowed(&elsewhere, &["--max-upload", "50000", "--request-timeout", "0.3"]);
    for (name, status, code, message) in [
        ("404", 422, "invalid", "has no such file"),
        ("403", 422, "invalid", "does not give the file"),
        ("418", 422, "invalid", "refuses with 418"),
        ("206", 502, "source_failed", "answers 206"),
        ("500", 502, "source_failed", "answers 500"),
        ("429", 502, "source_failed", "answers 429"),
        ("nowhere", 502, "source_failed", "redirects to nowhere"),
        ("large.nrrd", 413, "too_large", "50000 bytes"),
        ("large_unsaid.nrrd", 413, "too_large", "50000 bytes"),
        ("slow.nrrd", 502, "source_failed", "stopped coming"),
        ("early.nrrd", 502, "source_failed", "ended early"),
        ("never", 502, "source_failed", "does not answer"),
        ("picture.png", 415, "unknown_format", "single picture"),
        ("broken.nrrd", 400, "malformed", "type"),
    ] {
        let answer = load(&server, &elsewhere.url(&format!("files/{name}"))).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (status, code), "{name}: {answer:?}");
        let told = answer.json()["error"]["message"].as_str().expect("a message").to_owned();
        assert!(told.contains(message) && !told.contains("127.0.0.1"), "{name}: {told}");
        if ["invalid", "source_failed"].contains(&code) {
            assert_eq!(answer.path(), "source.url", "{name}");
        }
    }
    assert_nothing_remains(&server).await;
}

#[tokio::test]
async fn a_server_that_is_not_there_is_told_without_its_inside() {
    let closed = tokio::net::TcpListener::bind("127.0.0.1:0").await.expect("a port").local_addr().expect("an address");
    let url = format!("http://{closed}/a.nrrd");
    let server = Server::new(&["--allow-source", &url, "--allow-private-sources"]);
    let answer = load(&server, &url).await;
    assert_eq!(answer.verdict(), (502, "source_failed".into(), "source.url".into()));
    assert!(!String::from_utf8_lossy(&answer.bytes).contains("refused"), "{answer:?}");
}

#[tokio::test]
async fn redirects_are_followed_only_where_fetching_is_allowed() {
    let elsewhere = Elsewhere::start().await;
    let server = allowed(&elsewhere, &[]);
    assert_eq!(load(&server, &elsewhere.url("files/redirect?small.nrrd")).await.status, 201);
    // `steps?4` is asked for and redirects five times.
    assert_eq!(load(&server, &elsewhere.url("files/steps?4")).await.status, 201);
    for query in [
        "files/steps?5".to_owned(),
        "files/redirect?redirect".into(),
        "files/redirect?/secret/small.nrrd".into(),
        "files/redirect?//evil.example/files/small.nrrd".into(),
        format!("files/redirect?http://localhost:{}/files/small.nrrd", elsewhere.address.port()),
        "files/redirect?http://169.254.169.254/latest/meta-data/".into(),
    ] {
        let answer = load(&server, &elsewhere.url(&query)).await;
        assert_eq!(answer.verdict(), (422, "invalid".into(), "source.url".into()), "{query}");
    }
    let answer = load(&server, &elsewhere.url("files/redirect?file:///etc/passwd")).await;
    assert_eq!(answer.verdict(), (502, "source_failed".into(), "source.url".into()));
}

#[tokio::test]
async fn nothing_is_fetched_that_is_not_allowed() {
    let elsewhere = Elsewhere::start().await;
    let file = elsewhere.url("files/small.nrrd");
    let closed = Server::new(&["--allow-private-sources"]);
    assert_eq!(load(&closed, &file).await.verdict(), (422, "invalid".into(), "source.url".into()));
    let sources = async |server: &Server| server.get("/v1/server").await.json()["features"]["volume_sources"].clone();
    assert_eq!(sources(&closed).await, json!(["upload", "procedural"]));
    let server = allowed(&elsewhere, &[]);
    assert_eq!(sources(&server).await, json!(["upload", "url", "procedural"]));
    for url in [
        elsewhere.url("secret/small.nrrd"),
        elsewhere.url("files/../secret/small.nrrd"),
        elsewhere.url("files/..%2fsecret/small.nrrd"),
        file.replace("127.0.0.1", "localhost"),
        file.replace("http://", "http://user@"),
        "s3://bucket/key".into(),
        "file:///etc/passwd".into(),
        "small.nrrd".into(),
        String::new(),
    ] {
        assert_eq!(load(&server, &url).await.verdict(), (422, "invalid".into(), "source.url".into()), "{url}");
    }
    assert_eq!(elsewhere.requests(), 0);
    assert_eq!(load(&server, &file).await.status, 201);
    assert_eq!(elsewhere.requests(), 1, "the count would have seen it");
}

#[tokio::test]
async fn addresses_that_are_not_public_are_never_called() {
    let elsewhere = Elsewhere::start().await;
    let port = elsewhere.address.port();
    for host in ["127.0.0.1", "localhost", "2130706433", "0x7f.1", "127.1", "[::1]", "[::ffff:127.0.0.1]", "0.0.0.0"] {
        let url = format!("http://{host}:{port}/files/small.nrrd");
        let server = Server::new(&["--allow-source", &url]);
        let answer = load(&server, &url).await;
        assert_eq!(answer.verdict(), (422, "invalid".into(), "source.url".into()), "{host}: {answer:?}");
        assert!(String::from_utf8_lossy(&answer.bytes).contains("not public"), "{host}: {answer:?}");
    }
    assert_eq!(elsewhere.requests(), 0);
    let url = format!("http://localhost:{port}/files/small.nrrd");
    let open = Server::new(&["--allow-source", &url, "--allow-private-sources"]);
    assert_eq!(load(&open, &url).await.status, 201, "only the flag makes the difference");
}

#[tokio::test]
async fn a_client_that_leaves_ends_the_fetching() {
    let elsewhere = Elsewhere::start().await;
    let server = allowed(&elsewhere, &[]);
    let body = Body::from(from(&elsewhere.url("files/slow.nrrd")).to_string());
    let asked = server.send(request(Method::POST, "/v1/volumes", &[("content-type", "application/json")], body));
    assert!(tokio::time::timeout(Duration::from_millis(500), asked).await.is_err(), "it is slow");
    assert_eq!(elsewhere.requests(), 1);
    assert!(elsewhere.is_left().await, "the other server still sends");
    assert_nothing_remains(&server).await;
}

#[tokio::test]
async fn a_volume_that_is_deleted_while_it_is_fetched_ends_the_fetching() {
    let elsewhere = Elsewhere::start().await;
    let server = allowed(&elsewhere, &[]);
    let url = elsewhere.url("files/slow.nrrd");
    let started = server.post("/v1/volumes?wait=false", &from(&format!("{url}?signature=secret"))).await;
    assert_eq!(started.status, 202, "{started:?}");
    let volume = started.json();
    assert_eq!((&volume["name"], &volume["source"]), (&json!("slow"), &json!({ "url": url })));
    assert_eq!((&volume["state"], &volume["progress"]["what"]), (&json!("loading"), &json!("fetching")));
    while elsewhere.requests() == 0 {
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
    assert_eq!(server.delete(started.header("location")).await.status, 204);
    assert!(elsewhere.is_left().await, "the other server still sends");
    assert_nothing_remains(&server).await;
}

#[tokio::test]
async fn a_file_that_cannot_be_fetched_is_listed_as_failed_where_nobody_waits() {
    let elsewhere = Elsewhere::start().await;
    let server = allowed(&elsewhere, &[]);
    let started = server.post("/v1/volumes?wait=false", &from(&elsewhere.url("files/none.nrrd"))).await;
    assert_eq!(started.status, 202, "{started:?}");
    let path = started.header("location");
    let mut volume = started.json();
    while volume["state"] == "loading" {
        tokio::time::sleep(Duration::from_millis(5)).await;
        volume = server.get(path).await.json();
    }
    assert_eq!((&volume["state"], &volume["error"]["code"]), (&json!("failed"), &json!("invalid")), "{volume}");
    assert_eq!(volume["error"]["details"]["path"], "source.url");
}
