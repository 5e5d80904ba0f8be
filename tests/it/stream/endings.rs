//! How streams end.

use serde_json::{Value, json};

use super::client::{Client, hello};
use super::{SCENE, small};
use crate::support::process::alarms;

/// What was said last.
async fn last_words(client: &mut Client) -> Value {
    client.until_closed().await.pop().expect("there is a goodbye")
}

#[tokio::test]
async fn a_deleted_scene_says_goodbye() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let mut early = Client::silent(&server, "default").await;
    server.delete(SCENE);
    let goodbye = json!({ "type": "goodbye", "reason": "scene_deleted" });
    assert_eq!(last_words(&mut client).await, goodbye);
    // This one had not said hello when the scene was still there.
    early.say(&hello()).await;
    assert_eq!(last_words(&mut early).await, goodbye);
    server.stop_clean();
}

#[tokio::test]
async fn a_signal_says_goodbye_and_the_server_ends_in_order() {
    let server = small();
    let mut client = Client::connect(&server, "default", &hello()).await;
    let mut talking = Client::connect(&server, "default", &hello()).await;
    for step in 1..100 {
        talking.update(json!({ "view": { "width": 32 + step } })).await;
    }
    let mut deaf = Client::silent(&server, "default").await;
    deaf.say(&hello()).await;
    server.signal("-TERM");
    let goodbye = json!({ "type": "goodbye", "reason": "draining" });
    assert_eq!(last_words(&mut client).await, goodbye);
    assert_eq!(last_words(&mut talking).await, goodbye);
    let (status, log) = server.ended();
    assert_eq!(status.code(), Some(0), "{log}");
    assert_eq!(alarms(&log), Vec::<&str>::new());
    assert!(log.contains("renderer_ended=true"), "{log}");
    drop(deaf);
}
