//! Volumes: voxels, codes, histograms, files and procedural volumes.

mod average;
mod bricks;
mod code_map;
mod dicom;
mod dicom_errors;
mod dicom_fuzz;
mod documents;
mod fixture;
mod format;
mod formats_fuzz;
mod histogram;
mod hostile;
pub(crate) mod independent;
mod jpeg2000;
pub(crate) mod makers;
mod metaimage;
mod nifti;
mod npy;
mod nrrd;
mod nrrd_errors;
mod nrrd_files;
mod nrrd_fuzz;
mod packed;
mod procedural;
mod tiff;
mod voxels;
mod vti;
mod watch;
mod wrapping;
pub(crate) mod zarr;
mod zarr_errors;

use proptest::test_runner::{Config as ProptestConfig, RngSeed};
use spao_server::volume::format::read_bytes;
use spao_server::volume::{Endian, Format, Grid, Limits, Volume, VolumeError, VoxelType, Voxels};

/// A CT head of 128 x 128 x 105 `i16` voxels.
pub(crate) const FIXTURE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/visible-human-head-128.nrrd");

/// A unit grid with the voxels.
fn volume(dims: [u32; 3], voxels: Voxels) -> Volume {
    Volume::new(Grid::axis_aligned(dims, glam::DVec3::ONE), voxels).expect("a valid volume")
}

/// So many cases, the same in every run.
fn seeded(cases: u32) -> ProptestConfig {
    ProptestConfig { failure_persistence: None, rng_seed: RngSeed::Fixed(1), ..ProptestConfig::with_cases(cases) }
}

/// Reads an uploaded NRRD with the default limits.
fn read_nrrd(bytes: &[u8]) -> Result<Volume, VolumeError> {
    read_bytes(bytes, Format::Nrrd, None, &Limits::default())
}

/// Asserts that an error is about a field and says something.
#[track_caller]
fn assert_names<T: std::fmt::Debug>(result: Result<T, VolumeError>, field: &str, says: &str) {
    let error = result.expect_err("an error");
    assert_eq!(error.field(), field, "{error}");
    let message = error.to_string();
    assert!(message.starts_with(field) && message.contains(says), "`{message}` does not say `{says}`");
}

/// Twenty-four voxels of any type that use its whole width, with the bytes of a file of them.
fn sample_voxels(voxel_type: VoxelType, endian: Endian) -> (Voxels, Vec<u8>) {
    macro_rules! sample {
        ($variant:ident, $t:ty, $value:expr) => {{
            let values: Vec<$t> = (0..24_u8).map($value).collect();
            let bytes = values
                .iter()
                .flat_map(|v| match endian {
                    Endian::Little => v.to_le_bytes(),
                    Endian::Big => v.to_be_bytes(),
                })
                .collect();
            (Voxels::$variant(values), bytes)
        }};
    }
    match voxel_type {
        VoxelType::U8 => sample!(U8, u8, |i| i * 11),
        VoxelType::I8 => sample!(I8, i8, |i| (i * 11) as i8),
        VoxelType::U16 => sample!(U16, u16, |i| u16::MAX / 23 * u16::from(i)),
        VoxelType::I16 => sample!(I16, i16, |i| (u16::MAX / 23 * u16::from(i)) as i16),
        VoxelType::U32 => sample!(U32, u32, |i| u32::MAX / 23 * u32::from(i)),
        VoxelType::I32 => sample!(I32, i32, |i| (u32::MAX / 23 * u32::from(i)) as i32),
        VoxelType::U64 => sample!(U64, u64, |i| u64::MAX / 23 * u64::from(i)),
        VoxelType::I64 => sample!(I64, i64, |i| (u64::MAX / 23 * u64::from(i)) as i64),
        VoxelType::F32 => sample!(F32, f32, |i| (f32::from(i) - 7.3) * 1.7e3),
        VoxelType::F64 => sample!(F64, f64, |i| (f64::from(i) - 7.3) * 1.7e3),
    }
}

#[test]
#[should_panic(expected = "does not say")]
fn the_error_helper_notices_another_message() {
    assert_names::<()>(Err(VolumeError::Malformed { field: "sizes".into(), message: "one".into() }), "sizes", "two");
}

#[test]
#[should_panic(expected = "assertion `left == right` failed")]
fn the_error_helper_notices_another_field() {
    assert_names::<()>(Err(VolumeError::Malformed { field: "sizes".into(), message: "one".into() }), "type", "one");
}
