//! The value at a place, downloads of voxels, and what a file's header says besides.

use std::path::Path;

use futures_util::StreamExt;
use glam::{DVec3, dvec3};
use serde_json::{Value, json};
use spao_server::api::AppState;
use spao_server::volume::{Format, Limits, Volume, format};

use super::{Answer, Server};
use crate::volume::{independent, zarr};

/// An oblique volume of 3 x 2 x 2 voxels, one of which is NaN.
fn oblique() -> Vec<u8> {
    let header = "NRRD0005\ntype: double\ndimension: 3\nspace: left-posterior-superior\nsizes: 3 2 2\n\
                  space directions: (1.2,1.6,0) (-0.8,0.6,0) (0,0,4)\nspace origin: (10,-20,30)\n\
                  endian: little\nencoding: raw\ncontent: Jane Doe\npatient name:=Jane Doe\n\n";
    let value = |i: i32| if i == 11 { f64::NAN } else { f64::from(i * i) };
    [header.as_bytes().to_vec(), (0..12).flat_map(|i| value(i).to_le_bytes()).collect()].concat()
}

async fn upload(server: &Server, file: &[u8], name: &str) -> String {
    let answer = server.upload(name, file.to_vec()).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    answer.header("location").to_owned()
}

async fn probe(server: &Server, path: &str, at: DVec3) -> Value {
    let answer = server.get(&format!("{path}/probe?x={}&y={}&z={}", at.x, at.y, at.z)).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    answer.json()
}

#[tokio::test]
async fn a_probe_finds_the_voxel_and_interpolates_between_centres() {
    let server = Server::new(&[]);
    let path = upload(&server, &oblique(), "").await;
    let world = |i: f64, j: f64, k: f64| {
        dvec3(10.0, -20.0, 30.0) + i * dvec3(1.2, 1.6, 0.0) + j * dvec3(-0.8, 0.6, 0.0) + k * dvec3(0.0, 0.0, 4.0)
    };
    // Centres: voxel (i, j, k) has the value (i + 3 j + 6 k)².
    for (at, index, value, interpolated) in [
        ([0.0, 0.0, 0.0], [0, 0, 0], 0.0, 0.0),
        ([2.0, 0.0, 1.0], [2, 0, 1], 64.0, 64.0),
        ([0.25, 0.0, 0.0], [0, 0, 0], 0.0, 0.25),
        ([1.0, 0.75, 0.0], [1, 1, 0], 16.0, 0.25 + 0.75 * 16.0),
        (
            [1.0, 0.5001, 0.25],
            [1, 1, 0],
            16.0,
            0.75 * (0.4999 + 0.5001 * 16.0) + 0.25 * (0.4999 * 49.0 + 0.5001 * 100.0),
        ),
        // In the outer half of a border voxel, the border's value goes on.
        ([-0.4, 0.0, 0.0], [0, 0, 0], 0.0, 0.0),
        ([2.4, 0.0, 1.4], [2, 0, 1], 64.0, 64.0),
    ] {
        let found = probe(&server, &path, world(at[0], at[1], at[2])).await;
        assert_eq!((&found["inside"], &found["index"], &found["value"]), (&json!(true), &json!(index), &json!(value)));
        let got = found["interpolated"].as_f64().expect("a number");
        assert!((got - interpolated).abs() < 1e-9, "{at:?}: {got} instead of {interpolated}");
        assert!((got - interpolated - 0.01).abs() > 1e-9, "the comparison sees a hundredth");
        for axis in 0..3 {
            let position = found["position_in_voxels"][axis].as_f64().expect("a number");
            assert!((position - at[axis] - 0.5).abs() < 1e-9, "{at:?}: {found}");
        }
    }
    let nan = probe(&server, &path, world(2.0, 1.0, 1.0)).await;
    assert_eq!((&nan["inside"], &nan["index"]), (&json!(true), &json!([2, 1, 1])));
    assert_eq!((&nan["value"], &nan["interpolated"]), (&Value::Null, &Value::Null));
    let beside = probe(&server, &path, world(1.75, 1.0, 0.25)).await;
    assert_eq!((&beside["value"], &beside["interpolated"]), (&json!(25.0), &Value::Null));
    for outside in [world(-0.51, 0.0, 0.0), world(0.0, 1.51, 0.0), world(0.0, 0.0, 1.51), DVec3::splat(1e300)] {
        let found = probe(&server, &path, outside).await;
        assert_eq!(found["inside"], false, "{outside}");
        assert!(["index", "value", "interpolated"].iter().all(|name| found[*name].is_null()), "{found}");
    }
    for (query, field) in [("x=0&y=0", "z"), ("x=0&y=a&z=0", "y"), ("x=inf&y=0&z=0", "x"), ("x=0&y=0&z=0&w=0", "w")] {
        assert_eq!(server.get(&format!("{path}/probe?{query}")).await.path(), field, "{query}");
    }
}

async fn download(server: &Server, path: &str, format: &str) -> Vec<u8> {
    let answer = server.get(&format!("{path}/data?format={format}")).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    assert_eq!(answer.header("content-length"), answer.bytes.len().to_string());
    assert!(answer.header("content-disposition").ends_with(&format!(".{format}\"")));
    answer.bytes
}

fn read(file: &[u8], name: &str) -> Volume {
    let format = Format::from_name(name).expect("a format");
    format::read_bytes(file, format, None, &Limits::default()).unwrap_or_else(|error| panic!("{name}: {error}"))
}

/// Where a volume that was downloaded is not the one that was uploaded.
fn differences(got: &Volume, expected: &Volume, with_geometry: bool) -> Vec<&'static str> {
    let near = |a: DVec3, b: DVec3| (a - b).abs().max_element() <= 1e-12 * (1.0 + b.length());
    let (a, b) = (&got.grid, &expected.grid);
    let same_place = near(a.origin, b.origin)
        && near(a.spacing, b.spacing)
        && a.direction.iter().zip(b.direction).all(|(a, b)| near(*a, b))
        && got.about.patient_axes == expected.about.patient_axes;
    let bytes = |volume: &Volume| volume.voxels.little_endian_bytes().into_owned();
    let checks = [
        ("dims", a.dims == b.dims),
        ("type", got.voxels.voxel_type() == expected.voxels.voxel_type()),
        ("voxels", bytes(got) == bytes(expected)),
        ("geometry", !with_geometry || same_place),
    ];
    checks.into_iter().filter(|(_, right)| !right).map(|(what, _)| what).collect()
}

#[tokio::test]
async fn every_format_comes_back_as_nrrd_and_numpy_byte_for_byte() {
    let names = independent::expected().into_iter().map(|expected| expected.file).collect();
    assert!(round_trips(&independent::directory(), names).await > 100);
    assert!(round_trips(&zarr::folder(), zarr::archives()).await > 60);
}

/// Loads files of a directory and compares their downloads with what is in them.
async fn round_trips(directory: &Path, names: Vec<String>) -> usize {
    let server = Server::new(&["--data-dir", directory.to_str().expect("UTF-8"), "--max-volumes", "2"]);
    let none: [&str; 0] = [];
    for name in &names {
        let answer = server.post("/v1/volumes", &json!({ "source": { "path": name } })).await;
        assert_eq!(answer.status, 201, "{name}: {answer:?}");
        let path = answer.header("location").to_owned();
        let loaded = format::load_path(name, directory, None, &Limits::default()).expect("a fixture");
        let nrrd = read(&download(&server, &path, "nrrd").await, "nrrd");
        assert_eq!(differences(&nrrd, &loaded, true), none, "{name}");
        let npy = read(&download(&server, &path, "npy").await, "npy");
        assert_eq!(differences(&npy, &loaded, false), none, "{name}");
        server.delete(&path).await;
    }
    names.len()
}

#[tokio::test]
async fn the_comparison_of_downloads_sees_a_changed_byte_and_a_moved_volume() {
    let volume = read(&oblique(), "nrrd");
    let mut changed = oblique();
    *changed.last_mut().expect("not empty") ^= 1;
    assert_eq!(differences(&read(&changed, "nrrd"), &volume, true), ["voxels"]);
    let text = |from: &str, to: &str| {
        let at = oblique().windows(from.len()).position(|w| w == from.as_bytes()).expect("it is there");
        [&oblique()[..at], to.as_bytes(), &oblique()[at + from.len()..]].concat()
    };
    assert_eq!(differences(&read(&text("(10,-20", "(10,-21"), "nrrd"), &volume, true), ["geometry"]);
    let other_space = text("left-posterior-superior", "scanner-xyz");
    assert_eq!(differences(&read(&other_space, "nrrd"), &volume, true), ["geometry"]);
    assert!(differences(&read(&other_space, "nrrd"), &volume, false).is_empty());
}

#[tokio::test]
async fn a_download_keeps_nan_and_comes_in_pieces() {
    let server = Server::new(&[]);
    let path = upload(&server, &oblique(), "").await;
    let file = download(&server, &path, "nrrd").await;
    assert!(f64::from_le_bytes(*file.last_chunk().expect("eight bytes")).is_nan());
    // 100 x 100 x 90 voxels are four pieces.
    let voxels: Vec<u8> = (0..900_000u32).flat_map(|i| (i.wrapping_mul(2_654_435_761) as u16).to_le_bytes()).collect();
    let path = upload(&server, &voxels, "format=raw&dims=100,100,90&type=u16").await;
    assert!(download(&server, &path, "npy").await.ends_with(&voxels));
    let file = download(&server, &path, "nrrd").await;
    assert!(file.ends_with(&voxels));
    let header = String::from_utf8_lossy(&file[..file.len() - voxels.len()]).into_owned();
    assert!(header.contains("space dimension: 3\n") && !header.contains("space:"), "nobody knows the axes: {header}");
    assert_eq!(server.get(&format!("{path}/data?format=tiff")).await.path(), "format");
}

#[tokio::test]
async fn a_download_ends_when_its_volume_is_deleted() {
    let server = Server::new(&[]);
    let voxels = vec![1; 900_000];
    let path = upload(&server, &voxels, "format=raw&dims=100,100,90&type=u8").await;
    let request = super::request(axum::http::Method::GET, &format!("{path}/data"), &[], axum::body::Body::empty());
    let response = tower::ServiceExt::oneshot(server.router.clone(), request).await.expect("an answer");
    let mut pieces = response.into_body().into_data_stream();
    let header = pieces.next().await.expect("a header").expect("no failure");
    assert!(header.starts_with(b"NRRD0005"));
    assert!(pieces.next().await.expect("voxels").is_ok());
    assert_eq!(server.delete(&path).await.status, 204);
    assert!(pieces.next().await.expect("an end").is_err(), "a file that is not whole must not look like one");
}

fn names(answer: &Answer) -> Vec<String> {
    let json = answer.json();
    let fields = json["header"].as_array().expect("fields").iter();
    fields.map(|field| field["name"].as_str().expect("a name").to_owned()).collect()
}

#[tokio::test]
async fn what_may_name_a_patient_is_shown_only_where_that_is_wanted() {
    let closed = Server::new(&[]);
    let open = Server::new(&["--keep-identity"]);
    let nifti = independent::bytes_of("nifti1_sform.nii");
    let nifti = [&nifti[..148], b"Jane Doe\0", &nifti[157..]].concat();
    let meta = b"ObjectType = Image\nNDims = 3\nComment = Jane Doe\n0010|0010 = Jane Doe\nDimSize = 1 1 2\n\
                 ElementType = MET_UCHAR\nElementDataFile = LOCAL\n\x01\x02"
        .to_vec();
    for (file, hidden, kept) in
        [(oblique(), "patient name", "space directions"), (nifti, "descrip", "srow_x"), (meta, "0010|0010", "DimSize")]
    {
        let path = upload(&closed, &file, "").await;
        let answer = closed.get(&format!("{path}/metadata")).await;
        assert!(!String::from_utf8_lossy(&answer.bytes).contains("Jane"), "{answer:?}");
        assert!(
            !names(&answer).contains(&hidden.to_owned()) && names(&answer).contains(&kept.to_owned()),
            "{answer:?}"
        );
        assert!(answer.json()["withheld"].as_u64() > Some(0));
        let path = upload(&open, &file, "").await;
        let answer = open.get(&format!("{path}/metadata")).await;
        assert!(names(&answer).contains(&hidden.to_owned()), "{answer:?}");
        assert!(String::from_utf8_lossy(&answer.bytes).contains("Jane Doe"));
        assert_eq!(answer.json()["withheld"], 0);
    }
    // The state is what both servers differ in.
    let keeps = |state: &AppState| state.keep_identity;
    assert_eq!((keeps(&closed.state), keeps(&open.state)), (false, true));
}

#[tokio::test]
async fn the_technique_of_scans_and_microscopes_is_shown_and_the_patient_is_not() {
    let closed = Server::new(&[]);
    let data = |name: &str| std::fs::read(format!("{}/tests/data/{name}", env!("CARGO_MANIFEST_DIR"))).expect("there");
    let scan = upload(&closed, &data("dicom/explicit.zip"), "").await;
    let answer = closed.get(&format!("{scan}/metadata")).await;
    let shown = names(&answer);
    for keyword in ["Modality", "Manufacturer", "SliceThickness", "PixelSpacing", "BitsStored"] {
        assert!(shown.contains(&keyword.to_owned()), "{keyword} is missing: {shown:?}");
    }
    let secret = ["PatientName", "PatientID", "StudyDate", "InstitutionName", "StudyInstanceUID", "StudyDescription"];
    assert!(!secret.iter().any(|keyword| shown.contains(&(*keyword).to_owned())), "{shown:?}");
    assert!(!String::from_utf8_lossy(&answer.bytes).contains("Secret"), "{answer:?}");
    assert!(answer.json()["withheld"].as_u64() >= Some(secret.len() as u64));
    let packed = upload(&closed, &data("dicom/jpeg2000.zip"), "").await;
    assert!(names(&closed.get(&format!("{packed}/metadata")).await).contains(&"KVP".to_owned()));
    let cells = upload(&closed, &data("tiff/ome_channels.ome.tif"), "").await;
    let answer = closed.get(&format!("{cells}/metadata")).await;
    assert!(names(&answer).contains(&"SizeZ".to_owned()), "{answer:?}");
    assert!(!names(&answer).contains(&"ImageDescription".to_owned()), "{answer:?}");
    let levels = upload(&closed, &data("zarr/ome_05.zip"), "scale=1").await;
    let answer = closed.get(&format!("{levels}/metadata")).await;
    assert!(names(&answer).contains(&"level".to_owned()) && !names(&answer).contains(&"name".to_owned()), "{answer:?}");
    assert!(!String::from_utf8_lossy(&answer.bytes).contains("Jane"), "{answer:?}");
    // Negative control: with the operator's leave both are shown.
    let open = Server::new(&["--keep-identity"]);
    for (file, hidden) in [("dicom/explicit.zip", "PatientName"), ("tiff/ome_channels.ome.tif", "ImageDescription")] {
        let path = upload(&open, &data(file), "").await;
        let answer = open.get(&format!("{path}/metadata")).await;
        assert!(names(&answer).contains(&hidden.to_owned()), "{answer:?}");
    }
}

#[tokio::test]
async fn notes_are_in_the_volume_and_in_its_metadata() {
    let server = Server::new(&[]);
    let path = upload(&server, &oblique(), "").await;
    let note = json!(["1 voxel is NaN and shown as the lowest value"]);
    assert_eq!(server.get(&path).await.json()["notes"], note);
    let metadata = server.get(&format!("{path}/metadata")).await.json();
    assert_eq!((&metadata["notes"], &metadata["nan_count"]), (&note, &json!(1)));
    assert_eq!(metadata["patient_axes"], true);
    let plain = format!("/v1/volumes/{}", server.volume().await);
    assert_eq!(server.get(&plain).await.json().get("notes"), None);
    let metadata = server.get(&format!("{plain}/metadata")).await.json();
    assert_eq!((&metadata["patient_axes"], &metadata["header"]), (&json!(false), &json!([])));
}
