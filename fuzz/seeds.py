#!/usr/bin/env python3
"""Fills fuzz/corpus/ from the files of the tests, one folder for each target."""

import gzip
import io
import pathlib
import tarfile
import zipfile

HERE = pathlib.Path(__file__).resolve().parent
TESTS = HERE.parent / "tests"
VOLUMES = TESTS / "it/volume/fixtures/files"
DICOM = TESTS / "data/dicom"
TIFF = TESTS / "data/tiff"
ZARR = TESTS / "data/zarr"


def seed(target, name, data):
    folder = HERE / "corpus" / target
    folder.mkdir(parents=True, exist_ok=True)
    (folder / f"seed_{name}").write_bytes(data)


def as_tar(files):
    archive = io.BytesIO()
    with tarfile.open(fileobj=archive, mode="w", format=tarfile.USTAR_FORMAT) as tar:
        for name, data in files:
            info = tarfile.TarInfo(name)
            info.size = len(data)
            tar.addfile(info, io.BytesIO(data))
    return archive.getvalue()


def main():
    targets = [("nrrd", "*.nrrd"), ("nifti", "*.nii"), ("metaimage", "*.m[hr][ad]"), ("npy", "*.npy"), ("npz", "*.npz")]
    for target, pattern in [*targets, ("vti", "*.vti")]:
        for file in sorted(VOLUMES.glob(pattern)):
            seed(target, file.name, file.read_bytes())
    for file in sorted(VOLUMES.iterdir()):
        if file.suffix in (".gz", ".zst"):
            seed("wrapped", file.name, file.read_bytes())
    for target, _ in [*targets, ("vti", "")]:
        file = sorted((HERE / "corpus" / target).glob("seed_*"))[0]
        seed("wrapped", f"{file.name}.gz", gzip.compress(file.read_bytes(), mtime=0))
    for header in sorted(VOLUMES.glob("*.mhd")):
        files = [(file.name, file.read_bytes()) for file in sorted(VOLUMES.glob(f"{header.stem}.*"))]
        seed("packed", f"{header.stem}.tar", as_tar(files))
        text = header.read_bytes()
        seed("packed", header.name, bytes([len(text) // 2]) + text.ljust(len(text) // 2 * 2) + bytes(512))
    nrrd = b"NRRD0001\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\ndata file: d.raw\n\n"
    seed("packed", "detached.nhdr", bytes([len(nrrd) // 2]) + nrrd.ljust(len(nrrd) // 2 * 2) + bytes(8))
    # Encodings that no fixture has.
    fields = "type: int16\ndimension: 3\nsizes: 2 2 2\nendian: little\nspace: RAS\nspace origin: (1,2,3)\n"
    fields += "space directions: (1,0,0) (0,0,2) (0,3,0)\nkey:=value\n"
    voxels = bytes(range(16))
    for encoding, data in [("raw", voxels), ("gzip", gzip.compress(voxels, mtime=0)), ("ascii", b"1 2 3 4 5 6 7 8\n")]:
        seed("nrrd", f"{encoding}.nrrd", f"NRRD0005\n{fields}encoding: {encoding}\n\n".encode() + data)
    for file in sorted(DICOM.glob("*.dcm")):
        seed("dicom_file", file.name, file.read_bytes())
    for file in sorted(DICOM.glob("*.zip")):
        with zipfile.ZipFile(file) as archive:
            files = [(name, archive.read(name)) for name in archive.namelist() if not name.endswith("/")]
        # Large files are mutated where it does not matter.
        if file.stat().st_size < 20_000:
            seed("dicom_archive", file.name, file.read_bytes())
        tar = as_tar(files[:4])
        if len(tar) < 40_000:
            seed("dicom_archive", f"{file.stem}.tar", tar)
        seed("dicom_file", f"{file.stem}.dcm", files[len(files) // 2][1])
    for file in sorted([*ZARR.glob("*.zip"), *ZARR.glob("*.tar")]):
        # As tar: a mutated byte is no wrong checksum of a zip.
        if file.suffix == ".tar" or file.name.startswith("ome"):
            seed("zarr", file.name, file.read_bytes())
        if file.suffix == ".zip":
            with zipfile.ZipFile(file) as archive:
                files = [(name, archive.read(name)) for name in archive.namelist()]
            # Few chunks are as good as many, and metadata are found sooner among them.
            metadata = [(name, data) for name, data in files if name.rsplit("/")[-1][0] in ".z"]
            seed("zarr", f"{file.stem}.tar", as_tar(metadata + [f for f in files if f not in metadata][:4]))
    for file in sorted(TIFF.glob("*.tif")):
        seed("tiff", file.name, file.read_bytes())


if __name__ == "__main__":
    main()
