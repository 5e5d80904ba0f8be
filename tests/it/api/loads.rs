//! Volumes on their way: listed, told of, called off, given up.

use std::io::Write;
use std::net::TcpStream;
use std::time::{Duration, Instant};

use axum::body::Body;
use axum::http::Method;
use serde_json::{Value, json};

use super::{Answer, Server, request};
use crate::support::process::{PATIENCE, Process};

/// A volume that takes many seconds to compute.
fn slow() -> Value {
    json!({ "name": "slow", "source": { "procedural": { "kind": "mandelbulb", "dims": [420, 420, 420] } } })
}

fn quick() -> Value {
    json!({ "source": { "procedural": { "kind": "boxes", "dims": [12, 10, 8] } } })
}

/// A raw file that is too short, which shows only when it is read.
async fn upload_broken(server: &Server) -> String {
    let answer = server.upload("wait=false&format=raw&dims=4,3,2&type=u8&name=broken", vec![1; 23]).await;
    assert_eq!(answer.status, 202, "{answer:?}");
    answer.header("location").to_owned()
}

async fn start(server: &Server, body: &Value) -> (String, Value) {
    let answer = server.post("/v1/volumes?wait=false", body).await;
    assert_eq!(answer.status, 202, "{answer:?}");
    (answer.header("location").to_owned(), answer.json())
}

/// Asks until `wanted` is so.
async fn until(server: &Server, path: &str, mut wanted: impl FnMut(&Answer) -> bool) -> Answer {
    let deadline = Instant::now() + PATIENCE;
    loop {
        let answer = server.get(path).await;
        if wanted(&answer) {
            return answer;
        }
        assert!(Instant::now() < deadline, "{answer:?}");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

async fn until_state(server: &Server, path: &str, state: &str) -> Value {
    until(server, path, |answer| answer.json()["state"] != "loading").await;
    let volume = server.get(path).await.json();
    assert_eq!(volume["state"], state, "{volume}");
    volume
}

async fn listed(server: &Server) -> Vec<Value> {
    server.get("/v1/volumes").await.json()["volumes"].as_array().expect("a list").clone()
}

#[tokio::test]
async fn a_load_that_nobody_waits_for_is_listed_at_once_and_resident_later() {
    let server = Server::new(&[]);
    let body = json!({ "name": "Foam", "source": { "procedural": { "kind": "gyroid", "dims": [120, 100, 80] } } });
    let (path, first) = start(&server, &body).await;
    assert_eq!(path, format!("/v1/volumes/{}", first["id"].as_str().expect("an id")));
    assert_eq!((&first["name"], &first["state"]), (&json!("Foam"), &json!("loading")));
    assert_eq!(
        first["source"],
        json!({ "procedural": { "kind": "gyroid", "dims": [120, 100, 80], "seed": 0, "spacing": null } })
    );
    assert_eq!(first["progress"], json!({ "what": "fetching", "fraction": 0.0 }));
    for unknown in ["dims", "spacing", "origin", "direction", "voxel_type", "value_range", "sha256"] {
        assert_eq!(first[unknown], Value::Null, "{unknown}");
    }
    assert_eq!((&first["gpu_bytes"], &first["host_bytes"]), (&json!(0), &json!(0)));
    assert_eq!(listed(&server).await.len(), 1);
    let volume = until_state(&server, &path, "resident").await;
    for same in ["id", "name", "source", "created_at"] {
        assert_eq!(volume[same], first[same], "{same}");
    }
    assert!(volume.get("progress").is_none() && volume["dims"] == json!([120, 100, 80]), "{volume}");
    let waited = server.post("/v1/volumes", &body).await;
    assert_eq!((waited.status.as_u16(), &waited.json()["sha256"]), (201, &volume["sha256"]));
    assert_eq!(server.post("/v1/volumes?wait=maybe", &body).await.path(), "wait");
    let scene = server.post("/v1/scenes", &json!({ "volume": volume["id"] })).await;
    assert_eq!(scene.status, 201, "{scene:?}");
}

#[tokio::test]
async fn an_upload_that_nobody_waits_for_is_read_first() {
    let server = Server::new(&[]);
    let answer = server.upload("wait=false&format=raw&dims=4,3,2&type=u8&name=raw", (0..24).collect::<Vec<u8>>()).await;
    assert_eq!(answer.status, 202, "{answer:?}");
    assert_eq!(answer.json()["source"], json!({ "upload": { "format": "raw", "bytes": 24 } }));
    let volume = until_state(&server, answer.header("location"), "resident").await;
    assert_eq!(volume["value_range"], json!([0.0, 23.0]));
    // What the request itself says wrongly is the answer, and nothing is listed.
    assert_eq!(server.upload("wait=false&format=gif", vec![0; 10]).await.code(), "unknown_format");
    let url = json!({ "source": { "url": "https://example.org/a.nrrd" } });
    assert_eq!(server.post("/v1/volumes?wait=false", &url).await.path(), "source.url");
    assert_eq!(listed(&server).await.len(), 1);
}

#[tokio::test]
async fn progress_goes_on_and_never_back() {
    let server = Server::new(&[]);
    let (path, _) = start(&server, &slow()).await;
    let what = |volume: &Value| volume["progress"]["what"].as_str().unwrap_or("done").to_owned();
    let mut fractions = Vec::new();
    until(&server, &path, |answer| {
        if what(&answer.json()) == "reading" {
            fractions.push(answer.json()["progress"]["fraction"].as_f64().expect("a number"));
        }
        fractions.len() > 3 && fractions.last() > fractions.first() || what(&answer.json()) == "done"
    })
    .await;
    assert!(fractions.windows(2).all(|pair| pair[0] <= pair[1]), "{fractions:?}");
    assert!(fractions.iter().all(|fraction| (0.0..=1.0).contains(fraction)), "{fractions:?}");
    assert!(fractions.last() > fractions.first(), "it was not slow enough to see");
    assert_eq!(server.delete(&path).await.status, 204);
}

#[tokio::test]
async fn a_volume_that_is_deleted_on_its_way_gives_its_place_and_its_turn_back() {
    let server = Server::new(&["--max-volumes", "3"]);
    // Two are loaded at once, the third waits in line.
    let (first, _) = start(&server, &slow()).await;
    let (second, _) = start(&server, &slow()).await;
    let (third, waiting) = start(&server, &slow()).await;
    assert_eq!(waiting["progress"]["what"], "fetching");
    let refused = server.post("/v1/volumes?wait=false", &quick()).await;
    assert_eq!((refused.status.as_u16(), refused.code().as_str()), (429, "too_many"));
    for path in [&third, &first, &second] {
        let begun = Instant::now();
        assert_eq!(server.delete(path).await.status, 204);
        assert!(begun.elapsed() < Duration::from_secs(2), "deleting waits");
        assert_eq!(server.get(path).await.code(), "volume_not_found");
        assert_eq!(server.delete(path).await.code(), "volume_not_found");
    }
    assert_eq!(listed(&server).await, Vec::<Value>::new());
    let begun = Instant::now();
    let answer = server.post("/v1/volumes", &quick()).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    // Both turns were taken: one of the deleted ones must have ended. A whole one takes longer.
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
    assert_eq!(listed(&server).await.len(), 1);
}

#[tokio::test]
async fn what_looks_at_a_volume_on_its_way_is_told_to_try_again() {
    let server = Server::new(&[]);
    let (path, volume) = start(&server, &slow()).await;
    let id = &volume["id"];
    let reads = ["histogram", "slice", "thumbnail", "metadata", "data", "probe?x=1&y=1&z=1"];
    let mut answers = Vec::new();
    for read in reads {
        answers.push(server.get(&format!("{path}/{read}")).await);
    }
    answers.push(server.get(&format!("/v1/presets?volume={}", id.as_str().expect("an id"))).await);
    answers.push(server.post("/v1/scenes", &json!({ "volume": id })).await);
    let other = server.scene().await;
    answers.push(server.patch(&other, &json!({ "volume": id })).await);
    let picture = json!({ "scene": { "volume": id }, "width": 8, "height": 8 });
    answers.push(server.post("/v1/render", &picture).await);
    for answer in answers {
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (409, "volume_not_ready"), "{answer:?}");
        assert_eq!(answer.header("retry-after"), "1");
        let details = &answer.json()["error"]["details"];
        assert_eq!((&details["volume"], &details["state"]), (id, &json!("loading")));
        assert!(details["progress"]["fraction"].is_number(), "{details}");
    }
    assert_eq!(server.delete(&path).await.status, 204);
}

#[tokio::test]
async fn a_failure_that_nobody_waited_for_stays_listed_until_it_is_deleted() {
    let server = Server::new(&["--max-volumes", "1"]);
    let path = upload_broken(&server).await;
    let failed = until_state(&server, &path, "failed").await;
    assert_eq!((&failed["name"], &failed["error"]["code"]), (&json!("broken"), &json!("malformed")));
    assert_eq!(failed["error"]["details"], json!({ "path": "dims" }));
    let message = failed["error"]["message"].as_str().expect("a text");
    assert!(message.contains("24 bytes") && failed.get("progress").is_none(), "{failed}");
    assert_eq!(listed(&server).await, std::slice::from_ref(&failed));
    let refused = server.post("/v1/scenes", &json!({ "volume": failed["id"] })).await;
    assert_eq!((refused.status.as_u16(), refused.code().as_str()), (409, "volume_not_ready"));
    assert_eq!((refused.header("retry-after"), refused.path().as_str()), ("", "volume"));
    let details = &refused.json()["error"]["details"];
    assert_eq!((&details["state"], &details["error"]), (&json!("failed"), &failed["error"]));
    // It takes no place.
    assert_eq!(server.post("/v1/volumes", &quick()).await.status, 201);
    assert_eq!(server.delete(&path).await.status, 204);
    assert_eq!(server.get(&path).await.code(), "volume_not_found");
    // A failure that somebody waited for is the answer, and leaves no trace.
    let broken = server.upload("format=raw&dims=4,3,2&type=u8", vec![1; 23]).await;
    assert_eq!((broken.status.as_u16(), listed(&server).await.len()), (429, 1));
}

#[tokio::test]
async fn the_oldest_failures_are_forgotten() {
    let server = Server::new(&["--max-volumes", "1"]);
    let mut paths = Vec::new();
    for _ in 0..18 {
        let path = upload_broken(&server).await;
        until_state(&server, &path, "failed").await;
        paths.push(path);
    }
    let ids: Vec<String> =
        listed(&server).await.iter().map(|v| format!("/v1/volumes/{}", v["id"].as_str().expect("an id"))).collect();
    assert_eq!(ids, paths[2..]);
}

#[tokio::test]
async fn a_request_that_waits_is_told_when_its_volume_is_deleted() {
    let server = Server::new(&[]);
    let waiting = async { server.post("/v1/volumes", &slow()).await };
    let deleting = async {
        let listed = until(&server, "/v1/volumes", |answer| answer.json()["volumes"][0]["id"].is_string()).await;
        let volume = listed.json()["volumes"][0].clone();
        assert_eq!(volume["state"], "loading");
        server.delete(&format!("/v1/volumes/{}", volume["id"].as_str().expect("an id"))).await
    };
    let (waited, deleted) = tokio::join!(waiting, deleting);
    assert_eq!(deleted.status, 204);
    assert_eq!((waited.status.as_u16(), waited.code().as_str()), (409, "volume_cancelled"));
    assert_eq!(listed(&server).await, Vec::<Value>::new());
}

#[tokio::test]
async fn a_client_that_leaves_calls_its_load_off() {
    let server = Server::new(&[]);
    let body = slow();
    for _ in 0..2 {
        let waiting = server.post("/v1/volumes", &body);
        let gone = tokio::time::timeout(Duration::from_millis(300), waiting).await;
        assert!(gone.is_err(), "it was not slow enough to leave");
        assert_eq!(listed(&server).await, Vec::<Value>::new());
    }
    let begun = Instant::now();
    assert_eq!(server.post("/v1/volumes", &quick()).await.status, 201);
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
}

#[tokio::test]
async fn two_volumes_are_loaded_at_once_and_listed_in_the_order_of_their_requests() {
    let server = Server::new(&[]);
    let (slower, _) = start(
        &server,
        &json!({ "name": "a", "source": { "procedural": { "kind": "cloud", "dims": [150, 150, 150] } } }),
    )
    .await;
    let (quicker, _) = start(&server, &quick()).await;
    until_state(&server, &quicker, "resident").await;
    until_state(&server, &slower, "resident").await;
    let names: Vec<Value> = listed(&server).await.iter().map(|volume| volume["name"].clone()).collect();
    assert_eq!(names, [json!("a"), json!("boxes")]);
}

#[tokio::test]
async fn a_large_file_is_let_go_of_soon() {
    let data = tempfile::tempdir().expect("a directory");
    let path = data.path().join("large.nrrd");
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 1000 1000 700\nencoding: raw\n\n";
    std::fs::write(&path, header).expect("writable");
    // A hole: it takes no room, but must be read like any other file.
    let file = std::fs::OpenOptions::new().append(true).open(&path).expect("it is there");
    file.set_len(header.len() as u64 + 700_000_000).expect("holes are allowed");
    let server = Server::new(&["--data-dir", data.path().to_str().expect("UTF-8")]);
    let (path, first) = start(&server, &json!({ "source": { "path": "large.nrrd" } })).await;
    assert_eq!(first["name"], "large");
    until(&server, &path, |answer| answer.json()["progress"]["fraction"].as_f64() > Some(0.01)).await;
    let volume = server.get(&path).await.json();
    assert_eq!((&volume["progress"]["what"], &volume["dims"]), (&json!("reading"), &Value::Null), "{volume}");
    assert_eq!(server.delete(&path).await.status, 204);
    let begun = Instant::now();
    assert_eq!(server.post("/v1/volumes", &quick()).await.status, 201);
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}", begun.elapsed());
}

#[tokio::test]
async fn metrics_count_volumes_by_state() {
    let server = Server::new(&[]);
    until_state(&server, &upload_broken(&server).await, "failed").await;
    let (path, _) = start(&server, &slow()).await;
    let text = String::from_utf8(server.get("/metrics").await.bytes).expect("a text");
    for line in [
        r#"spao_volumes{state="loading"} 1"#,
        r#"spao_volumes{state="failed"} 1"#,
        r#"spao_volumes{state="resident"} 0"#,
    ] {
        assert!(text.lines().any(|found| found == line), "{line} is not in\n{text}");
    }
    let gone = server.send(request(Method::DELETE, &path, &[], Body::empty())).await;
    assert_eq!(gone.status, 204);
}

#[test]
fn a_server_that_is_loading_ends_at_once_when_it_is_told_to() {
    let process = Process::start(&["--drain-timeout", "60"]);
    let volume = process.post("/v1/volumes?wait=false", &slow());
    assert_eq!(volume["state"], "loading");
    let begun = Instant::now();
    let (status, log) = process.stop("-TERM");
    assert_eq!(status.code(), Some(0), "{log}");
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}: {log}", begun.elapsed());
    assert!(log.contains("renderer_ended=true"), "{log}");
}

#[test]
fn a_server_ends_within_its_deadline_while_somebody_waits_for_a_volume_and_is_told() {
    let process = Process::start(&["--drain-timeout", "4"]);
    let url = process.url("/v1/volumes");
    let waiting = std::thread::spawn(move || {
        let request = ureq::post(url).header("content-type", "application/json");
        let answer = request.config().http_status_as_error(false).build().send(slow().to_string());
        answer.map(|answer| answer.status().as_u16())
    });
    while process.get_json("/v1/volumes")["volumes"][0]["state"] != "loading" {
        std::thread::sleep(Duration::from_millis(10));
    }
    let begun = Instant::now();
    let (status, log) = process.stop("-TERM");
    assert_eq!(status.code(), Some(0), "{log}");
    assert!(begun.elapsed() < Duration::from_secs(20), "{:?}: {log}", begun.elapsed());
    // A closed connection would say nothing.
    assert_eq!(waiting.join().expect("it does not panic").ok(), Some(409), "{log}");
}

#[test]
fn a_client_that_hangs_up_calls_its_load_off() {
    use std::io::Write;
    let process = Process::start(&[]);
    let body = slow().to_string();
    let head = format!(
        "POST /v1/volumes HTTP/1.1\r\nHost: {}\r\nContent-Type: application/json\r\nContent-Length: {}\r\n\r\n",
        process.address,
        body.len()
    );
    let mut socket = std::net::TcpStream::connect(&process.address).expect("it listens");
    socket.write_all((head + &body).as_bytes()).expect("it reads");
    let listed = || process.get_json("/v1/volumes")["volumes"].as_array().expect("a list").len();
    let deadline = Instant::now() + PATIENCE;
    while listed() == 0 {
        assert!(Instant::now() < deadline, "it does not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
    drop(socket);
    let begun = Instant::now();
    while listed() > 0 {
        assert!(begun.elapsed() < Duration::from_secs(20), "it goes on");
        std::thread::sleep(Duration::from_millis(5));
    }
    process.stop_clean();
}

#[tokio::test]
async fn uploads_that_stall_keep_no_other_load_waiting() {
    let server = Process::start(&[]);
    let stalled: Vec<TcpStream> = (0..2)
        .map(|_| {
            let mut stream = TcpStream::connect(server.url("").trim_start_matches("http://")).expect("it listens");
            let head = "POST /v1/volumes HTTP/1.1\r\nHost: here\r\nContent-Type: application/octet-stream\r\n\
                        Content-Length: 1000000\r\n\r\nNRRD0004\n";
            stream.write_all(head.as_bytes()).expect("it is read");
            stream
        })
        .collect();
    std::thread::sleep(Duration::from_millis(200));
    let begin = Instant::now();
    server.post("/v1/volumes", &quick());
    server.post("/v1/volumes?dry_run=true", &quick());
    assert!(begin.elapsed() < PATIENCE / 2, "{:?}", begin.elapsed());
    drop(stalled);
    server.stop_clean();
}

#[tokio::test]
async fn a_file_that_a_header_names_and_that_is_not_there_is_the_requests_fault() {
    let data = tempfile::tempdir().expect("a folder");
    let header = "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: none.raw\n";
    std::fs::write(data.path().join("head.nhdr"), header).expect("a file");
    let server = Server::new(&["--data-dir", data.path().to_str().expect("UTF-8")]);
    let answer = server.post("/v1/volumes", &json!({ "source": { "path": "head.nhdr" } })).await;
    assert_eq!(answer.verdict(), (422, "invalid".into(), "source.path".into()), "{answer:?}");
    assert!(answer.json().to_string().contains("data file"), "{answer:?}");
}

#[tokio::test]
async fn a_list_is_no_request_for_a_volume() {
    let server = Server::new(&[]);
    for (body, path) in [(json!(["a", quick()["source"], null]), "$"), (json!({ "source": ["a.nrrd"] }), "source")] {
        let answer = server.post("/v1/volumes", &body).await;
        assert_eq!(answer.verdict(), (422, "invalid".into(), path.into()), "{answer:?}");
    }
}

#[tokio::test(flavor = "multi_thread")]
async fn a_slice_does_not_wait_for_a_volume_that_is_computed() {
    let server = Server::new(&[]);
    let volume = server.volume().await;
    let (path, _) = start(&server, &slow()).await;
    let fraction = |answer: &Answer| answer.json()["progress"]["fraction"].as_f64().unwrap_or(1.0);
    until(&server, &path, |answer| fraction(answer) > 0.0).await;
    // Large, so that it is worth several threads.
    let slice = server.get(&format!("/v1/volumes/{volume}/slice?axis=z&index=5&width=1024")).await;
    assert_eq!(slice.status, 200, "{slice:?}");
    let now = fraction(&server.get(&path).await);
    assert!(now < 0.8, "{now} of the load was done first");
    assert_eq!(server.delete(&path).await.status, 204);
}
