//! The elements that are kept of a data set; all others are passed over unread.
//!
//! A list of what may be shown rather than of what must not be: an element that is not here, private ones among them,
//! cannot give a patient away. What names or places a person is marked by the basic profile of PS3.15 table E.1-1:
//! names, numbers, dates, addresses, physicians, institutions, free text, unique identifiers.

/// Group and element in one number, as `0x0028_0010`.
pub(super) type Tag = u32;

/// How an element's bytes are read (PS3.5, 6.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Vr {
    /// Any of the textual ones, numbers in decimal among them.
    Text,
    /// Unsigned short.
    Us,
    /// Sequence of data sets.
    Sq,
}

/// Who may see an element's value in a header.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Shown {
    /// Everyone: it is about the picture or the machine.
    Always,
    /// Only those who may know the patient.
    Identity,
    /// Nobody: it is read for its use here.
    Never,
}

use Shown::{Always, Identity, Never};
use Vr::{Sq, Text, Us};

/// Tag, representation, keyword (PS3.6) and who may see it; by tag.
const FIELDS: [(Tag, Vr, &str, Shown); 91] = [
    (0x0002_0010, Text, "TransferSyntaxUID", Always),
    (0x0008_0005, Text, "SpecificCharacterSet", Never),
    (0x0008_0008, Text, "ImageType", Always),
    (0x0008_0016, Text, "SOPClassUID", Always),
    (0x0008_0018, Text, "SOPInstanceUID", Identity),
    (0x0008_0020, Text, "StudyDate", Identity),
    (0x0008_0021, Text, "SeriesDate", Identity),
    (0x0008_0022, Text, "AcquisitionDate", Identity),
    (0x0008_0023, Text, "ContentDate", Identity),
    (0x0008_0030, Text, "StudyTime", Identity),
    (0x0008_0050, Text, "AccessionNumber", Identity),
    (0x0008_0060, Text, "Modality", Always),
    (0x0008_0070, Text, "Manufacturer", Always),
    (0x0008_0080, Text, "InstitutionName", Identity),
    (0x0008_0081, Text, "InstitutionAddress", Identity),
    (0x0008_0090, Text, "ReferringPhysicianName", Identity),
    (0x0008_1010, Text, "StationName", Identity),
    (0x0008_1030, Text, "StudyDescription", Identity),
    (0x0008_103E, Text, "SeriesDescription", Identity),
    (0x0008_1050, Text, "PerformingPhysicianName", Identity),
    (0x0008_1070, Text, "OperatorsName", Identity),
    (0x0008_1090, Text, "ManufacturerModelName", Always),
    (0x0010_0010, Text, "PatientName", Identity),
    (0x0010_0020, Text, "PatientID", Identity),
    (0x0010_0030, Text, "PatientBirthDate", Identity),
    (0x0010_0040, Text, "PatientSex", Identity),
    (0x0010_1000, Text, "OtherPatientIDs", Identity),
    (0x0010_1001, Text, "OtherPatientNames", Identity),
    (0x0010_1010, Text, "PatientAge", Identity),
    (0x0010_1020, Text, "PatientSize", Identity),
    (0x0010_1030, Text, "PatientWeight", Identity),
    (0x0010_1040, Text, "PatientAddress", Identity),
    (0x0018_0015, Text, "BodyPartExamined", Always),
    (0x0018_0020, Text, "ScanningSequence", Always),
    (0x0018_0021, Text, "SequenceVariant", Always),
    (0x0018_0023, Text, "MRAcquisitionType", Always),
    (0x0018_0050, Text, "SliceThickness", Always),
    (0x0018_0060, Text, "KVP", Always),
    (0x0018_0080, Text, "RepetitionTime", Always),
    (0x0018_0081, Text, "EchoTime", Always),
    (0x0018_0082, Text, "InversionTime", Always),
    (0x0018_0087, Text, "MagneticFieldStrength", Always),
    (0x0018_0088, Text, "SpacingBetweenSlices", Always),
    (0x0018_1000, Text, "DeviceSerialNumber", Identity),
    (0x0018_1020, Text, "SoftwareVersions", Always),
    (0x0018_1030, Text, "ProtocolName", Identity),
    (0x0018_1100, Text, "ReconstructionDiameter", Always),
    (0x0018_1120, Text, "GantryDetectorTilt", Always),
    (0x0018_1150, Text, "ExposureTime", Always),
    (0x0018_1151, Text, "XRayTubeCurrent", Always),
    (0x0018_1210, Text, "ConvolutionKernel", Always),
    (0x0018_1314, Text, "FlipAngle", Always),
    (0x0018_5100, Text, "PatientPosition", Always),
    (0x0020_000D, Text, "StudyInstanceUID", Identity),
    (0x0020_000E, Text, "SeriesInstanceUID", Identity),
    (0x0020_0010, Text, "StudyID", Identity),
    (0x0020_0011, Text, "SeriesNumber", Always),
    (0x0020_0012, Text, "AcquisitionNumber", Always),
    (0x0020_0032, Text, "ImagePositionPatient", Always),
    (0x0020_0037, Text, "ImageOrientationPatient", Always),
    (0x0020_0052, Text, "FrameOfReferenceUID", Identity),
    (0x0020_4000, Text, "ImageComments", Identity),
    (0x0020_9113, Sq, "PlanePositionSequence", Never),
    (0x0020_9116, Sq, "PlaneOrientationSequence", Never),
    (0x0028_0002, Us, "SamplesPerPixel", Always),
    (0x0028_0004, Text, "PhotometricInterpretation", Always),
    (0x0028_0008, Text, "NumberOfFrames", Always),
    (0x0028_0010, Us, "Rows", Always),
    (0x0028_0011, Us, "Columns", Always),
    (0x0028_0030, Text, "PixelSpacing", Always),
    (0x0028_0100, Us, "BitsAllocated", Always),
    (0x0028_0101, Us, "BitsStored", Always),
    (0x0028_0102, Us, "HighBit", Always),
    (0x0028_0103, Us, "PixelRepresentation", Always),
    (0x0028_1050, Text, "WindowCenter", Always),
    (0x0028_1051, Text, "WindowWidth", Always),
    (0x0028_1052, Text, "RescaleIntercept", Always),
    (0x0028_1053, Text, "RescaleSlope", Always),
    (0x0028_1054, Text, "RescaleType", Always),
    (0x0028_1055, Text, "WindowCenterWidthExplanation", Always),
    (0x0028_2110, Text, "LossyImageCompression", Always),
    (0x0028_3000, Sq, "ModalityLUTSequence", Never),
    (0x0028_9110, Sq, "PixelMeasuresSequence", Never),
    (0x0028_9145, Sq, "PixelValueTransformationSequence", Never),
    (0x0054_1001, Text, "Units", Always),
    (0x3004_0002, Text, "DoseUnits", Always),
    (0x3004_0004, Text, "DoseType", Always),
    (0x3004_000C, Text, "GridFrameOffsetVector", Never),
    (0x3004_000E, Text, "DoseGridScaling", Always),
    (0x5200_9229, Sq, "SharedFunctionalGroupsSequence", Never),
    (0x5200_9230, Sq, "PerFrameFunctionalGroupsSequence", Never),
];

/// How a kept element is read; `None` for one that is passed over.
pub(super) fn representation(tag: Tag) -> Option<Vr> {
    field(tag).map(|&(_, vr, _, _)| vr)
}

/// Keyword and representation of an element that may be shown, and whether everyone may see it.
pub(super) fn shown(tag: Tag) -> Option<(&'static str, Vr, bool)> {
    let &(_, vr, keyword, shown) = field(tag)?;
    (shown != Never).then_some((keyword, vr, shown == Always))
}

/// Keyword of a kept element.
pub(super) fn keyword(tag: Tag) -> &'static str {
    field(tag).map_or("element", |&(_, _, keyword, _)| keyword)
}

fn field(tag: Tag) -> Option<&'static (Tag, Vr, &'static str, Shown)> {
    FIELDS.binary_search_by_key(&tag, |field| field.0).ok().map(|index| &FIELDS[index])
}
