//! The listing of the data directory.

use std::fs;
use std::path::Path;

use serde_json::{Value, json};
use tempfile::TempDir;

use super::Server;
use crate::volume::independent;

fn names(listing: &Value) -> Vec<&str> {
    listing["entries"].as_array().expect("entries").iter().filter_map(|entry| entry["name"].as_str()).collect()
}

/// A data directory with a folder, volumes, and things that are none, beside a secret.
fn directory() -> TempDir {
    let root = tempfile::tempdir().expect("a directory");
    let data = root.path().join("data");
    fs::create_dir_all(data.join("ct/old")).expect("a folder");
    let put = |path: &str, bytes: &[u8]| fs::write(root.path().join(path), bytes).expect("a file");
    put("secret.nrrd", b"NRRD0004");
    put("data/a.nii.gz", &independent::bytes_of("nifti1_gzip.nii.gz"));
    put("data/b.NRRD", &independent::bytes_of("nrrd_itk.nrrd"));
    put("data/broken.nrrd", b"NRRD0004\ntype: chair\n\n");
    put("data/readme.txt", b"text");
    put("data/.hidden.nrrd", b"NRRD0004");
    put("data/ct/head.npy", &independent::bytes_of("npy_i16_little.npy"));
    root
}

/// Unpacks an image of the fixtures as a folder.
fn put_zarr(folder: &Path) {
    let file = fs::File::open(format!("{}/tests/data/zarr/ome_05.zip", env!("CARGO_MANIFEST_DIR"))).expect("a fixture");
    zip::ZipArchive::new(file).expect("a zip").extract(folder).expect("it can be unpacked");
}

fn serve(data: &Path) -> Server {
    Server::new(&["--data-dir", data.to_str().expect("UTF-8")])
}

#[tokio::test]
async fn a_directory_is_listed_page_by_page_and_its_paths_can_be_loaded() {
    let root = directory();
    let server = serve(&root.path().join("data"));
    let all = server.get("/v1/files").await.json();
    assert_eq!(names(&all), ["a.nii.gz", "b.NRRD", "broken.nrrd", "ct", "readme.txt"]);
    assert_eq!((&all["path"], &all["next"]), (&json!(""), &Value::Null));
    let formats: Vec<&Value> = all["entries"].as_array().expect("entries").iter().map(|e| &e["format"]).collect();
    assert_eq!(formats, [&json!("nifti"), &json!("nrrd"), &json!("nrrd"), &Value::Null, &Value::Null]);
    assert_eq!(all["entries"][3], json!({ "kind": "directory", "name": "ct", "path": "ct" }));
    assert_eq!(all["entries"][4]["bytes"], 4);
    assert_eq!(all["entries"][0].get("dims"), None, "headers are read only where they are asked for");

    let mut seen: Vec<String> = Vec::new();
    let mut after = String::new();
    loop {
        let page = server.get(&format!("/v1/files?limit=2&after={after}")).await.json();
        assert!(names(&page).len() <= 2);
        seen.extend(names(&page).into_iter().map(str::to_owned));
        let Some(next) = page["next"].as_str() else { break };
        after = next.to_owned();
    }
    assert_eq!(seen, names(&all));

    let below = server.get("/v1/files?path=ct/&headers=true").await.json();
    assert_eq!((names(&below), &below["path"]), (vec!["head.npy", "old"], &json!("ct")));
    assert_eq!((&below["entries"][0]["dims"], &below["entries"][0]["voxel_type"]), (&json!([5, 4, 3]), &json!("i16")));
    let path = below["entries"][0]["path"].clone();
    assert_eq!(path, "ct/head.npy");
    assert_eq!(server.post("/v1/volumes", &json!({ "source": { "path": path } })).await.status, 201);
    assert_eq!(server.get("/v1/files?path=ct/old").await.json()["entries"], json!([]));
}

#[tokio::test]
async fn headers_say_what_a_file_holds_or_what_is_wrong_with_it() {
    let root = directory();
    let server = serve(&root.path().join("data"));
    let all = server.get("/v1/files?headers=true").await.json();
    let entry = |name: &str| {
        let entries = all["entries"].as_array().expect("entries");
        entries.iter().find(|entry| entry["name"] == name).expect("it is listed").clone()
    };
    assert_eq!((&entry("a.nii.gz")["dims"], &entry("a.nii.gz")["voxel_type"]), (&json!([5, 4, 3]), &json!("i16")));
    assert_eq!(entry("b.NRRD")["dims"], json!([5, 4, 3]));
    let spacing = |name: &str| entry(name)["spacing"].as_array().map(Vec::len);
    assert_eq!((spacing("a.nii.gz"), spacing("b.NRRD")), (Some(3), Some(3)));
    for (name, fault) in [("broken.nrrd", "type"), ("readme.txt", "format")] {
        let entry = entry(name);
        assert!(entry["error"].as_str().is_some_and(|text| text.starts_with(fault)), "{entry}");
        assert_eq!(entry.get("dims"), None);
    }
    assert_eq!(entry("ct").get("error"), None);
}

#[tokio::test]
async fn a_folder_of_zarr_is_listed_as_a_volume_and_loaded_at_a_level_of_detail() {
    let root = directory();
    let data = root.path().join("data");
    put_zarr(&data);
    let server = serve(&data);
    let listed = server.get("/v1/files?headers=true&after=ct&limit=1").await.json()["entries"][0].clone();
    let expected = json!({ "kind": "directory", "name": "ome_05.zarr", "path": "ome_05.zarr", "format": "zarr",
        "dims": [5, 4, 3], "voxel_type": "u16", "spacing": [0.00025, 0.0005, 0.0025] });
    let rounded = |value: &Value| (value.as_f64().expect("a number") * 1e9).round() / 1e9;
    assert_eq!(
        listed["spacing"].as_array().expect("numbers").iter().map(rounded).collect::<Vec<_>>(),
        [0.00025, 0.0005, 0.0025]
    );
    for field in ["kind", "name", "path", "format", "dims", "voxel_type"] {
        assert_eq!(listed[field], expected[field], "{field}");
    }
    let load = async |more: Value| {
        let mut source = json!({ "path": "ome_05.zarr" });
        source.as_object_mut().expect("an object").extend(more.as_object().expect("an object").clone());
        server.post("/v1/volumes", &json!({ "source": source })).await
    };
    let coarse = load(json!({ "scale": 1, "channel": 1 })).await.json();
    assert_eq!(coarse["dims"], json!([3, 2, 3]));
    assert_eq!(coarse["source"], json!({ "path": "ome_05.zarr", "channel": 1, "scale": 1 }));
    assert_eq!(load(json!({})).await.json()["dims"], json!([5, 4, 3]));
    let answer = load(json!({ "scale": 7 })).await;
    assert_eq!(answer.verdict(), (422, "invalid".into(), "source.scale".into()), "{answer:?}");
    let ct = server.get("/v1/files?path=ct&headers=true").await.json();
    assert_eq!(ct["entries"][0]["spacing"], Value::Null, "an array has no spacing");
}

#[cfg(unix)]
#[tokio::test]
async fn a_listing_never_leaves_the_data_directory() {
    let root = directory();
    let data = root.path().join("data");
    let link = |from: &str, to: &str| std::os::unix::fs::symlink(from, data.join(to)).expect("a link");
    link("../secret.nrrd", "out.nrrd");
    link("..", "up");
    link("b.NRRD", "inside.nrrd");
    link("nothing", "dangling.nrrd");
    let server = serve(&data);
    let all = server.get("/v1/files").await.json();
    assert_eq!(names(&all), ["a.nii.gz", "b.NRRD", "broken.nrrd", "ct", "inside.nrrd", "readme.txt"]);
    for path in ["..", "/", "/etc", "ct/../..", "up", "up/ct", "missing", "a.nii.gz", "a%00b"] {
        let answer = server.get(&format!("/v1/files?path={path}")).await;
        if path == "/" {
            assert_eq!(names(&answer.json()), names(&all), "slashes at the end mean nothing");
            continue;
        }
        assert_eq!(answer.verdict(), (422, "invalid".into(), "path".into()), "{path}: {answer:?}");
        assert!(!String::from_utf8_lossy(&answer.bytes).contains(root.path().to_str().expect("UTF-8")), "{answer:?}");
    }
    for (query, field) in [("limit=0", "limit"), ("limit=1001", "limit"), ("limit=101&headers=true", "limit")] {
        assert_eq!(server.get(&format!("/v1/files?{query}")).await.path(), field, "{query}");
    }
    assert_eq!(Server::new(&[]).get("/v1/files").await.verdict(), (422, "invalid".into(), "path".into()));
}
