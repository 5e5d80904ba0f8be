//! The HTTP interface, in process: requests go to the router and answers come back, without a socket.

pub(crate) mod accessibility;
mod bad_scenes;
mod catalogue;
mod envelope;
mod files;
mod frames;
mod hostile;
mod keys;
mod loads;
mod openapi;
mod process;
mod reduced;
mod scenes;
mod slices;
mod volumes;
mod voxels;

use axum::Router;
use axum::body::{Body, to_bytes};
use axum::http::{HeaderMap, Method, Request, StatusCode};
use clap::Parser;
use serde_json::{Value, json};
use spao_server::api::{AppState, Phase, router};
use spao_server::config::{Cli, Command, ServeArgs};
use spao_server::render_thread::RenderHandle;
use tower::ServiceExt;

use crate::support::renderer;

/// A server that is ready, with its own volumes and scenes and everybody's renderer.
pub(crate) struct Server {
    pub(crate) state: AppState,
    pub(crate) router: Router,
}

/// What came back.
#[derive(Debug)]
pub(crate) struct Answer {
    pub(crate) status: StatusCode,
    pub(crate) headers: HeaderMap,
    pub(crate) bytes: Vec<u8>,
}

/// The arguments of `serve`.
pub(crate) fn serve_args(arguments: &[&str]) -> ServeArgs {
    let all = ["spao-server", "serve"].iter().chain(arguments);
    match Cli::try_parse_from(all).expect("the arguments are right").command {
        Command::Serve(args) => *args,
        other => panic!("{other:?}"),
    }
}

impl Server {
    pub(crate) fn new(arguments: &[&str]) -> Self {
        Self::with_renderer(arguments, renderer())
    }

    pub(crate) fn with_renderer(arguments: &[&str], renderer: RenderHandle) -> Self {
        let state = AppState::new(&serve_args(arguments), renderer);
        state.lifecycle.enter(Phase::Serving);
        Self { router: router(state.clone()), state }
    }

    pub(crate) async fn send(&self, request: Request<Body>) -> Answer {
        let response = self.router.clone().oneshot(request).await.expect("the router always answers");
        let (parts, body) = response.into_parts();
        let bytes = to_bytes(body, usize::MAX).await.expect("bodies of answers are whole");
        let answer = Answer { status: parts.status, headers: parts.headers, bytes: bytes.to_vec() };
        if parts.status.as_u16() >= 400 && !answer.bytes.is_empty() {
            answer.assert_envelope();
        }
        answer
    }

    pub(crate) async fn get(&self, path: &str) -> Answer {
        self.send(request(Method::GET, path, &[], Body::empty())).await
    }

    pub(crate) async fn delete(&self, path: &str) -> Answer {
        self.send(request(Method::DELETE, path, &[], Body::empty())).await
    }

    pub(crate) async fn post(&self, path: &str, body: &Value) -> Answer {
        self.json(Method::POST, path, &[], body).await
    }

    pub(crate) async fn patch(&self, path: &str, body: &Value) -> Answer {
        self.json(Method::PATCH, path, &[], body).await
    }

    pub(crate) async fn json(&self, method: Method, path: &str, headers: &[(&str, &str)], body: &Value) -> Answer {
        let headers = [&[("content-type", "application/json")], headers].concat();
        self.send(request(method, path, &headers, Body::from(body.to_string()))).await
    }

    /// Uploads bytes.
    pub(crate) async fn upload(&self, query: &str, bytes: impl Into<Body>) -> Answer {
        self.send(request(Method::POST, &format!("/v1/volumes?{query}"), &[], bytes.into())).await
    }

    /// A small gyroid; its id.
    pub(crate) async fn volume(&self) -> String {
        let source = json!({ "procedural": { "kind": "gyroid", "dims": [20, 16, 12] } });
        let answer = self.post("/v1/volumes", &json!({ "source": source })).await;
        assert_eq!(answer.status, 201, "{answer:?}");
        answer.json()["id"].as_str().expect("volumes have ids").to_owned()
    }

    /// A scene of a small gyroid, with small pictures; its path.
    pub(crate) async fn scene(&self) -> String {
        let body = json!({ "volume": self.volume().await, "viewport": { "width": 48, "height": 32 } });
        let answer = self.post("/v1/scenes", &body).await;
        assert_eq!(answer.status, 201, "{answer:?}");
        format!("/v1/scenes/{}", answer.json()["id"].as_str().expect("scenes have ids"))
    }
}

/// A request.
pub(crate) fn request(method: Method, path: &str, headers: &[(&str, &str)], body: Body) -> Request<Body> {
    let builder = Request::builder().method(method).uri(path);
    let builder = headers.iter().fold(builder, |builder, (name, value)| builder.header(*name, *value));
    builder.body(body).expect("the request is well-formed")
}

impl Answer {
    pub(crate) fn json(&self) -> Value {
        serde_json::from_slice(&self.bytes).unwrap_or_else(|error| panic!("{error}: {self:?}"))
    }

    pub(crate) fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", |value| value.to_str().expect("headers are ASCII"))
    }

    pub(crate) fn code(&self) -> String {
        self.json()["error"]["code"].as_str().unwrap_or_default().to_owned()
    }

    /// The field that an error names.
    pub(crate) fn path(&self) -> String {
        self.json()["error"]["details"]["path"].as_str().unwrap_or_default().to_owned()
    }

    /// Status, code and field in one.
    pub(crate) fn verdict(&self) -> (u16, String, String) {
        (self.status.as_u16(), self.code(), self.path())
    }

    /// The body of an error is the envelope, names the request id of the header, and tells nothing of the inside.
    pub(crate) fn assert_envelope(&self) {
        if let Err(fault) = envelope_fault(&self.json(), self.header("x-request-id")) {
            panic!("{fault}: {self:?}");
        }
        let text = String::from_utf8_lossy(&self.bytes);
        for inside in ["panicked", "src/", ".rs:", "/home/"] {
            assert!(!text.contains(inside), "{text} tells {inside}");
        }
    }
}

/// What is wrong with an error's body.
pub(crate) fn envelope_fault(body: &Value, request_id: &str) -> Result<(), String> {
    let outer: Vec<&String> = body.as_object().ok_or("not an object")?.keys().collect();
    if outer != ["error"] {
        return Err(format!("outer fields {outer:?}"));
    }
    let error = body["error"].as_object().ok_or("error is not an object")?;
    for name in error.keys() {
        if !["code", "message", "details", "request_id"].contains(&name.as_str()) {
            return Err(format!("unknown field {name}"));
        }
    }
    for name in ["code", "message", "request_id"] {
        if error.get(name).and_then(Value::as_str).is_none_or(str::is_empty) {
            return Err(format!("no {name}"));
        }
    }
    if error["request_id"] != request_id {
        return Err("another request id in the header".into());
    }
    match error.get("details") {
        Some(details) if !details.is_object() => Err("details are not an object".into()),
        _ => Ok(()),
    }
}
