//! Detached NRRD headers: one data file or several, and only inside the directory.

use std::fs;
use std::path::Path;

use spao_server::volume::{Limits, Volume, VolumeError, Voxels, format};
use tempfile::TempDir;

use super::assert_names;
use super::nrrd::gzip;

/// A data directory with a header `sub/tooth.nhdr` of 2 x 3 x 4 big-endian `u16` voxels.
fn data_dir(lines: &str) -> TempDir {
    let root = tempfile::tempdir().expect("a directory");
    fs::create_dir(root.path().join("sub")).expect("a directory");
    let header = "NRRD0001\ntype: unsigned short\ndimension: 3\nsizes: 2 3 4\nspacings: 1 1 1\nendian: big\n";
    fs::write(root.path().join("sub/tooth.nhdr"), format!("{header}{lines}")).expect("written");
    root
}

fn voxels() -> Vec<u16> {
    (0..24).map(|i| i * 1000 + 7).collect()
}

fn big_endian() -> Vec<u8> {
    voxels().iter().flat_map(|v| v.to_be_bytes()).collect()
}

fn load(root: &Path) -> Result<Volume, VolumeError> {
    format::load_path("sub/tooth.nhdr", root, None, &Limits::default())
}

#[track_caller]
fn assert_loads(root: &TempDir) {
    assert_eq!(load(root.path()).expect("loads").voxels, Voxels::U16(voxels()));
}

#[test]
fn a_detached_big_endian_header_finds_its_data() {
    let root = data_dir("data file: ./tooth.raw\nencoding: raw\n");
    fs::write(root.path().join("sub/tooth.raw"), big_endian()).expect("written");
    assert_loads(&root);
    // A header of its own before the data.
    let root = data_dir("data file: deeper/my tooth.bin\nencoding: raw\nbyte skip: -1\n\n");
    fs::create_dir(root.path().join("sub/deeper")).expect("a directory");
    fs::write(root.path().join("sub/deeper/my tooth.bin"), [b"header".to_vec(), big_endian()].concat())
        .expect("written");
    assert_loads(&root);
}

#[test]
fn data_may_be_in_a_list_of_files() {
    let root = data_dir("encoding: gzip\ndatafile: LIST\na.gz\nb.gz\n");
    let bytes = big_endian();
    let (a, b) = bytes.split_at(24);
    fs::write(root.path().join("sub/a.gz"), gzip(a)).expect("written");
    fs::write(root.path().join("sub/b.gz"), gzip(b)).expect("written");
    assert_loads(&root);
    fs::write(root.path().join("sub/b.gz"), gzip(&b[1..])).expect("written");
    assert_names(load(root.path()), "data file", "truncated: expected 24 bytes, got 23");
}

#[test]
fn data_may_be_in_numbered_files() {
    for (pattern, names) in [
        ("s%02d.raw 8 11 1", ["s08.raw", "s09.raw", "s10.raw", "s11.raw"]),
        ("s%d.raw 8 14 2 2", ["s8.raw", "s10.raw", "s12.raw", "s14.raw"]),
        ("s%d.raw 3 0 -1", ["s3.raw", "s2.raw", "s1.raw", "s0.raw"]),
    ] {
        let root = data_dir(&format!("encoding: raw\ndata file: {pattern}\n"));
        for (name, slice) in names.iter().zip(big_endian().chunks(12)) {
            fs::write(root.path().join("sub").join(name), slice).expect("written");
        }
        assert_loads(&root);
    }
}

#[test]
fn the_order_of_files_matters_to_the_comparison() {
    let root = data_dir("encoding: raw\ndata file: LIST\nb\na\n");
    let bytes = big_endian();
    fs::write(root.path().join("sub/a"), &bytes[..24]).expect("written");
    fs::write(root.path().join("sub/b"), &bytes[24..]).expect("written");
    assert_ne!(load(root.path()).expect("loads").voxels, Voxels::U16(voxels()));
}

#[test]
fn file_names_that_are_too_many_or_none_are_refused() {
    for (value, says) in [
        ("s%d.raw 0 5000 1", "does not name 1 to 4096 files"),
        ("s%d.raw 0 9223372036854775807 1", "does not name"),
        ("s%d.raw -9223372036854775808 9223372036854775807 1", "does not name"),
        ("s%d.raw 0 5 0", "does not name"),
        ("s%d.raw 5 0 1", "does not name"),
        ("s%0999d.raw 0 3 1", "does not name"),
        ("s%s.raw 0 3 1", "one %d"),
        ("s%d.raw 0 3", "one %d"),
        ("s%d.raw 0 4 1", "24 voxels do not divide into 5 files"),
        ("", "no file is named"),
    ] {
        let root = data_dir(&format!("encoding: raw\ndata file: {value}\n"));
        assert_names(load(root.path()), "data file", says);
    }
    let root = data_dir(&format!("encoding: raw\ndata file: LIST\n{}", "a\n".repeat(5000)));
    assert_names(load(root.path()), "data file", "more than 4096 files");
}

#[test]
fn data_files_outside_the_directory_are_refused() {
    let outside = tempfile::tempdir().expect("a directory");
    let secret = outside.path().join("secret");
    fs::write(&secret, big_endian()).expect("written");
    for name in ["../tooth.raw", "a/../../b", secret.to_str().expect("text")] {
        let root = data_dir(&format!("encoding: raw\ndata file: {name}\n"));
        fs::write(root.path().join("tooth.raw"), big_endian()).expect("written");
        assert_names(load(root.path()), "data file", "is not a relative path without `..`");
    }
    let root = data_dir("encoding: raw\ndata file: missing.raw\n");
    assert_names(load(root.path()), "data file", "");
    let root = data_dir("encoding: raw\ndata file: .\n");
    assert_names(load(root.path()), "data file", "is not a file");
    #[cfg(unix)]
    {
        let root = data_dir("encoding: raw\ndata file: link\n");
        std::os::unix::fs::symlink(&secret, root.path().join("sub/link")).expect("a link");
        assert_names(load(root.path()), "data file", "leads out of the data directory");
        assert!(!load(root.path()).expect_err("an error").to_string().contains("secret"));
    }
}

#[test]
fn a_wrapped_header_may_be_detached_but_not_count_from_the_end() {
    let root = data_dir("");
    let header =
        "NRRD0001\ntype: unsigned short\ndimension: 3\nsizes: 2 3 4\nspacings: 1 1 1\nendian: big\nencoding: raw\n";
    let load = |lines: &str, data: &[u8]| {
        let file = [header.as_bytes(), lines.as_bytes(), data].concat();
        fs::write(root.path().join("sub/tooth.nhdr.gz"), gzip(&file)).expect("written");
        format::load_path("sub/tooth.nhdr.gz", root.path(), None, &Limits::default())
    };
    fs::write(root.path().join("sub/tooth.raw"), big_endian()).expect("written");
    assert_eq!(load("data file: tooth.raw\n", b"").expect("loads").voxels, Voxels::U16(voxels()));
    assert_eq!(
        load("byte skip: 2\n\n", &[b"ab", &big_endian()[..]].concat()).expect("loads").voxels,
        Voxels::U16(voxels())
    );
    assert_names(load("byte skip: -1\n\n", &big_endian()), "byte skip", "-1 in a compressed file");
}
