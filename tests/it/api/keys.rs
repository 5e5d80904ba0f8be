//! API keys, origins, and what the command line refuses.

use axum::body::Body;
use axum::http::Method;
use spao_server::api::ApiKeys;
use spao_server::config::ConfigError;

use super::{Server, request, serve_args};

#[tokio::test]
async fn with_keys_everything_but_probes_and_viewer_needs_one() {
    let server = Server::new(&["--api-key", "first-key-1", "--api-key", "second-key"]);
    let ask = async |path: &str, authorization: &[(&str, &str)]| {
        server.send(request(Method::GET, path, authorization, Body::empty())).await
    };
    for path in ["/v1/volumes", "/v1/server", "/docs", "/openapi.json", "/nope"] {
        let answer = ask(path, &[]).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (401, "unauthorized"), "{path}");
        assert_eq!(answer.header("www-authenticate"), "Bearer");
    }
    // The viewer has to come before it can ask for a key.
    for path in ["/livez", "/readyz", "/", "/viewer/app.js"] {
        assert_eq!(ask(path, &[]).await.status, 200, "{path}");
    }
    for (value, status) in [
        ("Bearer first-key-1", 200),
        ("bearer second-key", 200),
        ("Bearer first-key-2", 401),
        ("Bearer first-key-", 401),
        ("Bearer first-key-11", 401),
        ("Bearer", 401),
        ("Bearer ", 401),
        ("Basic first-key-1", 401),
        ("first-key-1", 401),
    ] {
        assert_eq!(ask("/v1/volumes", &[("authorization", value)]).await.status, status, "{value}");
    }
}

#[test]
fn the_debug_text_of_keys_holds_no_key() {
    let keys = ApiKeys::new(&["very-secret".into()]);
    assert!(keys.accepts(b"very-secret") && !keys.accepts(b"very-secreT") && !keys.is_open());
    assert_eq!(format!("{keys:?}"), "ApiKeys(1)");
}

#[tokio::test]
async fn only_allowed_origins_may_call_from_a_browser() {
    let server = Server::new(&["--allow-origin", "https://viewer.example", "--api-key", "first-key-1"]);
    let preflight = async |origin: &str| {
        let headers = [("origin", origin), ("access-control-request-method", "PATCH")];
        server.send(request(Method::OPTIONS, "/v1/scenes/x", &headers, Body::empty())).await
    };
    let answer = preflight("https://viewer.example").await;
    assert_eq!(answer.status, 200);
    assert_eq!(answer.header("access-control-allow-origin"), "https://viewer.example");
    assert!(answer.header("access-control-allow-methods").contains("PATCH"));
    assert_eq!(preflight("https://other.example").await.header("access-control-allow-origin"), "");
    let headers = [("origin", "https://viewer.example")];
    let refused = server.send(request(Method::GET, "/v1/volumes", &headers, Body::empty())).await;
    assert_eq!(refused.status, 401);
    assert_eq!(refused.header("access-control-allow-origin"), "https://viewer.example");
}

#[tokio::test]
async fn without_allowed_origins_no_cors_header_is_sent() {
    let server = Server::new(&[]);
    let headers = [("origin", "https://viewer.example")];
    let answer = server.send(request(Method::GET, "/v1/volumes", &headers, Body::empty())).await;
    assert!(answer.headers.keys().all(|name| !name.as_str().starts_with("access-control")), "{:?}", answer.headers);
}

#[tokio::test]
async fn pages_of_other_origins_can_change_nothing() {
    let server = Server::new(&["--allow-origin", "https://viewer.example"]);
    let scene = server.scene().await;
    let undo = async |headers: &[(&str, &str)]| {
        let path = format!("{scene}/undo");
        server.send(request(Method::POST, &path, headers, Body::empty())).await
    };
    let foreign = undo(&[("origin", "https://other.example"), ("host", "localhost:8080")]).await;
    assert_eq!((foreign.status.as_u16(), foreign.code().as_str()), (403, "forbidden_origin"));
    // The others get as far as finding out that there is nothing to undo.
    let own = [("origin", "http://localhost:8080"), ("host", "localhost:8080")];
    for headers in [&own[..], &[("origin", "https://viewer.example")], &[]] {
        assert_eq!(undo(headers).await.status, 409, "{headers:?}");
    }
}

#[test]
fn an_address_that_others_can_reach_needs_a_key_or_an_explicit_no() {
    let verdict = |arguments: &[&str]| serve_args(arguments).validate();
    assert_eq!(verdict(&[]), Ok(()));
    assert_eq!(verdict(&["--addr", "[::1]:80"]), Ok(()));
    let open = verdict(&["--addr", "0.0.0.0:8080"]);
    assert!(matches!(open, Err(ConfigError::OpenToEveryone(_))), "{open:?}");
    assert_eq!(verdict(&["--addr", "0.0.0.0:8080", "--no-auth"]), Ok(()));
    assert_eq!(verdict(&["--addr", "0.0.0.0:8080", "--api-key", "first-key-1"]), Ok(()));
    assert_eq!(verdict(&["--no-auth", "--api-key", "first-key-1"]), Err(ConfigError::KeyAndNoAuth));
    assert_eq!(verdict(&["--api-key", "short"]), Err(ConfigError::BadKey));
    assert_eq!(verdict(&["--api-key", "with space in it"]), Err(ConfigError::BadKey));
    assert_eq!(verdict(&["--allow-origin", "viewer"]), Err(ConfigError::BadOrigin("viewer".into())));
    assert_eq!(verdict(&["--allow-origin", "http://a/b"]), Err(ConfigError::BadOrigin("http://a/b".into())));
    assert!(matches!(verdict(&["--data-dir", "no/such/directory"]), Err(ConfigError::BadDataDir(_))));
}

#[test]
fn limits_take_units() {
    let args =
        serve_args(&["--max-upload", "64K", "--gpu-memory", "3G", "--max-image", "100", "--drain-timeout", "0.5"]);
    assert_eq!(args.limits.max_upload_bytes, 65536);
    assert_eq!(args.gpu.options().memory_budget_bytes, Some(3 << 30));
    assert_eq!(args.limits.max_image_axis, 100);
    assert_eq!(args.drain_timeout.as_millis(), 500);
    assert_eq!(serve_args(&[]).limits.max_upload_bytes, 2 << 30);
}
