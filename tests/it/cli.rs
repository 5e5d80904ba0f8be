//! The subcommands that make one file and end.

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

use crate::api::accessibility::read_npy;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_spao-server")).args(arguments).output().expect("the program starts")
}

/// Runs what should work.
fn done(arguments: &[&str]) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(0), "{arguments:?}: {output:?}");
    String::from_utf8(output.stdout).expect("UTF-8")
}

/// Runs what should fail; what it says.
fn failed(arguments: &[&str], code: i32) -> String {
    let output = run(arguments);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {output:?}");
    String::from_utf8(output.stderr).expect("UTF-8")
}

fn text(path: &Path) -> &str {
    path.to_str().expect("temporary paths are UTF-8")
}

#[test]
fn inspect_prints_what_a_file_holds() {
    let head = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/visible-human-head-128.nrrd");
    let json: Value = serde_json::from_str(&done(&["inspect", head, "--bins", "8"])).expect("JSON");
    assert_eq!(json["dims"], serde_json::json!([128, 128, 105]));
    assert_eq!(json["voxel_type"], "i16");
    assert_eq!(json["nan_count"], 0);
    let counts = json["histogram"]["counts"].as_array().expect("counts");
    assert_eq!(counts.iter().filter_map(Value::as_u64).sum::<u64>(), 128 * 128 * 105);
    assert_eq!(counts.len(), 8);
    assert!(failed(&["inspect", "no/such/file.nrrd"], 1).contains("no/such/file.nrrd"));
    let boxes: Value = serde_json::from_str(&done(&["inspect", "procedural:boxes:5,6,7"])).expect("JSON");
    assert_eq!(boxes["dims"], serde_json::json!([5, 6, 7]));
    for bad in ["procedural:boxes", "procedural:boxes:5,6", "procedural:boxes:x", "procedural:boxes:-1"] {
        assert!(failed(&["inspect", bad], 1).contains("procedural"), "{bad}");
    }
    assert!(failed(&["inspect", "procedural:cube:8"], 1).contains("procedural"));
}

#[test]
fn one_of_several_volumes_in_a_file_is_named_after_it() {
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data");
    let inspect = |argument: &str| -> Value {
        serde_json::from_str(&done(&["inspect", &format!("{data}/{argument}")])).expect("JSON")
    };
    let refused = |argument: &str| failed(&["inspect", &format!("{data}/{argument}")], 1);
    assert_eq!(inspect("dicom/several.zip#series=4")["dims"], serde_json::json!([5, 4, 3]));
    assert_eq!(inspect("dicom/several.zip#series=5")["dims"], serde_json::json!([5, 4, 4]));
    assert!(refused("dicom/several.zip").contains("series=5"));
    assert!(refused("dicom/several.zip#series=9").contains("series"));
    let sums =
        ["#channel=0", "#channel=1", ""].map(|c| inspect(&format!("tiff/ome_channels.ome.tif{c}"))["sha256"].clone());
    assert!(sums[0] == sums[2] && sums[0] != sums[1], "{sums:?}");
    assert!(refused("tiff/ome_channels.ome.tif#channel=x").contains("channel"));
    assert!(refused("tiff/ome_channels.ome.tif#page=1").contains("path"));
    // A file that is called so is meant itself.
    let directory = tempfile::tempdir().expect("a temporary directory");
    let odd = directory.path().join("a#channel=1");
    std::fs::copy(format!("{data}/tiff/ome_channels.ome.tif"), &odd).expect("copied");
    let json: Value = serde_json::from_str(&done(&["inspect", text(&odd)])).expect("JSON");
    assert_eq!(json["sha256"], sums[0]);
}

#[test]
fn a_part_of_a_volume_is_named_after_it() {
    let inspect = |argument: &str| -> Value { serde_json::from_str(&done(&["inspect", argument])).expect("JSON") };
    let part = inspect("procedural:boxes:20,10,5#region=2,3,1,20,10,5");
    assert_eq!((&part["dims"], &part["origin"]), (&serde_json::json!([18, 7, 4]), &serde_json::json!([2.0, 3.0, 1.0])));
    assert_eq!(part["resolution"]["region"], serde_json::json!([[2, 3, 1], [20, 10, 5]]));
    let series = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/dicom/several.zip#series=5#region=0,0,1,5,4,3");
    assert_eq!(inspect(series)["dims"], serde_json::json!([5, 4, 2]));
    for bad in ["2,3,1,20,10", "2,3,1,20,10,6", "2,3,1,2,10,5", "x"] {
        let message = failed(&["inspect", &format!("procedural:boxes:20,10,5#region={bad}")], 1);
        assert!(message.contains("region"), "{bad}: {message}");
    }
}

#[test]
fn openapi_prints_the_document() {
    let printed: Value = serde_json::from_str(&done(&["openapi"])).expect("JSON");
    assert_eq!(printed, spao_server::api::document());
}

#[test]
fn render_draws_a_scene_into_a_file() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let (scene, png) = (directory.path().join("scene.json"), directory.path().join("out.png"));
    std::fs::write(&scene, r##"{"rendering": {"background": "#ff0000"}, "viewport": {"width": 30, "height": 20}}"##)
        .expect("writable");
    done(&["render", "procedural:boxes:16", "--scene", text(&scene), "-o", text(&png)]);
    let picture = image::open(&png).expect("a PNG").to_rgb8();
    assert_eq!(picture.dimensions(), (30, 20));
    assert_eq!(picture.get_pixel(29, 19).0, [255, 0, 0]);
    let jpeg = directory.path().join("out.jpg");
    done(&["render", "procedural:boxes:16", "-o", text(&jpeg), "--width", "16", "--height", "12"]);
    assert_eq!(image::image_dimensions(&jpeg).expect("a JPEG"), (16, 12));
    let unnamed = directory.path().join("out");
    assert!(failed(&["render", "procedural:boxes:16", "-o", text(&unnamed)], 1).contains("--format"));
    failed(&["render", "procedural:boxes:16", "-o", text(&png), "--width", "0"], 2);
    std::fs::write(&scene, r#"{"camera": {"fov_y_deg": 0}}"#).expect("writable");
    let said = failed(&["render", "procedural:boxes:16", "--scene", text(&scene), "-o", text(&png)], 1);
    assert!(said.contains("camera.fov_y_deg"), "{said}");
}

#[test]
fn ao_writes_accessibility_with_the_settings_of_its_flags() {
    let directory = tempfile::tempdir().expect("a temporary directory");
    let file = |name: &str| directory.path().join(name);
    let (open, closed, nrrd) = (file("open.npy"), file("closed.npy"), file("a.nrrd"));
    let volume = "procedural:gyroid:12";
    done(&["ao", volume, "--method", "off", "-o", text(&open)]);
    done(&["ao", volume, "--method", "spao", "--structure", "n_buffer", "--levels", "3", "-o", text(&closed)]);
    done(&["ao", volume, "--structure", "hybrid", "--mip-levels", "1", "--normal-factor", "0.5", "-o", text(&nrrd)]);
    let values = |path: &Path| read_npy(&std::fs::read(path).expect("it was written")).expect("a NumPy file").1;
    assert!(values(&open).iter().all(|&a| a == 1.0));
    assert!(values(&closed).iter().any(|&a| a < 1.0));
    assert!(std::fs::read(&nrrd).expect("it was written").starts_with(b"NRRD"));
    assert!(failed(&["ao", volume, "--levels", "9", "-o", text(&nrrd)], 1).contains("ambient_occlusion.levels"));
    assert!(failed(&["ao", volume, "--method", "magic", "-o", text(&nrrd)], 1).contains("ambient_occlusion.method"));
    assert!(failed(&["ao", volume, "-o", text(&file("a.txt"))], 1).contains(".npy"));
}
