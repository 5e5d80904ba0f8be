#!/usr/bin/env python3
"""Compares what a running server makes of files with what SimpleITK and pydicom make of them: dims, type, range, spacing,
the world positions of all corners, the histogram, and every voxel; by upload and by path.

    pip install numpy SimpleITK pydicom
    spao-server serve --data-dir FOLDER &
    scripts/compare-readers.py FOLDER

A zip is taken for a DICOM series; a detached header is uploaded in a zip with the files that are called like it.
"""

import argparse
import io
import itertools
import json
import pathlib
import sys
import urllib.request
import zipfile

import numpy as np
import pydicom
import SimpleITK

TYPES = {"u8": "uint8", "i8": "int8", "u16": "uint16", "i16": "int16", "u32": "uint32", "i32": "int32"}
TYPES |= {"f32": "float32", "f64": "float64", "u64": "uint64", "i64": "int64"}


def upload_of(path):
    if path.suffix not in (".nhdr", ".mhd"):
        return path.read_bytes()
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for file in path.parent.glob(f"{path.stem}.*"):
            archive.write(file, file.name)
    return packed.getvalue()


def by_simpleitk(path):
    """Voxels (z, y, x) and the affine of indices to the world, LPS."""
    image = SimpleITK.ReadImage(str(path))
    matrix = np.eye(4)
    matrix[:3, :3] = np.array(image.GetDirection()).reshape(3, 3) * np.array(image.GetSpacing())
    matrix[:3, 3] = image.GetOrigin()
    return SimpleITK.GetArrayFromImage(image), matrix


def by_pydicom(path):
    """As by_simpleitk, of a zip with one series."""
    with zipfile.ZipFile(path) as archive:
        files = [pydicom.dcmread(io.BytesIO(archive.read(name))) for name in archive.namelist() if not name.endswith("/")]
    x_axis, y_axis = np.array(files[0].ImageOrientationPatient, float).reshape(2, 3)
    along = np.cross(x_axis, y_axis)
    files.sort(key=lambda file: np.dot(along, np.array(file.ImagePositionPatient, float)))
    first, last = (np.array(file.ImagePositionPatient, float) for file in (files[0], files[-1]))
    rows, columns = map(float, files[0].PixelSpacing)
    matrix = np.eye(4)
    matrix[:3, :3] = np.array([x_axis * columns, y_axis * rows, (last - first) / (len(files) - 1)]).T
    matrix[:3, 3] = first
    voxels = [file.pixel_array * int(file.RescaleSlope) + int(file.RescaleIntercept) for file in files]
    return np.stack(voxels), matrix


class Server:
    """The server's answers."""

    def __init__(self, url):
        self.url = url

    def call(self, method, path, body=None, kind="application/octet-stream"):
        request = urllib.request.Request(f"{self.url}/v1/{path}", body, {"Content-Type": kind}, method=method)
        with urllib.request.urlopen(request) as response:
            return response.read()

    def json(self, *arguments):
        return json.loads(self.call(*arguments))


def check(server, volume, voxels, affine):
    """What differs, in words."""
    dims = np.array(voxels.shape[::-1])
    if volume["dims"] != dims.tolist():
        yield f"dims {volume['dims']}, expected {dims.tolist()}"
        return
    spacing = np.linalg.norm(affine[:3, :3], axis=0)
    if not np.allclose(volume["spacing"], spacing, rtol=1e-5):
        yield f"spacing {volume['spacing']}, expected {spacing}"
    ours = np.eye(4)
    ours[:3, :3] = np.array(volume["direction"]).T * volume["spacing"]
    ours[:3, 3] = volume["origin"]
    corners = np.array([[*corner, 1] for corner in itertools.product(*[(0, n - 1) for n in dims])]).T
    apart = np.abs((ours @ corners - affine @ corners)[:3]).max()
    if apart > 1e-3 * spacing.min():
        yield f"corners up to {apart} apart"
    if volume["value_range"] != [voxels.min(), voxels.max()]:
        yield f"range {volume['value_range']}, expected {[voxels.min(), voxels.max()]}"
    downloaded = np.load(io.BytesIO(server.call("GET", f"volumes/{volume['id']}/data?format=npy")))
    if downloaded.dtype != TYPES[volume["voxel_type"]] or not np.can_cast(downloaded.dtype, voxels.dtype, "safe"):
        yield f"type {volume['voxel_type']}, downloaded as {downloaded.dtype}, expected {voxels.dtype}"
    if not np.array_equal(downloaded, voxels):
        yield f"{np.count_nonzero(downloaded != voxels)} of {voxels.size} voxels differ"
    histogram = server.json("GET", f"volumes/{volume['id']}/histogram?bins=256")
    low, high = histogram["range"]
    # Bins of whole numbers are found without rounding on either side.
    scaled = (voxels.astype(np.float64) - low) * (256 / (high - low))
    counts = np.bincount(np.clip(scaled.astype(np.int64), 0, 255).ravel(), minlength=256)
    if histogram["counts"] != counts.tolist():
        yield f"histogram differs by {np.abs(np.array(histogram['counts']) - counts).sum()}"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=pathlib.Path, help="what the server's --data-dir is")
    parser.add_argument("--url", default="http://127.0.0.1:8080")
    args = parser.parse_args()
    server, failed = Server(args.url), 0
    for path in sorted(args.folder.iterdir()):
        if not path.is_file() or path.suffix == ".raw":
            continue
        voxels, affine = by_pydicom(path) if path.suffix == ".zip" else by_simpleitk(path)
        source = json.dumps({"source": {"path": path.name}}).encode()
        ways = {
            "path": lambda: server.json("POST", "volumes", source, "application/json"),
            "upload": lambda: server.json("POST", "volumes", upload_of(path)),
        }
        for way, load in ways.items():
            volume = load()
            faults = list(check(server, volume, voxels, affine))
            failed += bool(faults)
            what = f"{volume['dims']} {volume['voxel_type']} {[round(s, 4) for s in volume['spacing']]}"
            print(f"{path.name} by {way}: {what}: {'; '.join(faults) or 'equal'}", flush=True)
            server.call("DELETE", f"volumes/{volume['id']}?force=true")
    sys.exit(failed > 0)


if __name__ == "__main__":
    main()
