//! Files inside of gzip and Zstandard: streams, checksums, and what unfolds without end.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use ruzstd::encoding::{CompressionLevel, compress_to_vec};
use spao_server::volume::{Endian, Format, Limits, RawSpec, Volume, VolumeError, VoxelType, format};

use super::independent::bytes_of;
use super::nrrd::{bytes_file, gzip};
use super::{assert_names, sample_voxels};

fn zstd(bytes: &[u8]) -> Vec<u8> {
    compress_to_vec(bytes, CompressionLevel::Fastest)
}

/// A frame that decoders skip.
fn skippable(bytes: &[u8]) -> Vec<u8> {
    [&0x184d_2a53_u32.to_le_bytes()[..], &(bytes.len() as u32).to_le_bytes(), bytes].concat()
}

/// Reads an upload of which nothing is known but the bytes.
fn upload(bytes: &[u8], limits: &Limits) -> Result<Volume, VolumeError> {
    format::read_bytes(bytes, Format::detect(None, None, bytes)?, None, limits)
}

/// `head`, then zeros that unfold to `length` bytes from a thousandth of that.
fn gzip_bomb(head: &[u8], length: usize) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(head).expect("to memory");
    let zeros = vec![0; 1 << 20];
    for _ in 0..length >> 20 {
        encoder.write_all(&zeros).expect("to memory");
    }
    encoder.finish().expect("to memory")
}

/// The same, from a thirty-thousandth: a frame whose blocks are a byte and how often it comes (RFC 8878, 3.1.1.2).
fn zstd_bomb(head: &[u8], length: usize) -> Vec<u8> {
    const LONGEST: usize = 1 << 17;
    let block = |kind: usize, size: usize, last: usize| (last | kind << 1 | size << 3).to_le_bytes()[..3].to_vec();
    // A window of 1 MiB; neither a size nor a checksum.
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0, 0x50];
    for piece in head.chunks(LONGEST) {
        frame.extend([&block(0, piece.len(), 0)[..], piece].concat());
    }
    frame.extend([&block(1, LONGEST, 0)[..], &[0]].concat().repeat(length / LONGEST));
    frame.extend(block(0, 0, 1));
    frame
}

#[test]
fn every_format_may_be_wrapped() {
    for file in ["nifti1_sform.nii", "meta_oblique.mha", "npy_fortran.npy", "npz_deflated.npz", "vti_inline_zlib.vti"] {
        let plain = bytes_of(file);
        let expected = upload(&plain, &Limits::default()).expect("valid");
        for wrapped in [gzip(&plain), zstd(&plain)] {
            let volume = upload(&wrapped, &Limits::default()).expect(file);
            assert_eq!(volume.sha256_hex(), expected.sha256_hex(), "{file}");
            assert_eq!(volume.about, expected.about);
        }
    }
    let nrrd = upload(&zstd(&bytes_file("")), &Limits::default()).expect("valid");
    assert_eq!(nrrd.voxels, upload(&bytes_file(""), &Limits::default()).expect("valid").voxels);
}

#[test]
fn members_and_frames_follow_each_other() {
    let plain = bytes_of("nifti1_sform.nii");
    let (a, b) = plain.split_at(400);
    let expected = upload(&plain, &Limits::default()).expect("valid").sha256_hex();
    for wrapped in [
        [gzip(a), gzip(b)].concat(),
        [zstd(a), zstd(b)].concat(),
        [skippable(b"whatever"), zstd(a), skippable(b""), zstd(b)].concat(),
    ] {
        assert_eq!(upload(&wrapped, &Limits::default()).expect("valid").sha256_hex(), expected);
    }
}

#[test]
fn a_damaged_or_short_wrapping_is_noticed() {
    let plain = bytes_of("nifti1_sform.nii");
    let with_checksum = bytes_of("nifti1_zstd.nii.zst");
    for wrapped in [gzip(&plain), with_checksum] {
        assert!(upload(&wrapped, &Limits::default()).is_ok());
        for missing in 1..wrapped.len() - 30 {
            assert!(
                upload(&wrapped[..wrapped.len() - missing], &Limits::default()).is_err(),
                "{missing} bytes missing"
            );
        }
        // The last bytes are, or belong to, the checksum.
        let mut wrong = wrapped.clone();
        let at = wrong.len() - if wrapped.starts_with(&[0x1f]) { 8 } else { 1 };
        wrong[at] ^= 1;
        assert_names(upload(&wrong, &Limits::default()), "data", "corrupt");
    }
}

#[test]
fn a_damaged_wrapping_is_never_the_fault_of_the_system() {
    for file in ["nifti1_sform.nii", "meta_ascii.mha", "meta_compressed.mha", "npz_stored.npz", "vti_ascii.vti"] {
        let wrapped = gzip(&bytes_of(file));
        let format = Format::detect(None, None, &wrapped).expect("valid");
        for at in 10..wrapped.len() {
            let mut damaged = wrapped.clone();
            damaged[at] ^= 0x55;
            let read = format::read_bytes(&damaged, format, None, &Limits::default());
            assert!(!matches!(read, Err(VolumeError::Io { .. })), "byte {at} of {file}: {read:?}");
        }
    }
}

#[test]
fn what_is_compressed_twice_is_told() {
    let twice = gzip(&zstd(&bytes_of("nifti1_sform.nii")));
    assert_names(Format::detect(None, None, &twice), "format", "compressed twice");
    assert_names(Format::detect(None, None, &gzip(b"?")), "format", "not recognised");
    assert_names(Format::detect(None, None, &[0x1f, 0x8b, 8]), "format", "not recognised");
}

#[test]
fn raw_voxels_may_begin_like_a_wrapping() {
    let spec = RawSpec { dims: [2, 3, 4], voxel_type: VoxelType::U16, endian: Endian::Little, spacing: [1.0; 3] };
    let read = |bytes: &[u8]| format::read_bytes(bytes, Format::Raw, Some(&spec), &Limits::default());
    let (expected, plain) = sample_voxels(VoxelType::U16, Endian::Little);
    assert_eq!(read(&gzip(&plain)).expect("valid").voxels, expected);
    assert_eq!(read(&zstd(&plain)).expect("valid").voxels, expected);
    let mut like_gzip = plain.clone();
    like_gzip[..3].copy_from_slice(&[0x1f, 0x8b, 8]);
    assert_eq!(read(&like_gzip).expect("valid").voxels.value(0), f64::from(0x8b1f));
    assert_names(read(&gzip(&[&plain[..], b"x"].concat())), "dims", "there are more");
    assert_names(read(&gzip(&plain[1..])), "data", "truncated");
}

#[test]
fn files_that_unfold_without_end_cost_what_their_headers_say() {
    let limits = Limits::default();
    // A gigabyte each would take seconds if it were unfolded.
    let length = 1 << 30;
    for bomb in [gzip_bomb, zstd_bomb] {
        let nifti = bytes_of("nifti1_i16_little.nii");
        assert_eq!(upload(&bomb(&nifti, length), &limits).expect("what follows is ignored").voxels.len(), 60);
        let meta = bytes_of("meta_i16.mha");
        assert_eq!(upload(&bomb(&meta, length), &limits).expect("what follows is ignored").voxels.len(), 60);
        let npy = bytes_of("npy_i16_little.npy");
        assert_eq!(upload(&bomb(&npy, length), &limits).expect("what follows is ignored").voxels.len(), 60);

        // Headers without end.
        assert_names(upload(&bomb(b"NRRD0005\n", length), &limits), "header", "longer than");
        assert_names(upload(&bomb(b"ObjectType = Image\nComment = ", length), &limits), "header", "longer than");
        let tag = b"<?xml version=\"1.0\"?>\n<VTKFile type=\"ImageData\"><A ";
        assert_names(upload(&bomb(tag, length), &limits), "XML", "more than 16777216 bytes besides the data");
        // An archive is unwrapped whole, and only so far.
        let small = Limits { max_bytes: 1 << 20, ..limits };
        let archive = bytes_of("npz_stored.npz");
        assert_names(upload(&bomb(&archive, 4 << 20), &small), "file", "1048577 bytes needed, the limit is 1048576");
    }
}

#[test]
fn what_comes_before_the_voxels_is_limited() {
    let limits = Limits { max_bytes: 1 << 20, ..Limits::default() };
    let mut far = bytes_of("nifti1_i16_little.nii");
    far[108..112].copy_from_slice(&(2e6_f32).to_le_bytes());
    assert_names(upload(&gzip_bomb(&far, 3 << 20), &limits), "vox_offset", "more than a volume may have");
}
