//! A volume packed into an archive: a header with its files of data, or a single file of another format.

use spao_server::volume::{Format, Limits, Volume, VolumeError, Voxels, format, list_directory};

use super::assert_names;
use super::dicom::{tar, unzipped};
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
    // Two volumes are none, and are taken for DICOM as any archive is, unless it is said what they are.
    let two = [("a.nhdr", &with("t.raw")[..]), ("b.nhdr", &with("t.raw")), ("t.raw", &data)];
    assert_fails(&two, "archive", "no DICOM pictures are in it");
    let named = |files: &[(&str, &[u8])], format| format::read_bytes(&zip_of(files), format, None, &Limits::default());
    assert_names(named(&two, Format::Nrrd), "archive", "holds several volumes, `a.nhdr` and `b.nhdr`; expected one");
    assert_names(named(&[("t.raw", &data)], Format::Nifti), "archive", "expected one file of a volume, or one header");
    assert_fails(&[("../h.nhdr", &with("t.raw")), ("t.raw", &data)], "archive", "leads out of the archive");
    // A header alone says what to do.
    assert_names(upload(&header("t.raw")), "data file", "upload both in one zip or tar");
    let meta = format!("{META}ElementDataFile = t.raw\n");
    assert_names(upload(meta.as_bytes()), "ElementDataFile", "upload both in one zip or tar");
}

#[test]
fn slices_of_dicom_win_over_what_lies_beside_them() {
    let header = format!("{FIELDS}encoding: raw\ndata file: mask.raw\n");
    let mask = [("seg/mask.nhdr", header.as_bytes()), ("seg/mask.raw", &big_endian()[..]), (".zattrs", b"")];
    let slices = unzipped("explicit.zip");
    let slices: Vec<(&str, &[u8])> = slices.iter().map(|(name, bytes)| (&name[..], &bytes[..])).collect();
    for archive in [packed(&[&mask[..], &slices].concat()), packed(&[&slices, &mask[..]].concat())].concat() {
        assert_eq!(Format::detect(None, None, &archive).ok(), Some(Format::Dicom));
        assert_eq!(upload(&archive).expect("loads").grid.dims, [5, 4, 3]);
    }
    // Also one that is called like a file of another format, and those with endings that nobody looks into.
    for archive in [zip_of(&[("slice.img", slices[1].1)]), tar(&[("slice.tif", slices[1].1)])] {
        assert_eq!(Format::detect(None, None, &archive).ok(), Some(Format::Dicom));
    }
    assert_eq!(Format::detect(None, None, &zip_of(&[mask[0], mask[1], ("a.DCM", b"x")])).ok(), Some(Format::Dicom));
}

#[test]
fn what_else_people_and_their_tools_pack_does_no_harm() {
    let (data, header) = (big_endian(), format!("{FIELDS}encoding: raw\ndata file: x.raw\n"));
    let both = [("x.nhdr", header.as_bytes()), ("x.raw", &data[..])];
    let more = [(".git/config", &b"x"[..]), ("README.md", b"x"), (".cache/y.nhdr", b"x"), ("a/.hidden/z.nrrd", b"x")];
    assert_loads(&[&more[..], &both].concat());
    assert_loads(&[("dir\\x.nhdr", both[0].1), ("dir\\x.raw", both[1].1)]);
    let nrrd = [FIELDS.as_bytes(), b"encoding: raw\n\n", &data].concat();
    assert_loads(&[("README.md", b"x"), ("x.nrrd", &nrrd)]);
    // A header after a hundred files, of a kind that has its data with it, and in a wrapping of its own.
    let names: Vec<String> = (0..100).map(|n| format!("note{n}.txt")).collect();
    let many: Vec<(&str, &[u8])> = names.iter().map(|name| (&name[..], &b"x"[..])).collect();
    for archive in &packed(&[&many[..], &both].concat())[..2] {
        assert_eq!(upload(archive).expect("loads").voxels, Voxels::U16(voxels()));
    }
    assert_loads(&[("with.nhdr", &nrrd)]);
    assert_loads(&[("x.nhdr.gz", &gzip(header.as_bytes())), both[1]]);
}

#[test]
fn long_names_of_tars_are_read() {
    let deep = "a-folder-with-a-long-name/".repeat(5);
    let name = format!("{deep}tooth.raw");
    let header = format!("{FIELDS}encoding: raw\ndata file: {name}\n");
    let mut gnu = tar::Builder::new(Vec::new());
    let mut pax = tar::Builder::new(Vec::new());
    for (path, bytes) in [("h.nhdr", header.into_bytes()), (&name, big_endian())] {
        let mut entry = tar::Header::new_gnu();
        entry.set_size(bytes.len() as u64);
        entry.set_mode(0o644);
        gnu.append_data(&mut entry.clone(), path, &bytes[..]).expect("memory is written");
        pax.append_pax_extensions([("mtime", &b"1.5"[..]), ("path", path.as_bytes())]).expect("memory is written");
        entry.set_path("short").expect("it is");
        entry.set_cksum();
        pax.append(&entry, &bytes[..]).expect("memory is written");
    }
    for archive in [gnu.into_inner(), pax.into_inner()].map(|archive| archive.expect("memory is written")) {
        for archive in [gzip(&archive), archive] {
            assert_eq!(upload(&archive).expect("loads").voxels, Voxels::U16(voxels()));
        }
    }
}

#[test]
fn damaged_data_are_noticed_and_thousands_of_files_are_no_matter() {
    let header = format!("{FIELDS}encoding: raw\ndata file: x.raw\n");
    let data = big_endian();
    let mut archive = zip_of(&[("x.nhdr", header.as_bytes()), ("x.raw", &data)]);
    let at = archive.windows(data.len()).position(|window| window == data).expect("it is stored as it is");
    archive[at + 5] ^= 1;
    assert_names(upload(&archive), "data file", "corrupt");

    let slices: Vec<(String, Vec<u8>)> = (0..4096).map(|n| (format!("s{n:04}.raw"), vec![n as u8; 6])).collect();
    let header = "NRRD0001\ntype: uint8\ndimension: 3\nsizes: 2 3 4096\nencoding: raw\ndata file: s%04d.raw 0 4095 1\n";
    let mut files: Vec<(&str, &[u8])> = slices.iter().map(|(name, bytes)| (&name[..], &bytes[..])).collect();
    files.push(("x.nhdr", header.as_bytes()));
    for archive in [zip_of(&files), tar(&files)] {
        assert_eq!(upload(&archive).expect("loads").grid.dims, [2, 3, 4096]);
    }
}

#[test]
fn a_file_within_takes_no_memory_before_its_header_is_read() {
    let long = [FIELDS.as_bytes(), b"encoding: raw\n\n", &vec![0; 40 << 20]].concat();
    for archive in [zip_of(&[("a.nrrd", &long)]), tar(&[("a.nhdr", &long)])] {
        // What follows the voxels does not matter.
        assert_eq!(upload(&archive).expect("loads").grid.dims, [2, 3, 4]);
    }
    let zeros = zip_of(&[("a.nii", &vec![0; 40 << 20])]);
    assert_names(upload(&zeros), "sizeof_hdr", "");
}
