//! From the bytes of a file's frames to stored values.

use std::io::Read;

use jpeg_decoder::{Decoder, PixelFormat, UnsupportedFeature};

use super::image::{Image, Layout, Samples};
use super::parser::{ITEM, PixelElement, SEQUENCE_END, UNDEFINED};
use super::syntax::Packing;
use super::{jpeg2000, rle};
use crate::volume::voxels::data_error;
use crate::volume::{Endian, VolumeError};

/// Most passes of a JPEG over its picture, each of which may take a dozen bytes and all its blocks; one is enough for
/// grey values, and a progressive JPEG has some ten.
const MAX_SCANS: usize = 64;

/// What is done with each frame: its number and its values as stored.
pub(super) type EachFrame<'f> = dyn FnMut(u32, &[f64]) -> Result<(), VolumeError> + 'f;

/// Decodes all frames of a file, in their order.
///
/// # Errors
/// Names `PixelData` if they are damaged or fewer than the file says; those of `each`.
pub(super) fn each_frame(image: &Image, voxels: PixelElement, each: &mut EachFrame) -> Result<(), VolumeError> {
    let Layout { syntax, .. } = image.layout;
    let mut values = Vec::new();
    match syntax.packing {
        Packing::Native => each_native(image, voxels, &mut values, each),
        _ if voxels.length != UNDEFINED => Err(malformed("not in fragments, as its transfer syntax promises")),
        _ => each_encapsulated(image, voxels, |frame, packed| {
            unpack(&image.layout, packed, &mut values)?;
            each(frame, &values)
        }),
    }
}

fn each_native(
    image: &Image,
    voxels: PixelElement,
    values: &mut Vec<f64>,
    each: &mut EachFrame,
) -> Result<(), VolumeError> {
    let layout = &image.layout;
    let (frame_bytes, frames) = (layout.frame_bytes() as u64, u64::from(image.frames));
    if voxels.length == UNDEFINED {
        return Err(malformed("in fragments, which its transfer syntax does not have"));
    }
    if u64::from(voxels.length) < frame_bytes * frames {
        let (rows, columns) = (layout.rows, layout.columns);
        let message = format!(
            "{} bytes; expected {} for {frames} pictures of {columns} x {rows}",
            voxels.length,
            frame_bytes * frames
        );
        return Err(malformed(&message));
    }
    let mut reader = voxels.reader;
    let mut bytes = Vec::new();
    for frame in 0..image.frames {
        bytes.clear();
        read_up_to(&mut reader, frame_bytes, &mut bytes)?;
        if bytes.len() < layout.frame_bytes() {
            return Err(truncated());
        }
        stored_values(layout, &bytes, layout.syntax.endian, values);
        each(frame, values)?;
    }
    Ok(())
}

/// Calls `each` with the packed bytes of every frame (PS3.5 annex A.4).
fn each_encapsulated(
    image: &Image,
    voxels: PixelElement,
    mut each: impl FnMut(u32, &[u8]) -> Result<(), VolumeError>,
) -> Result<(), VolumeError> {
    // No packing makes a frame that much larger; more would be kept in memory for nothing.
    let most = image.layout.frame_bytes() as u64 * 2 + (1 << 16);
    // With which mark each frame begins, where frames may be in several fragments.
    let start: &[u8] = match image.layout.syntax.packing {
        Packing::Jpeg => &[0xFF, 0xD8],
        Packing::Jpeg2000 => &jpeg2000::START,
        _ => &[],
    };
    let mut fragments = Fragments { reader: voxels.reader };
    // The first holds the offsets of frames; they are known by their own marks.
    fragments.next(&mut Vec::new(), u64::from(image.frames) * 4 + 64)?;
    let (mut frame, mut packed, mut fragment) = (0, Vec::new(), Vec::new());
    loop {
        fragment.clear();
        let more = fragments.next(&mut fragment, most)?;
        let begins = fragment.starts_with(start);
        let whole = !more || (image.frames > 1 && begins);
        if whole && !packed.is_empty() && frame < image.frames {
            each(frame, &packed)?;
            frame += 1;
            packed.clear();
        }
        if !more {
            break;
        }
        if (packed.len() + fragment.len()) as u64 > most {
            return Err(malformed("a packed frame is larger than a plain one"));
        }
        packed.append(&mut fragment);
    }
    if frame < image.frames {
        return Err(malformed(&format!("{frame} of {} frames are there", image.frames)));
    }
    Ok(())
}

struct Fragments<'r> {
    reader: Box<dyn Read + 'r>,
}

impl Fragments<'_> {
    /// Appends the next fragment's bytes; false if there is none.
    fn next(&mut self, bytes: &mut Vec<u8>, most: u64) -> Result<bool, VolumeError> {
        let mut head = Vec::new();
        read_up_to(&mut self.reader, 8, &mut head)?;
        let &[a, b, c, d, l0, l1, l2, l3] = head.as_slice() else {
            return Err(truncated());
        };
        match u32::from_be_bytes([b, a, d, c]) {
            ITEM => {}
            SEQUENCE_END => return Ok(false),
            _ => return Err(malformed("something that is not a fragment is among the fragments")),
        }
        let length = u64::from(u32::from_le_bytes([l0, l1, l2, l3]));
        if length > most {
            return Err(malformed(&format!("a fragment of {length} bytes is larger than a plain frame")));
        }
        read_up_to(&mut self.reader, length, bytes)?;
        if (bytes.len() as u64) < length { Err(truncated()) } else { Ok(true) }
    }
}

fn unpack(layout: &Layout, packed: &[u8], values: &mut Vec<f64>) -> Result<(), VolumeError> {
    match layout.syntax.packing {
        Packing::Rle => {
            let bytes = rle::decode(packed, layout.pixels(), layout.samples.bytes())?;
            stored_values(layout, &bytes, Endian::Little, values);
        }
        Packing::Jpeg => unpack_jpeg(layout, packed, values)?,
        Packing::Jpeg2000 => {
            let bytes = jpeg2000::decode(layout, packed)?;
            stored_values(layout, &bytes, Endian::Little, values);
        }
        Packing::Native | Packing::Encapsulated | Packing::NotRead(_) => {
            if packed.len() < layout.frame_bytes() {
                return Err(truncated());
            }
            stored_values(layout, packed, layout.syntax.endian, values);
        }
    }
    Ok(())
}

fn unpack_jpeg(layout: &Layout, packed: &[u8], values: &mut Vec<f64>) -> Result<(), VolumeError> {
    let jpeg = |error: jpeg_decoder::Error| match error {
        jpeg_decoder::Error::Unsupported(UnsupportedFeature::SamplePrecision(bits)) => {
            let message = format!("JPEG of {bits} bits with loss is not read; expected 8 bits, or JPEG without loss");
            VolumeError::unsupported("PixelData", message)
        }
        jpeg_decoder::Error::Unsupported(feature) => {
            VolumeError::unsupported("PixelData", format!("JPEG with {feature:?} is not read"))
        }
        other => malformed(&format!("JPEG: {other}")),
    };
    // In the data, 0xFF is never followed by this.
    let scans = packed.windows(2).filter(|pair| *pair == [0xFF, 0xDA]).count();
    if scans > MAX_SCANS {
        return Err(malformed(&format!("JPEG: {scans} scans; expected at most {MAX_SCANS}")));
    }
    let mut decoder = Decoder::new(packed);
    decoder.read_info().map_err(jpeg)?;
    let info = decoder.info().ok_or_else(|| malformed("JPEG: no header"))?;
    // Before anything of its size is allocated.
    if (info.width, info.height) != (layout.columns, layout.rows) {
        let (columns, rows) = (layout.columns, layout.rows);
        let message = format!("the JPEG is {} x {}; expected {columns} x {rows}", info.width, info.height);
        return Err(malformed(&message));
    }
    let sample_bytes = match info.pixel_format {
        PixelFormat::L8 => 1,
        PixelFormat::L16 => 2,
        _ => return Err(VolumeError::unsupported("PixelData", "the JPEG is in colour; expected grey values")),
    };
    let bytes = decoder.decode().map_err(jpeg)?;
    let Samples::Integer { allocated, .. } = layout.samples else {
        return Err(malformed("JPEG cannot hold floating-point voxels"));
    };
    if bytes.len() != layout.pixels() * sample_bytes {
        return Err(malformed("JPEG: not all voxels are there"));
    }
    let allocated = usize::from(allocated / 8);
    if sample_bytes > allocated {
        return Err(malformed(&format!("JPEG of {} bits in voxels of {}", sample_bytes * 8, allocated * 8)));
    }
    // The decoder's samples are in this machine's byte order.
    let mut wide = vec![0; layout.frame_bytes()];
    for (sample, narrow) in wide.chunks_exact_mut(allocated).zip(bytes.chunks_exact(sample_bytes)) {
        let value = match narrow {
            [low] => u16::from(*low),
            [a, b] => u16::from_ne_bytes([*a, *b]),
            _ => 0,
        };
        sample[..sample_bytes].copy_from_slice(&value.to_le_bytes()[..sample_bytes]);
    }
    stored_values(layout, &wide, Endian::Little, values);
    Ok(())
}

/// The values in a frame's bytes, of which there are enough.
fn stored_values(layout: &Layout, bytes: &[u8], endian: Endian, values: &mut Vec<f64>) {
    values.clear();
    let bytes = &bytes[..layout.frame_bytes()];
    let big = endian == Endian::Big;
    let Samples::Integer { allocated, stored, high, signed } = layout.samples else {
        let float = |b: [u8; 4]| f64::from(if big { f32::from_be_bytes(b) } else { f32::from_le_bytes(b) });
        let double = |b: [u8; 8]| if big { f64::from_be_bytes(b) } else { f64::from_le_bytes(b) };
        match layout.samples {
            Samples::Float => values.extend(bytes.as_chunks().0.iter().map(|b| float(*b))),
            _ => values.extend(bytes.as_chunks().0.iter().map(|b| double(*b))),
        }
        return;
    };
    // The bits of the value go to the top, which drops those above it, and back, which drops those below.
    let (left, right) = (31 - u32::from(high), 32 - u32::from(stored));
    let value = |raw: u32| {
        let top = raw << left;
        if signed { f64::from(top.cast_signed() >> right) } else { f64::from(top >> right) }
    };
    match allocated {
        8 => values.extend(bytes.iter().map(|&b| value(u32::from(b)))),
        16 => {
            let word = |b: &[u8; 2]| u32::from(if big { u16::from_be_bytes(*b) } else { u16::from_le_bytes(*b) });
            values.extend(bytes.as_chunks().0.iter().map(|b| value(word(b))));
        }
        _ => {
            let word = |b: &[u8; 4]| if big { u32::from_be_bytes(*b) } else { u32::from_le_bytes(*b) };
            values.extend(bytes.as_chunks().0.iter().map(|b| value(word(b))));
        }
    }
}

fn read_up_to(reader: &mut impl Read, count: u64, bytes: &mut Vec<u8>) -> Result<(), VolumeError> {
    reader.take(count).read_to_end(bytes).map(|_| ()).map_err(|e| data_error("PixelData", e))
}

fn malformed(message: &str) -> VolumeError {
    VolumeError::malformed("PixelData", message)
}

fn truncated() -> VolumeError {
    malformed("truncated: the file ends before its voxels do")
}
