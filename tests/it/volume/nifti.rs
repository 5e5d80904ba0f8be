//! NIfTI headers that are refused, or read as nibabel reads them; [`super::independent`] has the files that are read.

use spao_server::volume::{Format, Limits, Volume, VolumeError, Voxels, format};

use super::assert_names;
use super::independent::{bytes_of, directory};

fn read(bytes: &[u8]) -> Result<Volume, VolumeError> {
    format::read_bytes(bytes, Format::Nifti, None, &Limits::default())
}

/// A valid file of version 1 with other bytes at an offset.
fn with(at: usize, bytes: &[u8]) -> Vec<u8> {
    let mut file = bytes_of("nifti1_sform.nii");
    file[at..at + bytes.len()].copy_from_slice(bytes);
    file
}

fn shorts(numbers: &[i16]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

fn floats(numbers: &[f32]) -> Vec<u8> {
    numbers.iter().flat_map(|n| n.to_le_bytes()).collect()
}

const DIM: usize = 40;
const DATATYPE: usize = 70;
const PIXDIM: usize = 76;
const VOX_OFFSET: usize = 108;
const SLOPE: usize = 112;
const UNITS: usize = 123;
const QFORM_CODE: usize = 252;
const QUATERNION: usize = 256;
const SROW: usize = 280;
const MAGIC: usize = 344;

#[test]
fn the_file_that_these_tests_spoil_is_valid() {
    assert!(read(&with(DIM, &shorts(&[3, 5, 4, 3]))).is_ok());
    assert!(read(&with(VOX_OFFSET, &floats(&[0.0]))).is_ok());
}

#[test]
fn a_header_that_is_none_is_refused() {
    assert_names(read(b""), "sizeof_hdr", "not a NIfTI file");
    assert_names(read(&[7; 400]), "sizeof_hdr", "neither 348 nor 540");
    assert_names(read(&bytes_of("nifti1_sform.nii")[..347]), "header", "truncated");
    assert_names(read(&bytes_of("nifti2_qform.nii")[..539]), "header", "truncated");
    assert_names(read(&with(MAGIC, b"ni1\0")), "magic", "a pair of .hdr and .img files");
    assert_names(read(&with(MAGIC, b"\0\0\0\0")), "magic", "ANALYZE");
    assert_names(read(&with(MAGIC, b"n+3\0")), "magic", "damaged");
}

#[test]
fn a_pair_of_files_is_refused_by_either_name() {
    let root = tempfile::tempdir().expect("a directory");
    std::fs::write(root.path().join("a.hdr"), with(MAGIC, b"ni1\0")).expect("written");
    std::fs::write(root.path().join("a.img"), [9; 120]).expect("written");
    let load = |name| format::load_path(name, root.path(), None, &Limits::default());
    assert_names(load("a.hdr"), "magic", "join them in one .nii file");
    assert_names(load("a.img"), "sizeof_hdr", "join it with its .hdr");
}

#[test]
fn sizes_are_three_and_positive() {
    assert_names(read(&with(DIM, &shorts(&[2]))), "dim", "a picture and not a volume");
    assert_names(read(&with(DIM, &shorts(&[0]))), "dim", "0 axes");
    assert_names(read(&with(DIM, &shorts(&[8]))), "dim", "8 axes");
    assert_names(read(&with(DIM, &shorts(&[-3]))), "dim", "-3 axes");
    assert_names(read(&with(DIM, &shorts(&[3, 5, 0, 3]))), "dim", "0 is not a size");
    assert_names(read(&with(DIM, &shorts(&[3, 5, -4, 3]))), "dim", "-4 is not a size");
    assert_names(read(&with(DIM, &shorts(&[4, 5, 4, 3, 20]))), "dim", "20 volumes in one file");
    assert_names(read(&with(DIM, &shorts(&[5, 5, 4, 3, 1, 3]))), "dim", "3 volumes in one file");
    assert_names(read(&with(DIM, &shorts(&[3, 32767, 4, 3]))), "dim", "the limit is 4096");
    assert_names(read(&with(DIM, &shorts(&[3, 5, 4, 4]))), "data", "truncated: expected 160 bytes, got 120");
    let mut second = bytes_of("nifti2_qform.nii");
    second[24..32].copy_from_slice(&i64::MAX.to_le_bytes());
    assert_names(read(&second), "dim", "9223372036854775807");
}

#[test]
fn only_numbers_are_voxels() {
    for (code, name) in [(1, "single bits"), (32, "complex"), (128, "colours"), (1536, "128-bit"), (2304, "colours")] {
        assert_names(read(&with(DATATYPE, &shorts(&[code]))), "datatype", name);
    }
    assert_names(read(&with(DATATYPE, &shorts(&[3]))), "datatype", "3 is not a type");
}

#[test]
fn offsets_units_and_scales_are_checked() {
    for offset in [f32::NAN, f32::INFINITY, -1.0, 351.0] {
        assert_names(read(&with(VOX_OFFSET, &floats(&[offset]))), "vox_offset", "expected 352 or more");
    }
    assert_names(read(&with(VOX_OFFSET, &floats(&[1e6]))), "data", "truncated");
    assert_names(read(&with(UNITS, &[5])), "xyzt_units", "5 is not a unit");
    assert_names(read(&with(SLOPE, &floats(&[2.0, f32::NAN]))), "scl_inter", "NaN");
    assert_names(read(&with(SLOPE, &floats(&[f32::MAX, f32::MAX]))), "voxels", "infinite");
    // A slope of NaN or 0 means none, and the intercept nothing.
    for slope in [0.0, f32::NAN, f32::INFINITY] {
        let volume = read(&with(SLOPE, &floats(&[slope, f32::NAN]))).expect("valid");
        assert!(matches!(volume.voxels, Voxels::I16(_)));
    }
}

#[test]
fn a_world_that_cannot_be_is_refused() {
    for wrong in [f32::NAN, f32::INFINITY, 1e30] {
        assert!(read(&with(SROW, &floats(&[wrong]))).is_err(), "{wrong}");
        assert!(read(&with(SROW + 12, &floats(&[wrong]))).is_err(), "{wrong}");
    }
    assert_names(read(&with(SROW, &[0; 48])), "srow", "0 is not a spacing");
    assert_names(read(&with(SROW, &floats(&[1.0, 1.0, 0.0, 0.0, 1.0, 1.0]))), "srow", "one plane");
    // Only the qform is left.
    let turned = |at: usize, numbers: &[f32]| {
        let mut file = with(QFORM_CODE, &shorts(&[1, 0]));
        file[at..at + 4 * numbers.len()].copy_from_slice(&floats(numbers));
        read(&file)
    };
    assert!(turned(QUATERNION, &[0.0, 0.0, 1.0]).is_ok());
    assert_names(turned(QUATERNION, &[0.0, 0.5, 1.0]), "quatern", "longer than a unit quaternion");
    assert_names(turned(QUATERNION, &[f32::NAN, 0.0, 0.0]), "quatern", "NaN");
    assert_names(turned(PIXDIM + 4, &[f32::NAN]), "pixdim", "NaN");
    assert_names(turned(PIXDIM + 4, &[f32::INFINITY]), "pixdim", "inf");
    let volume = turned(PIXDIM + 4, &[-2.0, 0.0, 3.0]).expect("read as nibabel does");
    assert_eq!(volume.grid.spacing.to_array(), [2.0, 1.0, 3.0]);
    assert!(volume.about.notes.iter().any(|note| note.contains("negative ones are taken as positive")));
}

#[test]
fn voxels_that_are_not_numbers_are_counted() {
    let mut file = bytes_of("nifti1_f32_little.nii");
    let first = file.len() - 240;
    file[first..first + 8].copy_from_slice(&floats(&[f32::NAN, f32::NAN]));
    let two = read(&file).expect("valid");
    assert_eq!(two.about.notes, ["2 voxels are NaN and shown as the lowest value"]);
    file[first..first + 4].copy_from_slice(&floats(&[1.0]));
    assert_eq!(read(&file).expect("valid").about.notes, ["1 voxel is NaN and shown as the lowest value"]);
    let none = format::load_path("nifti1_f32_little.nii", &directory(), None, &Limits::default()).expect("valid");
    assert_eq!(none.about.notes, [""; 0]);
    let unknown =
        format::load_path("nifti1_no_orientation.nii", &directory(), None, &Limits::default()).expect("valid");
    assert!(unknown.about.notes[0].contains("does not say how the volume lies"));
}
