//! JPEG 2000 (ISO/IEC 15444-1, PS3.5 annex A.4.4), lossless and with loss.
//!
//! The library takes memory for what a codestream's headers claim, so these are looked at first.

use hayro_jpeg2000::{DecodeSettings, DecoderContext, Image};

use super::image::{Layout, Samples};
use crate::volume::VolumeError;

/// How every codestream begins.
pub(super) const START: [u8; 4] = [0xFF, 0x4F, 0xFF, 0x51];

/// Most tiles of a picture, which have numbers of 16 bits.
const MAX_TILES: u64 = 65_535;

/// Exponent of the smallest side of a precinct that is read, the lowest resolutions apart: each takes memory.
const LEAST_PRECINCT: u8 = 5;

/// Voxels of a picture of which each byte of its codestream may stand for no more than so many: an empty code block.
/// Decoding takes some twenty bytes for each voxel, however few bytes they come from.
const LARGE: usize = 1 << 24;
const MOST_PER_BYTE: usize = 1 << 12;

/// Markers.
const SIZE: u8 = 0x51;
const CODING: u8 = 0x52;
const CODING_OF_COMPONENT: u8 = 0x53;
const TILE_PART: u8 = 0x90;
const DATA: u8 = 0x93;
const END: u8 = 0xD9;

/// What a codestream's header says.
struct Sizes {
    bits: u8,
    signed: bool,
}

/// Unpacks a frame into the little-endian bytes that it would have without packing, as many bits as are allocated: the
/// data set says what they mean, whether the codestream agrees about the sign or not.
pub(super) fn decode(layout: &Layout, packed: &[u8]) -> Result<Vec<u8>, VolumeError> {
    let Sizes { bits, signed } = check(layout, packed)?;
    let Samples::Integer { allocated, .. } = layout.samples else {
        return Err(malformed("it cannot hold floating-point voxels"));
    };
    if u16::from(bits) > allocated.min(16) {
        return Err(malformed(&format!("{bits} bits in voxels of {}; expected at most 16", allocated)));
    }
    if layout.pixels() > LARGE && packed.len() < layout.pixels() / MOST_PER_BYTE {
        return Err(malformed(&format!("{} bytes are too few for {} voxels", packed.len(), layout.pixels())));
    }
    let fault = |error| malformed(&format!("{error}"));
    let image = Image::new(packed, &DecodeSettings::default()).map_err(fault)?;
    let mut context = DecoderContext::default();
    let decoded = image.decode(&mut context).map_err(fault)?;
    let [component] = decoded.components() else {
        return Err(VolumeError::unsupported("PixelData", "the JPEG 2000 is in colour; expected grey values"));
    };
    if component.samples().len() != layout.pixels() {
        return Err(malformed("not all voxels are there"));
    }
    // The library adds the offset of unsigned samples to signed ones too.
    let offset = if signed { f64::from(bits - 1).exp2() } else { 0.0 };
    let highest = f64::from(bits).exp2() - 1.0;
    let value = |sample: &f32| (f64::from(*sample).round().clamp(0.0, highest) - offset) as i32;
    let allocated = usize::from(allocated / 8);
    Ok(component.samples().iter().flat_map(|sample| value(sample).to_le_bytes().into_iter().take(allocated)).collect())
}

/// Compares what the headers of a codestream and its tiles claim with what the data set says.
fn check(layout: &Layout, packed: &[u8]) -> Result<Sizes, VolumeError> {
    let truncated = || malformed("truncated");
    if !packed.starts_with(&START) {
        return Err(malformed("not a codestream"));
    }
    let mut sizes = None;
    let mut at = 2;
    while let Some(&[0xFF, marker]) = packed.get(at..at + 2) {
        if marker == END {
            break;
        }
        if marker == DATA {
            return Err(malformed("data outside of a tile"));
        }
        let segment = segment(packed, at).ok_or_else(truncated)?;
        match marker {
            SIZE => sizes = Some(check_sizes(layout, segment)?),
            CODING | CODING_OF_COMPONENT => check_precincts(marker, segment)?,
            TILE_PART => {
                let end = tile_part(packed, at, segment)?;
                if end >= packed.len() {
                    break;
                }
                at = end;
                continue;
            }
            _ => {}
        }
        at += 2 + segment.len() + 2;
    }
    sizes.ok_or_else(|| malformed("it does not say its size"))
}

/// A marker's segment without its length.
fn segment(packed: &[u8], at: usize) -> Option<&[u8]> {
    let length = usize::from(u16::from_be_bytes(*packed.get(at + 2..)?.first_chunk()?));
    packed.get(at + 4..at + 2 + length)
}

/// Looks at the header of a tile-part; says where the next one begins.
fn tile_part(packed: &[u8], start: usize, segment_of_start: &[u8]) -> Result<usize, VolumeError> {
    let length = segment_of_start.get(2..).and_then(<[u8]>::first_chunk).map(|length| u32::from_be_bytes(*length));
    let length = length.ok_or_else(|| malformed("truncated"))? as usize;
    let mut at = start + 4 + segment_of_start.len();
    while packed.get(at..at + 2) != Some(&[0xFF, DATA]) {
        let &[0xFF, marker] = packed.get(at..at + 2).unwrap_or_default() else {
            return Err(malformed("the header of a tile is damaged or truncated"));
        };
        let segment = segment(packed, at).ok_or_else(|| malformed("truncated"))?;
        if matches!(marker, CODING | CODING_OF_COMPONENT) {
            check_precincts(marker, segment)?;
        }
        at += 4 + segment.len();
    }
    // 0 means up to the end.
    let end = if length == 0 { packed.len() } else { start.saturating_add(length) };
    if end < at + 2 { Err(malformed("a tile is shorter than its header")) } else { Ok(end) }
}

fn check_sizes(layout: &Layout, segment: &[u8]) -> Result<Sizes, VolumeError> {
    let number = |index: usize| {
        let bytes = segment.get(2 + index * 4..)?.first_chunk()?;
        Some(u64::from(u32::from_be_bytes(*bytes)))
    };
    let numbers: Option<Vec<u64>> = (0..8).map(number).collect();
    let (Some(numbers), Some(&[_, count, bits, across, down])) = (numbers, segment.get(34..39)) else {
        return Err(malformed("truncated"));
    };
    if segment.len() != 39 || count != 1 {
        return Err(VolumeError::unsupported("PixelData", "the JPEG 2000 is in colour; expected grey values"));
    }
    let (width, height) = (numbers[0].saturating_sub(numbers[2]), numbers[1].saturating_sub(numbers[3]));
    let (columns, rows) = (u64::from(layout.columns), u64::from(layout.rows));
    if (width, height) != (columns, rows) || (across, down) != (1, 1) {
        return Err(malformed(&format!("it is {width} x {height}; expected {columns} x {rows}")));
    }
    let tiles = |end: u64, start: u64, size: u64| (size > 0).then(|| end.saturating_sub(start).div_ceil(size));
    let tiles = tiles(numbers[0], numbers[6], numbers[4]).zip(tiles(numbers[1], numbers[7], numbers[5]));
    match tiles.map(|(across, down)| across.saturating_mul(down)) {
        Some(1..=MAX_TILES) => Ok(Sizes { bits: (bits & 0x7F) + 1, signed: bits & 0x80 != 0 }),
        _ => Err(malformed(&format!("the tiles cannot be; expected 1 to {MAX_TILES}"))),
    }
}

/// Precincts of a size of their own, a byte for each resolution from the lowest on.
fn check_precincts(marker: u8, segment: &[u8]) -> Result<(), VolumeError> {
    // What comes before: style, or component and style; then order, layers and transformation of all components.
    let (style, first) = if marker == CODING { (0, 10) } else { (1, 7) };
    let style = segment.get(style).ok_or_else(|| malformed("truncated"))?;
    if style & 1 == 0 {
        return Ok(());
    }
    let precincts = segment.get(first..).unwrap_or_default();
    let highest = precincts.iter().rev().take(3);
    if highest.flat_map(|sides| [sides & 0x0F, sides >> 4]).any(|side| side < LEAST_PRECINCT) {
        let message = format!("JPEG 2000 with precincts below {} pixels is not read", 1 << LEAST_PRECINCT);
        return Err(VolumeError::unsupported("PixelData", message));
    }
    Ok(())
}

fn malformed(message: &str) -> VolumeError {
    VolumeError::malformed("PixelData", format!("JPEG 2000: {message}"))
}
