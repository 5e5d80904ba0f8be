"""Makes the TIFF fixtures beside it and `expected.json`, what tifffile reads back from them.

Written and read with tifffile 2026.3.3, imagecodecs 2026.3.6, numpy 2.4.6; Python 3.11. The tests need none of them.
"""

import json
import pathlib

import numpy as np
import tifffile

HERE = pathlib.Path(__file__).parent
SIZE = (3, 4, 5)  # slices, rows, columns
EXPECTED = {}


def values(dtype, size=SIZE):
    """Every voxel another value, over the type's whole range, and no symmetry."""
    kind = np.dtype(dtype).kind
    low, high = (-1e3, 1e3) if kind == "f" else (np.iinfo(dtype).min, np.iinfo(dtype).max)
    ramp = np.linspace(0, 1, int(np.prod(size))) ** 1.5
    return (ramp * (float(high) - low) * 0.999 + low).astype(dtype).reshape(size)


def write(name, array, spacing=(1, 1, 1), shown=None, **options):
    path = HERE / name
    tifffile.imwrite(path, array, **({"photometric": "minisblack", "metadata": None} | options))
    read = tifffile.imread(path)
    assert read.shape == array.shape and (read == array).all(), name
    voxels = read if shown is None else read[shown]
    kind = "f32" if voxels.dtype == np.float16 else f"{voxels.dtype.kind}{voxels.dtype.itemsize * 8}"
    EXPECTED[name] = {
        "type": kind,
        "dims": list(voxels.shape[::-1]),
        "spacing": list(spacing),
        "voxels": [float(v) for v in voxels.ravel()],
    }


def main():
    for dtype in ["u1", "i1", "u2", "i2", "u4", "i4", "f2", "f4", "f8"]:
        write(f"{dtype}.tif", values(dtype))
    write("big_endian.tif", values("i2"), byteorder=">")
    write("big_endian_float.tif", values("f4"), byteorder=">", compression="zlib", predictor=True)
    write("bigtiff.tif", values("u2"), bigtiff=True)
    write("tiles.tif", values("u2", (3, 20, 33)), tile=(16, 16), compression="zlib")
    write("strips.tif", values("i4", (3, 7, 5)), rowsperstrip=2)
    write("deflate.tif", values("u2"), compression="zlib", predictor=True)
    write("lzw.tif", values("u2"), compression="lzw", predictor=True)
    write("packbits.tif", values("u1"), compression="packbits")
    # Z, channels: ImageJ's lengths in micrometres.
    imagej = dict(imagej=True, resolution=(4, 2))
    write("imagej.tif", values("u2"), (0.25e-3, 0.5e-3, 1.5e-3), **imagej,
          metadata={"axes": "ZYX", "spacing": 1.5, "unit": "um"})
    write("imagej_channels.tif", values("u2", (2, 3, 2, 4, 5)), (0.25, 0.5, 1.5), np.s_[0, :, 1], **imagej,
          metadata={"axes": "TZCYX", "spacing": 1.5, "unit": "mm"})
    ome = {"PhysicalSizeX": 0.25, "PhysicalSizeY": 0.5, "PhysicalSizeZ": 1.5}
    micro = (0.25e-3, 0.5e-3, 1.5e-3)
    write("ome.ome.tif", values("u2"), micro, metadata={"axes": "ZYX"} | ome)
    named = {"Channel": {"Name": ["DAPI", "GFP"]}}
    write("ome_channels.ome.tif", values("u2", (2, 3, 2, 4, 5)), micro, np.s_[0, :, 1],
          metadata={"axes": "TZCYX"} | ome | named)
    write("ome_order.ome.tif", values("u2", (2, 2, 3, 4, 5)), micro, np.s_[0, 1],
          metadata={"axes": "TCZYX"} | ome | named)
    nm = {f"PhysicalSize{axis}Unit": "nm" for axis in "XYZ"}
    write("ome_nanometres.ome.tif", values("f4"), (0.25e-6, 0.5e-6, 1.5e-6), metadata={"axes": "ZYX"} | ome | nm)

    tifffile.imwrite(HERE / "colour.tif", np.zeros((3, 4, 5, 3), "u1"), photometric="rgb", metadata=None)
    tifffile.imwrite(HERE / "zstd.tif", values("u2"), compression="zstd", photometric="minisblack", metadata=None)
    with tifffile.TiffWriter(HERE / "sizes.tif") as file:
        for rows in [4, 4, 6]:
            file.write(np.zeros((rows, 5), "u2"), photometric="minisblack", metadata=None)
    with tifffile.TiffWriter(HERE / "thumbnail.tif") as file:
        for page in values("u2"):
            file.write(page, photometric="minisblack", metadata=None)
        file.write(np.zeros((2, 2), "u2"), photometric="minisblack", metadata=None, subfiletype=1)
    EXPECTED["thumbnail.tif"] = EXPECTED["u2.tif"]
    (HERE / "expected.json").write_text(json.dumps(EXPECTED, indent=1).replace("\n   ", " ") + "\n")


main()
