//! DICOM series and frames against what pydicom reads from the same files (`tests/data/dicom/make.py`).

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};

use glam::DVec3;
use serde_json::Value;
use spao_server::volume::{Choice, Format, Limits, Volume, VolumeError, format};

use super::assert_names;

/// Where the fixtures are.
pub(super) fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/dicom")
}

/// Bytes of a fixture.
pub(super) fn fixture(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).expect("the fixture is there")
}

/// Reads an uploaded DICOM file or archive.
pub(super) fn read_dicom(bytes: &[u8], series: Option<&str>) -> Result<Volume, VolumeError> {
    let choice = Choice { series: series.map(str::to_owned), ..Choice::default() };
    format::read_chosen(bytes, Format::Dicom, None, &choice, &Limits::default())
}

/// A tar archive of files.
pub(super) fn tar(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = tar::Builder::new(Vec::new());
    for (name, bytes) in files {
        let mut header = tar::Header::new_ustar();
        header.set_size(bytes.len() as u64);
        header.set_mode(0o644);
        // Not `set_path`, which refuses what is to be refused here.
        header.as_mut_bytes()[..name.len()].copy_from_slice(name.as_bytes());
        header.set_cksum();
        archive.append(&header, *bytes).expect("memory is written");
    }
    archive.into_inner().expect("memory is written")
}

/// The files of a zip fixture.
pub(super) fn unzipped(name: &str) -> Vec<(String, Vec<u8>)> {
    let mut archive = zip::ZipArchive::new(std::io::Cursor::new(fixture(name))).expect("a zip");
    let mut files = Vec::new();
    for index in 0..archive.len() {
        let mut file = archive.by_index(index).expect("a file");
        let mut bytes = Vec::new();
        std::io::copy(&mut file, &mut bytes).expect("it is whole");
        files.push((file.name().expect("a name").into_owned(), bytes));
    }
    files
}

fn numbers(json: &Value) -> Vec<f64> {
    json.as_array().expect("an array").iter().map(|v| v.as_f64().expect("a number")).collect()
}

fn vector(json: &Value) -> DVec3 {
    DVec3::from_slice(&numbers(json))
}

/// Every value of a volume within `tolerance` of the independent reader's, and its geometry.
#[track_caller]
fn assert_as_expected(volume: &Volume, expected: &Value, tolerance: f64) {
    let grid = &volume.grid;
    assert_eq!(volume.voxels.voxel_type().name(), expected["type"], "type");
    assert_eq!(grid.dims.map(f64::from).to_vec(), numbers(&expected["dims"]), "dims");
    assert!(grid.origin.distance(vector(&expected["origin"])) < 1e-9, "origin {}", grid.origin);
    assert!(grid.spacing.distance(vector(&expected["spacing"])) < 1e-9, "spacing {}", grid.spacing);
    for (axis, direction) in grid.direction.iter().enumerate() {
        assert!(direction.distance(vector(&expected["direction"][axis])) < 1e-9, "direction {axis} {direction}");
    }
    for (index, value) in numbers(&expected["voxels"]).into_iter().enumerate() {
        let read = volume.voxels.value(index);
        assert!((read - value).abs() <= tolerance, "voxel {index} is {read}, expected {value}");
    }
}

fn expected() -> Value {
    serde_json::from_slice(&fixture("expected.json")).expect("JSON")
}

#[test]
fn every_transfer_syntax_and_value_type_is_read_as_pydicom_reads_it() {
    let expected = expected();
    let cases = expected.as_object().expect("an object");
    assert!(cases.len() >= 26, "{}", cases.len());
    for (name, expected) in cases {
        println!("{name}");
        let volume = read_dicom(&fixture(name), None).unwrap_or_else(|error| panic!("{name}: {error}"));
        // Decoders of lossy pictures may differ by one.
        assert_as_expected(
            &volume,
            expected,
            if matches!(name.as_str(), "jpeg.zip" | "jpeg2000_lossy.zip") { 1.0 } else { 0.0 },
        );
        assert!(volume.about.patient_axes, "{name}");
        let peeked = format::peek_path(name, &folder(), None).expect("headers are enough");
        assert_eq!(peeked.dims, volume.grid.dims);
        assert_eq!(peeked.spacing, Some(volume.grid.spacing.to_array()), "{name}");
        // 16 bits with an intercept rarely need more than 16 bits, which only the voxels tell.
        assert!(peeked.voxel_type == volume.voxels.voxel_type() || name == "wide.zip", "{name}: {peeked:?}");
    }
}

#[test]
#[should_panic(expected = "voxel 7 is")]
fn the_comparison_notices_one_voxel() {
    let mut expected = expected()["explicit.zip"].clone();
    expected["voxels"][7] = (expected["voxels"][7].as_f64().expect("a number") + 1.0).into();
    assert_as_expected(&read_dicom(&fixture("explicit.zip"), None).expect("valid"), &expected, 0.0);
}

#[test]
#[should_panic(expected = "direction 2")]
fn the_comparison_notices_a_flipped_axis() {
    let mut expected = expected()["explicit.zip"].clone();
    expected["direction"][2] = serde_json::json!([0.0, 0.0, -1.0]);
    assert_as_expected(&read_dicom(&fixture("explicit.zip"), None).expect("valid"), &expected, 0.0);
}

#[test]
fn zip_tar_gzipped_tar_and_folder_hold_the_same_volume() {
    let expected = read_dicom(&fixture("explicit.zip"), None).expect("valid");
    let files = unzipped("explicit.zip");
    let named: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (name.as_str(), bytes.as_slice())).collect();
    let tar = tar(&named);
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::default());
    gzip.write_all(&tar).expect("memory is written");
    let gzip = gzip.finish().expect("memory is written");
    let directory = tempfile::tempdir().expect("a directory");
    for (name, bytes) in &files {
        let path = directory.path().join("study").join(name);
        fs::create_dir_all(path.parent().expect("a parent")).expect("a directory");
        fs::write(path, bytes).expect("written");
    }
    fs::write(directory.path().join("study.tar.gz"), &gzip).expect("written");

    for bytes in [&tar, &gzip] {
        assert_eq!(Format::detect(None, None, bytes).expect("recognised"), Format::Dicom);
        let volume = read_dicom(bytes, None).expect("valid");
        assert_eq!(volume.sha256_hex(), expected.sha256_hex());
    }
    for path in ["study", "study.tar.gz"] {
        let volume = format::load_path(path, directory.path(), None, &Limits::default()).expect("valid");
        assert_eq!(volume.sha256_hex(), expected.sha256_hex(), "{path}");
        assert_eq!(volume.about.notes, ["Files that are not DICOM were passed over: 1."]);
    }
}

#[cfg(unix)]
#[test]
fn links_in_folders_and_archives_are_passed_over() {
    let directory = tempfile::tempdir().expect("a directory");
    let (inside, outside) = (directory.path().join("study"), directory.path().join("elsewhere"));
    fs::create_dir_all(&inside).expect("a directory");
    fs::create_dir_all(&outside).expect("a directory");
    fs::write(outside.join("a.dcm"), fixture("frames.dcm")).expect("written");
    std::os::unix::fs::symlink(outside.join("a.dcm"), inside.join("a.dcm")).expect("a link");
    std::os::unix::fs::symlink(&outside, inside.join("more")).expect("a link");
    std::os::unix::fs::symlink(&inside, inside.join("endless")).expect("a link");
    let load = format::load_path("study", directory.path(), None, &Limits::default());
    assert_names(load, "path", "no DICOM pictures");

    let mut archive = tar::Builder::new(Vec::new());
    let mut header = tar::Header::new_ustar();
    header.set_entry_type(tar::EntryType::Symlink);
    header.set_size(0);
    archive.append_link(&mut header, "a.dcm", "/etc/passwd").expect("memory is written");
    let bytes = archive.into_inner().expect("memory is written");
    assert_names(read_dicom(&bytes, None), "archive", "no DICOM pictures");
}

#[test]
fn several_series_are_listed_and_one_is_chosen() {
    let bytes = fixture("several.zip");
    let all = "series=1 (CT `Series 1 of Secret`, 1 slice), series=4 (CT `Series 4 of Secret`, 3 slices), \
               series=5 (CT `Series 5 of Secret`, 4 slices)";
    assert_names(read_dicom(&bytes, None), "series", all);
    assert_names(read_dicom(&bytes, Some("6")), "series", "`6` is none of the series here");
    assert_names(read_dicom(&bytes, Some("")), "series", "none of the series");
    for (choice, slices) in [("4", 3), ("1.2.826.0.1.3680043.8.498.77.5", 4), ("77.5", 4), ("1", 1)] {
        assert_eq!(read_dicom(&bytes, Some(choice)).expect(choice).grid.dims, [5, 4, slices], "{choice}");
    }
    assert_eq!(read_dicom(&bytes, Some("4")).expect("valid").voxels.value(0), 40.0);
}

#[test]
fn series_of_one_number_are_told_apart_by_their_identifiers() {
    let mut files = unzipped("several.zip");
    for (_, bytes) in &mut files {
        let number = b"\x20\x00\x11\x00IS\x02\x005 ";
        if let Some(at) = bytes.windows(number.len()).position(|part| part == number) {
            bytes[at + number.len() - 2] = b'4';
        }
    }
    let named: Vec<(&str, &[u8])> = files.iter().map(|(name, bytes)| (name.as_str(), &bytes[..])).collect();
    let bytes = tar(&named);
    assert_names(read_dicom(&bytes, None), "series", "series=77.4 (CT `Series 4 of Secret`, 3 slices), series=5 (CT");
    assert_names(read_dicom(&bytes, Some("4")), "series", "`4` is more than one of the series here");
    assert_eq!(read_dicom(&bytes, Some("77.4")).expect("valid").grid.dims, [5, 4, 3]);
    assert_eq!(read_dicom(&bytes, Some("5")).expect("valid").grid.dims, [5, 4, 4]);
}

#[test]
fn a_localizer_beside_the_volume_is_passed_over_and_noted() {
    let volume = read_dicom(&fixture("localizer.zip"), None).expect("valid");
    assert_eq!(volume.grid.dims, [5, 4, 3]);
    let note = "Other series were passed over: series=1 (CT, 1 slice).";
    assert_eq!(volume.about.notes, [note]);
    assert_eq!(read_dicom(&fixture("localizer.zip"), Some("1")).expect("valid").grid.dims, [5, 4, 1]);
}

#[test]
fn gaps_tilts_and_inverted_values_are_noted() {
    let notes = |name: &str| read_dicom(&fixture(name), None).expect("valid").about.notes.join(" ");
    let gap = notes("gap.zip");
    assert!(gap.contains("between 1.000 and 2.000 mm apart. 1 slice seems to be missing."), "{gap}");
    assert!(gap.contains("1.250 mm apart, so that a slice may be 0.500 mm from"), "{gap}");
    let tilted = notes("tilted.zip");
    assert!(tilted.contains("sideways by 26.6 degrees"), "{tilted}");
    assert!(notes("low_is_bright.zip").contains("MONOCHROME1"));
    assert_eq!(notes("explicit.zip"), "Files that are not DICOM were passed over: 1.");
}

#[test]
fn the_header_tells_of_the_picture_and_not_of_the_patient() {
    const SECRETS: [&str; 7] = ["secret", "physician", "hospital", "access", "1970", "1999", "1.2.826"];
    for name in ["explicit.zip", "implicit.zip", "frames.dcm"] {
        let about = read_dicom(&fixture(name), None).expect("valid").about;
        let (shown, withheld) = about.without_identity();
        let text = format!("{shown:?}").to_lowercase();
        for secret in SECRETS {
            assert!(!text.contains(secret), "{name} shows {secret}: {text}");
        }
        for (keyword, value) in [("Modality", "CT"), ("Manufacturer", "Maker"), ("Rows", "4"), ("Columns", "5")] {
            let expected = (keyword.to_owned(), value.to_owned());
            assert!(shown.contains(&&expected), "{name} lacks {keyword}: {shown:?}");
        }
        for keyword in ["SliceThickness", "PixelSpacing", "BitsStored"] {
            let expected = name != "frames.dcm" || keyword == "BitsStored";
            let is_shown = shown.iter().any(|(name, _)| name == keyword);
            assert!(is_shown || !expected, "{name} lacks {keyword}: {shown:?}");
        }
        // Negative control: what is withheld is there, for those who may know the patient.
        let text = format!("{:?}", about.header).to_lowercase();
        assert!(withheld >= SECRETS.len() && SECRETS.iter().all(|secret| text.contains(secret)), "{name}: {text}");
    }
}
