//! What is wrong in the same way in every format: sizes, distances, axes, values and lengths that cannot be.

use std::io::Write;

use flate2::Compression;
use flate2::write::{DeflateEncoder, GzEncoder, ZlibEncoder};
use spao_server::volume::{Format, Limits, VolumeError, format};

use super::assert_names;
use super::makers::{MAKERS, Made, read_raw, tiff_file};

/// Asserts that a file is refused for what is in it, with a field and a reason.
#[track_caller]
fn assert_refused<T>(result: Result<T, VolumeError>, what: &str) {
    let Err(error) = result else { panic!("{what} is read") };
    assert!(!matches!(error, VolumeError::Io { .. }), "{what}: {error}");
    assert!(!error.field().is_empty() && error.to_string().len() > error.field().len() + 8, "{what}: {error}");
}

#[test]
fn every_format_but_raw_has_a_maker_and_makes_what_is_asked_for() {
    let made = Made { spacing: [0.5, 0.75, 2.0], ..Made::new([4, 3, 2]) };
    for format in Format::all().filter(|format| *format != Format::Raw) {
        assert!(MAKERS.iter().any(|maker| maker.format == format), "{}", format.name());
    }
    for maker in &MAKERS {
        let volume = maker.read(&made).unwrap_or_else(|error| panic!("{}: {error}", maker.format.name()));
        assert_eq!(volume.grid.dims, [4, 3, 2], "{}", maker.format.name());
        let read: Vec<_> = (0..24).map(|i| volume.voxels.value(i) as f32).collect();
        assert_eq!(read, made.values, "{}", maker.format.name());
        if maker.has_spacing {
            assert_eq!(volume.grid.spacing.to_array(), made.spacing, "{}", maker.format.name());
        }
    }
    assert_eq!(read_raw(&made).expect("valid").grid.spacing.to_array(), made.spacing);
}

#[test]
#[should_panic(expected = "a sound file is read")]
fn the_helper_notices_a_file_that_is_read() {
    assert_refused(read_raw(&Made::new([4, 3, 2])), "a sound file");
}

#[test]
fn one_voxel_and_equal_voxels_are_a_volume() {
    for (dims, value) in [([1, 1, 1], 0.0_f32), ([1, 1, 1], -7.5), ([3, 2, 2], 7.25), ([3, 2, 2], f32::MAX)] {
        let mut made = Made::new(dims);
        made.values.fill(value);
        let volumes = MAKERS.iter().map(|maker| (maker.format.name(), maker.read(&made)));
        for (name, volume) in volumes.chain([("raw", read_raw(&made))]) {
            let volume = volume.unwrap_or_else(|error| panic!("{name}: {error}"));
            assert_eq!(volume.code_map.value_range(), [f64::from(value); 2], "{name}");
            assert!(volume.code_map.step.is_finite() && volume.code_map.step > 0.0, "{name}");
            let counts = volume.histogram(16).expect("bins").counts;
            assert_eq!(counts.iter().sum::<u64>(), volume.grid.voxel_count(), "{name}");
            assert!(volume.grid.index_from_world().is_finite(), "{name}");
        }
    }
}

#[test]
fn volumes_of_nothing_or_nothing_but_nan_are_refused() {
    for dims in [[0, 2, 2], [2, 0, 2], [2, 2, 0], [0, 0, 0]] {
        for maker in &MAKERS {
            assert_refused(maker.read(&Made::new(dims)), &format!("{dims:?} of {}", maker.format.name()));
        }
        assert_refused(read_raw(&Made::new(dims)), "raw");
    }
    let mut made = Made::new([3, 2, 2]);
    made.values[5] = f32::NAN;
    for maker in &MAKERS {
        let volume = maker.read(&made).expect("one is not a number");
        assert_eq!(volume.nan_count, 1, "{}", maker.format.name());
        let note = "1 voxel is NaN and shown as the lowest value";
        assert!(volume.about.notes.iter().any(|n| n == note), "{}", maker.format.name());
    }
    for (value, says) in [(f32::NAN, "every value is NaN"), (f32::INFINITY, "infinite"), (-f32::INFINITY, "infinite")] {
        made.values.fill(value);
        for maker in &MAKERS {
            assert_names(maker.read(&made), "voxels", says);
        }
        assert_names(read_raw(&made), "voxels", says);
    }
}

#[test]
fn sizes_that_no_machine_has_are_refused() {
    let largest = [u64::MAX, i64::MAX as u64, 1 << 62, (1 << 32) - 1, 1 << 16];
    for n in largest {
        for dims in [[n; 3], [n, 2, 1], [1, n, 2], [2, 1, n]] {
            let made = Made { dims, ..Made::new([2, 2, 1]) };
            for maker in &MAKERS {
                assert_refused(maker.read(&made), &format!("{dims:?} of {}", maker.format.name()));
            }
            assert_refused(read_raw(&made), "raw");
        }
    }
}

#[test]
fn headers_that_claim_more_than_there_is_are_refused() {
    let whole = Made::new([4, 3, 2]);
    for missing in [1, 11, 24] {
        let mut made = whole.clone();
        made.values.truncate(24 - missing);
        for maker in &MAKERS {
            assert_refused(maker.read(&made), &format!("{missing} missing of {}", maker.format.name()));
        }
        assert_refused(read_raw(&made), "raw");
    }
}

#[test]
fn distances_and_axes_that_no_space_has_are_refused() {
    let sound = Made::new([2, 2, 2]);
    for bad in [f64::NAN, f64::INFINITY, -f64::INFINITY, 0.0, 1e300, 1e-300] {
        for axis in 0..3 {
            let mut made = sound.clone();
            made.spacing[axis] = bad;
            // NaN in a NRRD's spacings means that nobody knows, but not in its directions.
            for maker in MAKERS.iter().filter(|maker| maker.has_spacing) {
                assert_refused(maker.read(&made), &format!("spacing {bad} of {}", maker.format.name()));
            }
            assert_refused(read_raw(&made), "raw");
        }
    }
    let [x, y, z] = sound.axes;
    for axes in [[x, x, z], [x, [-1.0, 0.0, 0.0], z], [x, [0.0; 3], z], [[f64::NAN; 3], y, z], [x, [1e300; 3], z]] {
        let made = Made { axes, ..sound.clone() };
        for maker in MAKERS.iter().filter(|maker| maker.has_axes) {
            assert_refused(maker.read(&made), &format!("axes {axes:?} of {}", maker.format.name()));
        }
    }
}

/// Zeros that unfold from a thousandth of themselves, four bytes of which are a voxel.
fn zeros(mut encoder: impl Write) {
    let zeros = vec![0; 1 << 20];
    (0..64).for_each(|_| encoder.write_all(&zeros).expect("to memory"));
}

#[test]
fn voxels_that_unfold_without_end_are_read_as_far_as_announced_or_refused() {
    let (mut gzip, mut zlib, mut deflate) = (Vec::new(), Vec::new(), Vec::new());
    zeros(GzEncoder::new(&mut gzip, Compression::fast()));
    zeros(ZlibEncoder::new(&mut zlib, Compression::fast()));
    zeros(DeflateEncoder::new(&mut deflate, Compression::fast()));
    let limits = Limits { max_axis: 64, max_voxels: 4096, max_bytes: 1 << 16 };
    let read = |format, parts: &[&[u8]]| format::read_bytes(&parts.concat(), format, None, &limits);

    let header = b"NRRD0004\ntype: float\ndimension: 3\nsizes: 2 2 2\nendian: little\nencoding: gzip\n\n";
    assert_eq!(read(Format::Nrrd, &[header, &gzip]).expect("the rest is ignored").voxels.len(), 8);
    let header = b"ObjectType = Image\nNDims = 3\nBinaryData = True\nCompressedData = True\nDimSize = 2 2 2\n\
                   ElementType = MET_FLOAT\nElementDataFile = LOCAL\n";
    assert_eq!(read(Format::MetaImage, &[header, &zlib]).expect("the rest is ignored").voxels.len(), 8);
    let header = b"<VTKFile type=\"ImageData\" byte_order=\"LittleEndian\" compressor=\"vtkZLibDataCompressor\">\
                   <ImageData WholeExtent=\"0 1 0 1 0 1\" Origin=\"0 0 0\" Spacing=\"1 1 1\">\
                   <Piece Extent=\"0 1 0 1 0 1\"><PointData Scalars=\"d\">\
                   <DataArray type=\"Float32\" Name=\"d\" format=\"appended\" offset=\"0\"/></PointData></Piece>\
                   </ImageData><AppendedData encoding=\"raw\">_";
    let block = |size: u32| [1, size, 0, zlib.len() as u32].map(u32::to_le_bytes).concat();
    assert_refused(read(Format::Vti, &[header, &block(32), &zlib]), "vti");
    assert_refused(read(Format::Vti, &[header, &block(64 << 20), &zlib]), "vti");
    // Deflated data sets: an element without end.
    let meta = b"\x02\x00\x10\x00UI\x16\x001.2.840.10008.1.2.1.99";
    assert_refused(read(Format::Dicom, &[&[0; 128], b"DICM", meta, &deflate]), "dicom");
    let page = |size: u32| {
        let length = zlib.len() as u32;
        let entries = [[0x100, 4, 1, 4], [0x101, 4, 1, size], [0x102, 3, 1, 8], [0x103, 3, 1, 8], [0x106, 3, 1, 1]];
        let strips = [[0x111, 4, 1, 8], [0x115, 3, 1, 1], [0x116, 4, 1, size], [0x117, 4, 1, length]];
        tiff_file(&zlib, &[[&entries[..], &strips].concat()])
    };
    assert_eq!(read(Format::Tiff, &[&page(4)]).expect("the rest is ignored").voxels.len(), 16);
    assert_names(read(Format::Tiff, &[&page(16 << 20)]), "dims", "the limit is");
}

#[test]
fn what_a_zip_or_tar_library_says_of_a_damaged_archive_is_the_files_fault_and_printable() {
    let mut zip = (MAKERS[4].make)(&Made::new([2, 2, 2]));
    let methods: Vec<_> = zip.windows(4).enumerate().filter(|(_, w)| w.starts_with(b"PK")).map(|(at, _)| at).collect();
    // The method of compression, in the file's own header and in the directory.
    zip[methods[0] + 8..methods[0] + 10].fill(0xED);
    zip[methods[1] + 10..methods[1] + 12].fill(0xED);
    for format in [Format::Npz, Format::Dicom] {
        assert_refused(format::read_bytes(&zip, format, None, &Limits::default()), format.name());
    }
    let mut tar = super::dicom::tar(&[("a\u{1b}[31m\r\nb", b"whatever")]);
    tar[148..156].copy_from_slice(b"\x1b[2J\x07abc");
    let error = format::read_bytes(&tar, Format::Dicom, None, &Limits::default()).expect_err("no sum");
    assert!(!error.to_string().contains(char::is_control), "{error:?}");
    assert_names::<()>(Err(error), "archive", "damaged");
}

/// Pages that have the same entry for the offsets of their strips.
fn pages_with_strips(pages: usize, strips: u32, data: usize) -> Vec<u8> {
    let entries = [[0x100, 4, 1, 1], [0x101, 4, 1, strips], [0x102, 3, 1, 8], [0x103, 3, 1, 1], [0x106, 3, 1, 1]];
    let strips = [[0x111, 4, strips, 8], [0x115, 3, 1, 1], [0x116, 4, 1, 1], [0x117, 4, strips, 8]];
    let page = [&entries[..], &strips].concat();
    // The first page has one strip and is not of interest.
    let mut first = page.clone();
    (first[1][3], first[5][2], first[8][2]) = (1, 1, 1);
    let mut list = vec![page; pages];
    list[0] = first;
    list[0].insert(0, [0xFE, 4, 1, 1]);
    tiff_file(&vec![0; data], &list)
}

#[test]
fn entries_of_a_tiff_page_take_no_more_memory_and_time_than_the_file_has() {
    let read = |bytes: &[u8]| format::read_bytes(bytes, Format::Tiff, None, &Limits::default());
    // A quarter of 2^32 strips in a file of a few hundred bytes: 32 GiB before the first of them is missed.
    assert_names(read(&pages_with_strips(2, 1 << 30, 64)), "pages", "larger than the limits allow");
    // A thousand pages share 64 Ki offsets: half a GiB is read of half a MiB.
    assert_names(read(&pages_with_strips(1000, 1 << 16, 1 << 18)), "pages", "share the same long entries");
    assert_names(read(&pages_with_strips(2, 4097, 1 << 15)), "dims", "4097 voxels along an axis needed");
}
