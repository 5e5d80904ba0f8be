//! OME-Zarr and Zarr against what zarr-python, ome-zarr-py and tensorstore say of the same files
//! (`tests/data/zarr/make.py`).

use std::collections::BTreeSet;
use std::fs;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use spao_server::volume::{Choice, Format, Limits, Volume, VolumeError, format};
use zip::ZipArchive;

use super::independent::{Expected, differences};
use super::{assert_names, dicom};

/// What a file holds, where it is chosen.
#[derive(Clone, Deserialize)]
#[serde(deny_unknown_fields)]
struct Case {
    file: String,
    channel: Option<u32>,
    scale: Option<u32>,
    expect: Expected,
}

impl Case {
    fn choice(&self) -> Choice {
        Choice { channel: self.channel, scale: self.scale, ..Choice::default() }
    }
}

pub(crate) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/zarr")
}

pub(super) fn fixture(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).expect("the fixture is there")
}

/// Names of the archives, each of them once.
pub(crate) fn archives() -> Vec<String> {
    let names: BTreeSet<String> = cases().into_iter().map(|case| case.file).collect();
    names.into_iter().collect()
}

fn cases() -> Vec<Case> {
    let read = |name: &str| serde_json::from_slice::<Vec<Case>>(&fixture(name)).expect("make.py wrote it");
    [read("expected_2.json"), read("expected_3.json")].concat()
}

pub(super) fn read_zarr(bytes: &[u8], choice: &Choice) -> Result<Volume, VolumeError> {
    format::read_chosen(bytes, Format::Zarr, None, choice, &Limits::default())
}

/// An archive's files in a folder.
fn unpacked(name: &str) -> tempfile::TempDir {
    let directory = tempfile::tempdir().expect("a directory");
    let mut archive = ZipArchive::new(Cursor::new(fixture(name))).expect("a zip");
    archive.extract(directory.path().join("cells.ome.zarr")).expect("it can be unpacked");
    directory
}

#[test]
fn every_codec_type_and_layout_is_read_as_other_libraries_read_it() {
    let cases = cases();
    assert!(cases.len() > 75, "{}", cases.len());
    let mut faults = Vec::new();
    for case in &cases {
        let bytes = fixture(&case.file);
        assert_eq!(Format::detect(None, None, &bytes).expect("recognised"), Format::Zarr, "{}", case.file);
        match read_zarr(&bytes, &case.choice()) {
            Ok(volume) => {
                faults.extend(differences(&volume, &case.expect));
                let peeked = format::peek_chosen(&case.file, &folder(), None, &case.choice(), &Limits::default());
                let peeked = peeked.expect("metadata are enough");
                assert_eq!((peeked.dims, peeked.voxel_type), (volume.grid.dims, volume.voxels.voxel_type()));
                let spacing = case.file.starts_with("ome").then(|| volume.grid.spacing.to_array());
                assert_eq!(peeked.spacing, spacing, "{}", case.file);
            }
            Err(error) => faults.push(format!("{}: {error}", case.file)),
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn the_comparison_notices_another_channel_and_another_level() {
    let case = cases().into_iter().find(|case| case.channel == Some(1) && case.scale == Some(0)).expect("an image");
    let bytes = fixture(&case.file);
    let read = |channel, scale| {
        let choice = Choice { channel: Some(channel), scale: Some(scale), ..Choice::default() };
        differences(&read_zarr(&bytes, &choice).expect("valid"), &case.expect).len()
    };
    assert_eq!(read(1, 0), 0);
    // The voxels; and dims, spacing and origin besides.
    assert_eq!(read(0, 0), 1);
    assert_eq!(read(1, 1), 4);
}

#[test]
fn a_folder_is_read_as_its_archive_is() {
    for (name, within) in [("ome_05.zip", "/ome_05.zarr"), ("v3_shards_large.zip", "/shards"), ("v2_blosc.zip", "")] {
        let name = if name == "v2_blosc.zip" { "large_blosclz_1_int16.zip" } else { name };
        let directory = unpacked(name);
        let path = format!("cells.ome.zarr{within}");
        let volume = format::load_path(&path, directory.path(), None, &Limits::default()).expect(name);
        let archived = read_zarr(&fixture(name), &Choice::default()).expect("valid");
        assert_eq!(volume.sha256_hex(), archived.sha256_hex(), "{name}");
        assert_eq!(volume.about, archived.about);
    }
}

#[test]
fn a_tar_and_a_tar_within_gzip_are_told_from_those_of_dicom() {
    let zarr = fixture("v3_gzip.tar");
    let wrapped = {
        use std::io::Write;
        let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
        encoder.write_all(&zarr).expect("to memory");
        encoder.finish().expect("to memory")
    };
    let dicom = dicom::tar(&[("a.dcm", b"whatever")]);
    let plain = read_zarr(&zarr, &Choice::default()).expect("valid");
    for (name, content_type) in [(None, None), (Some("tar"), None), (None, Some("application/x-tar"))] {
        for bytes in [&zarr, &wrapped] {
            assert_eq!(Format::detect(name, content_type, bytes).expect("known"), Format::Zarr);
            assert_eq!(read_zarr(bytes, &Choice::default()).expect("valid").voxels, plain.voxels);
        }
        assert_eq!(Format::detect(name, content_type, &dicom).expect("known"), Format::Dicom);
    }
    // Who says what it is, is believed.
    assert_eq!(Format::detect(Some("dicom"), None, &zarr).expect("known"), Format::Dicom);
    assert_eq!(Format::of_fetched("study.tar", None, &zarr).expect("known"), Format::Zarr);
    assert_eq!(Format::of_fetched("study.tar", None, &dicom).expect("known"), Format::Dicom);
}

#[test]
fn the_finest_level_within_the_limits_is_read_and_said() {
    let bytes = fixture("ome_05.zip");
    let read = |max_axis, scale| {
        let limits = Limits { max_axis, ..Limits::default() };
        format::read_chosen(&bytes, Format::Zarr, None, &Choice { scale, ..Choice::default() }, &limits)
    };
    let fine = read(5, None).expect("it fits");
    assert_eq!(fine.grid.dims, [5, 4, 3]);
    let notes = fine.about.notes.join(" ");
    assert!(
        !notes.contains("Level") && notes.contains("Of 2 channels the first is shown: channel=0 (`DAPI`)"),
        "{notes}"
    );
    assert!(notes.contains("Of 2 time points the first is shown."), "{notes}");
    let coarse = read(4, None).expect("the next one fits");
    assert_eq!(coarse.grid.dims, [3, 2, 3]);
    assert!(coarse.about.notes.join(" ").contains("Level 1 of 0 to 1 is read, the finest one within the limits"));
    assert_names(read(4, Some(0)), "shape", "5 voxels along an axis needed");
    assert_names(read(2, None), "shape", "3 voxels along an axis needed");
    assert_names(read(5, Some(2)), "scale", "2 is not a level of this file; it has 0 to 1");
    let channel = read_zarr(&bytes, &Choice { channel: Some(2), ..Choice::default() });
    assert_names(channel, "channel", "2 is not a channel of this file");
    let limits = Limits { max_axis: 4, ..Limits::default() };
    let peeked = format::peek_chosen("ome_05.zip", &folder(), None, &Choice::default(), &limits).expect("metadata");
    assert_eq!(peeked.dims, [3, 2, 3]);
}

#[test]
fn arrays_alone_have_one_level_and_one_channel() {
    let bytes = fixture("v2_plain.zip");
    for choice in [Choice { scale: Some(1), ..Choice::default() }, Choice { channel: Some(1), ..Choice::default() }] {
        let field = if choice.scale.is_some() { "scale" } else { "channel" };
        assert_names(read_zarr(&bytes, &choice), field, "this is an array alone, which has only one: 0");
    }
    let notes = read_zarr(&bytes, &Choice::default()).expect("valid").about.notes.join(" ");
    assert!(notes.contains("nothing about distances"), "{notes}");
    let tiff = format::read_chosen(
        b"II*\0",
        Format::Tiff,
        None,
        &Choice { scale: Some(0), ..Choice::default() },
        &Limits::default(),
    );
    assert_names(tiff, "scale", "only `zarr` has it, and this is `tiff`");
}

#[test]
fn the_header_tells_of_the_arrays_and_not_of_people() {
    let about = read_zarr(&fixture("ome_04.zip"), &Choice::default()).expect("valid").about;
    let (shown, withheld) = about.without_identity();
    for (name, value) in [("zarr_format", "2"), ("axes", "t, c, z, y, x"), ("level", "0 of 0 to 1")] {
        assert!(shown.contains(&&(name.to_owned(), value.to_owned())), "{name}: {shown:?}");
    }
    // Negative control: the name is there for those who may see it.
    assert!(!format!("{shown:?}").contains("Jane"));
    assert!(withheld == 1 && format!("{:?}", about.header).contains("Jane Doe"));
}
