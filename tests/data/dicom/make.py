"""Makes the DICOM fixtures beside it and `expected.json`, what pydicom reads back from them.

Written and read with pydicom 3.0.2, numpy 2.4.6, imagecodecs 2026.3.6 (JPEG), pylibjpeg-openjpeg 2.6.0 (JPEG 2000),
pylibjpeg-libjpeg 2.5.0 (decodes JPEG), Pillow 13.0.0 (JPEG 2000 with tiles); Python 3.11. The tests
need none of them.
"""

import io
import json
import pathlib
import zipfile

import imagecodecs
import numpy as np
import openjpeg.utils
import PIL.Image
import pydicom
from pydicom import uid
from pydicom.dataset import Dataset, FileMetaDataset
from pydicom.encaps import encapsulate

HERE = pathlib.Path(__file__).parent
SIZE = (3, 4, 5)  # slices, rows, columns
AXIAL = (1, 0, 0, 0, 1, 0)
# Rows run down the body, columns towards the back: a sagittal picture, turned by 3-4-5.
OBLIQUE = (0, 0.6, -0.8, -1, 0, 0)


def values(dtype, span):
    """Every voxel another value, and no symmetry."""
    count = int(np.prod(SIZE))
    return (np.linspace(0, 1, count) ** 1.5 * span[1] + span[0]).astype(dtype).reshape(SIZE)


def slice_dataset(array, position, orientation=AXIAL, series="1", number=0, **more):
    dataset = Dataset()
    dataset.SOPClassUID = uid.CTImageStorage
    dataset.SOPInstanceUID = f"1.2.826.0.1.3680043.8.498.{series}.{number + 1}"
    dataset.StudyDate = "19991231"
    dataset.AccessionNumber = "ACCESSION77"
    dataset.Modality = "CT"
    dataset.Manufacturer = "Maker"
    dataset.InstitutionName = "Hospital Secret"
    dataset.InstitutionAddress = "Secret street 1"
    dataset.ReferringPhysicianName = "Physician^Secret"
    dataset.SeriesDescription = f"Series {series} of Secret"
    dataset.PatientName = "Secret^Patient"
    dataset.PatientID = "SECRET-42"
    dataset.PatientBirthDate = "19700102"
    dataset.OtherPatientNames = "Secret^Other"
    dataset.PatientAddress = "Secret road 2"
    dataset.StudyInstanceUID = "1.2.826.0.1.3680043.8.498.99"
    dataset.SeriesInstanceUID = f"1.2.826.0.1.3680043.8.498.77.{series}"
    dataset.SeriesNumber = series
    dataset.InstanceNumber = str(100 - number)
    dataset.SliceThickness = "9"
    if position is not None:
        dataset.ImagePositionPatient = [f"{v:.6g}" for v in position]
        dataset.ImageOrientationPatient = list(orientation)
    dataset.PixelSpacing = ["0.5", "0.75"]
    dataset.SamplesPerPixel = 1
    dataset.PhotometricInterpretation = "MONOCHROME2"
    dataset.Rows, dataset.Columns = array.shape[-2:]
    bits = array.dtype.itemsize * 8
    dataset.BitsAllocated, dataset.BitsStored, dataset.HighBit = bits, bits, bits - 1
    dataset.PixelRepresentation = 1 if array.dtype.kind == "i" else 0
    private = dataset.private_block(0x0099, "SECRET BLOCK", create=True)
    private.add_new(0x01, "LO", "Secret private")
    for name, value in more.items():
        setattr(dataset, name, value)
    return dataset


def to_bytes(dataset, array, syntax=uid.ExplicitVRLittleEndian, packed=None):
    dataset.file_meta = FileMetaDataset()
    dataset.file_meta.TransferSyntaxUID = syntax
    big = syntax == uid.ExplicitVRBigEndian
    if packed is not None:
        dataset.PixelData = encapsulate(packed)
        dataset["PixelData"].VR = "OB"
        dataset["PixelData"].is_undefined_length = True
    elif syntax == uid.RLELossless:
        dataset.PixelData = array.tobytes()
        dataset["PixelData"].VR = "OW"
        dataset.compress(uid.RLELossless, array, generate_instance_uid=False)
    elif array is not None:
        dataset.PixelData = array.astype(array.dtype.newbyteorder(">" if big else "<")).tobytes()
        dataset["PixelData"].VR = "OB" if array.dtype.itemsize == 1 and not big else "OW"
    buffer = io.BytesIO()
    implicit = syntax == uid.ImplicitVRLittleEndian
    dataset.save_as(buffer, enforce_file_format=True) if syntax.is_encapsulated else pydicom.dcmwrite(
        buffer, dataset, enforce_file_format=True, implicit_vr=implicit, little_endian=not big
    )
    return buffer.getvalue()


def write_zip(name, files):
    with zipfile.ZipFile(HERE / name, "w", zipfile.ZIP_DEFLATED) as archive:
        for file, data in files:
            archive.writestr(zipfile.ZipInfo(file, (2020, 1, 1, 0, 0, 0)), data, zipfile.ZIP_DEFLATED)


EXPECTED = {}


def expect(name, files, dtype):
    """What pydicom and plain arithmetic make of the files."""
    slices = []
    for data in files:
        dataset = pydicom.dcmread(io.BytesIO(data))
        frames = dataset.pixel_array
        frames = frames[None] if frames.ndim == 2 else frames
        groups = dataset.get("PerFrameFunctionalGroupsSequence")
        for k, frame in enumerate(frames):
            if groups:
                position = groups[k].PlanePositionSequence[0].ImagePositionPatient
                shared = dataset.SharedFunctionalGroupsSequence[0]
                orientation = shared.PlaneOrientationSequence[0].ImageOrientationPatient
                spacing = shared.PixelMeasuresSequence[0].PixelSpacing
                slope, intercept = 2, -3
            else:
                position, orientation = dataset.ImagePositionPatient, dataset.ImageOrientationPatient
                spacing = dataset.PixelSpacing
                slope, intercept = dataset.get("RescaleSlope", 1), dataset.get("RescaleIntercept", 0)
                if "GridFrameOffsetVector" in dataset:
                    position = [*position[:2], position[2] + dataset.GridFrameOffsetVector[k]]
                    slope = dataset.DoseGridScaling
            position = np.array([float(v) for v in position])
            slices.append((position, frame * float(slope) + float(intercept), orientation, spacing))
    row, column = np.array(slices[0][2][:3], float), np.array(slices[0][2][3:], float)
    slices.sort(key=lambda s: np.dot(s[0], np.cross(row, column)))
    step = (slices[-1][0] - slices[0][0]) / max(len(slices) - 1, 1)
    length = float(np.linalg.norm(step))
    voxels = np.stack([s[1] for s in slices]).astype(dtype)
    EXPECTED[name] = {
        "type": {"f": "f", "i": "i", "u": "u"}[voxels.dtype.kind] + str(voxels.dtype.itemsize * 8),
        "dims": list(voxels.shape[::-1]),
        "origin": list(slices[0][0]),
        "spacing": [float(slices[0][3][1]), float(slices[0][3][0]), length],
        "direction": [list(row), list(column), list(step / length)],
        "voxels": [float(v) for v in voxels.ravel()],
    }


def stack(name, array, dtype, syntax=uid.ExplicitVRLittleEndian, step=(0, 0, 2.5), orientation=AXIAL, pack=None, **more):
    """A series whose names and numbers are in another order than its slices."""
    files = []
    for k, picture in enumerate(array):
        position = np.array((-10.5, 20.25, 300.0)) + np.array(step) * k
        dataset = slice_dataset(picture, position, orientation, number=k, **more)
        packed = pack and [pack(picture)]
        files.append((f"DICOM/IM{(k * 2 + 1) % len(array)}", to_bytes(dataset, picture, syntax, packed)))
    files.sort()
    write_zip(f"{name}.zip", [("README.TXT", b"not a picture"), *files])
    if dtype is not None:
        expect(f"{name}.zip", [data for _, data in files], dtype)


def multi_frame():
    array = values("u2", (0, 4000))[::-1]
    dataset = slice_dataset(array, None, BitsStored=12, HighBit=11, NumberOfFrames=str(len(array)))
    del dataset.PixelSpacing
    shared, measures, orientation, transform = Dataset(), Dataset(), Dataset(), Dataset()
    measures.PixelSpacing, measures.SliceThickness = ["0.5", "0.75"], "9"
    orientation.ImageOrientationPatient = list(OBLIQUE)
    transform.RescaleSlope, transform.RescaleIntercept, transform.RescaleType = "2", "-3", "US"
    shared.PixelMeasuresSequence = [measures]
    shared.PlaneOrientationSequence = [orientation]
    shared.PixelValueTransformationSequence = [transform]
    dataset.SharedFunctionalGroupsSequence = [shared]
    frames = []
    for k in range(len(array)):
        position, frame = Dataset(), Dataset()
        # The normal is (0, 0.8, 0.6); the first frame is the farthest along it.
        position.ImagePositionPatient = [1, 2 - 0.8 * k, 3 - 0.6 * k]
        frame.PlanePositionSequence = [position]
        frames.append(frame)
    dataset.PerFrameFunctionalGroupsSequence = frames
    for name, syntax in [("frames.dcm", uid.ExplicitVRLittleEndian), ("frames_rle.dcm", uid.RLELossless)]:
        data = to_bytes(dataset, array, syntax)
        (HERE / name).write_bytes(data)
        expect(name, [data], "i2")


def dose():
    array = values("u4", (7, 4e9))
    dataset = slice_dataset(array, (5, 6, 7), NumberOfFrames=str(len(array)), GridFrameOffsetVector=[0, 3, 6])
    dataset.DoseGridScaling = "1e-7"
    data = to_bytes(dataset, array, uid.ImplicitVRLittleEndian)
    (HERE / "dose.dcm").write_bytes(data)
    expect("dose.dcm", [data], "f4")


def several():
    files = []
    for series, count in [("1", 1), ("4", 3), ("5", 4)]:
        for k in range(count):
            picture = values("i2", (int(series) * 10, 50))[k % 3]
            dataset = slice_dataset(picture, (0, 0, k), series=series, number=k)
            files.append((f"{series}/{k}.dcm", to_bytes(dataset, picture)))
    write_zip("several.zip", files)
    write_zip("localizer.zip", files[:4])


def odd():
    grey = values("u2", (1, 900))
    def files(datasets):
        return [(f"{k}.dcm", to_bytes(d, None if d.get("PixelData") else grey[0])) for k, d in enumerate(datasets)]
    at = lambda z, **more: slice_dataset(grey[0], (0, 0, z), number=int(z), **more)
    write_zip("gap.zip", files([at(0), at(1), at(2), at(4), at(5)]))
    write_zip("same_place.zip", files([at(0), at(1), at(1), at(2)]))
    write_zip("turned.zip", files([at(0), at(1), slice_dataset(grey[0], (0, 0, 2), OBLIQUE)]))
    write_zip("no_positions.zip", files([slice_dataset(grey[0], None, number=k) for k in range(3)]))
    wide = slice_dataset(grey[0], (0, 0, 2))
    wide.Columns, wide.PixelData = 6, bytes(48)
    wide["PixelData"].VR = "OW"
    write_zip("sizes.zip", [(f"{k}.dcm", to_bytes(d, None if k == 2 else grey[0])) for k, d in enumerate([at(0), at(1), wide])])
    colour = slice_dataset(grey[0].astype("u1"), (0, 0, 0), SamplesPerPixel=3, PhotometricInterpretation="RGB")
    colour.PlanarConfiguration = 0
    (HERE / "colour.dcm").write_bytes(to_bytes(colour, np.zeros((4, 5, 3), "u1")))
    bits = slice_dataset(grey[0], (0, 0, 0), BitsAllocated=1, BitsStored=1, HighBit=0)
    (HERE / "bits.dcm").write_bytes(to_bytes(bits, np.zeros(4, "u1")))
    report = slice_dataset(grey[0], (0, 0, 0))
    (HERE / "no_picture.dcm").write_bytes(to_bytes(report, None))
    (HERE / "jpeg_ls.dcm").write_bytes(to_bytes(at(0), grey[0], uid.JPEGLSLossless, [imagecodecs.jpegls_encode(grey[0])]))


def jpeg2000(twelve, ct):
    """By OpenJPEG, through three libraries; the large pictures have several resolutions, and one has tiles."""
    def small(bits):
        options = dict(codecformat="j2k", level=0, resolutions=2, bitspersample=bits)
        return lambda array: imagecodecs.jpeg2k_encode(np.ascontiguousarray(array), **options)
    def encode(array, **options):
        bits = array.dtype.itemsize * 8
        return openjpeg.utils.encode_array(array, bits_stored=bits, photometric_interpretation=2, **options)
    lossless, lossy = uid.JPEG2000Lossless, uid.JPEG2000
    stack("jpeg2000", twelve, "i2", lossless, pack=small(12), KVP="120", **ct)
    stack("jpeg2000_wide", values("u2", (0, 65535)), "u2", lossless, pack=small(16))
    stack("jpeg2000_bytes", values("u1", (0, 255)), "u1", lossless, pack=small(8))
    # The codestream's samples are unsigned, the data set's are signed: the data set is right.
    stack("jpeg2000_mismatch", values("i2", (-4096, 8191)), "i2", lossless, BitsStored=13, HighBit=12,
          pack=lambda array: small(13)(array.view("u2") & 0x1FFF))
    z, y, x = np.meshgrid(np.arange(3), np.arange(34), np.arange(33), indexing="ij")
    large = (1000 * z + 20 * y * np.sin(x / 9) + np.random.default_rng(1).integers(0, 40, x.shape)).astype("i2")
    stack("jpeg2000_signed", (large * 16).astype("i2"), "i2", lossless, pack=encode)
    def tiled(array):
        buffer = io.BytesIO()
        picture = PIL.Image.fromarray(array)
        assert picture.mode == "I;16"
        picture.save(buffer, "JPEG2000", tile_size=(16, 16), num_resolutions=3, irreversible=False, no_jp2=True)
        return buffer.getvalue()
    stack("jpeg2000_tiles", (large + 2000).astype("u2"), "u2", lossless, pack=tiled)
    stack("jpeg2000_lossy", large, "i2", lossy, LossyImageCompression="01",
          pack=lambda array: encode(array, compression_ratios=[4]))


def main():
    signed = values("i2", (-30000, 60000))
    for name, syntax in [
        ("explicit", uid.ExplicitVRLittleEndian),
        ("implicit", uid.ImplicitVRLittleEndian),
        ("big_endian", uid.ExplicitVRBigEndian),
        ("deflated", uid.DeflatedExplicitVRLittleEndian),
        ("rle", uid.RLELossless),
    ]:
        stack(name, signed, "i2", syntax)
    twelve = values("u2", (0, 4095))
    ct = dict(BitsStored=12, HighBit=11, RescaleSlope="1", RescaleIntercept="-1024")
    stack("twelve_bits", twelve, "i2", **ct)
    stack("jpeg_lossless", twelve, "i2", uid.JPEGLosslessSV1, pack=imagecodecs.ljpeg_encode, **ct)
    stack("jpeg", values("u1", (0, 255)), "u1", uid.JPEGBaseline8Bit, pack=lambda a: imagecodecs.jpeg8_encode(a, 100))
    stack("bytes", values("u1", (0, 255)), "u1")
    stack("signed_bytes", values("i1", (-128, 255)), "i1")
    stack("rle_bytes", values("u1", (0, 255)), "u1", uid.RLELossless)
    stack("wide", values("u2", (0, 65535)), "i4", RescaleSlope="1", RescaleIntercept="-1000")
    stack("scaled", signed, "f4", RescaleSlope="0.25", RescaleIntercept="7.5")
    stack("low_is_bright", signed, "i2", PhotometricInterpretation="MONOCHROME1")
    stack("tilted", signed, "i2", step=(0, 1, 2))
    stack("oblique", signed, "i2", orientation=OBLIQUE, step=(0, -1.6, -1.2))
    jpeg2000(twelve, ct)
    multi_frame()
    dose()
    several()
    odd()
    (HERE / "expected.json").write_text(json.dumps(EXPECTED, indent=1).replace("\n   ", " ") + "\n")


main()
