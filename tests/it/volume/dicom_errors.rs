//! DICOM that is not read says why.

use std::io::{Cursor, Write};

use spao_server::volume::{Choice, Format, Limits, Volume, VolumeError, format};
use zip::write::SimpleFileOptions;

use super::assert_names;
use super::dicom::{fixture, read_dicom, tar, unzipped};

fn zip(files: &[(&str, &[u8])]) -> Vec<u8> {
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        archive.start_file(*name, SimpleFileOptions::default()).expect("memory is written");
        archive.write_all(bytes).expect("memory is written");
    }
    archive.finish().expect("memory is written").into_inner()
}

fn within(bytes: &[u8], limits: Limits) -> Result<Volume, VolumeError> {
    format::read_chosen(bytes, Format::Dicom, None, &Choice::default(), &limits)
}

#[test]
fn pictures_that_are_not_read_are_refused_by_what_they_are() {
    let refused = |name: &str, field: &str, says: &str| assert_names(read_dicom(&fixture(name), None), field, says);
    refused("colour.dcm", "PhotometricInterpretation", "`RGB` is a colour picture; expected one of grey values");
    refused("bits.dcm", "BitsAllocated", "voxels of 1 bits are not read; expected 8, 16 or 32");
    refused("no_picture.dcm", "PixelData", "missing; the file holds no picture");
    refused("jpeg_ls.dcm", "TransferSyntaxUID", "packed with JPEG-LS are not read; expected uncompressed");
}

#[test]
fn slices_that_are_no_stack_are_refused() {
    let refused = |name: &str, field: &str, says: &str| assert_names(read_dicom(&fixture(name), None), field, says);
    refused("same_place.zip", "ImagePositionPatient", "1 of 4 slices are where another one is");
    refused("turned.zip", "ImageOrientationPatient", "different planes");
    refused("no_positions.zip", "ImagePositionPatient", "missing; without it the slices cannot be put in order");
    refused("sizes.zip", "Rows", "slices of 4 x 5 and of 4 x 6 voxels");
}

#[test]
fn archives_with_nothing_to_show_say_what_is_in_them() {
    let none = [("a.txt", &b"text"[..]), ("b.dcm", &fixture("no_picture.dcm"))];
    for bytes in [zip(&none), tar(&none)] {
        let says = "no DICOM pictures are in it: 1 files are not DICOM, 1 are DICOM without PixelData";
        assert_names(read_dicom(&bytes, None), "archive", says);
    }
    assert_names(read_dicom(&zip(&[]), None), "archive", "no DICOM pictures");
    assert_names(read_dicom(b"", None), "data", "not a DICOM file");
    assert_names(read_dicom(&[7; 300], None), "data", "not a DICOM file");
}

#[test]
fn names_that_lead_out_of_an_archive_are_refused() {
    let frames = fixture("frames.dcm");
    for name in ["../a.dcm", "a/../../b.dcm", "/etc/a.dcm", "a\\..\\..\\b.dcm"] {
        assert_names(read_dicom(&tar(&[(name, &frames)]), None), "archive", "leads out of the archive");
        assert_names(read_dicom(&zip(&[(name, &frames)]), None), "archive", "leads out of the archive");
    }
    assert!(read_dicom(&tar(&[("./a..b/c.dcm", &frames)]), None).is_ok());
}

#[test]
fn an_archive_unpacks_to_no_more_than_the_limits_allow() {
    let limits = Limits { max_axis: 64, max_voxels: 4096, max_bytes: 1 << 16 };
    assert!(within(&fixture("explicit.zip"), limits).is_ok());
    let zeros = vec![0; 1 << 20];
    // In a zip, what is not DICOM is not unpacked beyond its first bytes; in a tar it has to be.
    let bomb = tar(&[("zeros", &zeros)]);
    assert_names(within(&bomb, limits), "archive", "the limit is 131072");
    let mut gzip = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::best());
    gzip.write_all(&bomb).expect("memory is written");
    assert_names(within(&gzip.finish().expect("memory is written"), limits), "archive", "the limit is 131072");
    let mut long = unzipped("explicit.zip").swap_remove(1).1;
    // A private element in front of the voxels that is as long as it says.
    let at = long.windows(4).rposition(|tag| tag == [0xE0, 0x7F, 0x10, 0x00]).expect("voxels");
    let element = [&b"\xE1\x7F\x10\x00OB\0\0"[..], &(1_u32 << 20).to_le_bytes(), &zeros].concat();
    long.splice(at..at, element);
    assert_names(within(&zip(&[("a.dcm", &long)]), limits), "archive", "the limit is 131072");
}

#[test]
fn too_large_is_refused_before_it_is_allocated() {
    let limits = Limits { max_axis: 4, max_voxels: 4096, max_bytes: 1 << 16 };
    assert_names(within(&fixture("explicit.zip"), limits), "dims", "5 voxels along an axis needed, the limit is 4");
    let limits = Limits { max_axis: 2, ..limits };
    assert_names(within(&fixture("frames.dcm"), limits), "NumberOfFrames", "3 frames needed, the limit is 2");
}

#[test]
fn a_jpeg_that_goes_over_its_picture_again_and_again_is_refused() {
    let scans = |count: usize| {
        let mut file = unzipped("jpeg.zip").swap_remove(1).1;
        let items: Vec<_> = (0..file.len() - 4).filter(|&at| file[at..].starts_with(b"\xFE\xFF\x00\xE0")).collect();
        let length = &mut file[items[1] + 4..items[1] + 8];
        let old = u32::from_le_bytes(length.try_into().expect("four bytes"));
        length.copy_from_slice(&(old + 2 * count as u32).to_le_bytes());
        let end = items[1] + 8 + old as usize;
        file.splice(end..end, b"\xFF\xDA".repeat(count));
        read_dicom(&file, None)
    };
    assert!(scans(0).is_ok() && scans(60).is_ok(), "what follows the picture is ignored");
    assert_names(scans(64), "PixelData", "JPEG: 65 scans; expected at most 64");
}

#[test]
fn truncated_files_and_archives_are_refused() {
    let whole = fixture("frames.dcm");
    for length in [whole.len() - 1, whole.len() - 100] {
        assert_names(read_dicom(&whole[..length], None), "PixelData", "truncated");
    }
    assert_names(read_dicom(&whole[..400], None), "data set", "truncated");
    let rle = fixture("frames_rle.dcm");
    assert_names(read_dicom(&rle[..rle.len() - 40], None), "PixelData", "truncated");
    let archive = fixture("explicit.zip");
    assert_names(read_dicom(&archive[..archive.len() / 2], None), "archive", "not a whole zip");
    let one = unzipped("explicit.zip").swap_remove(1).1;
    let archive = tar(&[("a.dcm", &one)]);
    assert!(read_dicom(&archive, None).is_ok());
    assert!(read_dicom(&archive[..512 + one.len() - 20], None).is_err());
    let short = zip(&[("a.dcm", &one[..one.len() - 20])]);
    assert_names(read_dicom(&short, None), "PixelData", "truncated: the file ends before its voxels do (in `a.dcm`)");
}
