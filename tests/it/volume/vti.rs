//! VTK files that are refused, or read in ways that VTK does not write; [`super::independent`] has those it writes.

use data_encoding::BASE64;
use flate2::Compression;
use flate2::write::ZlibEncoder;
use spao_server::volume::{Format, Limits, Volume, VolumeError, Voxels, format};
use std::io::Write;

use super::assert_names;

const FILE: &str = r#"<?xml version="1.0"?>
<!-- a comment with a <tag> -->
<VTKFile type="ImageData" version="1.0" byte_order="LittleEndian" header_type="UInt32">
<ImageData WholeExtent="0 1 0 1 0 2" Origin="0 0 0" Spacing="1 2 3">
<FieldData><DataArray type="Float64" Name="TIME" NumberOfTuples="1" format="ascii">0.5</DataArray></FieldData>
<Piece Extent="0 1 0 1 0 2"><PointData Scalars="d">
<DataArray type="UInt8" Name="d" format="ascii">0 1 2 3 4 5 6 7 8 9 10 11</DataArray>
</PointData></Piece></ImageData>
</VTKFile>"#;

fn read(text: &[u8]) -> Result<Volume, VolumeError> {
    format::read_bytes(text, Format::Vti, None, &Limits::default())
}

/// The file with a part replaced.
fn with(old: &str, new: &str) -> Result<Volume, VolumeError> {
    assert_eq!(FILE.matches(old).count(), 1, "{old}");
    read(FILE.replace(old, new).as_bytes())
}

const NUMBERS: &str = "0 1 2 3 4 5 6 7 8 9 10 11";
const ARRAY: &str = r#"<DataArray type="UInt8" Name="d" format="ascii">0 1 2 3 4 5 6 7 8 9 10 11</DataArray>"#;

fn encoded(data: &str) -> Result<Volume, VolumeError> {
    with(ARRAY, &format!(r#"<DataArray type="UInt8" Name="d" format="binary">{data}</DataArray>"#))
}

fn voxels() -> Voxels {
    Voxels::U8((0..12).collect())
}

fn words(numbers: &[u32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

fn zlib(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::best());
    encoder.write_all(bytes).expect("to memory");
    encoder.finish().expect("to memory")
}

#[test]
fn the_file_that_these_tests_spoil_is_valid() {
    let volume = read(FILE.as_bytes()).expect("valid");
    assert_eq!((volume.voxels, volume.grid.dims), (voxels(), [2, 2, 3]));
    assert!(!volume.about.patient_axes);
    assert_eq!(Format::detect(None, None, FILE.as_bytes()).expect("by its tags"), Format::Vti);
    assert_eq!(with(NUMBERS, &format!("\n{}\n", NUMBERS.replace(' ', "\n"))).expect("valid").voxels, voxels());
    // Facts about the array, before the numbers.
    let key = format!("<InformationKey name=\"R\" length=\"1\"><Value index=\"0\">2</Value></InformationKey>{NUMBERS}");
    assert_eq!(with(NUMBERS, &key).expect("valid").voxels, voxels());
}

#[test]
fn counts_may_be_encoded_with_the_data_or_apart() {
    let bytes: Vec<u8> = (0..12).collect();
    let together = BASE64.encode(&[words(&[12]), bytes.clone()].concat());
    assert_eq!(encoded(&together).expect("valid").voxels, voxels());
    assert_eq!(encoded(&format!("\n {}\n", together)).expect("valid").voxels, voxels());
    let apart = BASE64.encode(&words(&[12])) + &BASE64.encode(&bytes);
    assert_eq!(encoded(&apart).expect("valid").voxels, voxels());
    assert_names(encoded(""), "DataArray", "truncated");
    assert_names(encoded("Zm9v!"), "DataArray", "not base64");
    assert_names(encoded("Zg=x"), "DataArray", "after its padding");
    assert_names(encoded(&together[..together.len() - 1]), "DataArray", "truncated");
    let lying = BASE64.encode(&[words(&[4_000_000_000]), bytes].concat());
    assert_names(encoded(&lying), "DataArray", "4000000000 bytes of voxels; expected 12");
}

#[test]
fn blocks_give_no_more_and_no_less_than_announced() {
    let bytes: Vec<u8> = (0..12).collect();
    let blocks = |counts: &[u32], data: &[u8]| {
        let data = BASE64.encode(&words(counts)) + &BASE64.encode(data);
        let array = format!(r#"<DataArray type="UInt8" Name="d" format="binary">{data}</DataArray>"#);
        let version = r#"version="1.0" byte"#;
        let compressed = r#"compressor="vtkZLibDataCompressor" version="1.0" byte"#;
        let file = FILE.replace(ARRAY, &array).replace(version, compressed);
        assert!(file.contains("vtkZLib"));
        read(file.as_bytes())
    };
    let (whole, half) = (zlib(&bytes), [zlib(&bytes[..8]), zlib(&bytes[8..])]);
    let halves = half.concat();
    let size = |data: &[u8]| data.len() as u32;
    assert_eq!(blocks(&[1, 12, 0, size(&whole)], &whole).expect("valid").voxels, voxels());
    assert_eq!(blocks(&[1, 32768, 12, size(&whole)], &whole).expect("valid").voxels, voxels());
    let two = [2, 8, 4, size(&half[0]), size(&half[1])];
    assert_eq!(blocks(&two, &halves).expect("valid").voxels, voxels());
    let more = zlib(&vec![0; 1 << 24]);
    let cases: [(&[u32], &[u8], &str); 9] = [
        (&[0, 12, 0], &[], "0 blocks"),
        (&[1, 0, 0, 5], &whole, "expected 12 bytes"),
        (&[u32::MAX, u32::MAX, u32::MAX], &[], "expected 12 bytes"),
        (&[2, 4, 8, 5, 5], &halves, "expected 12 bytes"),
        (&[1, 13, 0, size(&whole)], &whole, "expected 12 bytes"),
        (&[1, 12, 0, size(&whole)], &whole[..whole.len() - 1], "truncated"),
        (&[1, 12, 0, size(&more)], &more, "a block gives not the 12 bytes"),
        (&[1, 12, 0, 0], &whole, "cannot give 12"),
        (&[1, 12, 0, 20], &[7; 20], "corrupt"),
    ];
    for (counts, data, says) in cases {
        assert_names(blocks(counts, data), "DataArray", says);
    }
}

#[test]
fn appended_data_are_where_they_should_be() {
    let array = |offset: &str| format!(r#"<DataArray type="UInt8" Name="d" format="appended" offset="{offset}"/>"#);
    let file = |offset: &str, tag: &str, data: &[u8]| {
        let text = FILE.replace(ARRAY, &array(offset));
        let (head, tail) = text.split_once("</VTKFile>").expect("an end tag");
        [head.as_bytes(), tag.as_bytes(), data, b"</AppendedData></VTKFile>", tail.as_bytes()].concat()
    };
    let raw = "<AppendedData encoding=\"raw\">\n  _";
    let data = [b"<<>&\0".to_vec(), words(&[12]), (0..12).collect()].concat();
    assert_eq!(read(&file("5", raw, &data)).expect("valid").voxels, voxels());
    assert_names(read(&file("4", raw, &data)), "DataArray", "bytes of voxels");
    assert_names(read(&file("18446744073709551615", raw, &data)), "offset", "beyond the appended data");
    assert_names(read(&file("-1", raw, &data)), "offset", "`-1`");
    assert_names(read(&file("5", "<AppendedData encoding=\"raw\">", &data)), "AppendedData", "`_`");
    assert_names(read(&file("5", "<AppendedData encoding=\"zip\">_", &data)), "encoding", "`zip`");
    assert_names(with(ARRAY, &array("0")), "AppendedData", "missing");
}

#[test]
fn a_wrong_attribute_names_itself() {
    let piece = r#"<Piece Extent="0 1 0 1 0 2">"#;
    let cases = [
        (r#"type="ImageData""#, r#"type="UnstructuredGrid""#, "type", "`UnstructuredGrid` is not read"),
        (r#"type="ImageData""#, r#"type="PImageData""#, "type", "a .pvti file only names others"),
        ("LittleEndian", "MiddleEndian", "byte_order", "MiddleEndian"),
        ("UInt32", "UInt16", "header_type", "UInt16"),
        (r#"version="1.0" byte"#, r#"compressor="vtkLZ4DataCompressor" byte"#, "compressor", "vtkLZ4DataCompressor"),
        (r#" WholeExtent="0 1 0 1 0 2""#, "", "WholeExtent", "missing"),
        (r#" WholeExtent="0 1 0 1 0 2""#, r#" WholeExtent="0 1 0 1""#, "WholeExtent", "6 numbers"),
        (r#" WholeExtent="0 1 0 1 0 2""#, r#" WholeExtent="0 1 0 1 0 5""#, "Extent", "do not fill the WholeExtent"),
        (piece, &format!(r#"<Piece Extent="0 1 0 1 0 1"/>{piece}"#), "Extent", "overlap"),
        (piece, &format!("{}{piece}", "<Piece Extent=\"0 1 0 1 0 0\"/>".repeat(64)), "Piece", "more than 64 pieces"),
        (piece, r#"<Piece Extent="0 1 0 1 0 3">"#, "Extent", "is not within the WholeExtent"),
        (piece, r#"<Piece Extent="0 1 0 1 0 1">"#, "Extent", "do not fill the WholeExtent"),
        // A part that has no cells is no overlap.
        (piece, &format!(r#"{piece}</Piece><Piece Extent="0 1 0 1 0 0">"#), "DataArray", "piece 0 has no array `d`"),
        (r#"Spacing="1 2 3""#, r#"Spacing="1 0 3""#, "Spacing", "0 is not a spacing"),
        (r#"Spacing="1 2 3""#, r#"Spacing="1 -2 3""#, "Spacing", "-2 is not a spacing"),
        (r#"Spacing="1 2 3""#, r#"Spacing="1 NaN 3""#, "Spacing", "NaN"),
        (r#"Origin="0 0 0""#, r#"Origin="0 0 inf""#, "Origin", "inf"),
        (r#"Origin="0 0 0""#, r#"Direction="1 0 0 0 1 0 1 0 0""#, "Direction", "0 is not a spacing"),
        (r#"Origin="0 0 0""#, r#"Direction="1 1 0 0 0 0 0 0 1""#, "Direction", "one plane"),
        (r#"type="UInt8""#, r#"type="String""#, "type", "`String` is not read"),
        (r#""d" format="ascii""#, r#""d" format="hex""#, "format", "`hex`"),
        (r#""d" format"#, r#""d" NumberOfComponents="3" format"#, "NumberOfComponents", "`3` values per voxel"),
        (NUMBERS, "0 1 2", "DataArray", "truncated: expected 12 numbers, got 3"),
        (NUMBERS, "0 1 2 x", "DataArray", "`x`"),
        (NUMBERS, "256 1 2", "DataArray", "`256`"),
        (ARRAY, "", "DataArray", "no array on points or cells"),
        ("</PointData>", "</CellData>", "XML", ""),
    ];
    for (old, new, field, says) in cases {
        assert_names(with(old, new), field, says);
    }
    let huge = FILE.replace("0 1 0 1 0 2", "-9223372036854775808 9223372036854775807 0 1 0 2");
    assert_names(read(huge.as_bytes()), "Extent", "18446744073709551616");
    let empty = FILE.replace("0 1 0 1 0 2", "1 0 0 1 0 2");
    assert_names(read(empty.as_bytes()), "Extent", "no voxels");
    assert_names(read(b"<VTKFile type=\"ImageData\">"), "ImageData", "missing");
}

#[test]
fn of_several_arrays_one_must_be_meant() {
    let other = ARRAY.replace("\"d\"", "\"e\"").replace("0 1", "1 1");
    let both = format!("{other}{ARRAY}");
    assert_eq!(with(ARRAY, &both).expect("the named one").voxels, voxels());
    let unnamed = FILE.replace(ARRAY, &both).replace(" Scalars=\"d\"", "");
    assert_names(read(unnamed.as_bytes()), "DataArray", "several (`e`, `d`)");
    let vectors = other.replace("format", "NumberOfComponents=\"3\" format");
    let one_scalar = FILE.replace(ARRAY, &format!("{vectors}{ARRAY}")).replace(" Scalars=\"d\"", "");
    assert_eq!(read(one_scalar.as_bytes()).expect("the only scalars").voxels, voxels());
    let many = FILE.replace(ARRAY, &ARRAY.repeat(1001));
    assert_names(read(many.as_bytes()), "DataArray", "more than 1000 arrays");
}
