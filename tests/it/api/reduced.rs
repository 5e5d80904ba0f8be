//! Volumes that are too large, and parts of volumes, over HTTP.

use serde::Serialize;
use serde_json::{Value, json};
use spao_server::gpu::GpuOptions;
use spao_server::render_thread::{RenderHandle, RenderThread};

use super::{Answer, Server};

/// A server whose GPU holds little.
fn tight(mib: u64) -> (Server, RenderThread) {
    let options = GpuOptions { memory_budget_bytes: Some(mib << 20), ..GpuOptions::default() };
    let (renderer, thread) = RenderHandle::spawn(options).expect("an adapter");
    (Server::with_renderer(&[], renderer), thread)
}

fn gyroid(n: u32) -> Value {
    json!({ "source": { "procedural": { "kind": "gyroid", "dims": [n, n, n] } } })
}

/// 6 x 5 x 4 voxels that all differ, 2 x 1 x 3 apart, the first at (10, 20, 30).
fn nrrd() -> Vec<u8> {
    let header = "NRRD0004\ntype: unsigned char\ndimension: 3\nsizes: 6 5 4\nspace dimension: 3\n\
                  space directions: (2,0,0) (0,1,0) (0,0,3)\nspace origin: (10,20,30)\nencoding: raw\n\n";
    [header.as_bytes(), &(0..120).collect::<Vec<u8>>()].concat()
}

/// The same along each axis.
fn cube<T: Serialize>(n: T) -> Value {
    json!([n, n, n])
}

async fn volume(answer: Answer) -> Value {
    assert_eq!(answer.status, 201, "{answer:?}");
    answer.json()
}

async fn voxels(server: &Server, volume: &Value) -> Vec<u8> {
    let id = volume["id"].as_str().expect("an id");
    let file = server.get(&format!("/v1/volumes/{id}/data?format=nrrd")).await.bytes;
    let start = file.windows(2).position(|pair| pair == b"\n\n").expect("the end of the header") + 2;
    file[start..].to_vec()
}

#[tokio::test]
async fn a_volume_that_does_not_fit_is_averaged_and_says_so() {
    let (server, _thread) = tight(24);
    let plan = server.post("/v1/volumes?dry_run=true", &gyroid(160)).await;
    assert_eq!(plan.status, 200, "{plan:?}");
    let plan = plan.json();
    let loaded = volume(server.post("/v1/volumes", &gyroid(160)).await).await;
    let factor = loaded["resolution"]["factor"][0].as_u64().expect("a number");
    assert!(factor > 1, "{loaded}");
    let dims = 160_u64.div_ceil(factor);
    assert_eq!(loaded["resolution"], json!({ "full_dims": cube(160), "factor": cube(factor), "region": null }));
    assert_eq!(loaded["dims"], cube(dims));
    assert_eq!(loaded["spacing"], cube(factor as f64));
    assert_eq!(loaded["origin"], cube((factor as f64 - 1.0) / 2.0));
    assert!(loaded["notes"][0].as_str().is_some_and(|note| note.contains("160 x 160 x 160")), "{loaded}");
    for same in ["dims", "resolution", "voxel_type", "gpu_bytes", "host_bytes"] {
        assert_eq!(plan[same], loaded[same], "{same}");
    }
    assert_eq!((&plan["fits"], plan["occlusion_bytes"].is_u64()), (&json!(true), true));
    // It is really the highest resolution that fits, and its pictures with occlusion do.
    let scene = server.post("/v1/scenes", &json!({ "volume": loaded["id"] })).await.json();
    let id = scene["id"].as_str().expect("an id");
    let frame = server.get(&format!("/v1/scenes/{id}/frame?width=64&height=48")).await;
    assert_eq!(frame.status, 200, "{frame:?}");
    // The same voxels again fit as they are.
    let whole = volume(server.post("/v1/volumes", &gyroid(20)).await).await;
    assert_eq!(whole["resolution"], json!({ "full_dims": cube(20), "factor": cube(1), "region": null }));
    assert!(whole.get("notes").is_none(), "{whole}");
}

#[tokio::test]
async fn who_wants_no_averages_gets_the_numbers() {
    let (server, _thread) = tight(8);
    let refused = server.post("/v1/volumes?reduce=never", &gyroid(160)).await;
    assert_eq!((refused.status.as_u16(), refused.code().as_str()), (507, "out_of_gpu_memory"), "{refused:?}");
    let mut body = gyroid(160);
    body["reduce"] = json!("never");
    assert_eq!(server.post("/v1/volumes", &body).await.code(), "out_of_gpu_memory");
    let plan = server.post("/v1/volumes?dry_run=true", &body).await.json();
    assert_eq!((&plan["fits"], &plan["resolution"]["factor"]), (&json!(false), &json!([1, 1, 1])));
    body["reduce"] = json!("sometimes");
    assert_eq!(server.post("/v1/volumes", &body).await.path(), "reduce");
    assert_eq!(server.post("/v1/volumes?reduce=no", &gyroid(8)).await.path(), "reduce");
    assert_eq!(server.get("/v1/volumes").await.json(), json!({ "volumes": [] }));
}

#[tokio::test]
async fn an_axis_beyond_the_adapters_textures_is_averaged_alone() {
    let server = Server::new(&[]);
    let longest = server.state.renderer.info().max_volume_axis;
    let (long, query) = (longest + 1, format!("format=raw&dims={},2,2&type=u8", longest + 1));
    let bytes: Vec<u8> = (0..4 * long).map(|at| (at % long / 16) as u8).collect();
    let loaded = volume(server.upload(&query, bytes.clone()).await).await;
    assert_eq!(loaded["resolution"]["factor"], json!([2, 1, 1]));
    assert_eq!((&loaded["dims"], &loaded["spacing"]), (&json!([long.div_ceil(2), 2, 2]), &json!([2.0, 1.0, 1.0])));
    assert_eq!(loaded["origin"], json!([0.5, 0.0, 0.0]));
    let refused = server.upload(&format!("{query}&reduce=never"), bytes.clone()).await;
    assert_eq!(refused.verdict(), (413, "too_large".into(), "dims".into()), "{refused:?}");
    assert_eq!(refused.json()["error"]["details"]["limit"], longest);
    // A part of it that is short enough is whole.
    let part = volume(server.upload(&format!("{query}&region=16,0,0,64,2,2"), bytes.clone()).await).await;
    assert_eq!((&part["dims"], &part["resolution"]["factor"]), (&json!([48, 2, 2]), &json!([1, 1, 1])));
    assert_eq!(voxels(&server, &part).await[..48], bytes[16..64]);
    let never = server.upload(&format!("{query}&region=0,0,0,{long},2,2&reduce=never"), bytes).await;
    assert_eq!((never.status.as_u16(), never.code().as_str()), (413, "too_large"), "{never:?}");
}

#[tokio::test]
async fn a_region_has_the_voxels_and_the_place_of_its_part() {
    let data = tempfile::tempdir().expect("a directory");
    std::fs::write(data.path().join("all.nrrd"), nrrd()).expect("writable");
    let server = Server::new(&["--data-dir", data.path().to_str().expect("UTF-8")]);
    let whole = volume(server.upload("", nrrd()).await).await;
    let region = json!([[1, 2, 1], [4, 5, 3]]);
    let uploaded = volume(server.upload("region=1,2,1,4,5,3", nrrd()).await).await;
    let source = json!({ "path": "all.nrrd", "region": region });
    let named = volume(server.post("/v1/volumes", &json!({ "source": source })).await).await;
    assert_eq!((&named["source"], &uploaded["source"]["region"]), (&source, &region));
    let all: Vec<u8> = (0..120).collect();
    let expected: Vec<u8> = (1..3)
        .flat_map(|k| (2..5).flat_map(move |j| (1..4).map(move |i| (k * 5 + j) * 6 + i)))
        .map(|at: usize| all[at])
        .collect();
    for part in [&uploaded, &named] {
        assert_eq!(part["dims"], json!([3, 3, 2]));
        assert_eq!(part["resolution"], json!({ "full_dims": [6, 5, 4], "factor": [1, 1, 1], "region": region }));
        assert_eq!((&part["origin"], &part["spacing"]), (&json!([12.0, 22.0, 33.0]), &whole["spacing"]));
        assert_eq!(voxels(&server, part).await, expected);
        // The same place has the same value.
        for (x, y, z) in [(12.0, 22.0, 33.0), (16.0, 24.0, 36.0), (13.4, 23.3, 35.0)] {
            let probe = async |volume: &Value| {
                let id = volume["id"].as_str().expect("an id");
                server.get(&format!("/v1/volumes/{id}/probe?x={x}&y={y}&z={z}")).await.json()
            };
            let (here, there) = (probe(part).await, probe(&whole).await);
            assert_eq!((&here["inside"], &here["value"]), (&json!(true), &there["value"]), "{x} {y} {z}");
            assert_eq!(here["interpolated"], there["interpolated"], "{x} {y} {z}");
        }
    }
    assert_eq!(uploaded["sha256"], named["sha256"]);
    assert_ne!(uploaded["sha256"], whole["sha256"]);
}

#[tokio::test]
async fn a_region_of_an_averaged_volume_is_whole_and_lies_on_it() {
    let (server, _thread) = tight(24);
    let small = volume(server.post("/v1/volumes", &gyroid(160)).await).await;
    let factor = small["resolution"]["factor"][0].as_u64().expect("a number") as u32;
    // The block with the number 7 along each axis.
    let (first, end) = (7 * factor, 8 * factor);
    let mut body = gyroid(160);
    body["source"]["region"] = json!([cube(first), cube(end)]);
    let part = volume(server.post("/v1/volumes", &body).await).await;
    assert_eq!((&part["dims"], &part["resolution"]["factor"]), (&cube(factor), &cube(1)));
    let inside = voxels(&server, &part).await;
    let mean = inside.iter().map(|&v| f64::from(v)).sum::<f64>() / inside.len() as f64;
    let middle = f64::from(first + end - 1) / 2.0;
    let probe = async |volume: &Value| {
        let id = volume["id"].as_str().expect("an id");
        server.get(&format!("/v1/volumes/{id}/probe?x={middle}&y={middle}&z={middle}")).await.json()
    };
    let there = probe(&small).await;
    assert_eq!((&there["index"], &there["value"]), (&json!([7, 7, 7]), &json!(mean.round())));
    assert_eq!(probe(&part).await["inside"], true);
}

#[tokio::test]
async fn a_region_that_is_wrong_is_named() {
    let data = tempfile::tempdir().expect("a directory");
    std::fs::write(data.path().join("all.nrrd"), nrrd()).expect("writable");
    let server = Server::new(&["--data-dir", data.path().to_str().expect("UTF-8")]);
    for region in ["1,2,3", "a", "0,0,0,7,5,4", "2,0,0,2,5,4", "3,0,0,2,5,4", "0,0,0,6,5,-4"] {
        for query in ["", "&dry_run=true"] {
            let answer = server.upload(&format!("region={region}{query}"), nrrd()).await;
            assert_eq!(answer.verdict(), (422, "invalid".into(), "region".into()), "{region}: {answer:?}");
        }
    }
    let outside = server.upload("region=0,0,0,7,5,4", nrrd()).await;
    let message = outside.json()["error"]["message"].to_string();
    assert!(message.contains("[6, 5, 4]"), "{message}");
    let path = |region: Value| json!({ "source": { "path": "all.nrrd", "region": region } });
    for (body, named) in [
        (path(json!([[0, 0, 0], [7, 5, 4]])), "source.region"),
        (path(json!([[0, 0, 0], [0, 5, 4]])), "source.region"),
        (path(json!([[0, 0, 0]])), "source.region"),
        (path(json!([[0, 0], [6, 5]])), "source.region"),
        (path(json!("0,0,0,1,1,1")), "source.region"),
    ] {
        let answer = server.post("/v1/volumes", &body).await;
        assert_eq!(answer.status, 422, "{body}: {answer:?}");
        assert!(answer.path().starts_with(named), "{body}: {answer:?}");
    }
    let misplaced = server.post("/v1/volumes?region=0,0,0,1,1,1", &gyroid(8)).await;
    assert_eq!(misplaced.verdict(), (422, "invalid".into(), "region".into()));
    let plan = server.post("/v1/volumes?dry_run=true", &path(json!([[0, 0, 0], [6, 2, 2]]))).await.json();
    assert_eq!((&plan["dims"], &plan["host_bytes"]), (&json!([6, 2, 2]), &json!(24)));
    assert_eq!(server.get("/v1/volumes").await.json(), json!({ "volumes": [] }));
}
