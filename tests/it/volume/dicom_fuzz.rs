//! DICOM files that nobody would write: refused or read, never a panic.

use proptest::prelude::*;
use spao_server::volume::{Choice, Format, Limits, format};

use super::dicom::{fixture, tar, unzipped};

fn read(bytes: &[u8]) -> Result<(), TestCaseError> {
    let limits = Limits { max_axis: 64, max_voxels: 4096, max_bytes: 1 << 16 };
    match format::read_chosen(bytes, Format::Dicom, None, &Choice::default(), &limits) {
        Ok(volume) => {
            prop_assert_eq!(volume.grid.voxel_count(), volume.voxels.len() as u64);
            prop_assert!(volume.grid.check().is_ok());
        }
        Err(error) => prop_assert!(!error.field().is_empty() && error.to_string().len() < 2000, "{}", error),
    }
    Ok(())
}

/// Files of every syntax, and archives of them.
fn files() -> Vec<Vec<u8>> {
    let mut files: Vec<Vec<u8>> =
        ["frames.dcm", "frames_rle.dcm", "dose.dcm", "several.zip", "gap.zip", "deflated.zip"].map(fixture).into();
    for name in ["implicit.zip", "big_endian.zip", "rle.zip", "jpeg.zip", "jpeg_lossless.zip", "jpeg2000.zip"] {
        let unzipped = unzipped(name);
        let named: Vec<(&str, &[u8])> = unzipped.iter().map(|(name, bytes)| (name.as_str(), &bytes[..])).collect();
        files.push(tar(&named));
        files.push(unzipped[1].1.clone());
    }
    files
}

/// A few bytes to change, and where the file ends.
fn damage() -> impl Strategy<Value = (usize, Vec<(f64, u8)>, Option<f64>)> {
    let change = (0.0..1.0, prop_oneof![any::<u8>(), prop::sample::select(vec![0, 1, 0x7F, 0x80, 0xFF])]);
    (any::<usize>(), prop::collection::vec(change, 1..6), prop::option::weighted(0.2, 0.0..1.0))
}

proptest! {
    #![proptest_config(super::seeded(1500))]

    #[test]
    fn any_dicom_with_changed_bytes_is_read_or_refused((which, changes, end) in damage()) {
        let files = files();
        let mut file = files[which % files.len()].clone();
        for (at, byte) in changes {
            let at = (at * file.len() as f64) as usize;
            file[at] = byte;
        }
        if let Some(end) = end {
            file.truncate((end * file.len() as f64) as usize);
        }
        read(&file)?;
    }

    #[test]
    fn any_bytes_after_a_dicom_preamble_are_read_or_refused(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let meta = b"\x02\x00\x10\x00UI\x12\x001.2.840.10008.1.2\0";
        read(&[&[0; 128][..], b"DICM", &bytes].concat())?;
        read(&[&[0; 128][..], b"DICM", meta, &bytes].concat())?;
        read(&[b"PK\x03\x04", &bytes[..]].concat())?;
    }
}
