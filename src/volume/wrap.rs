//! Files inside of gzip or Zstandard, unwrapped as a stream.
//!
//! Nothing here asks how much comes out: a reader takes what its header announces and no more, so a file that would
//! unfold into terabytes costs what its header says, which the limits have allowed before.

use std::io::{self, BufRead, BufReader, Read};

use flate2::bufread::MultiGzDecoder;
use ruzstd::decoding::errors::{FrameDecoderError, ReadFrameHeaderError};
use ruzstd::decoding::{BlockDecodingStrategy, FrameDecoder};

/// What a file is wrapped in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Wrapping {
    /// RFC 1952, of one member or several (`bgzip` writes many).
    Gzip,
    /// RFC 8878, of one frame or several.
    Zstd,
}

impl Wrapping {
    /// By the first bytes of a file.
    pub(super) fn of(first_bytes: &[u8]) -> Option<Self> {
        let skippable = |b: &[u8]| b.len() >= 4 && b[0] & 0xf0 == 0x50 && b[1..4] == [0x2a, 0x4d, 0x18];
        if first_bytes.starts_with(&[0x1f, 0x8b, 8]) {
            Some(Self::Gzip)
        } else if first_bytes.starts_with(&[0x28, 0xb5, 0x2f, 0xfd]) || skippable(first_bytes) {
            Some(Self::Zstd)
        } else {
            None
        }
    }

    /// What is inside, as a stream.
    pub(super) fn unwrap<'a>(self, reader: impl BufRead + 'a) -> Box<dyn BufRead + 'a> {
        match self {
            Self::Gzip => Box::new(BufReader::new(MultiGzDecoder::new(reader))),
            Self::Zstd => Box::new(BufReader::new(ZstdFrames::new(reader))),
        }
    }
}

/// A file's name without `.gz` or `.zst`, in lower case.
pub(super) fn unwrapped_name(name: &str) -> String {
    let lower = name.to_ascii_lowercase();
    let endings = [".gz", ".zst", ".zstd"];
    let inner = endings.iter().find_map(|ending| lower.strip_suffix(ending));
    inner.unwrap_or(&lower).to_owned()
}

/// The frames of a Zstandard file, one after the other. The decoder refuses windows of more than 128 MiB.
struct ZstdFrames<R> {
    source: R,
    decoder: FrameDecoder,
    in_frame: bool,
}

impl<R: BufRead> ZstdFrames<R> {
    fn new(source: R) -> Self {
        Self { source, decoder: FrameDecoder::new(), in_frame: false }
    }

    /// Begins the next frame; false at the end of the file.
    fn begin(&mut self) -> io::Result<bool> {
        while !self.source.fill_buf()?.is_empty() {
            match self.decoder.reset(&mut self.source) {
                Ok(()) => return Ok(true),
                Err(FrameDecoderError::ReadFrameHeaderError(ReadFrameHeaderError::SkipFrame { length, .. })) => {
                    let length = u64::from(length);
                    if io::copy(&mut self.source.by_ref().take(length), &mut io::sink())? < length {
                        return Err(io::ErrorKind::UnexpectedEof.into());
                    }
                }
                Err(error) => return Err(self.fault(error)),
            }
        }
        Ok(false)
    }

    /// The decoder does not say whether its source had ended, or was wrong.
    fn fault(&mut self, error: FrameDecoderError) -> io::Error {
        match self.source.fill_buf() {
            Ok([]) => io::Error::new(io::ErrorKind::UnexpectedEof, error.to_string()),
            Ok(_) => io::Error::new(io::ErrorKind::InvalidData, error.to_string()),
            Err(error) => error,
        }
    }

    fn check_sum(&self) -> io::Result<()> {
        match (self.decoder.get_checksum_from_data(), self.decoder.get_calculated_checksum()) {
            (Some(written), Some(calculated)) if written != calculated => {
                Err(io::Error::new(io::ErrorKind::InvalidData, "the checksum of a zstd frame does not match"))
            }
            _ => Ok(()),
        }
    }
}

impl<R: BufRead> Read for ZstdFrames<R> {
    fn read(&mut self, out: &mut [u8]) -> io::Result<usize> {
        if out.is_empty() {
            return Ok(0);
        }
        loop {
            if !self.in_frame {
                if !self.begin()? {
                    return Ok(0);
                }
                self.in_frame = true;
            }
            while self.decoder.can_collect() == 0 && !self.decoder.is_finished() {
                if let Err(error) = self.decoder.decode_blocks(&mut self.source, BlockDecodingStrategy::UptoBlocks(1)) {
                    return Err(self.fault(error));
                }
            }
            let got = self.decoder.read(out)?;
            if got > 0 {
                return Ok(got);
            }
            self.check_sum()?;
            self.in_frame = false;
        }
    }
}
