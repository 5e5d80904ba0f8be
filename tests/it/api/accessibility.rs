//! The accessibility download: its files are what they say, and lie where they should.

use serde_json::{Value, json};
use spao_server::volume::{Limits, format};

use super::{Answer, Server};

/// Shape and values of a `.npy` file of float32 in C order.
pub(crate) fn read_npy(file: &[u8]) -> Result<(Vec<usize>, Vec<f32>), String> {
    let (magic, rest) = file.split_at_checked(10).ok_or("too short")?;
    if &magic[..8] != b"\x93NUMPY\x01\x00" {
        return Err("no magic".into());
    }
    let length = usize::from(u16::from_le_bytes([magic[8], magic[9]]));
    if (10 + length) % 64 != 0 {
        return Err("the data is not aligned".into());
    }
    let (header, data) = rest.split_at_checked(length).ok_or("too short")?;
    let header = std::str::from_utf8(header).map_err(|e| e.to_string())?;
    if !header.ends_with('\n') || !header.contains("'descr': '<f4'") || !header.contains("'fortran_order': False") {
        return Err(format!("header {header:?}"));
    }
    let shape = header.split_once('(').and_then(|(_, rest)| rest.split_once(')')).ok_or("no shape")?.0;
    let shape: Vec<usize> = shape.split(',').filter_map(|n| n.trim().parse().ok()).collect();
    let values: Vec<f32> = data.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect();
    if data.len() != 4 * shape.iter().product::<usize>() {
        return Err(format!("{} bytes for shape {shape:?}", data.len()));
    }
    Ok((shape, values))
}

fn ao_grid(answer: &Answer) -> Value {
    serde_json::from_str(answer.header("x-ao-grid")).expect("JSON")
}

#[test]
fn the_npy_reader_finds_every_fault() {
    let good = {
        let header = format!("{:<117}\n", "{'descr': '<f4', 'fortran_order': False, 'shape': (1, 1, 2), }");
        [&b"\x93NUMPY\x01\x00\x76\x00"[..], header.as_bytes(), &1f32.to_le_bytes(), &2f32.to_le_bytes()].concat()
    };
    assert_eq!(read_npy(&good), Ok((vec![1, 1, 2], vec![1.0, 2.0])));
    assert!(read_npy(&good[..good.len() - 1]).is_err());
    for at in [0, 6, 8, 20] {
        let mut bad = good.clone();
        bad[at] ^= 1;
        assert!(read_npy(&bad).is_err(), "byte {at}");
    }
}

#[tokio::test]
async fn npy_has_one_value_per_sample_in_z_y_x_order() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let answer = server.get(&format!("{scene}/ao")).await;
    assert_eq!(answer.status, 200, "{answer:?}");
    assert_eq!(answer.header("x-scene-revision"), "1");
    assert!(answer.header("content-disposition").ends_with("-ao.npy\""));
    let (shape, values) = read_npy(&answer.bytes).expect("a NumPy file");
    let grid = ao_grid(&answer);
    // 20 x 16 x 12 voxels; the samples are voxel centres, or corners of which there is one more per axis.
    let extra = usize::from(grid["first"] == json!([0.0, 0.0, 0.0]));
    assert_eq!(shape, [12 + extra, 16 + extra, 20 + extra]);
    assert_eq!(grid["step"], json!([1.0, 1.0, 1.0]));
    assert!(values.iter().all(|a| (0.0..=1.0).contains(a)));
    assert!(values.iter().any(|&a| a < 1.0), "a gyroid occludes itself");
}

#[tokio::test]
async fn nrrd_holds_the_same_values_where_the_volume_is() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let npy = server.get(&format!("{scene}/ao?format=npy")).await;
    let nrrd = server.get(&format!("{scene}/ao?format=nrrd")).await;
    assert_eq!(nrrd.status, 200, "{nrrd:?}");
    let volume = format::read_bytes(&nrrd.bytes, format::Format::Nrrd, None, &Limits::default()).expect("a NRRD file");
    let (shape, values) = read_npy(&npy.bytes).expect("a NumPy file");
    assert_eq!(volume.grid.dims.map(|n| n as usize), [shape[2], shape[1], shape[0]]);
    assert_eq!(volume.voxels, spao_server::volume::Voxels::F32(values));
    // The gyroid's first voxel centre is the world's origin.
    let first = ao_grid(&nrrd)["first"].as_array().expect("three numbers")[0].as_f64().expect("a number");
    assert_eq!(volume.grid.origin, glam::DVec3::splat(first - 0.5));
}

#[tokio::test]
async fn switched_off_everything_is_open_and_strength_does_not_matter() {
    let server = Server::new(&[]);
    let scene = server.scene().await;
    let before = server.get(&format!("{scene}/ao")).await;
    server.patch(&scene, &json!({ "ambient_occlusion": { "strength": 0.25 } })).await;
    assert_eq!(server.get(&format!("{scene}/ao")).await.bytes, before.bytes);
    server.patch(&scene, &json!({ "ambient_occlusion": { "method": "off" } })).await;
    let (_, values) = read_npy(&server.get(&format!("{scene}/ao")).await.bytes).expect("a NumPy file");
    assert!(values.iter().all(|&a| a == 1.0));
    assert_eq!(server.get(&format!("{scene}/ao?format=tiff")).await.path(), "format");
}
