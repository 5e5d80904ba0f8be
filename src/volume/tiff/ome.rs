//! OME-XML in the description: sizes, order of planes, lengths.

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::volume::VolumeError;
use crate::volume::error::excerpt;
use crate::volume::units::millimetres;

/// The first image's `Pixels`.
#[derive(Debug, Default, PartialEq)]
pub(super) struct Ome {
    /// Such as `XYZCT`: Z, C and T with the fastest first.
    pub(super) order: String,
    /// Z, C, T.
    pub(super) sizes: [usize; 3],
    /// In mm, along x, y and z; as far as the file says.
    pub(super) lengths: [Option<f64>; 3],
    /// Names of the channels.
    pub(super) channels: Vec<Option<String>>,
    /// Which pages hold which planes.
    pub(super) data: Vec<TiffData>,
    /// Further images in the file.
    pub(super) more_images: usize,
}

/// Some planes, from the first one on, in pages from `page` on.
#[derive(Debug, PartialEq)]
pub(super) struct TiffData {
    pub(super) page: Option<usize>,
    /// Z, C, T.
    pub(super) first: [usize; 3],
    pub(super) planes: Option<usize>,
}

/// `None` if the description is not OME-XML.
pub(super) fn parse(description: &str) -> Result<Option<Ome>, VolumeError> {
    if !description.contains("<OME") && !description.contains(":OME ") {
        return Ok(None);
    }
    let mut reader = Reader::from_str(description);
    let mut found: Option<Ome> = None;
    let mut file = None;
    loop {
        match reader.read_event().map_err(|e| malformed(&format!("not XML: {}", excerpt(&e.to_string()))))? {
            Event::Eof => break,
            Event::Start(element) | Event::Empty(element) => match (element.local_name().as_ref(), &mut found) {
                ("Pixels", None) => found = Some(pixels(&element)?),
                ("Pixels", Some(ome)) => ome.more_images += 1,
                ("Channel", Some(ome)) if ome.more_images == 0 => {
                    ome.channels.push(attribute(&element, "Name")?);
                }
                ("TiffData", Some(ome)) if ome.more_images == 0 => ome.data.push(tiff_data(&element)?),
                ("UUID", Some(ome)) if ome.more_images == 0 => {
                    // A file that is all there is may name itself.
                    let name = attribute(&element, "FileName")?;
                    if name.is_some() && file.is_some() && name != file {
                        return Err(malformed("its planes are in several files; expected them in one"));
                    }
                    file = file.or(name);
                }
                ("MetadataOnly" | "BinaryOnly", _) => {
                    return Err(malformed("its pages or what describes them are in another file; expected one file"));
                }
                _ => {}
            },
            _ => {}
        }
    }
    found.map(Some).ok_or_else(|| malformed("it has no Pixels"))
}

fn pixels(element: &BytesStart) -> Result<Ome, VolumeError> {
    let size = |name: &str| number(element, name).map(|size| size.unwrap_or(1));
    let lengths = ["X", "Y", "Z"].map(|axis| length(element, axis));
    let [x, y, z] = lengths;
    Ok(Ome {
        order: attribute(element, "DimensionOrder")?.unwrap_or_else(|| "XYZCT".into()),
        sizes: [size("SizeZ")?, size("SizeC")?, size("SizeT")?],
        lengths: [x?, y?, z?],
        ..Ome::default()
    })
}

fn tiff_data(element: &BytesStart) -> Result<TiffData, VolumeError> {
    let first = |name: &str| number(element, name).map(|first| first.unwrap_or(0));
    Ok(TiffData {
        page: number(element, "IFD")?,
        first: [first("FirstZ")?, first("FirstC")?, first("FirstT")?],
        planes: number(element, "PlaneCount")?,
    })
}

/// `PhysicalSizeX` in mm; its unit is the micrometre unless another is said.
fn length(element: &BytesStart, axis: &str) -> Result<Option<f64>, VolumeError> {
    let name = format!("PhysicalSize{axis}");
    let Some(text) = attribute(element, &name)? else {
        return Ok(None);
    };
    let length = text.parse().ok().filter(|length: &f64| length.is_finite() && *length > 0.0);
    let length = length.ok_or_else(|| malformed(&format!("{name} {} is not a length", excerpt(&text))))?;
    let unit = attribute(element, &format!("{name}Unit"))?.unwrap_or_else(|| "\u{b5}m".into());
    // `pixel` and `reference frame` are no lengths: taken as they are.
    Ok(Some(length * millimetres(&unit).unwrap_or(1.0)))
}

fn number(element: &BytesStart, name: &str) -> Result<Option<usize>, VolumeError> {
    let Some(text) = attribute(element, name)? else {
        return Ok(None);
    };
    let number = text.parse().map(Some);
    number.map_err(|_| malformed(&format!("{name} {} is not a whole number", excerpt(&text))))
}

fn attribute(element: &BytesStart, name: &str) -> Result<Option<String>, VolumeError> {
    for attribute in element.attributes() {
        let attribute = attribute.map_err(|e| malformed(&format!("not XML: {}", excerpt(&e.to_string()))))?;
        if attribute.key.as_ref() == name {
            return Ok(Some(attribute.value.into_owned()));
        }
    }
    Ok(None)
}

fn malformed(message: &str) -> VolumeError {
    VolumeError::malformed("description", format!("OME-XML: {message}"))
}
