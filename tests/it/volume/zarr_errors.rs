//! Zarr hierarchies that lie, or that are not read.

use std::io::Write;

use proptest::prelude::*;
use serde_json::{Value, json};
use spao_server::volume::{Choice, Format, Limits, Volume, VolumeError, format};

use super::assert_names;
use super::makers::zip_of;
use super::zarr::{fixture, read_zarr};

/// Two voxels along each axis, in chunks of as many.
fn sound() -> Value {
    json!({
        "zarr_format": 3, "node_type": "array", "shape": [2, 2, 2], "data_type": "uint8", "fill_value": 0,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": [2, 2, 2] } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "/" } },
        "codecs": [{ "name": "bytes" }],
    })
}

fn group(path: &str, axes: &[&str], transformations: &Value) -> Value {
    let axes: Vec<Value> = axes.iter().map(|axis| json!({ "name": axis, "type": "space" })).collect();
    let datasets = json!([{ "path": path, "coordinateTransformations": transformations }]);
    let images = json!([{ "axes": axes, "datasets": datasets }]);
    json!({ "zarr_format": 3, "node_type": "group", "attributes": { "ome": { "version": "0.5", "multiscales": images } } })
}

const VOXELS: &[u8] = &[1, 2, 3, 4, 5, 6, 7, 8];

fn read_array(array: &Value, chunk: &[u8]) -> Result<Volume, VolumeError> {
    let files: [(&str, &[u8]); 2] = [("zarr.json", &array.to_string().into_bytes()), ("c/0/0/0", chunk)];
    read_zarr(&zip_of(&files), &Choice::default())
}

/// Reads the sound array with another value of a field.
fn read_with(field: &str, value: Value) -> Result<Volume, VolumeError> {
    let mut array = sound();
    array[field] = value;
    read_array(&array, VOXELS)
}

fn read_image(group: &Value) -> Result<Volume, VolumeError> {
    let files: [(&str, &[u8]); 3] = [
        ("zarr.json", &group.to_string().into_bytes()),
        ("0/zarr.json", &sound().to_string().into_bytes()),
        ("0/c/0/0/0", VOXELS),
    ];
    read_zarr(&zip_of(&files), &Choice::default())
}

#[test]
fn the_sound_array_and_the_sound_image_are_read() {
    assert_eq!(read_array(&sound(), VOXELS).expect("sound").voxels.little_endian_bytes(), VOXELS);
    let steps = json!([{ "type": "scale", "scale": [2.0, 1.0, 0.5] }, { "type": "translation", "translation": [3.0, 2.0, 1.0] }]);
    let volume = read_image(&group("0", &["z", "y", "x"], &steps)).expect("sound");
    assert_eq!(volume.grid.spacing.to_array(), [0.5, 1.0, 2.0]);
    assert_eq!(volume.grid.origin.to_array(), [1.0, 2.0, 3.0]);
    // Axes have their places by name.
    let turned = read_image(&group("0", &["x", "y", "z"], &steps)).expect("sound");
    assert_eq!(turned.grid.spacing.to_array(), [2.0, 1.0, 0.5]);
    assert_eq!(turned.voxels.little_endian_bytes().as_ref(), [1, 5, 3, 7, 2, 6, 4, 8]);
}

#[test]
fn types_that_are_not_one_number_are_refused_by_name() {
    for data_type in [json!("complex64"), json!("string"), json!("r24"), json!({ "name": "fixed_length_utf32" })] {
        let name = data_type.as_str().unwrap_or("fixed_length_utf32").to_owned();
        assert_names(read_with("data_type", data_type), "data_type", &name);
    }
    for dtype in
        [json!("|S4"), json!("<U8"), json!("|O"), json!("<c8"), json!("<M8[ns]"), json!([["r", "|u1"], ["g", "|u1"]])]
    {
        let array =
            json!({ "zarr_format": 2, "shape": [1, 1, 1], "chunks": [1, 1, 1], "dtype": dtype, "compressor": null });
        let bytes = zip_of(&[(".zarray", array.to_string().as_bytes()), ("0.0.0", b"1")]);
        assert_names(
            read_zarr(&bytes, &Choice::default()),
            "dtype",
            "is not read; expected bool, integers of 8 to 64 bits",
        );
    }
}

#[test]
fn codecs_that_are_not_read_are_named() {
    let bytes = json!({ "name": "bytes" });
    let codecs = |codec: Value| read_with("codecs", json!([bytes, codec]));
    for name in ["numcodecs.bz2", "bitround", "vlen-utf8"] {
        assert_names(codecs(json!({ "name": name })), "codecs", name);
    }
    assert_names(read_with("codecs", json!([])), "codecs", "neither bytes nor sharding_indexed");
    assert_names(read_with("codecs", json!([bytes, bytes])), "codecs", "`bytes` is not where it may be");
    assert_names(read_with("codecs", json!([{ "name": "gzip" }, bytes])), "codecs", "before `bytes`, is not read");
    assert_names(read_with("codecs", json!(vec![bytes.clone(); 17])), "codecs", "at most 16");
    let order = |order: Value| json!([{ "name": "transpose", "configuration": { "order": order } }, bytes]);
    for bad in [json!([0, 0, 1]), json!([0, 1]), json!([0, 1, 3]), json!("K")] {
        assert_names(read_with("codecs", order(bad)), "order", "");
    }
    for (field, codec) in [("filters", json!([{ "id": "delta" }])), ("compressor", json!({ "id": "lzma" }))] {
        let mut array = json!({ "zarr_format": 2, "shape": [1, 1, 1], "chunks": [1, 1, 1], "dtype": "|u1" });
        array[field] = codec;
        let bytes = zip_of(&[(".zarray", array.to_string().as_bytes()), ("0.0.0", b"1")]);
        assert_names(read_zarr(&bytes, &Choice::default()), field, "is not read; expected gzip, zlib, zstd, blosc");
    }
}

#[test]
fn sizes_are_checked_before_anything_is_read() {
    let shape = |shape: Value, chunk: Value| {
        let mut array = sound();
        array["shape"] = shape;
        array["chunk_grid"]["configuration"]["chunk_shape"] = chunk;
        read_array(&array, VOXELS)
    };
    assert_names(shape(json!([1_u64 << 40, 2, 2]), json!([2, 2, 2])), "shape", "the limit is");
    assert_names(shape(json!([u64::MAX, u64::MAX, u64::MAX]), json!([1, 1, 1])), "shape", "the limit is");
    assert_names(shape(json!([0, 2, 2]), json!([2, 2, 2])), "shape", "empty axis");
    assert_names(shape(json!([2, 2, 2]), json!([0, 2, 2])), "chunk_shape", "above 0");
    assert_names(shape(json!([2, 2, 2]), json!([2, 2])), "chunk_shape", "one for each axis");
    assert_names(shape(json!([2, 2]), json!([2, 2])), "shape", "has 2 axes; expected three");
    assert_names(shape(json!([2, 2, 2, 2]), json!([2, 2, 2, 2])), "shape", "has 4 axes; expected three");
    assert_names(shape(json!(vec![1; 9]), json!(vec![1; 9])), "shape", "at most 8");
    // More chunks than anyone looks for, chunks larger than memory, and a product that no number holds.
    assert_names(shape(json!([2048, 1024, 1024]), json!([1, 1, 1])), "chunks", "the limit is 1048576");
    assert_names(shape(json!([2, 2, 2]), json!([1 << 20, 1 << 20, 2])), "chunks", "bytes in a chunk needed");
    assert_names(shape(json!([2, 2, 2]), json!([u64::MAX, u64::MAX, u64::MAX])), "chunks", "bytes in a chunk needed");
}

#[test]
fn chunks_are_missing_truncated_or_damaged() {
    let bytes = zip_of(&[("zarr.json", &sound().to_string().into_bytes())]);
    assert_names(read_zarr(&bytes, &Choice::default()), "chunks", "none of its chunks is there, such as `c/0/0/0`");
    assert_names(read_array(&sound(), &VOXELS[..7]), "chunk", "7 bytes of numbers; expected 8");
    assert_names(read_array(&sound(), &[VOXELS, VOXELS].concat()), "chunk", "16 bytes of numbers; expected 8");
    let mut array = sound();
    array["shape"] = json!([2, 2, 3]);
    array["fill_value"] = json!(9);
    let volume = read_array(&array, VOXELS).expect("what is missing has the fill value");
    assert_eq!(volume.voxels.little_endian_bytes().as_ref(), [1, 2, 9, 3, 4, 9, 5, 6, 9, 7, 8, 9]);
    for fill in [json!(-1), json!(256), json!(0.5), json!("NaN"), json!([1])] {
        assert_names(read_with("fill_value", fill), "fill_value", "is not a value of type u8");
    }
    let zeros = vec![0; 1 << 24];
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    gzip.write_all(&zeros).expect("to memory");
    let bomb = gzip.finish().expect("to memory");
    array = sound();
    for name in ["gzip", "zstd", "blosc", "numcodecs.zlib", "numcodecs.lz4", "crc32c"] {
        array["codecs"] = json!([{ "name": "bytes" }, { "name": name }]);
        assert_names(read_array(&array, VOXELS), "chunk", "`c/0/0/0`: ");
        assert_names(read_array(&array, &[]), "chunk", "`c/0/0/0`: ");
    }
    array["codecs"] = json!([{ "name": "bytes" }, { "name": "gzip" }]);
    assert_names(read_array(&array, &bomb[..4000]), "chunk", "unpacks to more than it should");
    assert!(matches!(read_array(&array, &bomb), Err(VolumeError::TooLarge { .. })));
    // Blosc: more than the chunk has; snappy.
    array["codecs"] = json!([{ "name": "bytes" }, { "name": "blosc" }]);
    let blosc = |flags: u8, size: u32| {
        [&[2, 1, flags, 1], &size.to_le_bytes()[..], &8_u32.to_le_bytes(), &24_u32.to_le_bytes(), VOXELS].concat()
    };
    assert_eq!(read_array(&array, &blosc(2, 8)).expect("not packed").voxels.little_endian_bytes(), VOXELS);
    assert_names(read_array(&array, &blosc(2, u32::MAX)), "chunk", "unpacks to more than it should");
    // No bytes in blocks of 2 GiB, which nothing is taken for.
    let none = [&blosc(0, 0)[..8], &(1_u32 << 31).to_le_bytes(), &blosc(0, 0)[12..]].concat();
    assert_names(read_array(&array, &none), "chunk", "0 bytes of numbers; expected 8");
    assert_names(read_array(&array, &blosc(2 << 5, 8)), "chunk", "snappy is not read");
}

#[test]
fn shards_whose_index_lies_are_refused() {
    let mut array = sound();
    array["shape"] = json!([2, 2, 4]);
    array["chunk_grid"]["configuration"]["chunk_shape"] = json!([2, 2, 4]);
    let bytes = json!({ "name": "bytes", "configuration": { "endian": "little" } });
    let shards = json!({ "chunk_shape": [2, 2, 2], "codecs": [bytes], "index_codecs": [bytes] });
    array["codecs"] = json!([{ "name": "sharding_indexed", "configuration": shards }]);
    let shard = |index: [u64; 4]| [VOXELS, VOXELS, &index.map(u64::to_le_bytes).concat()].concat();
    let read = |index| read_array(&array, &shard(index));
    assert_eq!(read([0, 8, 8, 8]).expect("sound").voxels.len(), 16);
    assert_eq!(read([0, 8, u64::MAX, u64::MAX]).expect("the fill value").voxels.value(2), 0.0);
    assert_names(read([0, 8, 4, 8]), "chunk", "chunks of the shard overlap");
    assert_names(read([0, 8, 8, 7]), "chunk", "7 bytes of numbers; expected 8");
    for (offset, length) in [(1 << 60, 8), (u64::MAX, 8), (8, u64::MAX), (8, 1 << 40), (44, 8)] {
        assert_names(read([0, 8, offset, length]), "chunk", "longer than it may be");
    }
    assert_names(read_array(&array, &[0; 31]), "chunk", "shorter than the index of a shard");
    let long = [vec![0; 100_000], shard([0, 8, 8, 8])].concat();
    assert_names(read_array(&array, &long), "chunk", "longer than its chunks may be");
    let mut summed = array.clone();
    summed["codecs"][0]["configuration"]["index_codecs"] = json!([bytes, { "name": "crc32c" }]);
    let bad_sum = [&shard([0, 8, 8, 8])[..], &[1, 2, 3, 4]].concat();
    assert_names(read_array(&summed, &bad_sum), "chunk", "the checksum of the shard's index does not match");
    let mut nested = array.clone();
    nested["codecs"][0]["configuration"]["codecs"] = array["codecs"].clone();
    assert_names(read_array(&nested, VOXELS), "codecs", "shards within shards are not read");
    let mut uneven = array.clone();
    uneven["codecs"][0]["configuration"]["chunk_shape"] = json!([2, 2, 3]);
    assert_names(read_array(&uneven, VOXELS), "chunk_shape", "do not fill shards");
}

#[test]
fn names_that_lead_out_are_refused() {
    for path in ["../0", "/etc", "0/../../x", "", ".", "a//b", "..\\0", "c:0", "a\0b"] {
        let image = group(path, &["z", "y", "x"], &json!([]));
        assert_names(read_image(&image), "datasets.path", "is not a relative path without `..`");
    }
    let bytes = zip_of(&[("zarr.json", &sound().to_string().into_bytes()), ("../c/0/0/0", VOXELS)]);
    assert_names(read_zarr(&bytes, &Choice::default()), "archive", "leads out of the archive");
}

#[cfg(unix)]
#[test]
fn links_out_of_the_folder_are_refused() {
    let directory = tempfile::tempdir().expect("a directory");
    let folder = directory.path().join("a.zarr");
    std::fs::create_dir_all(folder.join("c/0/0")).expect("written");
    std::fs::write(folder.join("zarr.json"), sound().to_string()).expect("written");
    std::fs::write(directory.path().join("secret"), VOXELS).expect("written");
    let load = || format::load_path("a.zarr", directory.path(), None, &Limits::default());
    std::os::unix::fs::symlink(directory.path().join("secret"), folder.join("c/0/0/0")).expect("linked");
    assert_names(load(), "chunk", "leads out of the data directory");
    std::fs::remove_file(folder.join("c/0/0/0")).expect("removed");
    std::fs::write(folder.join("c/0/0/0"), VOXELS).expect("written");
    assert!(load().is_ok());
}

#[test]
fn images_that_are_not_volumes_are_refused() {
    let none = json!([]);
    assert_names(read_image(&group("0", &["c", "y", "x"], &none)), "axes", "no axis z among");
    assert_names(read_image(&group("0", &["z", "y", "x", "x"], &none)), "axes", "more than one axis x");
    assert_names(read_image(&group("0", &["z", "y", "x", "v"], &none)), "axes", "4 axes are named, but the array has");
    assert_names(read_image(&group("1", &["z", "y", "x"], &none)), "datasets.path", "no array at `1`");
    for (field, bad) in [
        ("coordinateTransformations", json!([{ "type": "affine" }])),
        ("coordinateTransformations", json!([{ "type": "scale", "path": "scales" }])),
        ("coordinateTransformations", json!([{ "type": "scale", "scale": [0, 1, 1] }])),
        ("coordinateTransformations", json!([{ "type": "scale", "scale": [-1, 1, 1] }])),
        ("coordinateTransformations.scale", json!([{ "type": "scale", "scale": [1, 1] }])),
        ("coordinateTransformations.scale", json!([{ "type": "scale", "scale": ["1", 1, 1] }])),
        ("translation", json!([{ "type": "translation", "translation": [1] }])),
        ("coordinateTransformations", json!([{ "type": "translation", "translation": [1e300, 1, 1] }])),
    ] {
        assert_names(read_image(&group("0", &["z", "y", "x"], &bad)), field, "");
    }
    for (attributes, says) in [
        (json!({}), "neither an OME-Zarr image nor an array is at the root"),
        (json!({ "ome": { "plate": {} } }), "this is a plate or a well"),
        (json!({ "ome": { "multiscales": [] } }), "expected a list of at least one image"),
    ] {
        let group = json!({ "zarr_format": 3, "node_type": "group", "attributes": attributes });
        assert_names(read_image(&group), "multiscales", says);
    }
    let two = zip_of(&[("a/zarr.json", b"{}"), ("b/.zgroup", b"{}")]);
    assert_names(read_zarr(&two, &Choice::default()), "archive", "several Zarr hierarchies, such as `a` and `b`");
    assert_names(read_zarr(&zip_of(&[("a", b"")]), &Choice::default()), "archive", "no Zarr hierarchy in it");
    assert_names(read_zarr(b"whatever", &Choice::default()), "archive", "not a zip or tar archive");
    assert_names(read_zarr(&zip_of(&[("zarr.json", b"{")]), &Choice::default()), "zarr.json", "is not JSON");
    assert_names(read_zarr(&zip_of(&[("zarr.json", b"7")]), &Choice::default()), "zarr.json", "is not a JSON object");
}

#[test]
fn the_first_image_of_a_converted_file_is_shown() {
    let root =
        json!({ "zarr_format": 3, "node_type": "group", "attributes": { "ome": { "bioformats2raw.layout": 3 } } });
    let files: [(&str, &[u8]); 4] = [
        ("zarr.json", &root.to_string().into_bytes()),
        ("0/zarr.json", &group("0", &["z", "y", "x"], &json!([])).to_string().into_bytes()),
        ("0/0/zarr.json", &sound().to_string().into_bytes()),
        ("0/0/c/0/0/0", VOXELS),
    ];
    let volume = read_zarr(&zip_of(&files), &Choice::default()).expect("sound");
    assert!(volume.about.notes.join(" ").contains("Of the images in the folder the first, `0`, is shown."));
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(3000) })]
    #[test]
    fn archives_with_faults_are_read_or_refused(at in 0..1_000_000_usize, bits in 1..=255_u8, file in 0..7_usize) {
        let names = ["ome_05.zip", "ome_04.zip", "v3_shards.zip", "v2_fortran.tar", "large_lz4_1_int16.zip",
            "large_blosclz_1_int16.zip", "large_zstd_2_uint16.zip"];
        let mut bytes = fixture(names[file]);
        let at = at % bytes.len();
        bytes[at] ^= bits;
        let limits = Limits { max_axis: 64, max_voxels: 1 << 14, max_bytes: 1 << 16 };
        match format::read_bytes(&bytes, Format::Zarr, None, &limits) {
            Ok(volume) => prop_assert!(volume.voxels.len() as u64 == volume.grid.voxel_count()),
            Err(error) => prop_assert!(!matches!(error, VolumeError::Io { .. }) && error.to_string().len() < 600, "{}", error),
        }
    }
}
