//! JPEG 2000 in DICOM whose headers lie: [`super::dicom`] has what is read, against pydicom.

use spao_server::volume::{Format, Limits, Volume, VolumeError, format};

use super::assert_names;
use super::dicom::unzipped;

/// Bytes after the marker of the sizes: those of the picture, of its tiles, the number of components, and the first
/// one's bits.
const WIDTH: usize = 6;
const TILE_WIDTH: usize = 22;
const COMPONENTS: usize = 38;
const BITS: usize = 40;

/// Reads a file of one picture with its codestream changed, of which the sizes are at the given place.
fn changed(change: impl FnOnce(&mut Vec<u8>, usize)) -> Result<Volume, VolumeError> {
    let (_, mut file) = unzipped("jpeg2000.zip").pop().expect("pictures");
    let at = position(&file, &[0xFF, 0x4F, 0xFF, 0x51]) + 2;
    change(&mut file, at);
    let limits = Limits { max_axis: 1 << 16, ..Limits::default() };
    format::read_bytes(&file, Format::Dicom, None, &limits)
}

fn position(bytes: &[u8], part: &[u8]) -> usize {
    bytes.windows(part.len()).position(|window| window == part).expect("it is there")
}

#[test]
fn a_codestream_that_claims_too_much_is_refused_before_it_is_decoded() {
    let with = |offset: usize, bytes: &[u8]| {
        changed(|file, at| file[at + offset..at + offset + bytes.len()].copy_from_slice(bytes))
    };
    assert_eq!(with(WIDTH, &[0, 0, 0, 5]).expect("nothing is changed").grid.dims, [5, 4, 1]);
    assert_names(with(WIDTH, &[0, 0, 0, 6]), "PixelData", "JPEG 2000: it is 6 x 4; expected 5 x 4");
    assert_names(with(WIDTH, &[0xFF; 4]), "PixelData", "it is 4294967295 x 4");
    assert_names(with(TILE_WIDTH, &[0; 4]), "PixelData", "the tiles cannot be; expected 1 to 65535");
    assert_names(with(COMPONENTS, &[0, 3]), "PixelData", "the JPEG 2000 is in colour; expected grey values");
    assert_names(with(BITS, &[30]), "PixelData", "31 bits in voxels of 16; expected at most 16");
    assert_names(with(BITS + 1, &[2]), "PixelData", "expected 5 x 4");
    let large = changed(|file, at| {
        for tag in [0x10, 0x11] {
            let value = position(file, &[0x28, 0, tag, 0, b'U', b'S', 2, 0]) + 8;
            file[value..value + 2].copy_from_slice(&5000_u16.to_le_bytes());
        }
        for offset in [WIDTH, WIDTH + 4, TILE_WIDTH, TILE_WIDTH + 4] {
            file[at + offset..at + offset + 4].copy_from_slice(&5000_u32.to_be_bytes());
        }
    });
    assert_names(large, "PixelData", "bytes are too few for 25000000 voxels");
}

#[test]
fn damaged_headers_of_a_codestream_are_refused() {
    let tile = |file: &[u8]| position(file, &[0xFF, 0x90, 0, 10]);
    let short = changed(|file, _| {
        let at = tile(file);
        file[at + 6..at + 10].copy_from_slice(&[0, 0, 0, 12]);
    });
    assert_names(short, "PixelData", "a tile is shorter than its header");
    let no_data = changed(|file, _| {
        let at = tile(file) + 12;
        assert_eq!(file[at..at + 2], [0xFF, 0x93]);
        file[at] = 0;
    });
    assert_names(no_data, "PixelData", "the header of a tile is damaged or truncated");
    assert_names(changed(|file, at| file[at - 2] = 0), "PixelData", "not a codestream");
    // Precincts of two pixels: the bit that says that there are some, and their sides, in place of a comment.
    let precincts = changed(|file, _| {
        let at = position(file, &[0xFF, 0x52]);
        file[at + 4] |= 1;
        let after = at + 14;
        file.splice(after..after, [0x11, 0x11]);
        file[at + 3] += 2;
        let comment = position(file, &[0xFF, 0x64]);
        file[comment + 3] -= 2;
        file.drain(comment + 6..comment + 8);
    });
    assert_names(precincts, "PixelData", "JPEG 2000 with precincts below 32 pixels is not read");
}
