//! The pages of a file.

use std::io::{self, Read, Seek, SeekFrom};

use half::slice::HalfFloatSliceExt;
use tiff::decoder::{Decoder, DecodingResult};
use tiff::tags::{PhotometricInterpretation, SampleFormat, Tag};
use tiff::{ColorType, TiffError};

use crate::volume::input::ReadSeek;
use crate::volume::{Limits, VolumeError, VoxelType, Voxels};

/// Most pages that are looked at: several channels and time points of a deep volume.
const MAX_PAGES: usize = 1 << 16;

/// Bytes of memory for any one entry of a page, which takes 32 for each offset of a strip: enough for 2^19 strips, and
/// for the longest description.
const MAX_ENTRY_BYTES: usize = 16 << 20;

/// Bytes read of the pages' entries, as a multiple of the file: more are the same ones again and again.
const HEADERS_PER_FILE_BYTE: u64 = 8;

/// The same for a small file.
const LEAST_HEADER_BYTES: u64 = 1 << 20;

/// Bit 0 of `NewSubfileType`: a page of reduced resolution, such as a thumbnail.
const REDUCED: u32 = 1;

/// A file whose pages are alike.
pub(super) struct Pages<'i> {
    decoder: Decoder<Metered<'i>>,
    /// Numbers in the file of the pages that are not thumbnails.
    numbers: Vec<usize>,
    /// Columns and rows of each.
    pub(super) size: [u32; 2],
    pub(super) voxel_type: VoxelType,
    /// What the first page says about all.
    pub(super) description: Option<String>,
    /// Pixels per unit along x and y, of the first page.
    pub(super) resolution: [Option<f64>; 2],
    /// Whether low values are meant to be bright.
    pub(super) inverted: bool,
}

/// What has to be the same in all pages.
#[derive(PartialEq)]
struct Page {
    size: [u32; 2],
    color: ColorType,
    voxel_type: VoxelType,
}

impl<'i> Pages<'i> {
    /// Looks at every page, but not at its voxels.
    pub(super) fn open(source: Box<dyn ReadSeek + 'i>, limits: &Limits) -> Result<Self, VolumeError> {
        let decoder = Decoder::new(Metered::new(source).map_err(|e| fault(e.into()))?).map_err(fault)?;
        let mut decoder = decoder.with_limits(allowed(MAX_ENTRY_BYTES));
        let description = decoder.find_tag(Tag::ImageDescription).map_err(fault)?;
        let description = description.and_then(|value| value.into_string().ok());
        let resolution = [Tag::XResolution, Tag::YResolution].map(|tag| resolution(&mut decoder, tag));
        let inverted = decoder.find_tag_unsigned::<u16>(Tag::PhotometricInterpretation).map_err(fault)?
            == Some(PhotometricInterpretation::WhiteIsZero.to_u16());
        let (mut first, mut numbers, mut number) = (None, Vec::new(), 0);
        loop {
            if number == MAX_PAGES {
                let (needed, limit) = (number as u128 + 1, MAX_PAGES as u64);
                return Err(VolumeError::TooLarge { field: "pages".into(), unit: "pages", needed, limit });
            }
            let kind = decoder.find_tag_unsigned::<u32>(Tag::NewSubfileType).map_err(fault)?.unwrap_or(0);
            if kind & REDUCED == 0 {
                let page = page(&mut decoder)?;
                check_alike(first.get_or_insert(Page { ..page }), &page, number)?;
                numbers.push(number);
            }
            if !decoder.more_images() {
                break;
            }
            decoder.next_image().map_err(fault)?;
            number += 1;
        }
        let Page { size, voxel_type, .. } = first.ok_or_else(|| malformed("all are of reduced resolution"))?;
        let page_bytes = limits.check("dims", [size[0], size[1], 1], voxel_type)? * voxel_type.bytes() as usize;
        // The entries are known; reading them once more costs no more.
        decoder.inner().left = u64::MAX;
        let decoder = decoder.with_limits(allowed(page_bytes.max(MAX_ENTRY_BYTES)));
        Ok(Self { decoder, numbers, size, voxel_type, description, resolution, inverted })
    }

    /// Number of pages.
    pub(super) fn len(&self) -> usize {
        self.numbers.len()
    }

    /// How each page is stored, for people.
    pub(super) fn technical_fields(&self) -> [(&'static str, String); 5] {
        let [width, length] = self.size;
        [
            ("ImageWidth", width.to_string()),
            ("ImageLength", length.to_string()),
            ("Pages", self.numbers.len().to_string()),
            ("VoxelType", self.voxel_type.to_string()),
            ("PhotometricInterpretation", if self.inverted { "WhiteIsZero" } else { "BlackIsZero" }.into()),
        ]
    }

    /// Appends the voxels of a page, counted from 0.
    pub(super) fn append(&mut self, page: usize, voxels: &mut Voxels) -> Result<(), VolumeError> {
        let &number = self.numbers.get(page).ok_or_else(|| malformed(&format!("there is no page {page}")))?;
        self.decoder.seek_to_image(number).map_err(fault)?;
        let decoded = self.decoder.read_image().map_err(fault)?;
        match (voxels, decoded) {
            (Voxels::U8(voxels), DecodingResult::U8(page)) => voxels.extend(page),
            (Voxels::I8(voxels), DecodingResult::I8(page)) => voxels.extend(page),
            (Voxels::U16(voxels), DecodingResult::U16(page)) => voxels.extend(page),
            (Voxels::I16(voxels), DecodingResult::I16(page)) => voxels.extend(page),
            (Voxels::U32(voxels), DecodingResult::U32(page)) => voxels.extend(page),
            (Voxels::I32(voxels), DecodingResult::I32(page)) => voxels.extend(page),
            (Voxels::U64(voxels), DecodingResult::U64(page)) => voxels.extend(page),
            (Voxels::I64(voxels), DecodingResult::I64(page)) => voxels.extend(page),
            (Voxels::F32(voxels), DecodingResult::F32(page)) => voxels.extend(page),
            (Voxels::F32(voxels), DecodingResult::F16(page)) => voxels.extend(page.to_f32_vec()),
            (Voxels::F64(voxels), DecodingResult::F64(page)) => voxels.extend(page),
            _ => return Err(malformed(&format!("page {page} is of another type than the first"))),
        }
        Ok(())
    }
}

/// What the library may allocate at once. It allocates what an entry claims to have before that is read, so this is
/// no more than is needed; to the first page it applies limits of its own (256 MiB).
fn allowed(bytes: usize) -> tiff::decoder::Limits {
    let mut allowed = tiff::decoder::Limits::default();
    allowed.decoding_buffer_size = bytes;
    // Packing may make it larger.
    allowed.intermediate_buffer_size = bytes.saturating_mul(2);
    allowed.ifd_value_size = MAX_ENTRY_BYTES;
    allowed
}

/// A file of which no more may be read than is left: many pages may point at the same long entries.
struct Metered<'i> {
    inner: Box<dyn ReadSeek + 'i>,
    left: u64,
}

impl<'i> Metered<'i> {
    fn new(mut inner: Box<dyn ReadSeek + 'i>) -> io::Result<Self> {
        let length = inner.seek(SeekFrom::End(0))?;
        inner.rewind()?;
        Ok(Self { inner, left: length.saturating_mul(HEADERS_PER_FILE_BYTE).max(LEAST_HEADER_BYTES) })
    }
}

impl Read for Metered<'_> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let got = self.inner.read(bytes)?;
        let left = self.left.checked_sub(got as u64);
        self.left = left.ok_or_else(|| io::Error::other("its pages share the same long entries"))?;
        Ok(got)
    }
}

impl Seek for Metered<'_> {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        self.inner.seek(to)
    }
}

fn page(decoder: &mut Decoder<Metered>) -> Result<Page, VolumeError> {
    let (columns, rows) = decoder.dimensions().map_err(fault)?;
    let color = decoder.colortype().map_err(fault)?;
    let ColorType::Gray(bits) = color else {
        let message = format!("{color:?} is in colour; expected one grey value per voxel");
        return Err(VolumeError::unsupported("pages", message));
    };
    let format = decoder.find_tag_unsigned::<u16>(Tag::SampleFormat).map_err(fault)?;
    let format = format.map_or(SampleFormat::Uint, SampleFormat::from_u16_exhaustive);
    let voxel_type = match (format, bits) {
        (SampleFormat::Uint, 8) => VoxelType::U8,
        (SampleFormat::Uint, 16) => VoxelType::U16,
        (SampleFormat::Uint, 32) => VoxelType::U32,
        (SampleFormat::Uint, 64) => VoxelType::U64,
        (SampleFormat::Int, 8) => VoxelType::I8,
        (SampleFormat::Int, 16) => VoxelType::I16,
        (SampleFormat::Int, 32) => VoxelType::I32,
        (SampleFormat::Int, 64) => VoxelType::I64,
        (SampleFormat::IEEEFP, 16 | 32) => VoxelType::F32,
        (SampleFormat::IEEEFP, 64) => VoxelType::F64,
        _ => {
            let message = format!("{format:?} values of {bits} bits are not read; expected 8, 16, 32 or 64");
            return Err(VolumeError::unsupported("pages", message));
        }
    };
    Ok(Page { size: [columns, rows], color, voxel_type })
}

fn check_alike(first: &Page, page: &Page, number: usize) -> Result<(), VolumeError> {
    if first == page {
        return Ok(());
    }
    let say = |page: &Page| format!("{} x {} voxels of type {}", page.size[0], page.size[1], page.voxel_type);
    let message = format!("page {number} has {}, the first has {}; expected pages alike", say(page), say(first));
    Err(malformed(&message))
}

fn resolution(decoder: &mut Decoder<Metered>, tag: Tag) -> Option<f64> {
    let value = decoder.find_tag(tag).ok()??;
    let number = match value {
        tiff::decoder::ifd::Value::Rational(n, d) => f64::from(n) / f64::from(d),
        other => other.into_f64().ok()?,
    };
    (number.is_finite() && number > 0.0).then_some(number)
}

fn malformed(message: &str) -> VolumeError {
    VolumeError::malformed("pages", message)
}

fn fault(error: TiffError) -> VolumeError {
    match error {
        TiffError::UnsupportedError(reason) => {
            VolumeError::unsupported("pages", short(&format!("a kind of TIFF that is not read: {reason}")))
        }
        TiffError::IoError(e) if e.raw_os_error().is_some() => VolumeError::io("pages", e),
        TiffError::LimitsExceeded => malformed("something in it claims to be larger than the limits allow"),
        other => malformed(&short(&format!("not a whole TIFF file: {other}"))),
    }
}

/// Some errors repeat what is in the file.
fn short(message: &str) -> String {
    const LONGEST: usize = 200;
    let mut short: String = message.chars().take(LONGEST).collect();
    if message.chars().nth(LONGEST).is_some() {
        short.push_str("...");
    }
    short
}
