//! The error envelope, request ids, HEAD, and what stands between a client and the routes.

use std::time::Duration;

use axum::Router;
use axum::body::Body;
use axum::http::Method;
use axum::routing::get;
use serde_json::json;
use spao_server::api::{Phase, with_middleware};
use spao_server::error::ErrorCode;

use super::{Server, envelope_fault, request};

#[test]
fn the_envelope_check_finds_every_fault() {
    let good = json!({ "error": { "code": "c", "message": "m", "request_id": "r" } });
    assert_eq!(envelope_fault(&good, "r"), Ok(()));
    let faults = [
        json!({ "error": { "code": "c", "message": "m", "request_id": "other" } }),
        json!({ "error": { "code": "c", "message": "m" } }),
        json!({ "error": { "code": "", "message": "m", "request_id": "r" } }),
        json!({ "error": { "code": "c", "message": "m", "request_id": "r", "cause": "x" } }),
        json!({ "error": { "code": "c", "message": "m", "request_id": "r", "details": "x" } }),
        json!({ "error": "c" }),
        json!({ "error": {}, "more": 1 }),
        json!([]),
    ];
    for fault in faults {
        assert!(envelope_fault(&fault, "r").is_err(), "{fault}");
    }
}

#[test]
fn every_error_code_has_a_name_of_its_own_and_an_error_status() {
    let mut names: Vec<_> = ErrorCode::ALL.iter().map(|code| code.name_and_status().0).collect();
    assert!(ErrorCode::ALL.iter().all(|code| (400..=511).contains(&code.name_and_status().1)));
    names.sort_unstable();
    names.dedup();
    assert_eq!(names.len(), ErrorCode::ALL.len());
}

#[tokio::test]
async fn unknown_routes_and_methods_answer_with_the_envelope() {
    let server = Server::new(&[]);
    for path in ["/nope", "/v1", "/v1/volumes/", "/v1/scenes/x/pick", "//"] {
        let answer = server.get(path).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (404, "not_found"), "{path}");
    }
    let answer = server.send(request(Method::PUT, "/v1/volumes", &[], Body::empty())).await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (405, "method_not_allowed"));
    assert!(answer.header("allow").contains("POST"), "{:?}", answer.headers);
}

#[tokio::test]
async fn ids_that_do_not_exist_are_named() {
    let server = Server::new(&[]);
    for (path, code) in [
        ("/v1/volumes/v_0", "volume_not_found"),
        ("/v1/volumes/v_0/histogram", "volume_not_found"),
        ("/v1/scenes/s_0", "scene_not_found"),
        ("/v1/scenes/s_0/frame", "scene_not_found"),
        ("/v1/scenes/s_0/ao", "scene_not_found"),
        ("/v1/scenes/s_0/stream", "scene_not_found"),
        ("/v1/presets/none/thumbnail", "preset_not_found"),
    ] {
        let answer = server.get(path).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (404, code), "{path}");
    }
    let long = server.get(&format!("/v1/volumes/%00%0a{}", "v".repeat(5000))).await;
    assert_eq!(long.code(), "volume_not_found");
    assert_eq!(long.json()["error"]["details"]["volume"], "v".repeat(64));
}

#[tokio::test]
async fn a_sane_request_id_comes_back_and_any_other_is_replaced() {
    let server = Server::new(&[]);
    let ask = async |id: &str| server.send(request(Method::GET, "/nope", &[("x-request-id", id)], Body::empty())).await;
    let answer = ask("my-id/42").await;
    assert_eq!(answer.header("x-request-id"), "my-id/42");
    assert_eq!(answer.json()["error"]["request_id"], "my-id/42");
    for bad in ["", "two words", "naïve", &"x".repeat(129)] {
        let answer = ask(bad).await;
        assert_ne!(answer.header("x-request-id"), bad);
        assert_eq!(answer.header("x-request-id").len(), 16);
    }
    assert_ne!(ask("").await.header("x-request-id"), ask("").await.header("x-request-id"));
}

#[tokio::test]
async fn head_is_answered_like_get_without_a_body() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    for path in ["/", "/v1/volumes", "/v1/server", "/livez", "/docs", &scene, &format!("{scene}/frame"), "/nope"] {
        let get = server.get(path).await;
        let head = server.send(request(Method::HEAD, path, &[], Body::empty())).await;
        assert_eq!(head.status, get.status, "{path}");
        assert_eq!(head.header("content-type"), get.header("content-type"), "{path}");
        assert!(head.bytes.is_empty(), "{path}");
    }
}

#[tokio::test]
async fn a_panic_in_a_handler_is_an_internal_error_that_tells_nothing() {
    let server = Server::new(&[]);
    let panics = get(async || -> () { panic!("the secret in src/inside.rs:1") });
    let router = with_middleware(Router::new().route("/panics", panics), server.state.clone());
    let server = Server { state: server.state, router };
    let answer = server.get("/panics").await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (500, "internal"));
    assert!(!String::from_utf8_lossy(&answer.bytes).contains("secret"));
}

#[tokio::test]
async fn a_request_that_takes_too_long_is_ended() {
    let server = Server::new(&["--request-timeout", "0.05"]);
    let slow = get(async || tokio::time::sleep(Duration::from_secs(60)).await);
    let router = with_middleware(Router::new().route("/slow", slow), server.state.clone());
    let server = Server { state: server.state, router };
    let answer = server.get("/slow").await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (503, "timeout"));
    assert_eq!(answer.header("retry-after"), "10");
}

#[tokio::test]
async fn bodies_that_are_not_json_are_refused() {
    let server = Server::new(&[]);
    let send = async |content_type: &str, body: &str| {
        let headers = [("content-type", content_type)];
        let answer = server.send(request(Method::POST, "/v1/scenes", &headers, Body::from(body.to_owned()))).await;
        (answer.status.as_u16(), answer.code())
    };
    for body in ["", "{", "{\"volume\": \"v\"} x", "{\"volume\": NaN}", "{\"volume\": 1e999}", &"[".repeat(100_000)] {
        assert_eq!(send("application/json", body).await, (400, "malformed".into()), "{body:.40}");
    }
    assert_eq!(send("text/plain", "{}").await, (415, "unsupported_media_type".into()));
    assert_eq!(send("application/jsonx", "{}").await, (415, "unsupported_media_type".into()));
    assert_eq!(send("application/json; charset=utf-8", "{}").await, (422, "invalid".into()));
    let long = format!("{{\"volume\": \"{}\"}}", "x".repeat(2 << 20));
    assert_eq!(send("application/json", &long).await, (413, "too_large".into()));
}

#[tokio::test]
async fn query_strings_are_checked() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    for (query, path) in [
        ("width=0", "width"),
        ("width=abc", "width"),
        ("height=-1", "height"),
        ("height=1.5", "height"),
        ("width=99999999999", "width"),
        ("format=gif", "format"),
        ("width=8&width=9", "width"),
        ("widht=8", "widht"),
    ] {
        let answer = server.get(&format!("{scene}/frame?{query}")).await;
        assert_eq!(answer.verdict(), (422, "invalid".into(), path.into()), "{query}");
    }
    assert_eq!(server.get(&format!("{scene}/frame?width=&format=")).await.status, 200);
}

#[tokio::test]
async fn a_server_that_starts_or_drains_is_alive_but_not_ready() {
    let server = Server::new(&[]);
    assert_eq!(server.get("/readyz").await.json(), json!({ "status": "ready" }));
    server.state.lifecycle.enter(Phase::Draining);
    server.state.lifecycle.enter(Phase::Serving);
    for path in ["/readyz", "/v1/volumes", "/"] {
        let answer = server.get(path).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (503, "not_ready"), "{path}");
        assert_eq!(answer.json()["error"]["details"]["reason"], "draining");
        assert_eq!(answer.header("retry-after"), "1");
    }
    assert_eq!(server.get("/livez").await.json(), json!({ "status": "alive" }));
}
