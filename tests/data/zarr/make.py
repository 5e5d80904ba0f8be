"""Makes the archives here, and `expected_2.json` or `expected_3.json`: Zarr hierarchies written by other libraries.

    pip install zarr==2.18.7 numcodecs==0.15.2 numpy==2.2.6 && python tests/data/zarr/make.py
    pip install zarr==3.1.6 ome-zarr==0.18.0 numpy==2.4.6 tensorstore==0.1.86 && python tests/data/zarr/make.py

Each run makes what its version of zarr-python is for; the second one also has every array read by tensorstore, and
compares. Volumes have 5 x 4 x 3 voxels, so that no axis can be taken for another, in chunks of 2 x 3 x 2 that do not
fill them; `large_*` have so many that Blosc has several blocks, split ones, and a last one that is shorter. What is
expected is in the terms of this project: dims x, y, z, lengths in mm, the SHA-256 of the voxels, x fastest and
little-endian.
"""

import hashlib
import json
import pathlib
import shutil
import tarfile
import tempfile
import zipfile

import numcodecs
import numpy as np
import zarr

HERE = pathlib.Path(__file__).parent
SHAPE, CHUNKS = (3, 4, 5), (2, 3, 2)
LARGE, LARGE_CHUNKS = (5, 33, 35), (3, 33, 35)
NAMES = {"bool": "u8", "uint8": "u8", "int8": "i8", "uint16": "u16", "int16": "i16", "uint32": "u32", "int32": "i32",
         "uint64": "u64", "int64": "i64", "float16": "f32", "float32": "f32", "float64": "f64"}
expected = []


def voxels(name, shape=SHAPE):
    """All of an integer type's range, or fractions; no two rows alike."""
    count = int(np.prod(shape))
    i = np.arange(count) * 37 % 60
    dtype = np.dtype(name)
    if dtype.kind == "b":
        return (i % 3 == 0).reshape(shape)
    if dtype.kind == "f":
        return ((i - 17.3) * 1.7e2).astype(dtype).reshape(shape)
    info = np.iinfo(dtype)
    span = int(info.max) - int(info.min)
    return np.array([int(info.min) + span * int(k) // 59 for k in i], dtype=dtype).reshape(shape)


def large(name):
    """Smooth, so that it can be packed, with some noise."""
    z, y, x = np.meshgrid(*[np.arange(n) for n in LARGE], indexing="ij")
    noise = np.random.default_rng(1).integers(0, 3, LARGE)
    return (z * 1000 + y * 30 + x * 7 + noise).astype(name)


def expect(file, values, spacing=(1, 1, 1), origin=(0, 0, 0), channel=None, scale=None):
    values = np.ascontiguousarray(values)
    name = NAMES[values.dtype.newbyteorder("=").name]
    little = values.astype(np.dtype(name[0] + str(int(name[1:]) // 8)).newbyteorder("<"))
    z, y, x = values.shape
    expected.append({"file": file, "channel": channel, "scale": scale, "expect": {
        "file": file, "dims": [x, y, z], "type": name, "spacing": [float(s) for s in spacing],
        "origin": [float(o) for o in origin], "direction": [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
        "sha256": hashlib.sha256(little.tobytes()).hexdigest(), "patient_axes": False}})


def pack(folder, name, within=""):
    """As an archive with the hierarchy at its root, or in a folder."""
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    if name.endswith(".zip"):
        with zipfile.ZipFile(HERE / name, "w", zipfile.ZIP_DEFLATED if within else zipfile.ZIP_STORED) as archive:
            for path in files:
                info = zipfile.ZipInfo(within + path.relative_to(folder).as_posix())
                archive.writestr(info, path.read_bytes(), archive.compression)
    else:
        with tarfile.open(HERE / name, "w", format=tarfile.USTAR_FORMAT) as archive:
            for path in files:
                info = tarfile.TarInfo(within + path.relative_to(folder).as_posix())
                info.size = path.stat().st_size
                archive.addfile(info, path.open("rb"))


def check_by_tensorstore(folder, values, version):
    import tensorstore
    spec = {"driver": "zarr" if version == 2 else "zarr3", "kvstore": {"driver": "file", "path": f"{folder}/"}}
    if version == 2:
        # tensorstore does not look for it.
        spec["metadata"] = {"dimension_separator": json.loads((folder / ".zarray").read_text())
                            .get("dimension_separator", ".")}
    read = tensorstore.open(spec, read=True).result().read().result()
    assert np.array_equal(np.asarray(read), values, equal_nan=values.dtype.kind == "f"), folder


def array(name, values, archive="zip", within="", check=True, write=None, **options):
    """An array alone; `write` writes its values, or some of them."""
    folder = pathlib.Path(tempfile.mkdtemp())
    options.setdefault("chunks", CHUNKS if values.shape == SHAPE else LARGE_CHUNKS)
    if zarr.__version__.startswith("2"):
        made = zarr.open(zarr.DirectoryStore(str(folder)), mode="w", shape=values.shape, dtype=values.dtype, **options)
    else:
        made = zarr.create_array(zarr.storage.LocalStore(folder), shape=values.shape, dtype=values.dtype, **options)
    if write:
        write(made)
    else:
        made[...] = values
    read = made[...]
    if check and not zarr.__version__.startswith("2"):
        check_by_tensorstore(folder, read, options.get("zarr_format", 3))
    pack(folder, f"{name}.{archive}", within)
    expect(f"{name}.{archive}", read)
    shutil.rmtree(folder)


def make_2():
    for dtype in NAMES:
        array(f"v2_{NAMES[dtype]}_{dtype}", voxels(dtype))
    for dtype in ["int16", "float32"]:
        array(f"v2_big_{dtype}", voxels(dtype).astype(np.dtype(dtype).newbyteorder(">")))
    i16 = voxels("int16")
    array("v2_fortran", i16, order="F", archive="tar")
    array("v2_slashes", i16, dimension_separator="/", within="cells.zarr/")
    codecs = {"plain": None, "gzip": numcodecs.GZip(), "zlib": numcodecs.Zlib(), "zstd": numcodecs.Zstd(),
              "lz4": numcodecs.LZ4()}
    for name, compressor in codecs.items():
        array(f"v2_{name}", i16, compressor=compressor)
    for packing in ["blosclz", "lz4", "lz4hc", "zlib", "zstd"]:
        for shuffle, dtype in [(0, "int32"), (1, "int16"), (1, "float64"), (2, "uint16")]:
            compressor = numcodecs.Blosc(packing, 5, shuffle, blocksize=4096)
            array(f"large_{packing}_{shuffle}_{dtype}", large(dtype), compressor=compressor)
    def half(made):
        made[:2, :3] = i16[:2, :3]
    array("v2_missing_chunks", i16, fill_value=-7, write=half)


def make_3():
    from zarr.codecs import BloscCodec, BytesCodec, Crc32cCodec, GzipCodec, ShardingCodec, TransposeCodec, ZstdCodec
    for dtype in NAMES:
        array(f"v3_{NAMES[dtype]}_{dtype}", voxels(dtype))
    i16 = voxels("int16")
    array("v3_big", i16, serializer=BytesCodec(endian="big"))
    array("v3_gzip", i16, compressors=GzipCodec(), archive="tar")
    array("v3_zstd", i16, compressors=ZstdCodec(checksum=True), within="cells.ome.zarr/")
    array("v3_blosc", large("int16"), compressors=BloscCodec(cname="zstd", shuffle="bitshuffle", typesize=2))
    array("v3_crc32c", i16, compressors=[ZstdCodec(), Crc32cCodec()])
    array("v3_transposed", i16, filters=TransposeCodec(order=(2, 0, 1)), compressors=None)
    array("v3_v2_keys", i16, chunk_key_encoding={"name": "v2", "separator": "."})
    def some(made):
        made[2:, 3:, 2:] = values[2:, 3:, 2:]
    values = voxels("float32")
    array("v3_missing_chunks", values, fill_value=float("nan"), write=some)
    big = (4, 6, 8)
    array("v3_shards", i16, shards=(4, 3, 4))
    array("v3_shards_large", large("int16"), chunks=(2, 11, 7), shards=(4, 33, 14), within="shards/")
    for name, location, endian in [("start", "start", "little"), ("end_big", "end", "big")]:
        shards = ShardingCodec(chunk_shape=CHUNKS, codecs=[TransposeCodec(order=(1, 2, 0)), BytesCodec(endian="little"),
                                                           GzipCodec()],
                               index_codecs=[BytesCodec(endian=endian)], index_location=location)
        array(f"v3_shards_{name}", i16, chunks=big, serializer=shards, compressors=None)
    array("v3_shards_missing", i16, shards=big, fill_value=9,
          write=lambda made: made.__setitem__((slice(0, 2), slice(3, 4)), i16[:2, 3:4]))
    array("v3_format_2", i16, zarr_format=2)
    make_ome()


def make_ome():
    """Two levels, two channels, two time points; lengths in nanometres and micrometres, and as they are."""
    from ome_zarr import format as ome_format
    from ome_zarr import writer
    t, c = 2, 2
    planes = np.stack([np.stack([voxels("uint16") + 100 * k + i for k in range(c)]) for i in range(t)])
    coarse = planes[..., ::2, ::2]
    for version, kind in [("04", ome_format.FormatV04()), ("05", ome_format.FormatV05())]:
        folder = pathlib.Path(tempfile.mkdtemp())
        group = zarr.open_group(folder, mode="w", zarr_format=kind.zarr_format)
        unit = {"x": "nanometer", "y": "nanometer", "z": "micrometer"}
        axes = [{"name": "t", "type": "time", "unit": "second"}, {"name": "c", "type": "channel"},
                *({"name": a, "type": "space", "unit": unit[a]} for a in "zyx")]
        scales = [[1, 1, 2.5, 500, 250], [1, 1, 2.5, 1000, 500]]
        steps = [[{"type": "scale", "scale": scale}, {"type": "translation", "translation": [0, 0, 10, 100 * k, 50 * k]}]
                 for k, scale in enumerate(scales)]
        writer.write_multiscale([planes, coarse], group, fmt=kind, axes=axes, coordinate_transformations=steps,
                                storage_options={"chunks": (1, 2, 2, 3, 2)}, name="Jane Doe",
                                metadata={"omero": {"channels": [{"label": "DAPI"}, {"label": "GFP"}]}})
        if version == "04":
            attributes = json.loads((folder / ".zattrs").read_text())
            attributes.setdefault("omero", {"channels": [{"label": "DAPI"}, {"label": "GFP"}]})
            (folder / ".zattrs").write_text(json.dumps(attributes))
        for level, (values, scale) in enumerate(zip([planes, coarse], scales)):
            path = folder / json.loads(json.dumps(group.attrs.asdict() if kind.zarr_format == 2 else
                                                  group.attrs["ome"]))["multiscales"][0]["datasets"][level]["path"]
            check_by_tensorstore(path, values, kind.zarr_format)
        pack(folder, f"ome_{version}.zip", f"ome_{version}.zarr/")
        shutil.rmtree(folder)
        for level, (values, scale) in enumerate(zip([planes, coarse], scales)):
            for channel in range(c):
                spacing = [scale[4] * 1e-6, scale[3] * 1e-6, scale[2] * 1e-3]
                origin = [50e-6 * level, 100e-6 * level, 10e-3]
                expect(f"ome_{version}.zip", values[0, channel], spacing, origin, channel, level)
    # Three axes, no units.
    folder = pathlib.Path(tempfile.mkdtemp())
    group = zarr.open_group(folder, mode="w", zarr_format=3)
    writer.write_image(voxels("uint8"), group, fmt=ome_format.FormatV05(), axes="zyx", scale_factors=[])
    pack(folder, "ome_zyx.zip")
    expect("ome_zyx.zip", voxels("uint8"))
    shutil.rmtree(folder)
    # Labels of an image.
    folder = pathlib.Path(tempfile.mkdtemp())
    group = zarr.open_group(folder, mode="w", zarr_format=2)
    labels = (voxels("uint8") // 50).astype("uint32")
    writer.write_labels(labels, group, name="nuclei", fmt=ome_format.FormatV04(), axes="zyx", scale_factors=[])
    pack(folder / "labels" / "nuclei", "ome_labels.zip")
    expect("ome_labels.zip", labels)
    shutil.rmtree(folder)


def main():
    version = zarr.__version__[0]
    make_2() if version == "2" else make_3()
    lines = ",\n".join(json.dumps(entry) for entry in expected)
    (HERE / f"expected_{version}.json").write_text(f"[\n{lines}\n]\n")


main()
