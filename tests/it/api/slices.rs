//! Slices and thumbnails: pictures compared with plain loops over the voxels, and the letters at their edges.

use image::{DynamicImage, GenericImageView};
use spao_server::volume::{Format, Limits, Volume, format};

use super::{Answer, Server};

/// A NRRD file of 5 x 4 x 3 floats in the given space, spaced 1, 2 and 3 along its axes. One voxel is NaN.
fn file(space: &str) -> Vec<u8> {
    let header = format!(
        "NRRD0005\ntype: float\ndimension: 3\n{space}\nsizes: 5 4 3\nspace directions: (1,0,0) (0,2,0) (0,0,3)\n\
         endian: little\nencoding: raw\n\n"
    );
    let value = |i: u32| if i == 37 { f32::NAN } else { (i * 37 % 60) as f32 - 20.0 };
    [header.into_bytes(), (0..60).flat_map(|i| value(i).to_le_bytes()).collect()].concat()
}

const PATIENT: &str = "space: left-posterior-superior";

async fn upload(server: &Server, space: &str) -> String {
    let answer = server.upload("", file(space)).await;
    assert_eq!(answer.status, 201, "{answer:?}");
    answer.header("location").to_owned()
}

fn gray(answer: &Answer) -> (u32, u32, Vec<u8>) {
    assert_eq!(answer.status, 200, "{answer:?}");
    assert_eq!(answer.header("content-type"), "image/png");
    let picture = image::load_from_memory(&answer.bytes).expect("a picture");
    assert!(matches!(picture, DynamicImage::ImageLuma8(_)), "{:?}", picture.color());
    let (width, height) = picture.dimensions();
    (width, height, picture.into_luma8().into_raw())
}

/// The value at (across, down) of a slice, by the sentence of the documents; beyond the edges the outermost go on.
fn voxel(volume: &Volume, axis: char, index: u32, [u, v]: [i64; 2]) -> f64 {
    let at = |a: usize, i: i64| i.clamp(0, i64::from(volume.grid.dims[a]) - 1) as u32;
    let up = |i: i64| i64::from(volume.grid.dims[2]) - 1 - i;
    volume.value_at(match axis {
        'z' => [at(0, u), at(1, v), index],
        'y' => [at(0, u), index, at(2, up(v))],
        _ => [index, at(1, u), at(2, up(v))],
    })
}

/// Pixels by two loops over far more samples than have a weight.
fn expected(volume: &Volume, axis: char, index: u32, size: [u32; 2], window: [f64; 2]) -> Vec<f64> {
    let axes = match axis {
        'z' => [0, 1],
        'y' => [0, 2],
        _ => [1, 2],
    };
    let samples = axes.map(|a| f64::from(volume.grid.dims[a]));
    let mut pixels = Vec::new();
    for y in 0..size[1] {
        for x in 0..size[0] {
            let (mut sum, mut weights) = (0.0, 0.0);
            for v in -12..24 {
                for u in -12..24 {
                    let weight = |at: i64, pixel: u32, a: usize| {
                        let scale = samples[a] / f64::from(size[a]);
                        let center = (f64::from(pixel) + 0.5) * scale - 0.5;
                        (1.0 - (at as f64 - center).abs() / scale.max(1.0)).max(0.0)
                    };
                    let weight = weight(u, x, 0) * weight(v, y, 1);
                    sum += weight * voxel(volume, axis, index, [u, v]);
                    weights += weight;
                }
            }
            let share = (sum / weights - window[0]) / (window[1] - window[0]);
            pixels.push((share * 255.0).clamp(0.0, 255.0));
        }
    }
    pixels
}

fn assert_near(pixels: &[u8], expected: &[f64]) {
    assert_eq!(pixels.len(), expected.len());
    let worst = pixels.iter().zip(expected).map(|(a, b)| (f64::from(*a) - b).abs()).fold(0.0, f64::max);
    assert!(worst <= 0.5 + 1e-6, "differs by {worst}: {pixels:?} {expected:?}");
}

fn is_near(pixels: &[u8], expected: &[f64]) -> bool {
    pixels.len() == expected.len() && pixels.iter().zip(expected).all(|(a, b)| (f64::from(*a) - b).abs() <= 0.5 + 1e-6)
}

#[tokio::test]
async fn a_slice_is_what_plain_loops_make_of_the_voxels() {
    let server = Server::new(&[]);
    let path = upload(&server, PATIENT).await;
    let volume = format::read_bytes(&file(PATIENT), Format::Nrrd, None, &Limits::default()).expect("a NRRD file");
    assert_eq!(volume.code_map.value_range(), [-20.0, 39.0]);
    for (query, axis, index, size, window) in [
        ("", 'z', 1, [5, 8], [-20.0, 39.0]),
        ("axis=z&index=0", 'z', 0, [5, 8], [-20.0, 39.0]),
        ("axis=y&index=3&low=0&high=10", 'y', 3, [5, 9], [0.0, 10.0]),
        ("axis=x&low=-5.5", 'x', 2, [4, 5], [-5.5, 39.0]),
        ("axis=z&index=1&width=17", 'z', 1, [17, 27], [-20.0, 39.0]),
        ("axis=y&index=1&width=2&high=12", 'y', 1, [2, 4], [-20.0, 12.0]),
        ("axis=x&index=4&width=1", 'x', 4, [1, 1], [-20.0, 39.0]),
    ] {
        let answer = server.get(&format!("{path}/slice?{query}")).await;
        let (width, height, pixels) = gray(&answer);
        assert_eq!([width, height], size, "{query}");
        assert_near(&pixels, &expected(&volume, axis, index, size, window));
        assert_eq!(answer.header("x-slice-index"), index.to_string());
        assert_eq!(answer.header("x-window"), format!("low={},high={}", window[0], window[1]));
    }
    let (_, _, pixels) = gray(&server.get(&format!("{path}/slice?index=1")).await);
    for other in [
        expected(&volume, 'z', 0, [5, 8], [-20.0, 39.0]),
        expected(&volume, 'z', 1, [5, 8], [-19.0, 39.0]),
        expected(&volume, 'z', 1, [8, 5], [-20.0, 39.0]),
    ] {
        assert!(!is_near(&pixels, &other), "the comparison sees another slice, window or size");
    }
}

#[tokio::test]
async fn pixels_are_square_and_their_size_is_told() {
    let server = Server::new(&["--max-image", "64"]);
    let path = upload(&server, PATIENT).await;
    for (query, size) in [("axis=z", "1,1"), ("axis=y", "1,1"), ("axis=x", "2,1.8"), ("axis=z&width=10", "0.5,0.5")] {
        assert_eq!(server.get(&format!("{path}/slice?{query}")).await.header("x-pixel-size"), size, "{query}");
    }
    let long = server.upload("format=raw&dims=2,90,3&type=u8", vec![7; 540]).await;
    let long = format!("{}/slice", long.header("location"));
    let (width, height, pixels) = gray(&server.get(&long).await);
    assert_eq!((width, height), (1, 64), "the longer side ends at the limit");
    assert!(pixels.iter().all(|&pixel| pixel == 0), "a constant slice is black");
    assert_eq!(server.get(&format!("{long}?width=2")).await.verdict(), (422, "invalid".into(), "width".into()));
}

#[tokio::test]
async fn edges_have_letters_where_the_axes_are_a_patients() {
    let server = Server::new(&[]);
    let lps = upload(&server, PATIENT).await;
    let ras = upload(&server, "space: right-anterior-superior").await;
    let none = upload(&server, "space dimension: 3").await;
    for (path, axis, expected) in [
        (&lps, "z", "left=R,right=L,top=A,bottom=P"),
        (&lps, "y", "left=R,right=L,top=H,bottom=F"),
        (&lps, "x", "left=A,right=P,top=H,bottom=F"),
        (&ras, "z", "left=L,right=R,top=P,bottom=A"),
        (&ras, "y", "left=L,right=R,top=H,bottom=F"),
        (&ras, "x", "left=P,right=A,top=H,bottom=F"),
        (&none, "z", ""),
    ] {
        let answer = server.get(&format!("{path}/slice?axis={axis}")).await;
        assert_eq!(answer.header("x-orientation"), expected, "{path} {axis}");
    }
}

#[tokio::test]
async fn a_slice_that_cannot_be_is_refused_by_name() {
    let server = Server::new(&[]);
    let path = upload(&server, PATIENT).await;
    for (query, field) in [
        ("axis=w", "axis"),
        ("index=3", "index"),
        ("index=-1", "index"),
        ("axis=x&index=5", "index"),
        ("low=nan", "low"),
        ("high=inf", "high"),
        ("low=5&high=5", "high"),
        ("low=39", "low"),
        ("width=0", "width"),
        ("width=4097", "width"),
        ("height=3", "height"),
    ] {
        let answer = server.get(&format!("{path}/slice?{query}")).await;
        assert_eq!(answer.verdict(), (422, "invalid".into(), field.into()), "{query}");
    }
    for view in ["slice", "thumbnail", "probe?x=0&y=0&z=0", "data", "metadata"] {
        assert_eq!(server.get(&format!("/v1/volumes/none/{view}")).await.code(), "volume_not_found", "{view}");
    }
}

#[tokio::test]
async fn a_thumbnail_shows_the_highest_values_along_y() {
    let server = Server::new(&[]);
    let path = upload(&server, PATIENT).await;
    let volume = format::read_bytes(&file(PATIENT), Format::Nrrd, None, &Limits::default()).expect("a NRRD file");
    let highest = |x: u32, z: u32| (0..4).map(|y| volume.value_at([x, y, z])).fold(f64::MIN, f64::max);
    let all: Vec<f64> = (0..15).map(|i| highest(i % 5, i / 5)).collect();
    let (low, high) = (all.iter().copied().fold(f64::MAX, f64::min), all.iter().copied().fold(f64::MIN, f64::max));
    let (width, height, pixels) = gray(&server.get(&format!("{path}/thumbnail")).await);
    assert_eq!((width, height), (5, 9), "nothing is enlarged beyond square pixels");
    // The middle one of three rows of pixels is in the middle of a voxel.
    let row = |z: u32| (0..5).map(|x| (highest(x, z) - low) / (high - low) * 255.0).collect::<Vec<_>>();
    for (z, y) in [(2, 1), (1, 4), (0, 7)] {
        assert_near(&pixels[y * 5..][..5], &row(z));
        assert!(!is_near(&pixels[y * 5..][..5], &row((z + 1) % 3)), "the comparison sees another row");
    }
    let head = std::fs::read(crate::volume::FIXTURE).expect("the fixture is there");
    let path = server.upload("", head).await.header("location").to_owned();
    for (query, size) in [("", (128, 105)), ("?size=512", (128, 105)), ("?size=64", (64, 53)), ("?size=16", (16, 13))] {
        let (width, height, pixels) = gray(&server.get(&format!("{path}/thumbnail{query}")).await);
        assert_eq!((width, height), size, "{query}");
        let (dark, bright) = (pixels.iter().min().expect("pixels"), pixels.iter().max().expect("pixels"));
        assert!(*dark < 60 && *bright > 150, "air and bone: {dark} {bright}");
    }
    for query in ["?size=15", "?size=513"] {
        assert_eq!(server.get(&format!("{path}/thumbnail{query}")).await.path(), "size");
    }
}
