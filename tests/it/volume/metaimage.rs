//! MetaImage headers that are refused, or read as ITK reads them; [`super::independent`] has the files that are read.

use std::fs;

use spao_server::volume::{Format, Limits, Volume, VolumeError, format};

use super::assert_names;

const HEADER: &str = "ObjectType = Image\nNDims = 3\nBinaryData = True\nDimSize = 5 4 3\nElementType = MET_UCHAR\n";

/// Reads the header with these lines instead of those of the same names, and the bytes 0 to 59.
fn read(lines: &str) -> Result<Volume, VolumeError> {
    read_bytes(lines, &(0..60).collect::<Vec<_>>())
}

fn read_bytes(lines: &str, data: &[u8]) -> Result<Volume, VolumeError> {
    let name = |line: &str| line.split('=').next().unwrap_or_default().trim().to_owned();
    let replaced: Vec<_> = lines.lines().map(name).collect();
    let kept: Vec<_> = HEADER.lines().filter(|line| !replaced.contains(&name(line))).collect();
    let local = if lines.contains("ElementDataFile") { "" } else { "ElementDataFile = LOCAL\n" };
    let header = format!("{}\n{lines}{local}", kept.join("\n"));
    let file = [header.as_bytes(), data].concat();
    format::read_bytes(&file, Format::MetaImage, None, &Limits::default())
}

#[test]
fn the_header_that_these_tests_spoil_is_valid() {
    let volume = read("").expect("valid");
    assert_eq!((volume.voxels.value(59), volume.grid.spacing.to_array()), (59.0, [1.0; 3]));
    assert!(volume.about.patient_axes && volume.about.notes.is_empty());
    assert_eq!(read("ElementSize = 2 3 4\n").expect("valid").grid.spacing.to_array(), [2.0, 3.0, 4.0]);
    let micrometres = read("DistanceUnits = um\nElementSpacing = 500 500 2000\nOrigin = 1000 0 0\n").expect("valid");
    assert_eq!(micrometres.grid.spacing.to_array(), [0.5, 0.5, 2.0]);
    assert_eq!(micrometres.grid.origin.x, 1.0);
    assert!(read("NDims = 4\nDimSize = 5 4 3 1\nElementSpacing = 1 1 1 1\n").is_ok());
}

#[test]
fn a_wrong_or_missing_value_names_its_field() {
    let cases = [
        ("ObjectType = Mesh\n", "ObjectType", "`Mesh` is not Image"),
        ("NDims = 2\n", "NDims", "2 axes"),
        ("NDims = x\n", "NDims", "`x`"),
        ("NDims = 99999999999999999999\n", "NDims", "numbers"),
        ("NDims = 4\nDimSize = 5 4 3 7\n", "DimSize", "7 volumes in one file"),
        ("DimSize = 5 4\n", "DimSize", "3 numbers"),
        ("DimSize = 5 4 0\n", "DimSize", "empty axis"),
        ("DimSize = 5 4 -3\n", "DimSize", "3 numbers"),
        ("DimSize = 4294967295 4294967295 4294967295\n", "DimSize", "limit"),
        ("DimSize = 5 4 4\n", "ElementDataFile", "truncated"),
        ("ElementType = MET_UCHAR_ARRAY\n", "ElementType", "is not read"),
        ("ElementNumberOfChannels = 3\n", "ElementNumberOfChannels", "`3` values per voxel"),
        ("ElementSpacing = 1 1 0\n", "ElementSpacing", "0 is not a spacing"),
        ("ElementSpacing = 1 -1 1\n", "ElementSpacing", "-1 is not a spacing"),
        ("ElementSpacing = 1 nan 1\n", "ElementSpacing", "NaN is not a spacing"),
        ("ElementSpacing = 1 inf 1\n", "ElementSpacing", "inf is not a spacing"),
        ("Offset = 0 0 nan\n", "Offset", "not a position"),
        ("Position = 0 0 1e300\n", "Position", "not a position"),
        ("TransformMatrix = 1 0 0 0 1 0\n", "TransformMatrix", "9 numbers"),
        ("TransformMatrix = 1 0 0 0 1 0 1 1 0\n", "TransformMatrix", "one plane"),
        ("Rotation = 0 0 0 0 1 0 0 0 1\n", "Rotation", "0 is not a spacing"),
        ("Orientation = nan 0 0 0 1 0 0 0 1\n", "Orientation", "NaN"),
        ("DistanceUnits = inch\n", "DistanceUnits", "`inch`"),
        ("BinaryData = maybe\n", "BinaryData", "neither True nor False"),
        ("BinaryData = False\nCompressedData = True\n", "CompressedData", "as text"),
        ("HeaderSize = 10\n", "HeaderSize", "file of their own"),
        ("HeaderSize = -2\n", "HeaderSize", "-2"),
        ("ElementDataFile =\n", "ElementDataFile", "names no file"),
        ("ElementDataFile = LIST\n", "ElementDataFile", "one file for each slice is not read"),
        ("ElementDataFile = slice%03d.raw 1 3 1\n", "ElementDataFile", "one file for each slice is not read"),
        ("ElementDataFile = a.raw\n", "ElementDataFile", "upload both in one zip or tar"),
        ("NDims = 3\nNDims = 3\n", "header", "given twice"),
        ("nonsense\n", "header", "is not `Name = value`"),
    ];
    for (lines, field, says) in cases {
        assert_names(read(lines), field, says);
    }
    let none = format::read_bytes(HEADER.as_bytes(), Format::MetaImage, None, &Limits::default());
    assert_names(none, "ElementDataFile", "the header ends without it");
}

#[test]
fn compressed_data_are_no_more_and_no_less_than_announced() {
    let zlib = |length: usize| {
        let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::best());
        std::io::Write::write_all(&mut encoder, &vec![7; length]).expect("to memory");
        encoder.finish().expect("to memory")
    };
    let compressed = |data: &[u8]| read_bytes("CompressedData = True\n", data);
    assert_eq!(compressed(&zlib(60)).expect("valid").voxels.value(59), 7.0);
    assert_eq!(compressed(&super::nrrd::gzip(&[7; 60])).expect("gzip is read too").voxels.value(59), 7.0);
    assert_names(compressed(&zlib(59)), "ElementDataFile", "truncated: expected 60 bytes, got 59");
    assert_eq!(compressed(&zlib(1 << 26)).expect("what follows is ignored").voxels.len(), 60);
    assert_names(compressed(b"not zlib"), "ElementDataFile", "corrupt");
    assert_names(compressed(b""), "ElementDataFile", "truncated");
}

#[test]
fn fields_without_effect_are_told() {
    let notes = |lines: &str| read(lines).expect("valid").about.notes;
    assert!(notes("AnatomicalOrientation = LPS\n")[0].contains("AnatomicalOrientation `LPS` has no effect"));
    assert!(notes("AnatomicalOrientation = RAI\n").is_empty());
    assert!(notes("AnatomicalOrientation = ???\n").is_empty());
    assert!(notes("ElementToIntensityFunctionSlope = 2\n")[0].contains("values are those that are stored"));
    assert!(notes("ElementToIntensityFunctionSlope = 1\nElementToIntensityFunctionOffset = 0.0\n").is_empty());
}

#[test]
fn rows_of_another_length_than_1_are_part_of_the_spacing() {
    let grid = read("ElementSpacing = 2 2 2\nTransformMatrix = 0 3 0 1 0 0 0 0 1.0000001\n").expect("valid").grid;
    assert_eq!(grid.spacing.to_array(), [6.0, 2.0, 2.0000002]);
    assert_eq!(grid.direction.map(|d| d.to_array()), [[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]]);
    let rounded = read("ElementSpacing = 2 2 2\nTransformMatrix = 0.70711 0.70711 0 -0.70711 0.70711 0 0 0 1\n");
    assert_eq!(rounded.expect("valid").grid.spacing.to_array(), [2.0; 3]);
}

#[test]
fn data_files_outside_the_directory_are_refused() {
    let outside = tempfile::tempdir().expect("a directory");
    let root = outside.path().join("data");
    fs::create_dir_all(root.join("sub")).expect("a directory");
    let data: Vec<u8> = (0..60).collect();
    for file in ["secret.raw", "data/a.raw", "data/sub/b.raw"] {
        fs::write(outside.path().join(file), &data).expect("written");
    }
    let load = |header: &str, name: &str| {
        fs::write(root.join(header), format!("{HEADER}ElementDataFile = {name}\n")).expect("written");
        format::load_path(header, &root, None, &Limits::default())
    };
    assert!(load("x.mhd", "a.raw").is_ok());
    assert!(load("x.mhd", "sub/b.raw").is_ok());
    assert!(load("sub/x.mhd", "b.raw").is_ok());
    let absolute = outside.path().join("secret.raw");
    for bad in ["../secret.raw", "sub/../../secret.raw", absolute.to_str().expect("text")] {
        assert_names(load("x.mhd", bad), "ElementDataFile", "is not a relative path");
    }
    assert_names(load("x.mhd", "missing.raw"), "ElementDataFile", "");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&absolute, root.join("link.raw")).expect("a link");
        assert_names(load("x.mhd", "link.raw"), "ElementDataFile", "leads out of the data directory");
    }
}
