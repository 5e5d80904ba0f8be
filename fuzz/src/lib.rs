//! What every fuzz target asserts: a file is read within the limits, or refused with a field and a reason.

// Not as a dependency on the server: its GPU and HTTP stacks would be compiled and instrumented for nothing.
#[allow(dead_code, unused_imports)]
#[path = "../../src/volume/mod.rs"]
mod volume;

use std::alloc::System;
use std::io::Write;

use cap::Cap;
pub use volume::Format;
use volume::{Choice, Limits, Volume, VolumeError, format};

/// Beyond this, reading aborts. The limits below would do with less than a MiB, but an XML header may have 16 MiB, a
/// Zstandard frame a window of 100 MiB, and an entry of a TIFF's first page claim 256 MiB.
const MOST_MEMORY: usize = 300 << 20;

#[global_allocator]
static MEMORY: Cap<System> = Cap::new(System, MOST_MEMORY);

/// Small, so that files are too large as often as they are read.
const LIMITS: Limits = Limits { max_axis: 64, max_voxels: 1 << 14, max_bytes: 1 << 16 };

/// Reads a file of the format.
pub fn check(format: Format, bytes: &[u8]) {
    let read = |choice: &Choice| format::read_chosen(bytes, format, None, choice, &LIMITS);
    let result = read(&Choice::default());
    // Beyond the refusal to choose there is more to read.
    if let (Format::Dicom, Err(error)) = (format, &result)
        && error.field() == "series"
    {
        assert_sound(read(&Choice { series: Some("1".to_owned()), ..Choice::default() }));
    }
    if let (Format::Tiff | Format::Zarr, Ok(_)) = (format, &result) {
        assert_sound(read(&Choice { channel: Some(1), ..Choice::default() }));
    }
    if let (Format::Zarr, Ok(_)) = (format, &result) {
        assert_sound(read(&Choice { scale: Some(1), ..Choice::default() }));
    }
    assert_sound(result);
}

/// Reads a file as an upload of which nothing is known.
pub fn check_detected(bytes: &[u8]) {
    match Format::detect(None, None, bytes) {
        Ok(format) => check(format, bytes),
        Err(error) => assert_explained(&error),
    }
}

/// Reads a header and its data from a zip; the first byte says where in the others the data begin.
pub fn check_packed(bytes: &[u8]) {
    let Some((&at, bytes)) = bytes.split_first() else { return };
    let (header, data) = bytes.split_at(bytes.len().min(2 * usize::from(at)));
    for header_name in ["h.nhdr", "a/h.mhd"] {
        let mut archive = zip::ZipWriter::new(std::io::Cursor::new(Vec::new()));
        let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
        for (name, bytes) in [(header_name, header), ("d.raw", data), ("a/d.raw", data)] {
            archive.start_file(name, options).expect("to memory");
            archive.write_all(bytes).expect("to memory");
        }
        check_detected(&archive.finish().expect("to memory").into_inner());
    }
}

fn assert_sound(result: Result<Volume, VolumeError>) {
    let volume = match result {
        Ok(volume) => volume,
        Err(error) => return assert_explained(&error),
    };
    let count = volume.grid.voxel_count();
    assert_eq!(count, volume.voxels.len() as u64);
    LIMITS.check("dims", volume.grid.dims, volume.voxels.voxel_type()).expect("within the limits");
    volume.grid.check().expect("a sound grid");
    assert!(volume.grid.index_from_world().is_finite());
    let [lowest, highest] = volume.code_map.value_range();
    assert!(lowest.is_finite() && highest.is_finite() && lowest <= highest, "{lowest} to {highest}");
    assert!(volume.nan_count < count);
    assert!(volume.code_map.step.is_finite() && volume.code_map.step > 0.0, "step {}", volume.code_map.step);
    for index in 0..volume.voxels.len() {
        let value = volume.voxels.value(index);
        assert!(value.is_nan() || (lowest..=highest).contains(&value), "{value} in {lowest} to {highest}");
    }
    assert_eq!(volume.sha256_hex().len(), 64);
}

fn assert_explained(error: &VolumeError) {
    // The bytes are in memory: whatever is wrong is the file's fault and not the system's.
    assert!(!matches!(error, VolumeError::Io { .. }), "{error}");
    let message = error.to_string();
    assert!(!error.field().is_empty() && message.len() > error.field().len() + 2, "{message}");
    assert!(message.len() < 2000, "a message of {} bytes", message.len());
    assert!(!message.contains(|c: char| c.is_control()), "{message:?}");
}
