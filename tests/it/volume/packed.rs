//! A volume packed into an archive: a header with its files of data, or a single file of another format.

use spao_server::volume::{Format, Limits, Volume, VolumeError, Voxels, format, list_directory};

use super::assert_names;
use super::dicom::tar;
use super::independent::bytes_of;
use super::makers::zip_of;
use super::nrrd::gzip;

const FIELDS: &str = "NRRD0001\ntype: unsigned short\ndimension: 3\nsizes: 2 3 4\nspacings: 1 1 1\nendian: big\n";

const META: &str =
    "ObjectType = Image\nNDims = 3\nDimSize = 2 3 4\nElementType = MET_USHORT\nElementByteOrderMSB = True\n";

fn voxels() -> Vec<u16> {
    (0..24).map(|i| i * 1000 + 7).collect()
}

fn big_endian() -> Vec<u8> {
    voxels().iter().flat_map(|v| v.to_be_bytes()).collect()
}

/// As an upload whose format nobody has said.
fn upload(archive: &[u8]) -> Result<Volume, VolumeError> {
    let format = Format::detect(None, None, archive)?;
    format::read_bytes(archive, format, None, &Limits::default())
}

/// The files as a zip, a tar, and a tar in gzip.
fn packed(files: &[(&str, &[u8])]) -> [Vec<u8>; 3] {
    [zip_of(files), tar(files), gzip(&tar(files))]
}

#[track_caller]
fn assert_loads(files: &[(&str, &[u8])]) {
    for archive in packed(files) {
        assert_eq!(upload(&archive).expect("loads").voxels, Voxels::U16(voxels()));
    }
}

#[track_caller]
fn assert_fails(files: &[(&str, &[u8])], field: &str, says: &str) {
    for archive in packed(files) {
        assert_names(upload(&archive), field, says);
    }
}

#[test]
fn a_header_finds_its_data_in_the_archive_whatever_comes_first() {
    let data = big_endian();
    let header = format!("{FIELDS}encoding: raw\ndata file: ./tooth.raw\n");
    let (header, data) = (("tooth.nhdr", header.as_bytes()), ("tooth.raw", &data[..]));
    assert_loads(&[header, data]);
    assert_loads(&[data, header]);
    assert_loads(&[("./tooth.raw", data.1), ("tooth.nhdr", header.1)]);
    // In a folder, with what some systems add.
    let folder = [("__MACOSX/a/._tooth.nhdr", &b"x"[..]), ("a/.DS_Store", b"x"), ("a/tooth.nhdr", header.1)];
    assert_loads(&[&folder[..], &[("a/tooth.raw", data.1), ("tooth.raw", b"another")]].concat());
    let meta = format!("{META}ElementDataFile = deeper/tooth.raw\n");
    assert_loads(&[("tooth.mhd", meta.as_bytes()), ("deeper/tooth.raw", data.1), ("readme.txt", b"")]);
}

#[test]
fn data_may_be_in_several_compressed_files_and_behind_a_header_of_their_own() {
    let data = big_endian();
    let (a, b) = data.split_at(24);
    let header = format!("{FIELDS}encoding: gzip\ndata file: LIST\na.gz\nb.gz\n");
    assert_loads(&[("b.gz", &gzip(b)), ("h.nhdr", header.as_bytes()), ("a.gz", &gzip(a))]);
    let header = format!("{FIELDS}encoding: raw\nbyte skip: -1\ndata file: skipped.bin\n");
    assert_loads(&[("h.nhdr", header.as_bytes()), ("skipped.bin", &[b"header".to_vec(), data].concat())]);
}

#[test]
fn every_format_of_one_file_may_be_packed_alone() {
    for file in ["nifti1_sform.nii", "nifti1_zstd.nii.zst", "meta_oblique.mha", "npy_fortran.npy", "vti_ascii.vti"] {
        let plain = bytes_of(file);
        let expected = upload(&plain).expect("valid");
        for archive in packed(&[(&format!("folder/{file}"), &plain), ("folder/.hidden", b"")]) {
            let volume = upload(&archive).expect(file);
            assert_eq!((volume.sha256_hex(), &volume.grid), (expected.sha256_hex(), &expected.grid), "{file}");
        }
    }
}

#[test]
fn a_file_of_the_data_directory_may_be_such_an_archive() {
    let header = format!("{FIELDS}encoding: raw\ndata file: tooth.raw\n");
    let archive = zip_of(&[("tooth.nhdr", header.as_bytes()), ("tooth.raw", &big_endian())]);
    let root = tempfile::tempdir().expect("a directory");
    std::fs::write(root.path().join("tooth.zip"), archive).expect("written");
    let volume = format::load_path("tooth.zip", root.path(), None, &Limits::default()).expect("loads");
    assert_eq!(volume.voxels, Voxels::U16(voxels()));
    let shape = format::peek_path("tooth.zip", root.path(), None).expect("its header is found");
    assert_eq!(shape.dims, [2, 3, 4]);
    let format = |with_headers| {
        let listing = list_directory("", root.path(), "", 10, with_headers).expect("a directory");
        listing.entries[0].format
    };
    assert_eq!([format(false), format(true)], [Some(Format::Dicom), Some(Format::Nrrd)]);
}

#[test]
fn what_is_missing_doubtful_or_outside_is_named() {
    let data = big_endian();
    let header = |data: &str| format!("{FIELDS}encoding: raw\ndata file: {data}\n").into_bytes();
    let with = |name: &str| header(name);
    assert_fails(
        &[("h.nhdr", &with("gone.raw")), ("tooth.raw", &data)],
        "data file",
        "`gone.raw` is not in the archive",
    );
    assert_fails(&[("a/h.nhdr", &with("../tooth.raw")), ("tooth.raw", &data)], "data file", "without `..`");
    assert_fails(&[("h.nhdr", &with("/tooth.raw")), ("tooth.raw", &data)], "data file", "without `..`");
    assert_fails(&[("h.nhdr", &with("t.raw")), ("t.raw", &data[1..])], "data file", "truncated: expected 48 bytes");
    let two = [("a.nhdr", &with("t.raw")[..]), ("b.nhdr", &with("t.raw")), ("t.raw", &data)];
    assert_fails(&two, "archive", "holds several headers, `a.nhdr` and `b.nhdr`; expected one");
    // Two volumes are none, and are taken for DICOM as any archive is.
    let nifti = bytes_of("nifti1_sform.nii");
    assert_fails(&[("a.nii", &nifti), ("b.nii", &nifti)], "archive", "no DICOM pictures are in it");
    let named =
        format::read_bytes(&zip_of(&[("a.nii", &nifti), ("b.nii", &nifti)]), Format::Nifti, None, &Limits::default());
    assert_names(named, "archive", "expected one file of a volume, or one header");
    assert_fails(&[("../h.nhdr", &with("t.raw")), ("t.raw", &data)], "archive", "leads out of the archive");
    // A header alone says what to do.
    assert_names(upload(&header("t.raw")), "data file", "upload both in one zip or tar");
    let meta = format!("{META}ElementDataFile = t.raw\n");
    assert_names(upload(meta.as_bytes()), "ElementDataFile", "upload both in one zip or tar");
}

#[test]
fn what_unpacks_to_too_much_is_refused() {
    let long = vec![0; 40 << 20];
    let limits = Limits { max_bytes: 1 << 20, ..Limits::default() };
    let read = |archive: &[u8], format| format::read_bytes(archive, format, None, &limits);
    let too_large = |read: Result<Volume, VolumeError>| matches!(read, Err(VolumeError::TooLarge { field, .. }) if field == "archive");
    assert!(too_large(read(&zip_of(&[("a.nii", &long)]), Format::Nifti)));
    let header = [FIELDS.as_bytes(), b"encoding: raw\ndata file: t.raw\n#", &long].concat();
    let unlimited = |archive: &[u8]| format::read_bytes(archive, Format::Nrrd, None, &Limits::default());
    assert!(too_large(unlimited(&zip_of(&[("h.nhdr", &header)]))));
}
