//! Picture and array files, without a server around them.

use glam::{DVec3, dvec3};
use spao_server::array_file::{ArrayFormat, write_accessibility};
use spao_server::encode::{ImageFormat, encode_pixels};
use spao_server::renderer::{AccessibilityVolume, StageTimings};
use spao_server::scene::Rgba;
use spao_server::session::{random_hex, rfc3339};
use spao_server::volume::{Grid, Limits, Voxels, format};
use std::path::Path;
use std::time::{Duration, UNIX_EPOCH};

use super::accessibility::read_npy;

/// 5 x 4 pixels that differ, of the given alpha.
fn pixels(alpha: impl Fn(u8) -> u8) -> Vec<u8> {
    (0..20u8).flat_map(|i| [i * 12, 255 - i * 9, i.wrapping_mul(77), alpha(i)]).collect()
}

fn decoded(bytes: &[u8]) -> Vec<u8> {
    image::load_from_memory(bytes).expect("a picture").to_rgba8().into_raw()
}

#[test]
fn lossless_formats_give_back_every_pixel() {
    for alpha in [|_| 255, |i| i * 3] {
        let pixels = pixels(alpha);
        for format in [ImageFormat::Png, ImageFormat::Webp] {
            let bytes = encode_pixels([5, 4], &pixels, format, Rgba([1.0; 4])).expect("it can be encoded");
            assert_eq!(decoded(&bytes), pixels, "{format:?}");
            let mut other = pixels.clone();
            other[7] ^= 1;
            let bytes = encode_pixels([5, 4], &other, format, Rgba([1.0; 4])).expect("it can be encoded");
            assert_ne!(decoded(&bytes), pixels, "{format:?}");
        }
    }
}

#[test]
fn jpeg_shows_the_background_through_what_is_translucent() {
    let side = 16;
    let flat = |rgba: [u8; 4]| rgba.repeat(side * side);
    let jpeg = |rgba: [u8; 4]| {
        let background = Rgba([0.0, 0.0, 1.0, 0.0]);
        let bytes = encode_pixels([side as u32; 2], &flat(rgba), ImageFormat::Jpeg, background).expect("encodable");
        decoded(&bytes)[..3].to_vec()
    };
    let near = |got: Vec<u8>, expected: [u8; 3]| got.iter().zip(expected).all(|(a, b)| a.abs_diff(b) <= 3);
    assert!(near(jpeg([255, 0, 0, 0]), [0, 0, 255]));
    assert!(near(jpeg([255, 0, 0, 255]), [255, 0, 0]));
    assert!(near(jpeg([255, 0, 0, 128]), [128, 0, 127]));
    assert!(!near(jpeg([255, 0, 0, 255]), [245, 0, 0]), "the comparison sees ten steps");
}

#[test]
fn formats_are_known_by_name_and_by_ending() {
    for format in ImageFormat::ALL {
        assert_eq!(ImageFormat::from_name(format.name()), Some(format));
    }
    assert_eq!(ImageFormat::from_path(Path::new("a.b/c.JPG")), Some(ImageFormat::Jpeg));
    assert_eq!(ImageFormat::from_path(Path::new("c.gif")), None);
    assert_eq!(ArrayFormat::from_path(Path::new("c.NPY")), Some(ArrayFormat::Npy));
    assert_eq!(ArrayFormat::from_path(Path::new("npy")), None);
}

#[test]
fn an_accessibility_file_lies_over_its_oblique_volume() {
    let diagonal = dvec3(0.6, 0.8, 0.0);
    let grid = Grid {
        dims: [4, 4, 4],
        spacing: dvec3(0.5, 2.0, 3.0),
        origin: dvec3(10.0, -20.0, 30.0),
        direction: [diagonal, dvec3(-0.8, 0.6, 0.0), DVec3::Z],
    };
    let accessibility = AccessibilityVolume {
        dims: [3, 2, 1],
        values: vec![0.0, 0.125, 0.25, 0.5, 0.75, 1.0],
        first: [1.0, 1.5, 2.0],
        step: [1.0, 2.0, 4.0],
        timings: StageTimings::default(),
    };
    let npy = write_accessibility(&accessibility, &grid, ArrayFormat::Npy);
    assert_eq!(read_npy(&npy), Ok((vec![1, 2, 3], accessibility.values.clone())));
    let nrrd = write_accessibility(&accessibility, &grid, ArrayFormat::Nrrd);
    let read = format::read_bytes(&nrrd, format::Format::Nrrd, None, &Limits::default()).expect("a NRRD file");
    assert_eq!(read.voxels, Voxels::F32(accessibility.values.clone()));
    for sample in [[0u32, 0, 0], [2, 1, 0]] {
        let index = DVec3::from_array(sample.map(f64::from));
        let in_volume = DVec3::from(accessibility.first) + index * DVec3::from(accessibility.step);
        let expected = grid.world_from_index().transform_point3(in_volume);
        let found = read.grid.world_from_index().transform_point3(index + 0.5);
        assert!(found.distance(expected) < 1e-9, "{found} {expected}");
        assert!(found.distance(expected + grid.spacing * 0.5) > 1e-3, "the comparison sees half a voxel");
    }
}

#[test]
fn times_are_written_as_dates() {
    let at = |seconds: u64, millis: u64| rfc3339(UNIX_EPOCH + Duration::from_millis(seconds * 1000 + millis));
    assert_eq!(at(0, 0), "1970-01-01T00:00:00.000Z");
    assert_eq!(at(951_782_399, 999), "2000-02-28T23:59:59.999Z");
    assert_eq!(at(951_782_400, 0), "2000-02-29T00:00:00.000Z");
    assert_eq!(at(951_868_800, 1), "2000-03-01T00:00:00.001Z");
    assert_eq!(at(1_735_689_599, 0), "2024-12-31T23:59:59.000Z");
    assert_eq!(at(4_107_542_400, 0), "2100-03-01T00:00:00.000Z");
}

#[test]
fn ids_do_not_repeat() {
    let ids: std::collections::HashSet<String> = (0..10_000).map(|_| random_hex()).collect();
    assert_eq!(ids.len(), 10_000);
    assert!(ids.iter().all(|id| id.len() == 16 && id.bytes().all(|b| b.is_ascii_hexdigit())));
}
