//! Small files of every format with the sizes, distances, axes and values that a test asks for, however wrong.

use std::io::{Cursor, Write};

use spao_server::volume::{Endian, Format, Limits, RawSpec, Volume, VolumeError, VoxelType, format};
use zip::write::SimpleFileOptions;

/// What a file says; its voxels are `f32`.
#[derive(Clone)]
pub(crate) struct Made {
    /// Of the header, whatever `values` there are.
    pub(crate) dims: [u64; 3],
    pub(crate) spacing: [f64; 3],
    /// World direction of each axis.
    pub(crate) axes: [[f64; 3]; 3],
    pub(crate) values: Vec<f32>,
}

impl Made {
    /// A sound file of values that differ.
    pub(crate) fn new(dims: [u64; 3]) -> Self {
        let count = dims.iter().product::<u64>();
        let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
        Self { dims, spacing: [1.0; 3], axes, values: (0..count).map(|i| i as f32 * 0.5 - 1.0).collect() }
    }

    fn bytes(&self) -> Vec<u8> {
        self.values.iter().flat_map(|value| value.to_le_bytes()).collect()
    }

    fn step(&self, axis: usize) -> [f64; 3] {
        self.axes[axis].map(|component| component * self.spacing[axis])
    }
}

/// How to make a file of a format.
pub(crate) struct Maker {
    pub(crate) format: Format,
    /// Whether its files say how far apart voxels are.
    pub(crate) has_spacing: bool,
    /// Whether its files say where axes point.
    pub(crate) has_axes: bool,
    pub(crate) make: fn(&Made) -> Vec<u8>,
}

/// One for each format with a header.
pub(crate) const MAKERS: [Maker; 9] = [
    Maker { format: Format::Nrrd, has_spacing: true, has_axes: true, make: nrrd },
    Maker { format: Format::Nifti, has_spacing: true, has_axes: true, make: nifti },
    Maker { format: Format::MetaImage, has_spacing: true, has_axes: true, make: metaimage },
    Maker { format: Format::Npy, has_spacing: false, has_axes: false, make: npy },
    Maker { format: Format::Npz, has_spacing: false, has_axes: false, make: npz },
    Maker { format: Format::Vti, has_spacing: true, has_axes: true, make: vti },
    Maker { format: Format::Dicom, has_spacing: true, has_axes: true, make: dicom },
    Maker { format: Format::Tiff, has_spacing: true, has_axes: false, make: tiff },
    Maker { format: Format::Zarr, has_spacing: true, has_axes: false, make: zarr },
];

impl Maker {
    /// Makes and reads a file.
    pub(crate) fn read(&self, made: &Made) -> Result<Volume, VolumeError> {
        format::read_bytes(&(self.make)(made), self.format, None, &Limits::default())
    }
}

/// Reads voxels alone.
pub(crate) fn read_raw(made: &Made) -> Result<Volume, VolumeError> {
    let dims = made.dims.map(|n| u32::try_from(n).unwrap_or(u32::MAX));
    let spec = RawSpec { dims, voxel_type: VoxelType::F32, endian: Endian::Little, spacing: made.spacing };
    format::read_bytes(&made.bytes(), Format::Raw, Some(&spec), &Limits::default())
}

fn joined<const N: usize>(numbers: [f64; N], by: &str) -> String {
    numbers.map(|number| number.to_string()).join(by)
}

fn nrrd(made: &Made) -> Vec<u8> {
    let [x, y, z] = made.dims;
    let directions = [0, 1, 2].map(|axis| format!("({})", joined(made.step(axis), ","))).join(" ");
    let header = format!(
        "NRRD0004\ntype: float\ndimension: 3\nsizes: {x} {y} {z}\nspace: LPS\nspace directions: {directions}\n\
         endian: little\nencoding: raw\n\n"
    );
    [header.as_bytes(), &made.bytes()].concat()
}

fn nifti(made: &Made) -> Vec<u8> {
    let mut header = vec![0; 544];
    let mut put = |at: usize, bytes: &[u8]| header[at..at + bytes.len()].copy_from_slice(bytes);
    put(0, &540_i32.to_le_bytes());
    put(4, b"n+2\0\r\n\x1a\n");
    put(12, &16_i16.to_le_bytes());
    put(14, &32_i16.to_le_bytes());
    for (i, n) in [3, made.dims[0], made.dims[1], made.dims[2], 1, 1, 1, 1].into_iter().enumerate() {
        put(16 + 8 * i, &n.to_le_bytes());
    }
    put(168, &544_i64.to_le_bytes());
    put(348, &1_i32.to_le_bytes());
    for axis in 0..3 {
        put(112 + 8 * axis, &made.spacing[axis].to_le_bytes());
        for (row, component) in made.step(axis).into_iter().enumerate() {
            put(400 + 32 * row + 8 * axis, &component.to_le_bytes());
        }
    }
    header.extend(made.bytes());
    header
}

fn metaimage(made: &Made) -> Vec<u8> {
    let [x, y, z] = made.dims;
    let matrix = made.axes.map(|axis| joined(axis, " ")).join(" ");
    let header = format!(
        "ObjectType = Image\nNDims = 3\nBinaryData = True\nTransformMatrix = {matrix}\nElementSpacing = {}\n\
         DimSize = {x} {y} {z}\nElementType = MET_FLOAT\nElementDataFile = LOCAL\n",
        joined(made.spacing, " ")
    );
    [header.as_bytes(), &made.bytes()].concat()
}

fn npy(made: &Made) -> Vec<u8> {
    let [x, y, z] = made.dims;
    let header = format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({z}, {y}, {x}), }}\n");
    [b"\x93NUMPY\x01\x00", &(header.len() as u16).to_le_bytes()[..], header.as_bytes(), &made.bytes()].concat()
}

fn npz(made: &Made) -> Vec<u8> {
    let deflated = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Deflated);
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    archive.start_file("array.npy", deflated).expect("memory is written");
    archive.write_all(&npy(made)).expect("memory is written");
    archive.finish().expect("memory is written").into_inner()
}

fn vti(made: &Made) -> Vec<u8> {
    let [x, y, z] = made.dims.map(|n| i128::from(n) - 1);
    let direction = [0, 1, 2].map(|row| joined(made.axes.map(|axis| axis[row]), " ")).join(" ");
    let values: Vec<_> = made.values.iter().map(f32::to_string).collect();
    let text = format!(
        "<VTKFile type=\"ImageData\" version=\"1.0\" byte_order=\"LittleEndian\">\n<ImageData \
         WholeExtent=\"0 {x} 0 {y} 0 {z}\" Origin=\"0 0 0\" Spacing=\"{}\" Direction=\"{direction}\">\n\
         <Piece Extent=\"0 {x} 0 {y} 0 {z}\"><PointData Scalars=\"d\">\n\
         <DataArray type=\"Float32\" Name=\"d\" format=\"ascii\">{}</DataArray>\n\
         </PointData></Piece></ImageData></VTKFile>\n",
        joined(made.spacing, " "),
        values.join(" ")
    );
    text.into_bytes()
}

/// An element in explicit little endian.
fn element(group: u16, number: u16, vr: &[u8; 2], value: &[u8]) -> Vec<u8> {
    let mut value = value.to_vec();
    if value.len() % 2 == 1 {
        value.push(if vr == b"UI" { 0 } else { b' ' });
    }
    let length = (value.len() as u32).to_le_bytes();
    let length = if vr == b"OF" { [&[0; 2][..], &length].concat() } else { length[..2].to_vec() };
    [&group.to_le_bytes()[..], &number.to_le_bytes(), vr, &length, &value].concat()
}

/// One file of several frames, placed as a dose's are.
fn dicom(made: &Made) -> Vec<u8> {
    let [columns, rows, frames] = made.dims;
    let [across, down, apart] = made.spacing;
    let offsets: Vec<_> = (0..frames.min(8)).map(|k| (k as f64 * apart).to_string()).collect();
    let [x, y, _] = made.axes;
    let orientation = format!("{}\\{}", joined(x, "\\"), joined(y, "\\"));
    let elements = [
        element(0x0002, 0x0010, b"UI", b"1.2.840.10008.1.2.1"),
        element(0x0020, 0x000E, b"UI", b"1.2.3"),
        element(0x0020, 0x0032, b"DS", b"0\\0\\0"),
        element(0x0020, 0x0037, b"DS", orientation.as_bytes()),
        element(0x0028, 0x0004, b"CS", b"MONOCHROME2"),
        element(0x0028, 0x0008, b"IS", frames.to_string().as_bytes()),
        element(0x0028, 0x0010, b"US", &(rows as u16).to_le_bytes()),
        element(0x0028, 0x0011, b"US", &(columns as u16).to_le_bytes()),
        element(0x0028, 0x0030, b"DS", joined([down, across], "\\").as_bytes()),
        element(0x3004, 0x000C, b"DS", offsets.join("\\").as_bytes()),
        element(0x7FE0, 0x0008, b"OF", &made.bytes()),
    ];
    [&[0; 128][..], b"DICM", &elements.concat()].concat()
}

/// OME; no more than eight pages.
fn tiff(made: &Made) -> Vec<u8> {
    let [columns, rows, slices] = made.dims;
    let [x, y, z] = made.spacing;
    let text = format!(
        "<OME><Image><Pixels DimensionOrder=\"XYZCT\" Type=\"float\" SizeX=\"{columns}\" SizeY=\"{rows}\" \
         SizeZ=\"{slices}\" SizeC=\"1\" SizeT=\"1\" PhysicalSizeX=\"{x}\" PhysicalSizeXUnit=\"mm\" \
         PhysicalSizeY=\"{y}\" PhysicalSizeYUnit=\"mm\" PhysicalSizeZ=\"{z}\" PhysicalSizeZUnit=\"mm\">\
         <TiffData/></Pixels></Image></OME>\0"
    );
    let size = [columns as u32, rows as u32];
    let page = size[0].wrapping_mul(size[1]).wrapping_mul(4);
    let pages = slices.clamp(1, 8) as u32;
    // Voxels come last, after pages of eleven entries.
    let data = 8 + text.len() as u32 + pages * (2 + 11 * 12 + 4);
    let entries = |k: u32| {
        let offset = data.saturating_add(page.saturating_mul(k));
        vec![
            [0x100, 4, 1, size[0]],
            [0x101, 4, 1, size[1]],
            [0x102, 3, 1, 32],
            [0x103, 3, 1, 1],
            [0x106, 3, 1, 1],
            [0x10E, 2, text.len() as u32, 8],
            [0x111, 4, 1, offset],
            [0x115, 3, 1, 1],
            [0x116, 4, 1, size[1]],
            [0x117, 4, 1, page],
            [0x153, 3, 1, 3],
        ]
    };
    let pages: Vec<_> = (0..pages).map(entries).collect();
    [tiff_file(text.as_bytes(), &pages), made.bytes()].concat()
}

/// A little-endian TIFF: data from byte 8 on, then the pages with their entries (tag, type, count, value or offset).
pub(crate) fn tiff_file(data: &[u8], pages: &[Vec<[u32; 4]>]) -> Vec<u8> {
    let first = 8 + data.len() as u32;
    let mut file = [b"II*\0", &first.to_le_bytes()[..], data].concat();
    for (k, entries) in pages.iter().enumerate() {
        file.extend((entries.len() as u16).to_le_bytes());
        for [tag, kind, count, value] in entries {
            file.extend((*tag as u16).to_le_bytes());
            file.extend((*kind as u16).to_le_bytes());
            file.extend(count.to_le_bytes());
            file.extend(value.to_le_bytes());
        }
        let next = if k + 1 == pages.len() { 0 } else { file.len() as u32 + 4 };
        file.extend(next.to_le_bytes());
    }
    file
}

/// A zip of files.
pub(crate) fn zip_of(files: &[(&str, &[u8])]) -> Vec<u8> {
    let stored = SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    let mut archive = zip::ZipWriter::new(Cursor::new(Vec::new()));
    for (name, bytes) in files {
        archive.start_file(*name, stored).expect("memory is written");
        archive.write_all(bytes).expect("memory is written");
    }
    archive.finish().expect("memory is written").into_inner()
}

fn zarr(made: &Made) -> Vec<u8> {
    let ([x, y, z], [dx, dy, dz]) = (made.dims, made.spacing);
    let [cx, cy, cz] = made.dims.map(|n| n.clamp(1, 64));
    let group = format!(
        "{{\"zarr_format\": 3, \"node_type\": \"group\", \"attributes\": {{\"ome\": {{\"version\": \"0.5\", \
         \"multiscales\": [{{\"axes\": [{}], \"datasets\": [{{\"path\": \"0\", \"coordinateTransformations\": \
         [{{\"type\": \"scale\", \"scale\": [{dz}, {dy}, {dx}]}}]}}]}}]}}}}}}",
        ["z", "y", "x"].map(|name| format!("{{\"name\": \"{name}\", \"type\": \"space\"}}")).join(", ")
    );
    let array = format!(
        "{{\"zarr_format\": 3, \"node_type\": \"array\", \"shape\": [{z}, {y}, {x}], \"data_type\": \"float32\", \
         \"chunk_grid\": {{\"name\": \"regular\", \"configuration\": {{\"chunk_shape\": [{cz}, {cy}, {cx}]}}}}, \
         \"chunk_key_encoding\": {{\"name\": \"default\"}}, \"fill_value\": 0, \
         \"codecs\": [{{\"name\": \"bytes\", \"configuration\": {{\"endian\": \"little\"}}}}]}}"
    );
    zip_of(&[("zarr.json", group.as_bytes()), ("0/zarr.json", array.as_bytes()), ("0/c/0/0/0", &made.bytes())])
}
