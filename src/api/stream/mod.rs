//! `GET /v1/scenes/{id}/stream`: pictures over a WebSocket, paced by the client's acknowledgements.
//!
//! Architecture Invariant: a connection is one task that owns its state. Updates overwrite, at most one picture
//! is being drawn, and a picture starts only when the client has room for it: latest-wins is the structure.

mod connection;
mod handshake;
mod messages;
mod outbox;
mod pictures;
mod quality;
mod view;
mod watcher;

pub(super) use handshake::open;
pub use quality::Quality;
