//! The real program: started, asked over a socket, stopped by a signal.

use std::process::Command;

use serde_json::{Value, json};

use crate::support::process::{PROGRAM, Process, alarms};

#[test]
fn the_alarm_check_sees_warnings_and_errors() {
    let log = "T  INFO a: fine\nT  WARN b: hm\nT ERROR c: no\n";
    assert_eq!(alarms(log), ["T  WARN b: hm", "T ERROR c: no"]);
}

#[test]
fn a_server_starts_serves_a_frame_and_ends_on_sigterm_without_a_warning() {
    let process = Process::start(&[]);
    assert_eq!(process.lines[1], format!("Viewer:  http://{}/", process.address));
    assert!(process.lines[2].contains("curl"), "{:?}", process.lines);
    assert_eq!(process.get("/readyz"), br#"{"status":"ready"}"#);
    let source = json!({ "procedural": { "kind": "gyroid", "dims": [24, 24, 24] } });
    let volume = process.post("/v1/volumes", &json!({ "source": source }));
    let scene = process.post("/v1/scenes", &json!({ "volume": volume["id"] }));
    let id = scene["id"].as_str().expect("an id");
    let frame = process.get(&format!("/v1/scenes/{id}/frame?width=64&height=48"));
    let picture = image::load_from_memory(&frame).expect("a PNG");
    assert_eq!((picture.width(), picture.height()), (64, 48));
    let health = Command::new(PROGRAM).args(["healthcheck", "--addr", &process.address]).output().expect("it runs");
    assert!(health.status.success(), "{health:?}");

    let address = process.address.clone();
    let (status, log) = process.stop("-TERM");
    assert_eq!(status.code(), Some(0), "{log}");
    assert_eq!(alarms(&log), Vec::<&str>::new());
    for part in
        ["method=POST route=\"/v1/volumes\" status=201", "route=\"/v1/scenes/{id}/frame\" status=200", "SIGTERM"]
    {
        assert!(log.contains(part), "{part} is not in\n{log}");
    }
    assert!(!log.contains(id), "ids of scenes are not in the lines of requests:\n{log}");
    let health = Command::new(PROGRAM).args(["healthcheck", "--addr", &address]).output().expect("it runs");
    assert_eq!(health.status.code(), Some(1), "{health:?}");
}

#[test]
fn volumes_of_the_command_line_come_with_a_scene_and_the_log_may_be_json() {
    let head = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/visible-human-head-128.nrrd");
    let process = Process::start(&["--log-format", "json", "--volume", "procedural:boxes:16", "--volume", head]);
    let volumes: Value = serde_json::from_slice(&process.get("/v1/volumes")).expect("JSON");
    assert_eq!(volumes["volumes"][0]["name"], "boxes");
    assert_eq!(volumes["volumes"][1]["name"], "visible-human-head-128");
    let scenes: Value = serde_json::from_slice(&process.get("/v1/scenes")).expect("JSON");
    assert_eq!(scenes["scenes"].as_array().map(Vec::len), Some(2));
    assert!(process.lines[2].contains(scenes["scenes"][0]["id"].as_str().expect("an id")));
    let (status, log) = process.stop("-INT");
    assert_eq!(status.code(), Some(0), "{log}");
    // Graphics drivers write to standard error too, past the log.
    let events: Vec<Value> = log.lines().filter_map(|line| serde_json::from_str(line).ok()).collect();
    assert!(events.iter().any(|event| event["signal"] == "SIGINT"), "{log}");
    assert!(events.iter().all(|event| event["level"] == "INFO"), "{log}");
}

#[test]
fn what_cannot_be_served_is_refused_at_the_start() {
    let run = |arguments: &[&str]| {
        let output = Command::new(PROGRAM).args(arguments).env_remove("SPAO_API_KEYS").output().expect("it runs");
        (output.status.code(), String::from_utf8_lossy(&output.stderr).into_owned())
    };
    let (code, message) = run(&["serve", "--addr", "0.0.0.0:0"]);
    assert_eq!(code, Some(2), "{message}");
    assert!(message.contains("--api-key") && message.contains("--no-auth"), "{message}");
    let (code, message) = run(&["serve", "--no-such-flag"]);
    assert_eq!(code, Some(2), "{message}");
    let (code, message) = run(&["serve", "--addr", "127.0.0.1:0", "--volume", "no/such/file.nrrd"]);
    assert_eq!(code, Some(1), "{message}");
    assert!(message.contains("no/such/file.nrrd"), "{message}");
}
