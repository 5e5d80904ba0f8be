//! Files that other libraries wrote, against what other libraries read in them: `fixtures/make.py` made both.

use std::path::{Path, PathBuf};

use glam::DVec3;
use serde::Deserialize;
use sha2::{Digest, Sha256};
use spao_server::volume::{Format, Limits, Volume, format};

use super::makers::zip_of;

/// What the independent reader says of a file.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct Expected {
    pub(crate) file: String,
    dims: [u32; 3],
    #[serde(rename = "type")]
    voxel_type: String,
    spacing: [f64; 3],
    origin: [f64; 3],
    direction: [[f64; 3]; 3],
    sha256: String,
    patient_axes: bool,
}

pub(crate) fn directory() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/it/volume/fixtures/files")
}

pub(crate) fn expected() -> Vec<Expected> {
    let text = std::fs::read_to_string(directory().join("../expected.json")).expect("it is committed");
    serde_json::from_str(&text).expect("make.py wrote it")
}

pub(crate) fn bytes_of(file: &str) -> Vec<u8> {
    std::fs::read(directory().join(file)).expect("a file of the fixtures")
}

/// Where a volume is not what the independent reader says.
pub(crate) fn differences(volume: &Volume, expected: &Expected) -> Vec<String> {
    // Angles and lengths of a few hundred: single precision, in which NIfTI-1 has them, would show.
    let near = |a: DVec3, b: [f64; 3]| (a - DVec3::from_array(b)).abs().max_element() <= 1e-9 * (1.0 + a.length());
    let grid = &volume.grid;
    let sum: String =
        Sha256::digest(volume.voxels.little_endian_bytes()).iter().map(|byte| format!("{byte:02x}")).collect();
    let checks = [
        ("dims", grid.dims == expected.dims),
        ("type", volume.voxels.voxel_type().name() == expected.voxel_type),
        ("spacing", near(grid.spacing, expected.spacing)),
        ("origin", near(grid.origin, expected.origin)),
        ("direction", grid.direction.iter().zip(expected.direction).all(|(a, b)| near(*a, b))),
        ("voxels", sum == expected.sha256),
        ("patient_axes", volume.about.patient_axes == expected.patient_axes),
    ];
    let wrong = checks.into_iter().filter(|(_, right)| !right);
    wrong.map(|(what, _)| format!("{}: {what}: {grid:?} instead of {expected:?}", expected.file)).collect()
}

#[test]
fn files_of_other_libraries_are_read_as_other_libraries_read_them() {
    let limits = Limits::default();
    let mut faults = Vec::new();
    for expected in expected() {
        match format::load_path(&expected.file, &directory(), None, &limits) {
            Ok(volume) => {
                faults.extend(differences(&volume, &expected));
                let peeked = format::peek_path(&expected.file, &directory(), None).expect("it was read");
                assert_eq!((peeked.dims, peeked.voxel_type), (volume.grid.dims, volume.voxels.voxel_type()));
                let is_array = expected.file.starts_with("np");
                let spacing = (!is_array).then(|| volume.grid.spacing.to_array());
                assert_eq!(peeked.spacing, spacing, "{}", expected.file);
            }
            Err(error) => faults.push(format!("{}: {error}", expected.file)),
        }
    }
    assert!(faults.is_empty(), "{faults:#?}");
}

#[test]
fn uploads_are_recognised_by_their_bytes_and_read_the_same() {
    let mut beside = 0;
    for expected in expected() {
        let bytes = bytes_of(&expected.file);
        let format = Format::detect(None, Some("application/octet-stream"), &bytes).expect(&expected.file);
        if expected.file.ends_with(".mhd") {
            let error = format::read_bytes(&bytes, format, None, &Limits::default()).expect_err("data elsewhere");
            assert!(error.to_string().contains("upload both in one zip or tar"), "{error}");
            let text = String::from_utf8_lossy(&bytes);
            let data = text.lines().find_map(|line| line.strip_prefix("ElementDataFile = ")).expect("named");
            let both = zip_of(&[(&expected.file, &bytes), (data, &bytes_of(data))]);
            let format = Format::detect(None, None, &both).expect(&expected.file);
            let volume = format::read_bytes(&both, format, None, &Limits::default()).expect(&expected.file);
            assert_eq!(differences(&volume, &expected), [""; 0]);
            beside += 1;
            continue;
        }
        let volume = format::read_bytes(&bytes, format, None, &Limits::default()).expect(&expected.file);
        assert_eq!(differences(&volume, &expected), [""; 0]);
    }
    assert_eq!(beside, 4);
}

#[test]
fn every_format_with_a_header_has_files_of_other_libraries() {
    let found: Vec<_> =
        expected().iter().map(|e| Format::detect(None, None, &bytes_of(&e.file)).expect("read")).collect();
    for format in [Format::Nrrd, Format::Nifti, Format::MetaImage, Format::Npy, Format::Npz, Format::Vti] {
        assert!(found.iter().filter(|f| **f == format).count() >= 2, "{}", format.name());
    }
}

#[test]
fn the_comparison_notices_every_difference() {
    let expected = expected().into_iter().find(|e| e.file == "nifti1_sform.nii").expect("a file of the fixtures");
    let volume = format::load_path(&expected.file, &directory(), None, &Limits::default()).expect("valid");
    assert_eq!(differences(&volume, &expected), [""; 0]);
    let perturbed = |change: &dyn Fn(&mut Expected)| {
        let mut other = expected.clone();
        change(&mut other);
        differences(&volume, &other).len()
    };
    assert_eq!(perturbed(&|e| e.dims.swap(0, 1)), 1);
    assert_eq!(perturbed(&|e| e.voxel_type = "u16".into()), 1);
    assert_eq!(perturbed(&|e| e.spacing[1] += 1e-6), 1);
    assert_eq!(perturbed(&|e| e.origin[0] *= -1.0), 1);
    assert_eq!(perturbed(&|e| e.direction.swap(0, 1)), 1);
    assert_eq!(perturbed(&|e| e.sha256.replace_range(..1, "_")), 1);
    assert_eq!(perturbed(&|e| e.patient_axes = false), 1);
}

#[test]
fn headers_are_kept_as_text() {
    let header_of =
        |file: &str| format::load_path(file, &directory(), None, &Limits::default()).expect("valid").about.header;
    let cases = [
        ("nifti1_sform.nii", "sform_code", "2"),
        ("nifti2_qform.nii", "version", "NIfTI-2"),
        ("meta_i16.mha", "ElementType", "MET_SHORT"),
        ("npy_fortran.npy", "fortran_order", "True"),
        ("npz_deflated.npz", "array", "array"),
        ("vti_inline.vti", "DataArray Name", "density"),
        ("nrrd_right-anterior-superior.nrrd", "space", "right-anterior-superior"),
        ("nrrd_right-anterior-superior.nrrd", "a key", "a value"),
    ];
    for (file, name, value) in cases {
        let header = header_of(file);
        assert!(header.contains(&(name.to_owned(), value.to_owned())), "{file}: {header:?}");
    }
}
