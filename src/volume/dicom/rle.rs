//! RLE Lossless (PS3.5 annex G): byte planes, the most significant first, each packed with `PackBits`.

use crate::volume::VolumeError;

/// Unpacks a frame of `pixels` samples of `sample_bytes` each into little-endian bytes.
pub(super) fn decode(packed: &[u8], pixels: usize, sample_bytes: usize) -> Result<Vec<u8>, VolumeError> {
    let malformed = |message: &str| VolumeError::malformed("PixelData", format!("RLE: {message}"));
    let header: Vec<u32> = packed
        .get(..64)
        .ok_or_else(|| malformed("a frame is shorter than its header"))?
        .chunks_exact(4)
        .map(|b| u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        .collect();
    if header[0] as usize != sample_bytes {
        let message = format!("{} segments in a frame of {sample_bytes} bytes a voxel", header[0]);
        return Err(malformed(&message));
    }
    // The packed bytes of a plane can be 2 in 128 of the plain ones: nothing is reserved that is not there.
    if packed.len().saturating_mul(64) < pixels {
        return Err(malformed("truncated"));
    }
    let mut bytes = vec![0; pixels * sample_bytes];
    for plane in 0..sample_bytes {
        let start = header[1 + plane] as usize;
        let segment = packed.get(start..).ok_or_else(|| malformed("a segment starts beyond the frame"))?;
        let end = if plane + 1 < sample_bytes { header[2 + plane] as usize } else { packed.len() };
        let segment = end.checked_sub(start).and_then(|length| segment.get(..length));
        let segment = segment.ok_or_else(|| malformed("segments are out of order"))?;
        let samples = bytes[sample_bytes - 1 - plane..].iter_mut().step_by(sample_bytes);
        if unpack(segment, samples).is_none() {
            return Err(malformed("truncated"));
        }
    }
    Ok(bytes)
}

/// `None` if the segment ends before the samples do.
fn unpack<'a>(segment: &[u8], mut samples: impl Iterator<Item = &'a mut u8>) -> Option<()> {
    let mut rest = segment.iter();
    let mut next = samples.next();
    while next.is_some() {
        let control = rest.next()?.cast_signed();
        // -128 means nothing; a negative number repeats a byte.
        let repeat = if control < 0 && control != i8::MIN { Some(*rest.next()?) } else { None };
        let count = if control == i8::MIN { 0 } else { u32::from(control.unsigned_abs()) + 1 };
        for _ in 0..count {
            let value = match repeat {
                Some(value) => value,
                None => *rest.next()?,
            };
            match next {
                Some(sample) => *sample = value,
                // Padding to an even number of bytes.
                None => break,
            }
            next = samples.next();
        }
    }
    Some(())
}
