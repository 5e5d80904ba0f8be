//! NRRD files that are refused: every error names the field at fault.

use spao_server::volume::format::read_bytes;
use spao_server::volume::{Format, Limits, VolumeError};

use super::nrrd::{bytes_file, file, gzip};
use super::{assert_names, read_nrrd};

const HEADER: &str = "type: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n";

/// The valid header with one line replaced, or left out if the new one is empty.
fn replaced(field: &str, line: &str) -> Vec<u8> {
    let mut lines: Vec<&str> = HEADER.lines().filter(|l| !l.starts_with(field)).collect();
    lines.extend((!line.is_empty()).then_some(line));
    file(&(lines.join("\n") + "\n"), &(0..24).collect::<Vec<_>>())
}

#[test]
fn the_header_that_these_tests_spoil_is_valid() {
    assert!(read_nrrd(&bytes_file("")).is_ok());
    assert!(read_nrrd(&replaced("sizes", "sizes: 4 3 2")).is_ok());
}

#[test]
fn a_wrong_or_missing_value_names_its_field() {
    let cases = [
        ("type", "", "missing"),
        ("type", "type: uint12", "`uint12` is not a type"),
        ("type", "type: block", "`block`"),
        ("type", "type:", "is not a type"),
        ("dimension", "", "missing"),
        ("dimension", "dimension: 2", "2 axes"),
        ("dimension", "dimension: 5", "5 axes"),
        ("dimension", "dimension: -3", "whole number"),
        ("sizes", "", "missing"),
        ("sizes", "sizes: 2 3", "3 values"),
        ("sizes", "sizes: 2 3 4 1", "3 values"),
        ("sizes", "sizes: 2 0 4", "0 is not a size"),
        ("sizes", "sizes: 2 x 4", "`x`"),
        ("sizes", "sizes: 2 -3 4", "`-3`"),
        ("sizes", "sizes: 2 3 4.0", "`4.0`"),
        ("sizes", "sizes: 99999999999999999999999 1 1", "whole number"),
        ("encoding", "", "missing"),
        ("encoding", "encoding: lzma", "`lzma` is not an encoding"),
        ("encoding", "encoding: bzip2", "`bzip2` is not read"),
        ("encoding", "encoding: hex", "`hex` is not read"),
    ];
    for (field, line, says) in cases {
        assert_names(read_nrrd(&replaced(field, line)), field, says);
    }
}

#[test]
fn wrong_geometry_and_skips_name_their_field() {
    let cases = [
        ("spacings", "spacings: 1 0 1", "0 is not a spacing"),
        ("spacings", "spacings: 1 -2 1", "-2 is not a spacing"),
        ("spacings", "spacings: 1 inf 1", "inf is not a spacing"),
        ("spacings", "spacings: 1 1", "3 values"),
        ("spacings", "spacings: 1 one 1", "`one` is not a number"),
        ("space directions", "space directions: (1,0,0) (0,1,0) (1,1,0)", "one plane"),
        ("space directions", "space directions: (1,0,0) (0,0,0) (0,0,1)", "0 is not a spacing"),
        ("space directions", "space directions: (1,0,0) (0,nan,0) (0,0,1)", "not a spacing"),
        ("space directions", "space directions: (1,0,0) (0,1e400,0) (0,0,1)", "not a spacing"),
        ("space directions", "space directions: (1,0,0) (0,1,0)", "3 vectors"),
        ("space directions", "space directions: (1,0,0) (0,1) (0,0,1)", "3 vectors"),
        ("space directions", "space directions: (1,0,0) (0,1,0) (0,0,1", "3 vectors"),
        ("space directions", "space directions: (1,0,0) (0,1,0) (0,0,1) (0,0,1)", "3 vectors"),
        ("space directions", "space directions: (1,0,0) none (0,0,1)", "`none`"),
        ("space origin", "space origin: (0,0,inf)", "not a position"),
        ("space origin", "space origin: 0 0 0", "1 vectors"),
        ("space dimension", "space dimension: 2", "expected 3"),
        ("space", "space: right-anterior-superior-time", "four axes"),
        ("kinds", "kinds: RGB-color domain domain", "`RGB-color`"),
        ("endian", "endian: middle", "`middle`"),
        ("byte skip", "byte skip: 100000", ""),
        ("byte skip", "byte skip: -2", "whole number"),
        ("line skip", "line skip: 3", "more lines than there are"),
        ("line skip", "line skip: 18446744073709551615", "more lines than there are"),
        ("data file", "data file: elsewhere.raw", "upload"),
        ("data file", "data file: LIST", "no file is named"),
        ("header", "spacing: 1 1 1", "`spacing` is not a field"),
        ("header", "just words", "`just words` is not `field: value`"),
        ("type", "type: uint8", "given twice"),
    ];
    for (field, line, says) in cases {
        // Too large a skip leaves too little data, which is what is said first.
        let field = if line.ends_with("100000") { "data" } else { field };
        assert_names(read_nrrd(&bytes_file(&format!("{line}\n"))), field, says);
    }
}

#[test]
fn four_axes_of_many_samples_name_the_dimension() {
    let header = "type: uint8\ndimension: 4\nsizes: 2 2 2 3\nencoding: raw\n";
    assert_names(read_nrrd(&file(header, &[0; 24])), "dimension", "4 axes of sizes [2, 2, 2, 3]");
}

#[test]
fn wide_voxels_need_their_byte_order() {
    let header = "type: short\ndimension: 3\nsizes: 2 3 2\nencoding: raw\n";
    assert_names(read_nrrd(&file(header, &[0; 24])), "endian", "missing");
    assert_names(read_nrrd(&file(&header.replace("raw", "gzip\nbyte skip: -1\nendian: big"), &[])), "byte skip", "-1");
}

#[test]
fn lying_sizes_are_refused_before_anything_is_allocated() {
    let too_large = |sizes: &str| {
        let error = read_nrrd(&replaced("sizes", sizes)).expect_err("an error");
        assert!(matches!(error, VolumeError::TooLarge { .. }), "{error}");
        assert_eq!(error.field(), "sizes");
    };
    too_large("sizes: 99999999 99999999 99999999");
    too_large("sizes: 4294967295 4294967295 4294967295");
    too_large("sizes: 4294967296 1 1");
    too_large("sizes: 18446744073709551615 1 1");
    too_large("sizes: 4096 4096 4096");
    // Within the limits, but there are 24 bytes.
    assert_names(read_nrrd(&replaced("sizes", "sizes: 1024 1024 1024")), "data", "expected 1073741824 bytes");
}

#[test]
fn the_callers_limits_hold() {
    let file = bytes_file("");
    let read = |limits: &Limits| read_bytes(&file, Format::Nrrd, None, limits);
    let exact = Limits { max_axis: 4, max_voxels: 24, max_bytes: 24 };
    assert!(read(&exact).is_ok());
    assert_names(read(&Limits { max_axis: 3, ..exact }), "sizes", "4 voxels along an axis needed, the limit is 3");
    assert_names(read(&Limits { max_voxels: 23, ..exact }), "sizes", "24 voxels needed, the limit is 23");
    assert_names(read(&Limits { max_bytes: 23, ..exact }), "sizes", "24 bytes needed, the limit is 23");
}

#[test]
fn truncated_data_say_how_much_is_missing() {
    let bytes = [7_u8; 24];
    let short = |encoding: &str, data: &[u8]| {
        read_nrrd(&file(&format!("type: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: {encoding}\n"), data))
    };
    assert_names(short("raw", &bytes[..23]), "data", "truncated: expected 24 bytes of voxels, got at most 23");
    assert_names(short("raw", &[]), "data", "truncated");
    assert_names(short("gzip", &gzip(&bytes[..20])), "data", "truncated: expected 24 bytes, got 20");
    let whole = gzip(&[0; 24]);
    for length in 0..whole.len() {
        assert_names(short("gzip", &whole[..length]), "data", "");
    }
    assert_names(short("ascii", b"1 2 3 4 5 6 7 8 9 1 2 3 4 5 6 7 8 9 20 21 22 23 "), "data", "got 22");
    assert_names(short("ascii", b"1 2"), "data", "truncated");
    assert_names(short("raw\nbyte skip: 5", &bytes), "data", "truncated");
    assert_names(short("gzip\nbyte skip: 50", &gzip(&bytes)), "byte skip", "50 bytes, but there are 24");
}

#[test]
fn corrupt_data_are_the_files_fault() {
    let header = "type: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: gzip\n";
    let good = gzip(&[7; 24]);
    let mut bad = good.clone();
    let checksum = bad.len() - 8;
    bad[checksum] ^= 1;
    assert!(read_nrrd(&file(header, &good)).is_ok());
    assert_names(read_nrrd(&file(header, &bad)), "data", "corrupt compressed data");
    assert_names(read_nrrd(&file(header, &[7; 24])), "data", "corrupt compressed data");
    let ascii = header.replace("gzip", "ascii");
    assert_names(read_nrrd(&file(&ascii, &b"300 ".repeat(24))), "data", "`300` at index 0");
    assert_names(read_nrrd(&file(&ascii, &b"9".repeat(5000))), "data", "is not a number");
}

#[test]
fn skipping_more_compressed_bytes_than_the_limit_is_refused() {
    let header = "type: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: gzip\nbyte skip: 99999999999999\n";
    assert_names(read_nrrd(&file(header, &gzip(&[7; 24]))), "byte skip", "the limit is");
}

#[test]
fn voxels_of_nothing_but_nan_or_infinite_are_refused() {
    let header = "type: float\ndimension: 3\nsizes: 2 1 1\nencoding: ascii\n";
    assert_names(read_nrrd(&file(header, b"nan nan")), "voxels", "NaN");
    assert_names(read_nrrd(&file(header, b"1 -inf")), "voxels", "infinite value at index 1");
    assert_names(read_nrrd(&file(header, b"1e999 1")), "voxels", "infinite value at index 0");
}

#[test]
fn a_header_that_is_none_is_refused() {
    assert_names(read_nrrd(b""), "magic", "");
    assert_names(read_nrrd(b"NRRD0006\ntype: uint8\n\n"), "magic", "`NRRD0006`");
    assert_names(read_nrrd(b"\x7fELF\x02\x01\x01"), "magic", "");
    assert_names(read_nrrd(format!("NRRD0005\n{HEADER}").as_bytes()), "header", "no empty line");
}

#[test]
fn an_endless_header_is_refused() {
    assert_names(read_nrrd(&bytes_file(&format!("content: {}\n", "x".repeat(100_000)))), "header", "longer");
    assert_names(read_nrrd(&bytes_file(&"# comment\n".repeat(200_000))), "header", "longer");
    assert_names(read_nrrd(&[b'N'; 100_000]), "header", "longer");
}

#[test]
fn messages_do_not_repeat_a_long_or_unprintable_value() {
    let error = read_nrrd(&replaced("type", &format!("type: \x1b[31m{}", "x".repeat(1000)))).expect_err("an error");
    let message = error.to_string();
    assert!(message.len() < 150 && !message.contains('\x1b'), "{message}");
}
