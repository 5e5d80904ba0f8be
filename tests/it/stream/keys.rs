//! Who may open a stream.

use data_encoding::BASE64URL_NOPAD;
use serde_json::{Value, json};
use tokio_tungstenite::tungstenite::Error;

use super::client::{Client, hello, upgrade};
use super::small;
use crate::api::envelope_fault;
use crate::support::process::Process;

/// The status and code of a refusal, which must be the envelope.
fn refusal(error: Error) -> (u16, String) {
    let Error::Http(answer) = error else { panic!("{error}") };
    let id = answer.headers().get("x-request-id").map_or("", |id| id.to_str().expect("ASCII")).to_owned();
    let body = answer.body().as_deref().unwrap_or_default();
    let body: Value = serde_json::from_slice(body).expect("JSON");
    assert_eq!(envelope_fault(&body, &id), Ok(()));
    (answer.status().as_u16(), body["error"]["code"].as_str().unwrap_or_default().to_owned())
}

async fn verdict(server: &Process, headers: &[(&'static str, String)]) -> (u16, String) {
    match upgrade(server, "default", headers).await {
        Ok((_, answer)) => (answer.status().as_u16(), String::new()),
        Err(error) => refusal(error),
    }
}

#[tokio::test]
async fn pages_of_other_origins_are_refused() {
    let server = Process::start(&["--volume", "procedural:boxes:8", "--allow-origin", "https://viewer.example"]);
    let ask = async |origin: &str| verdict(&server, &[("origin", origin.to_owned())]).await;
    let forbidden = (403, "forbidden_origin".to_owned());
    assert_eq!(ask("https://evil.example").await, forbidden);
    assert_eq!(ask("null").await, forbidden);
    assert_eq!(ask(&format!("http://{}.evil.example", server.address)).await, forbidden);
    assert_eq!(ask("http://127.0.0.1:1").await, forbidden);
    assert_eq!(ask("https://viewer.example").await.0, 101);
    assert_eq!(ask(&format!("http://{}", server.address)).await.0, 101);
    assert_eq!(verdict(&server, &[]).await.0, 101, "programs send no origin");
    server.stop_clean();
}

#[tokio::test]
async fn there_is_no_stream_without_a_scene() {
    let server = small();
    let error = upgrade(&server, "none", &[]).await.expect_err("there is no such scene");
    assert_eq!(refusal(error), (404, "scene_not_found".to_owned()));
}

#[tokio::test]
async fn a_key_comes_in_the_header_as_a_subprotocol_or_in_hello() {
    let server = Process::start(&["--volume", "procedural:boxes:8", "--api-key", "first-key-1"]);
    let unauthorized = (401, "unauthorized".to_owned());
    let bearer = |key: &str| [("authorization", format!("Bearer {key}"))];
    assert_eq!(verdict(&server, &bearer("first-key-1")).await.0, 101);
    assert_eq!(verdict(&server, &bearer("first-key-2")).await, unauthorized);

    let protocol =
        |key: &str| [("sec-websocket-protocol", format!("spao.v1, bearer.{}", BASE64URL_NOPAD.encode(key.as_bytes())))];
    let (_, answer) = upgrade(&server, "default", &protocol("first-key-1")).await.expect("the key is right");
    assert_eq!(answer.headers()["sec-websocket-protocol"], "spao.v1", "the key is not said back");
    assert_eq!(verdict(&server, &protocol("first-key-2")).await, unauthorized);
    let undecodable = [("sec-websocket-protocol", "spao.v1, bearer.%%".to_owned())];
    assert_eq!(verdict(&server, &undecodable).await, unauthorized);

    let with_key = |key: Value| {
        let mut hello = hello();
        hello["api_key"] = key;
        hello
    };
    Client::connect(&server, "default", &with_key(json!("first-key-1"))).await;
    for wrong in [hello(), with_key(json!("first-key-2")), with_key(json!(""))] {
        let mut client = Client::silent(&server, "default").await;
        client.say(&wrong).await;
        let said = client.until_closed().await;
        assert_eq!(said[0]["code"], "unauthorized", "{said:?}");
        assert_eq!(said[1], json!({ "type": "goodbye", "reason": "unauthorized" }));
    }
    server.stop_clean();
}
