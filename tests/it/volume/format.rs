//! Raw files, recognising formats, and paths in the data directory.

use std::fs;

use spao_server::volume::{Endian, Format, Limits, RawSpec, VoxelType, bytes_needed, format, nrrd};

use super::{assert_names, sample_voxels};

fn spec(voxel_type: VoxelType, endian: Endian) -> RawSpec {
    RawSpec { dims: [2, 3, 4], voxel_type, endian, spacing: [0.5, 1.0, 2.0] }
}

#[test]
fn raw_voxels_of_every_type_are_read_from_both_byte_orders() {
    for voxel_type in VoxelType::ALL {
        for endian in [Endian::Little, Endian::Big] {
            let (voxels, bytes) = sample_voxels(voxel_type, endian);
            let spec = spec(voxel_type, endian);
            let volume = format::read_bytes(&bytes, Format::Raw, Some(&spec), &Limits::default()).expect("valid");
            assert_eq!(volume.voxels, voxels);
            assert_eq!(volume.grid.dims, [2, 3, 4]);
            assert_eq!(volume.grid.spacing.to_array(), [0.5, 1.0, 2.0]);
        }
    }
}

#[test]
fn raw_bytes_must_be_exactly_those_of_the_dims() {
    let spec = spec(VoxelType::U16, Endian::Little);
    for length in [47, 49, 0] {
        let read = format::read_bytes(&vec![1; length], Format::Raw, Some(&spec), &Limits::default());
        assert_names(read, "dims", &format!("are 48 bytes, but there are {length}"));
    }
    let huge = RawSpec { dims: [4096, 4096, 4096], ..spec };
    assert_names(format::read_bytes(&[1], Format::Raw, Some(&huge), &Limits::default()), "dims", "limit");
    let flat = RawSpec { spacing: [1.0, 0.0, 1.0], ..spec };
    assert_names(format::read_bytes(&[1; 48], Format::Raw, Some(&flat), &Limits::default()), "spacing", "0");
    assert_names(format::read_bytes(&[1; 48], Format::Raw, None, &Limits::default()), "dims", "missing");
}

#[test]
fn raw_parameters_are_parsed_strictly() {
    let parsed = RawSpec::parse("2, 3,4", "u16", Some("big"), Some("0.5,1,2")).expect("valid");
    assert_eq!(parsed, spec(VoxelType::U16, Endian::Big));
    let defaults = RawSpec::parse("2,3,4", "u8", None, None).expect("valid");
    assert_eq!((defaults.endian, defaults.spacing), (Endian::Little, [1.0; 3]));
    assert_names(RawSpec::parse("2,3", "u8", None, None), "dims", "three numbers");
    assert_names(RawSpec::parse("2,3,4,5", "u8", None, None), "dims", "three numbers");
    assert_names(RawSpec::parse("2,3,-4", "u8", None, None), "dims", "three numbers");
    assert_names(RawSpec::parse("2,3,4", "uint8", None, None), "type", "`uint8` is not one of u8");
    assert_names(RawSpec::parse("2,3,4", "u8", Some("middle"), None), "endian", "middle");
    assert_names(RawSpec::parse("2,3,4", "u8", None, Some("1,1")), "spacing", "three numbers");
}

#[test]
fn a_format_is_found_by_name_then_content_type_then_magic() {
    let detect = |name, content_type, bytes: &[u8]| Format::detect(name, content_type, bytes);
    assert_eq!(detect(Some("raw"), Some("application/x-nrrd"), b"NRRD0005").expect("raw"), Format::Raw);
    assert_eq!(detect(None, Some("application/x-nrrd; v=5"), b"?").expect("nrrd"), Format::Nrrd);
    assert_eq!(detect(None, Some("application/octet-stream"), b"NRRD0004\n").expect("nrrd"), Format::Nrrd);
    assert_eq!(detect(None, None, b"NRRD0001\n").expect("nrrd"), Format::Nrrd);
    assert_names(detect(None, None, b"?"), "format", "not recognised");
    assert_names(detect(None, None, b""), "format", "not recognised");
    assert_names(detect(Some("doc"), None, b"NRRD0005"), "format", "`doc` is not a format; expected one of nrrd, ");
}

#[test]
fn every_format_has_a_name_by_which_it_is_found() {
    let names: Vec<_> = Format::all().map(Format::name).collect();
    for format in Format::all() {
        assert_eq!(Format::from_name(format.name()).expect("its own name"), format);
        assert_eq!(names.iter().filter(|name| **name == format.name()).count(), 1, "{names:?}");
    }
    assert_eq!(Format::from_name("NHDR").expect("an ending"), Format::Nrrd);
    assert_names(Format::from_name("doc"), "format", &names.join(", "));
}

#[test]
fn formats_that_are_not_read_are_refused_by_name() {
    let mut minc = vec![0; 140];
    minc[..4].copy_from_slice(b"CDF\x01");
    let magic: [(&str, &[u8]); 4] = [
        ("minc", &minc),
        ("png", b"\x89PNG\r\n"),
        ("matlab", b"MATLAB 5.0 MAT-file"),
        ("vtk", b"# vtk DataFile Version 3.0"),
    ];
    for (name, bytes) in magic {
        assert_names(Format::detect(None, None, bytes), "format", &format!("`{name}` is not read"));
    }
    for name in ["minc", "png", "hdf5", "mgh", "vtu", "jpeg"] {
        assert_names(Format::from_name(name), "format", &format!("`{name}` is not read"));
    }
    assert_names(Format::detect(None, Some("image/png"), b""), "format", "a single picture");
}

#[test]
fn a_volume_is_named_after_its_file_without_the_ending() {
    let cases = [
        ("head.nrrd", "head"),
        ("Head.v2.NRRD.GZ", "Head.v2"),
        ("a.raw.zst", "a"),
        ("strange.bin", "strange"),
        ("noending", "noending"),
        (".nrrd", ".nrrd"),
    ];
    for (file, name) in cases {
        assert_eq!(format::bare_name(file), name, "{file}");
    }
}

#[test]
fn files_are_loaded_by_path_inside_the_data_directory_only() {
    let outside = tempfile::tempdir().expect("a directory");
    let root = outside.path().join("data");
    fs::create_dir_all(root.join("ct")).expect("a directory");
    let (_, bytes) = sample_voxels(VoxelType::U16, Endian::Big);
    fs::write(root.join("ct/a.raw"), &bytes).expect("written");
    fs::write(outside.path().join("secret.raw"), &bytes).expect("written");
    fs::write(root.join("head.v2.mnc.gz"), &bytes).expect("written");
    fs::write(root.join("unknown"), &bytes).expect("written");
    let spec = spec(VoxelType::U16, Endian::Big);
    let load = |path: &str| format::load_path(path, &root, Some(&spec), &Limits::default());

    assert_eq!(load("ct/a.raw").expect("valid").voxels.len(), 24);
    assert_eq!(load("./ct/a.raw").expect("valid").voxels.len(), 24);
    let peeked = format::peek_path("ct/a.raw", &root, Some(&spec)).expect("valid");
    assert_eq!(bytes_needed(peeked.dims, peeked.voxel_type), Some(48));
    let absolute = outside.path().join("secret.raw");
    for bad in ["../secret.raw", "ct/../../secret.raw", absolute.to_str().expect("text"), ""] {
        assert_names(load(bad), "path", "is not a relative path");
    }
    assert_names(load("ct"), "path", "is not a file");
    assert_names(load("missing.raw"), "path", "");
    assert_names(load("nul\0.raw"), "path", "");
    assert_names(load("head.v2.mnc.gz"), "format", "`minc` is not read");
    assert_names(load("unknown"), "format", "not recognised by file name");
    #[cfg(unix)]
    {
        std::os::unix::fs::symlink(&absolute, root.join("link.raw")).expect("a link");
        assert_names(load("link.raw"), "path", "leads out of the data directory");
        std::os::unix::fs::symlink(root.join("ct/a.raw"), root.join("fine.raw")).expect("a link");
        assert_eq!(load("fine.raw").expect("valid").voxels.len(), 24);
    }
}

#[test]
fn a_volume_written_as_nrrd_reads_back_the_same() {
    let (_, bytes) = sample_voxels(VoxelType::F32, Endian::Little);
    let spec = spec(VoxelType::F32, Endian::Little);
    let mut volume = format::read_bytes(&bytes, Format::Raw, Some(&spec), &Limits::default()).expect("valid");
    volume.grid.origin = glam::DVec3::new(-3.25, 1e-7, 1524.5);
    let mut file = nrrd::attached_header(&volume.grid, VoxelType::F32).into_bytes();
    file.extend_from_slice(&volume.voxels.little_endian_bytes());
    let back = format::read_bytes(&file, Format::Nrrd, None, &Limits::default()).expect("valid");
    assert_eq!(back.grid, volume.grid);
    assert_eq!(back.voxels, volume.voxels);
    assert_eq!(back.sha256_hex(), volume.sha256_hex());
}
