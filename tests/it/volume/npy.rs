//! NumPy files that are refused; [`super::independent`] has those that are read.

use std::io::{Cursor, Write};

use spao_server::volume::{Format, Limits, Volume, VolumeError, format};
use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::assert_names;

/// An array of version 1 with this dictionary and the bytes 0 to 59.
fn array(dictionary: &str) -> Vec<u8> {
    let length = u16::try_from(dictionary.len()).expect("short").to_le_bytes();
    let data: Vec<u8> = (0..60).collect();
    [b"\x93NUMPY\x01\x00", &length[..], dictionary.as_bytes(), &data].concat()
}

fn read(bytes: &[u8]) -> Result<Volume, VolumeError> {
    format::read_bytes(bytes, Format::Npy, None, &Limits::default())
}

fn described(descr: &str, order: &str, shape: &str) -> Vec<u8> {
    array(&format!("{{'descr': {descr}, 'fortran_order': {order}, 'shape': {shape}, }}"))
}

const BYTES: &str = "'|u1'";

#[test]
fn dictionaries_are_read_in_any_spelling() {
    let cases = [
        "{'descr': '|u1', 'fortran_order': False, 'shape': (3, 4, 5), }          \n",
        "{'shape':(3,4,5),'fortran_order':False,'descr':\"|u1\"}",
        " { \"descr\" : '<u1' , 'shape' : ( 3L, 4L, 5L ) , 'fortran_order' : False }",
    ];
    for dictionary in cases {
        let volume = read(&array(dictionary)).expect(dictionary);
        assert_eq!((volume.grid.dims, volume.voxels.value(59)), ([5, 4, 3], 59.0));
        assert!(!volume.about.patient_axes && volume.about.notes[0].contains("taken to be 1"));
    }
}

#[test]
fn a_wrong_header_names_what_is_wrong() {
    let cases = [
        (b"".to_vec(), "header", "truncated"),
        (b"\x93NUMPX\x01\x00".to_vec(), "magic", "not a NumPy array"),
        (b"\x93NUMPY\x04\x00\x00\x00\x00\x00".to_vec(), "version", "4; expected 1, 2 or 3"),
        (b"\x93NUMPY\x02\x00\xff\xff\xff\xff".to_vec(), "header", "4294967295 bytes long"),
        (b"\x93NUMPY\x01\x00\x10\x00{'descr'".to_vec(), "header", "truncated"),
        (array(""), "header", "is not a dictionary"),
        (array("{}"), "descr", "missing"),
        (array("{'descr': '|u1'}"), "fortran_order", "missing"),
        (array("{'descr': '|u1', 'fortran_order': False}"), "shape", "missing"),
        (array("{'descr' '|u1'}"), "header", "is not a dictionary"),
        (array("{'extra': 1}"), "header", "is not a dictionary"),
        (array("{'descr': '|u1"), "header", "is not a dictionary"),
        (described("[('a', '<u1')]", "False", "(60,)"), "descr", "records"),
        (described("'|O'", "False", "(3, 4, 5)"), "descr", "`|O` is not read"),
        (described("'<f16'", "False", "(3, 4, 5)"), "descr", "`<f16` is not read"),
        (described("'<c8'", "False", "(3, 4, 5)"), "descr", "`<c8` is not read"),
        (described("'\u{e9}1'", "False", "(3, 4, 5)"), "descr", "is not read"),
        (described(BYTES, "Maybe", "(3, 4, 5)"), "header", "is not a dictionary"),
        (described(BYTES, "False", "()"), "shape", "has 0 axes"),
        (described(BYTES, "False", "(12, 5)"), "shape", "[12, 5] has 2 axes"),
        (described(BYTES, "False", "(2, 3, 2, 5)"), "shape", "has 4 axes"),
        (described(BYTES, "False", "(3, -4, 5)"), "header", "is not a dictionary"),
        (described(BYTES, "False", "(3, 0, 5)"), "shape", "empty axis"),
        (described(BYTES, "False", "(3, 4, 6)"), "data", "truncated: expected 72 bytes, got 60"),
        (described(BYTES, "True", "(4096, 4096, 4096)"), "shape", "limit"),
        (described(BYTES, "False", "(18446744073709551615, 4, 5)"), "shape", "18446744073709551615"),
        (described(BYTES, "False", "(18446744073709551616, 4, 5)"), "header", "is not a dictionary"),
    ];
    for (file, field, says) in cases {
        assert_names(read(&file), field, says);
    }
}

/// An archive of files by name.
fn archive(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut writer = ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        let deflated = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
        writer.start_file(*name, deflated).expect("to memory");
        writer.write_all(bytes).expect("to memory");
    }
    writer.finish().expect("to memory").into_inner()
}

fn read_archive(bytes: &[u8]) -> Result<Volume, VolumeError> {
    format::read_bytes(bytes, Format::Npz, None, &Limits::default())
}

#[test]
fn of_several_arrays_one_must_be_meant() {
    let volume = described(BYTES, "False", "(3, 4, 5)");
    let other = described(BYTES, "True", "(5, 4, 3)");
    let flat = described(BYTES, "False", "(60,)");
    let dims = |files: &[(&str, &[u8])]| read_archive(&archive(files)).map(|volume| volume.grid.dims);
    assert_eq!(dims(&[("flat.npy", &flat), ("a.npy", &volume), ("note.txt", b"?")]).expect("one"), [5, 4, 3]);
    assert_eq!(dims(&[("a.npy", &volume), ("array.npy", &other)]).expect("the named one"), [3, 4, 5]);
    assert_names(dims(&[("a.npy", &volume), ("b.npy", &other)]), "archive", "2 arrays with three axes (`a`, `b`)");
    assert_names(dims(&[("flat.npy", &flat)]), "shape", "has 1 axes");
    assert_names(dims(&[("a.txt", &volume)]), "archive", "no array in it");
    let many: Vec<_> = (0..1001).map(|i| format!("{i}.npy")).collect();
    let many: Vec<_> = many.iter().map(|name| (name.as_str(), &b""[..])).collect();
    assert_names(dims(&many), "archive", "1001 arrays");
}

#[test]
fn archives_that_lie_are_refused() {
    let good = archive(&[("a.npy", &described(BYTES, "False", "(3, 4, 5)"))]);
    assert_eq!(Format::detect(None, None, &good).expect("by its first name"), Format::Npz);
    assert!(read_archive(&good).is_ok());
    assert_names(read_archive(b"PK\x03\x04"), "archive", "not a zip archive");
    // An archive within something else, such as a second wrapping that stores it as it is.
    assert_names(read_archive(&[b"something", &good[..]].concat()), "archive", "does not begin like one");
    // The end record says that there are 65534 files.
    let mut lying = good.clone();
    let end = lying.len() - 22;
    lying[end + 8..end + 12].copy_from_slice(&[0xfe, 0xff, 0xfe, 0xff]);
    assert!(read_archive(&lying).is_err());
    // A changed byte of the data does not go unnoticed.
    for at in 36..good.len() - 90 {
        let mut changed = good.clone();
        changed[at] ^= 0x10;
        if let Ok(volume) = read_archive(&changed) {
            assert_eq!(volume.voxels, read_archive(&good).expect("valid").voxels, "byte {at}");
        }
    }
    let claims_more = archive(&[("a.npy", &described(BYTES, "False", "(4096, 4096, 100)"))]);
    assert_names(read_archive(&claims_more), "data", "truncated");
}
