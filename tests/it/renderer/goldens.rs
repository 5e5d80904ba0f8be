//! Pictures that people have looked at, kept in `tests/golden/`. The README there says how to make them again.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value, json};
use spao_server::volume::{ProceduralKind, Volume};

use super::support::{Difference, Picture, Studio, ct_head, oblique, procedural};

/// Set to 1, the goldens are written anew; the tests fail nevertheless, so that no run of theirs goes unseen.
const WRITE: &str = "SPAO_WRITE_GOLDENS";

/// Adapters round differently: hardly a pixel is more than a few steps off.
fn is_right(difference: &Difference) -> bool {
    difference.is_within(0.5, 4.0, 48.0)
}

fn path(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden").join(format!("{name}.png"))
}

/// Why a picture is not the golden one.
fn fault(picture: &Picture, golden: &Path) -> Option<String> {
    let expected = match image::open(golden) {
        Ok(expected) => expected.into_rgba8(),
        Err(error) => return Some(format!("{}: {error}", golden.display())),
    };
    let pixels = expected.pixels().map(|pixel| pixel.0).collect();
    let expected = Picture { size: [expected.width(), expected.height()], pixels };
    if expected.size != picture.size {
        return Some(format!("{} is {:?}, the picture {:?}", golden.display(), expected.size, picture.size));
    }
    let difference = Difference::between_pictures(picture, &expected);
    (!is_right(&difference)).then(|| format!("{}: {difference:?}", golden.display()))
}

fn write(picture: &Picture, golden: &Path) {
    let [width, height] = picture.size;
    let pixels = picture.pixels.concat();
    image::save_buffer(golden, &pixels, width, height, image::ColorType::Rgba8).expect("tests/golden can be written");
}

/// Compares pictures of one volume with their goldens, or writes those: what is wrong.
fn faults(volume: impl Into<Arc<Volume>>, pictures: &[(&str, [u32; 2], Value)]) -> Vec<String> {
    let mut studio = Studio::new(volume);
    let writing = std::env::var(WRITE).is_ok_and(|value| value == "1");
    let mut faults = Vec::new();
    for (name, size, document) in pictures {
        let mut document = document.clone();
        json_patch::merge(&mut document, &json!({"viewport": {"width": size[0], "height": size[1]}}));
        let scene = studio.scene(&document);
        let picture = studio.picture(&scene, *size);
        if writing {
            write(&picture, &path(name));
            faults.push(format!("{name} was written; look at it, and run again without {WRITE}"));
        } else {
            faults.extend(fault(&picture, &path(name)));
        }
    }
    faults
}

#[track_caller]
fn assert_none(faults: &[String]) {
    assert!(faults.is_empty(), "\n{}", faults.join("\n"));
}

/// One box along x (red), two along y (green), three along z (blue). Narrow bands, since the border of a box passes
/// through all lower values.
fn axes() -> Value {
    let bands = [(60, "#ffffff"), (110, "#ff3322"), (160, "#33cc44"), (255, "#4466ff")];
    let band = |&(value, color): &(i32, &str)| {
        [(-10, 0.0), (0, 0.6), (10, 0.0)]
            .map(|(d, opacity)| json!({"value": value + d, "color": color, "opacity": opacity}))
    };
    json!({"points": bands.iter().flat_map(band).collect::<Vec<_>>()})
}

#[test]
fn a_head_looks_as_it_did() {
    let size = [160, 120];
    let pictures = [
        ("ct_head_default", size, json!({})),
        ("ct_head_ao_off", size, json!({"ambient_occlusion": {"method": "off"}})),
        ("ct_head_bone", size, json!({"transfer_function": {"preset": "ct_bone"}})),
        (
            "ct_head_clipped",
            size,
            json!({"rendering": {"clip_planes": [[-0.8, 0.6, 0.0, 20.0]], "background": "#00000000"}}),
        ),
    ];
    assert_none(&faults(ct_head(), &pictures));
}

#[test]
fn boxes_along_the_axes_look_as_they_did() {
    let size = [96, 72];
    let volume = procedural(ProceduralKind::Boxes, [57, 49, 41]);
    let middle = volume.grid.center();
    let along = |x: f64, y: f64, z: f64, up: [f64; 3]| {
        let eye = [middle.x + 100.0 * x, middle.y + 100.0 * y, middle.z + 100.0 * z];
        json!({
            "transfer_function": axes(),
            "camera": {"projection": "orthographic", "eye": eye, "target": middle.to_array(), "up": up, "height": 60}
        })
    };
    let pictures = [
        ("boxes_along_x", size, along(1.0, 0.0, 0.0, [0.0, 0.0, 1.0])),
        ("boxes_along_y", size, along(0.0, -1.0, 0.0, [0.0, 0.0, 1.0])),
        ("boxes_along_z", size, along(0.0, 0.0, 1.0, [0.0, 1.0, 0.0])),
        ("boxes_perspective", size, json!({"transfer_function": axes()})),
    ];
    assert_none(&faults(volume, &pictures));
}

#[test]
fn an_oblique_surface_and_a_cloud_look_as_they_did() {
    let size = [96, 72];
    let surface = [
        ("gyroid_oblique", size, json!({"lighting": {"direction": [0.36, -0.48, 0.8], "color": "#ffddaa"}})),
        ("gyroid_raytraced", size, json!({"ambient_occlusion": {"method": "raytraced", "levels": 4, "rays": 32}})),
    ];
    let mut all = faults(oblique(procedural(ProceduralKind::Gyroid, [40, 32, 24])), &surface);
    all.extend(faults(procedural(ProceduralKind::Cloud, [48, 40, 36]), &[("cloud", size, json!({}))]));
    assert_none(&all);
}

#[test]
fn a_golden_that_is_missing_of_another_size_or_of_something_else_fails() {
    let folder = tempfile::tempdir().expect("a folder for the test");
    let golden = folder.path().join("golden.png");
    let mut studio = Studio::new(procedural(ProceduralKind::Boxes, [57, 49, 41]));
    let scene = studio.scene(&json!({"transfer_function": axes()}));
    let picture = studio.picture(&scene, [48, 36]);

    let missing = fault(&picture, &golden).expect("a missing golden is a fault");
    assert!(missing.contains("golden.png"), "{missing}");
    write(&picture, &golden);
    assert_eq!(fault(&picture, &golden), None);

    let smaller = studio.picture(&scene, [36, 36]);
    assert!(fault(&smaller, &golden).is_some_and(|fault| fault.contains("[48, 36]")));
    let mut mirrored = picture.clone();
    mirrored.pixels.chunks_exact_mut(48).for_each(<[[u8; 4]]>::reverse);
    assert!(fault(&mirrored, &golden).is_some());
    let mut darker = scene.clone();
    darker.lighting.diffuse -= 0.1;
    assert!(fault(&studio.picture(&darker, [48, 36]), &golden).is_some());
    let mut moved = scene;
    moved.camera.eye.x += 1.0;
    assert!(fault(&studio.picture(&moved, [48, 36]), &golden).is_some());
}
