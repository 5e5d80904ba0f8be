//! Volumes: how they come, what is shown of them, and that nothing remains of those that cannot come.

use axum::body::Body;
use axum::http::Method;
use serde_json::{Value, json};
use spao_server::gpu::GpuOptions;
use spao_server::render_thread::RenderHandle;

use super::{Server, request};

/// A NRRD file of 4 x 3 x 2 voxels.
fn nrrd(kind: &str, data: &[u8]) -> Vec<u8> {
    let header = format!(
        "NRRD0004\ntype: {kind}\ndimension: 3\nsizes: 4 3 2\nspacings: 1 2 3\nendian: little\nencoding: raw\n\n"
    );
    [header.as_bytes(), data].concat()
}

fn bytes_of(values: impl IntoIterator<Item = f32>) -> Vec<u8> {
    values.into_iter().flat_map(f32::to_le_bytes).collect()
}

fn procedural(kind: &str, dims: [u32; 3]) -> Value {
    json!({ "source": { "procedural": { "kind": kind, "dims": dims } } })
}

async fn count(server: &Server) -> usize {
    server.get("/v1/volumes").await.json()["volumes"].as_array().expect("a list").len()
}

#[tokio::test]
async fn an_uploaded_volume_is_listed_shown_counted_and_deleted() {
    let server = Server::new(&[]);
    let answer = server.upload("name=small", nrrd("unsigned char", &(0..24).collect::<Vec<u8>>())).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    let volume = answer.json();
    let path = answer.header("location").to_owned();
    assert_eq!(path, format!("/v1/volumes/{}", volume["id"].as_str().expect("an id")));
    assert_eq!(volume["name"], "small");
    assert_eq!(volume["state"], "resident");
    assert_eq!(volume["dims"], json!([4, 3, 2]));
    assert_eq!(volume["spacing"], json!([1.0, 2.0, 3.0]));
    assert_eq!(volume["voxel_type"], "u8");
    assert_eq!(volume["value_range"], json!([0.0, 23.0]));
    assert_eq!(volume["host_bytes"], 24);
    assert_eq!(
        volume["source"],
        json!({ "upload": { "format": "nrrd", "bytes": nrrd("unsigned char", &[0; 24]).len() } })
    );
    assert_eq!(volume["sha256"].as_str().map(str::len), Some(64));
    assert_eq!(server.get(&path).await.json(), volume);
    assert_eq!(server.get("/v1/volumes").await.json(), json!({ "volumes": [volume] }));
    let histogram = server.get(&format!("{path}/histogram?bins=3")).await.json();
    assert_eq!(histogram, json!({ "range": [0.0, 23.0], "counts": [8, 8, 8] }));
    assert_eq!(server.get(&format!("{path}/histogram")).await.json()["counts"].as_array().map(Vec::len), Some(256));
    for bins in ["0", "65537", "x"] {
        assert_eq!(server.get(&format!("{path}/histogram?bins={bins}")).await.path(), "bins");
    }
    assert_eq!(server.delete(&path).await.status, 204);
    assert_eq!(server.delete(&path).await.status, 404);
    assert_eq!(count(&server).await, 0);
}

#[tokio::test]
async fn raw_voxels_need_their_dims_and_type() {
    let server = Server::new(&[]);
    let data = bytes_of((0..24).map(|i| i as f32 * 0.5));
    let query = "format=raw&dims=4,3,2&type=f32&endian=little&spacing=0.5,0.5,1";
    let answer = server.upload(query, data.clone()).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    assert_eq!(answer.json()["value_range"], json!([0.0, 11.5]));
    assert_eq!(answer.json()["spacing"], json!([0.5, 0.5, 1.0]));
    for (query, status, path) in [
        ("format=raw", 400, "dims"),
        ("format=raw&dims=4,3,2", 422, "type"),
        ("format=raw&type=f32", 422, "dims"),
        ("format=raw&dims=4,3&type=f32", 422, "dims"),
        ("format=raw&dims=4,3,-2&type=f32", 422, "dims"),
        ("format=raw&dims=0,3,2&type=f32", 400, "dims"),
        ("format=raw&dims=4,3,3&type=f32", 400, "dims"),
        ("format=raw&dims=4,3,2&type=f16", 422, "type"),
        ("format=raw&dims=4,3,2&type=f32&endian=middle", 422, "endian"),
        ("format=raw&dims=4,3,2&type=f32&spacing=0,1,1", 400, "spacing"),
        ("format=raw&dims=4000000000,4000000000,4000000000&type=f32", 413, "dims"),
    ] {
        let answer = server.upload(query, data.clone()).await;
        assert_eq!((answer.status.as_u16(), answer.path().as_str()), (status, path), "{query}: {answer:?}");
    }
    assert_eq!(count(&server).await, 1);
}

#[tokio::test]
async fn nothing_remains_of_a_file_that_cannot_be_loaded() {
    let server = Server::new(&["--max-upload", "8K", "--max-voxels", "4000"]);
    let memory = server.state.renderer.memory();
    let nan = bytes_of([f32::NAN; 24]);
    let infinite = bytes_of([f32::INFINITY; 24]);
    let uploads: [(&str, Vec<u8>, u16, &str); 10] = [
        ("", vec![0; 100], 415, "unknown_format"),
        ("format=gif", vec![0; 100], 415, "unknown_format"),
        ("", b"\x89PNG\r\n".to_vec(), 415, "unknown_format"),
        ("", b"\x93NUMPY\x01\x00".to_vec(), 400, "malformed"),
        ("format=dicom", vec![0; 100], 400, "malformed"),
        ("", nrrd("unsigned char", &[0; 23]), 400, "malformed"),
        ("", nrrd("unsigned chair", &[0; 24]), 400, "malformed"),
        ("", nrrd("float", &nan), 400, "malformed"),
        ("", nrrd("float", &infinite), 400, "malformed"),
        ("", nrrd("unsigned char", &[0; 9000]), 413, "too_large"),
    ];
    for (query, bytes, status, code) in uploads {
        let start = String::from_utf8_lossy(&bytes[..bytes.len().min(30)]).into_owned();
        let answer = server.upload(query, bytes).await;
        assert_eq!((answer.status.as_u16(), answer.code().as_str()), (status, code), "{query} {start}: {answer:?}");
    }
    let answer = server.post("/v1/volumes", &procedural("gyroid", [20, 20, 20])).await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (413, "too_large"));
    assert_eq!(answer.json()["error"]["details"]["limit"], 4000);
    assert_eq!(count(&server).await, 0);
    // Other tests use the same renderer at the same time: theirs is the only reason for a difference.
    assert!(server.state.renderer.memory().budget_bytes == memory.budget_bytes);
}

#[tokio::test]
async fn a_wrapped_file_is_recognised_and_its_format_told() {
    let server = Server::new(&[]);
    let file = include_bytes!("../volume/fixtures/files/nifti1_gzip.nii.gz");
    let answer = server.upload("", file.to_vec()).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    let volume = answer.json();
    assert_eq!(volume["source"], json!({ "upload": { "format": "nifti", "bytes": file.len() } }));
    assert_eq!((&volume["dims"], &volume["voxel_type"]), (&json!([5, 4, 3]), &json!("i16")));
    let formats = server.get("/v1/server").await.json()["features"]["volume_formats"].clone();
    assert!(formats.as_array().is_some_and(|names| names.contains(&json!("nifti"))), "{formats}");
}

#[tokio::test]
async fn a_body_that_is_too_long_is_refused_before_it_is_read() {
    let server = Server::new(&["--max-upload", "1K"]);
    let never = Body::from_stream(futures_util::stream::pending::<Result<Vec<u8>, std::io::Error>>());
    let headers = [("content-length", "1025")];
    let answer = server.send(request(Method::POST, "/v1/volumes?format=nrrd", &headers, never)).await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (413, "too_large"));
    assert_eq!(answer.json()["error"]["details"], json!({ "limit": 1024 }));
}

#[tokio::test]
async fn a_body_that_stops_coming_is_given_up() {
    let server = Server::new(&["--request-timeout", "0.05"]);
    let never = Body::from_stream(futures_util::stream::pending::<Result<Vec<u8>, std::io::Error>>());
    let answer = server.upload("format=nrrd", never).await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (408, "request_timeout"));
}

#[tokio::test]
async fn json_names_a_source() {
    let server = Server::new(&[]);
    let body =
        json!({ "name": "Foam", "source": { "procedural": { "kind": "cloud", "dims": [8, 9, 10], "seed": 3 } } });
    let answer = server.post("/v1/volumes", &body).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    assert_eq!(answer.json()["name"], "Foam");
    assert_eq!(answer.json()["dims"], json!([8, 9, 10]));
    assert_eq!(answer.json()["source"]["procedural"]["seed"], 3);
    for (body, status, path) in [
        (json!({}), 422, "$"),
        (json!({ "source": {} }), 422, "source"),
        (json!({ "source": { "path": "a", "url": "b" } }), 422, "source"),
        (json!({ "source": { "file": "a" } }), 422, "source.file"),
        (json!({ "source": { "url": "https://x/y" } }), 422, "source.url"),
        (json!({ "source": { "path": "head.nrrd" } }), 422, "source.path"),
        (json!({ "source": { "procedural": { "kind": "gyroid" } } }), 422, "source.procedural"),
        (json!({ "source": { "procedural": { "kind": "cube", "dims": [8, 8, 8] } } }), 422, "source.procedural.kind"),
        (json!({ "source": { "procedural": { "kind": "gyroid", "dims": [8, 8] } } }), 422, "source.procedural.dims"),
        (json!({ "source": { "procedural": { "kind": "gyroid", "dims": [8, 8, 0] } } }), 422, "source.procedural.dims"),
        (json!({ "name": 3, "source": {} }), 422, "name"),
        (json!({ "name": "x".repeat(201), "source": { "path": "a" } }), 422, "name"),
        (json!([]), 422, "$"),
    ] {
        let answer = server.post("/v1/volumes", &body).await;
        assert_eq!(answer.status, status, "{body}: {answer:?}");
        assert!(answer.path().starts_with(path), "{body}: {answer:?}");
    }
    assert_eq!(count(&server).await, 1);
}

#[tokio::test]
async fn paths_stay_in_the_data_directory() {
    let outside = tempfile::tempdir().expect("a temporary directory");
    let data = outside.path().join("data");
    std::fs::create_dir(&data).expect("it is new");
    let file = nrrd("unsigned char", &[7; 24]);
    std::fs::write(outside.path().join("secret.nrrd"), &file).expect("writable");
    std::fs::write(data.join("seven.nrrd"), &file).expect("writable");
    #[cfg(unix)]
    std::os::unix::fs::symlink(outside.path().join("secret.nrrd"), data.join("link.nrrd")).expect("writable");
    let server = Server::new(&["--data-dir", data.to_str().expect("UTF-8")]);
    let load = async |path: &str| server.post("/v1/volumes", &json!({ "source": { "path": path } })).await;
    let answer = load("seven.nrrd").await;
    assert_eq!(answer.status, 201, "{answer:?}");
    assert_eq!(answer.json()["name"], "seven");
    assert_eq!(answer.json()["source"], json!({ "path": "seven.nrrd" }));
    let absolute = outside.path().join("secret.nrrd");
    for path in ["../secret.nrrd", absolute.to_str().expect("UTF-8"), "link.nrrd", "none.nrrd", "", ".", "a\0b"] {
        let answer = load(path).await;
        assert!(answer.status.is_client_error(), "{path}: {answer:?}");
        let text = String::from_utf8_lossy(&answer.bytes).into_owned();
        assert!(path.starts_with('/') || !text.contains(outside.path().to_str().expect("UTF-8")), "{text}");
    }
    assert_eq!(count(&server).await, 1);
}

#[tokio::test]
async fn of_several_series_one_is_asked_for() {
    let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/dicom");
    let server = Server::new(&["--data-dir", folder]);
    let bytes = std::fs::read(format!("{folder}/several.zip")).expect("the fixture is there");
    for (query, path) in [
        ("", "series"),
        ("series=9", "series"),
        ("channel=0", "channel"),
        ("channel=x", "channel"),
        ("scale=0", "scale"),
        ("scale=x", "scale"),
    ] {
        let answer = server.upload(query, bytes.clone()).await;
        assert_eq!((answer.status.as_u16(), answer.path().as_str()), (422, path), "{query}: {answer:?}");
    }
    let answer = server.upload("", bytes.clone()).await;
    let message = answer.json()["error"]["message"].to_string();
    assert!(message.contains("series=5 (CT `Series 5 of Secret`, 4 slices)"), "{message}");
    let answer = server.upload("series=5", bytes).await;
    assert_eq!((answer.status.as_u16(), &answer.json()["dims"]), (201, &json!([5, 4, 4])), "{answer:?}");

    let load = async |source: Value| server.post("/v1/volumes", &json!({ "source": source })).await;
    let answer = load(json!({ "path": "several.zip", "series": "4" })).await;
    assert_eq!((answer.status.as_u16(), &answer.json()["dims"]), (201, &json!([5, 4, 3])), "{answer:?}");
    assert_eq!(answer.json()["source"], json!({ "path": "several.zip", "series": "4" }));
    assert_eq!(load(json!({ "path": "several.zip" })).await.path(), "source.series");
    let seriesless = json!({ "procedural": { "kind": "gyroid", "dims": [8, 8, 8] }, "series": "4" });
    assert_eq!(load(seriesless).await.path(), "source.series");
    // A folder of everything: the series that can be told apart are listed, and none is taken silently.
    let answer = load(json!({ "path": "." })).await;
    assert!(answer.status.is_client_error(), "{answer:?}");
    assert_eq!(count(&server).await, 2);
}

#[tokio::test]
async fn a_dry_run_tells_what_a_volume_needs_and_loads_nothing() {
    let server = Server::new(&[]);
    let plan = server.post("/v1/volumes?dry_run=true", &procedural("gyroid", [20, 10, 5])).await;
    assert_eq!(plan.status, 200, "{plan:?}");
    assert_eq!(plan.json()["host_bytes"], 1000);
    assert_eq!(plan.json()["fits"], true);
    let upload = server.upload("dry_run=true", nrrd("short", &[0; 48])).await;
    assert_eq!((upload.status.as_u16(), &upload.json()["voxel_type"]), (200, &json!("i16")));
    assert_eq!(count(&server).await, 0);
    let volume = server.post("/v1/volumes", &procedural("gyroid", [20, 10, 5])).await.json();
    assert_eq!(plan.json()["gpu_bytes"], volume["gpu_bytes"], "the plan is what happens");
    let broken = server.upload("dry_run=true", nrrd("short", &[0; 47])).await;
    assert_eq!(broken.status, 400);
}

#[tokio::test]
async fn there_may_be_so_many_volumes() {
    let server = Server::new(&["--max-volumes", "2"]);
    server.volume().await;
    let second = server.volume().await;
    let refused = server.post("/v1/volumes", &procedural("boxes", [8, 8, 8])).await;
    assert_eq!((refused.status.as_u16(), refused.code().as_str()), (429, "too_many"));
    server.delete(&format!("/v1/volumes/{second}")).await;
    assert_eq!(server.post("/v1/volumes", &procedural("boxes", [8, 8, 8])).await.status, 201);
}

#[tokio::test]
async fn a_volume_that_does_not_fit_says_what_is_needed_and_what_is_there() {
    let options = GpuOptions { memory_budget_bytes: Some(8 << 20), ..GpuOptions::default() };
    let (renderer, _thread) = RenderHandle::spawn(options).expect("an adapter");
    let server = Server::with_renderer(&[], renderer);
    let small = server.volume().await;
    let answer = server.post("/v1/volumes?reduce=never", &procedural("gyroid", [160, 160, 160])).await;
    assert_eq!((answer.status.as_u16(), answer.code().as_str()), (507, "out_of_gpu_memory"), "{answer:?}");
    let details = &answer.json()["error"]["details"];
    assert!(details["needed_bytes"].as_u64() > Some(160 * 160 * 160));
    assert_eq!(details["budget_bytes"], 8 << 20);
    assert_eq!(details["resident"][0]["volume"], json!(small));
    assert_eq!(count(&server).await, 1);
    let plan = server.post("/v1/volumes?dry_run=true&reduce=never", &procedural("gyroid", [160, 160, 160])).await;
    assert_eq!(plan.json()["fits"], false);
}

#[tokio::test]
async fn a_volume_in_use_is_deleted_by_force_only() {
    let server = Server::new(&[]);
    let volume = server.volume().await;
    let path = format!("/v1/volumes/{volume}");
    let scene = server.post("/v1/scenes", &json!({ "volume": volume })).await.json();
    let refused = server.delete(&path).await;
    assert_eq!((refused.status.as_u16(), refused.code().as_str()), (409, "volume_in_use"));
    assert_eq!(refused.json()["error"]["details"]["scenes"], json!([scene["id"]]));
    assert_eq!(server.delete(&format!("{path}?force=maybe")).await.path(), "force");
    assert_eq!(server.get(&path).await.status, 200);
    assert_eq!(server.delete(&format!("{path}?force=true")).await.status, 204);

    let scene = format!("/v1/scenes/{}", scene["id"].as_str().expect("an id"));
    assert_eq!(server.get(&scene).await.status, 200, "the scene is still there");
    let frame = server.get(&format!("{scene}/frame?width=8&height=8")).await;
    assert_eq!((frame.status.as_u16(), frame.code().as_str()), (404, "volume_not_found"));
    let patch = server.patch(&scene, &json!({ "lighting": { "ambient": 1 } })).await;
    assert_eq!((patch.status.as_u16(), patch.code().as_str()), (404, "volume_not_found"));
    let other = server.volume().await;
    assert_eq!(server.patch(&scene, &json!({ "volume": other })).await.status, 200);
    assert_eq!(server.get(&format!("{scene}/frame?width=8&height=8")).await.status, 200);
    let undone = server.send(request(Method::POST, &format!("{scene}/undo"), &[], Body::empty())).await;
    assert_eq!((undone.status.as_u16(), undone.code().as_str()), (404, "volume_not_found"));
    assert_eq!(server.get(&scene).await.json()["volume"], json!(other));
}

#[tokio::test]
async fn a_volume_is_free_again_once_its_scene_looks_elsewhere_or_is_gone() {
    let server = Server::new(&[]);
    let (first, second) = (server.volume().await, server.volume().await);
    let scene = server.post("/v1/scenes", &json!({ "volume": first })).await;
    let scene = scene.header("location").to_owned();
    assert_eq!(server.patch(&scene, &json!({ "volume": second })).await.status, 200);
    assert_eq!(server.delete(&format!("/v1/volumes/{first}")).await.status, 204);
    assert_eq!(server.delete(&format!("/v1/volumes/{second}")).await.status, 409);
    assert_eq!(server.delete(&scene).await.status, 204);
    assert_eq!(server.delete(&format!("/v1/volumes/{second}")).await.status, 204);
}
