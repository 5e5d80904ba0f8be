//! Opening a stream: origin, key, scene, and the client's hello.

use std::time::Duration;

use axum::extract::ws::rejection::WebSocketUpgradeRejection;
use axum::extract::ws::{Message, WebSocket, WebSocketUpgrade};
use axum::extract::{Path, State};
use axum::http::{HeaderMap, header};
use axum::response::Response;
use data_encoding::BASE64URL_NOPAD;

use super::connection::{FAREWELL, serve};
use super::messages::{self, Hello, Incoming, PROTOCOL};
use super::watcher::Watcher;
use crate::api::{AppState, auth};
use crate::error::{ApiError, ErrorCode};

/// The subprotocol's own name; a key may follow as a second one, [`KEY_SUBPROTOCOL`] and the key in base64url.
const SUBPROTOCOL: &str = "spao.v1";
const KEY_SUBPROTOCOL: &str = "bearer.";

/// Longest message from a client: a scene with the most control points is well under it.
const MAX_MESSAGE_BYTES: usize = 1 << 20;

/// A client that says nothing for so long after connecting is none.
const HELLO_TIMEOUT: Duration = Duration::from_secs(10);

/// `GET /v1/scenes/{id}/stream`
pub(in crate::api) async fn open(
    State(state): State<AppState>,
    Path(id): Path<String>,
    headers: HeaderMap,
    upgrade: Result<WebSocketUpgrade, WebSocketUpgradeRejection>,
) -> Result<Response, ApiError> {
    auth::check_origin(&headers, &state.allow_origins)?;
    let entry = state.scenes.get(&id)?;
    let known = match key(&headers) {
        _ if state.keys.is_open() => true,
        Some(key) if state.keys.accepts(&key) => true,
        Some(_) => return Err(ApiError::new(ErrorCode::Unauthorized, "this key is not known")),
        // It may come with the hello.
        None => false,
    };
    let upgrade = upgrade.map_err(|error| {
        ApiError::new(ErrorCode::Malformed, format!("a stream is opened by a WebSocket handshake: {error}"))
    })?;
    let place = state.stream_place()?;
    let upgrade = upgrade.protocols([SUBPROTOCOL]).max_message_size(MAX_MESSAGE_BYTES);
    Ok(upgrade.on_upgrade(async move |mut socket| {
        // Held as long as the connection lives.
        let _place = place;
        let hello = welcome(&mut socket, &state, known).await;
        let phases = state.lifecycle.watch();
        match hello.and_then(|hello| Ok(Watcher::new(state, entry.clone(), &hello)?)) {
            Ok(watcher) => serve(watcher, entry, phases, socket).await,
            Err(Some(error)) => refuse(&mut socket, &error).await,
            Err(None) => {}
        }
    }))
}

/// Waits for the client's hello; `None` when it left.
async fn welcome(socket: &mut WebSocket, state: &AppState, known: bool) -> Result<Hello, Option<ApiError>> {
    let first = tokio::time::timeout(HELLO_TIMEOUT, socket.recv()).await;
    let expected = |what: String| Some(ApiError::new(ErrorCode::Invalid, format!("expected `hello` first{what}")));
    let text = match first {
        Err(_) => return Err(expected(", and within 10 s".into())),
        Ok(None | Some(Err(_)) | Some(Ok(Message::Close(_)))) => return Err(None),
        Ok(Some(Ok(Message::Text(text)))) => text,
        Ok(Some(Ok(_))) => return Err(expected(", as text".into())),
    };
    let hello = match messages::parse(&text) {
        Ok(Incoming::Hello(hello)) => hello,
        Ok(_) => return Err(expected(String::new())),
        Err((error, _)) => return Err(Some(error)),
    };
    let accepted = hello.api_key.as_ref().is_some_and(|key| state.keys.accepts(key.as_bytes()));
    if !known && !accepted {
        return Err(Some(ApiError::new(ErrorCode::Unauthorized, "a key is needed, in `api_key`")));
    }
    if hello.protocol != PROTOCOL {
        let message = format!("expected {PROTOCOL}, got {}", hello.protocol);
        return Err(Some(ApiError::invalid("protocol", message)));
    }
    Ok(hello)
}

/// Tells a client why it is not served.
async fn refuse(socket: &mut WebSocket, error: &ApiError) {
    for message in [messages::error(error, None), messages::goodbye(error.code.name_and_status().0)] {
        let _ = socket.send(Message::Text(message.to_string().into())).await;
    }
    let _ = socket.send(Message::Close(None)).await;
    // A socket dropped with something unread is reset, and the error is lost with it.
    let _ = tokio::time::timeout(FAREWELL, async { while let Some(Ok(_)) = socket.recv().await {} }).await;
}

/// The key of a request, from its headers or among its subprotocols.
fn key(headers: &HeaderMap) -> Option<Vec<u8>> {
    if let Some(key) = auth::bearer(headers) {
        return Some(key.to_vec());
    }
    let offered = headers.get_all(header::SEC_WEBSOCKET_PROTOCOL).iter();
    let mut names = offered.filter_map(|value| value.to_str().ok()).flat_map(|value| value.split(','));
    let encoded = names.find_map(|name| name.trim().strip_prefix(KEY_SUBPROTOCOL))?;
    // An undecodable key is a wrong one.
    Some(BASE64URL_NOPAD.decode(encoded.as_bytes()).unwrap_or_default())
}
