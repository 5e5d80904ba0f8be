//! NRRD files that are read: types, encodings, geometry, skips.

use std::io::Write;

use flate2::Compression;
use flate2::write::GzEncoder;
use glam::DVec3;
use spao_server::volume::{Endian, Grid, VoxelType, Voxels, nrrd};

use super::{read_nrrd, sample_voxels};

/// A file of 2 x 3 x 4 `uint8` voxels 0 to 23 with more header lines.
pub(super) fn bytes_file(lines: &str) -> Vec<u8> {
    file(&format!("type: uint8\ndimension: 3\nsizes: 2 3 4\nencoding: raw\n{lines}"), &(0..24).collect::<Vec<_>>())
}

pub(super) fn file(header: &str, data: &[u8]) -> Vec<u8> {
    let mut file = format!("NRRD0005\n{header}\n").into_bytes();
    file.extend_from_slice(data);
    file
}

pub(super) fn gzip(bytes: &[u8]) -> Vec<u8> {
    let mut encoder = GzEncoder::new(Vec::new(), Compression::fast());
    encoder.write_all(bytes).expect("to memory");
    encoder.finish().expect("to memory")
}

fn grid_of(lines: &str) -> Grid {
    read_nrrd(&bytes_file(lines)).expect("a valid file").grid
}

fn spellings(voxel_type: VoxelType) -> &'static [&'static str] {
    match voxel_type {
        VoxelType::I8 => &["signed char", "int8", "int8_t"],
        VoxelType::U8 => &["uchar", "unsigned char", "uint8", "uint8_t"],
        VoxelType::I16 => &["short", "short int", "signed short", "signed short int", "int16", "int16_t"],
        VoxelType::U16 => &["ushort", "unsigned short", "unsigned short int", "uint16", "uint16_t"],
        VoxelType::I32 => &["int", "signed int", "int32", "int32_t"],
        VoxelType::U32 => &["uint", "unsigned int", "uint32", "uint32_t"],
        VoxelType::I64 => {
            &["longlong", "long long", "long long int", "signed long long", "signed long long int", "int64", "int64_t"]
        }
        VoxelType::U64 => &["ulonglong", "unsigned long long", "unsigned long long int", "uint64", "uint64_t"],
        VoxelType::F32 => &["float", "FLOAT"],
        VoxelType::F64 => &["double"],
    }
}

#[test]
fn every_type_endian_and_encoding_reads_back() {
    for voxel_type in VoxelType::ALL {
        for (endian, name) in [(Endian::Little, "little"), (Endian::Big, "big")] {
            let (expected, bytes) = sample_voxels(voxel_type, endian);
            let text: Vec<String> = ascii(&expected);
            let encodings = [
                ("raw", bytes.clone()),
                ("gzip", gzip(&bytes)),
                ("gz", gzip(&bytes)),
                ("ascii", text.join(" ").into_bytes()),
                ("text", format!("\n {}\n", text.join(",\n")).into_bytes()),
            ];
            for spelling in spellings(voxel_type) {
                for (encoding, data) in &encodings {
                    let header =
                        format!("type: {spelling}\ndimension: 3\nsizes: 2 3 4\nendian: {name}\nencoding: {encoding}\n");
                    let volume = read_nrrd(&file(&header, data)).expect(&header);
                    assert_eq!(volume.voxels, expected, "{header}");
                    assert_eq!(volume.grid, Grid::axis_aligned([2, 3, 4], DVec3::ONE));
                }
            }
        }
    }
}

/// Shortest decimal text of each voxel that reads back the same.
fn ascii(voxels: &Voxels) -> Vec<String> {
    match voxels {
        Voxels::U64(values) => values.iter().map(ToString::to_string).collect(),
        Voxels::I64(values) => values.iter().map(ToString::to_string).collect(),
        Voxels::F32(values) => values.iter().map(ToString::to_string).collect(),
        other => (0..other.len()).map(|i| other.value(i).to_string()).collect(),
    }
}

#[test]
fn all_five_versions_crlf_and_spellings_of_fields_are_read() {
    for version in 1..=5 {
        let header = format!(
            "NRRD000{version}\r\n# a comment\r\nType:  uint8 \r\nDIMENSION: 3\r\nsizes: 2  3\t4\r\nencoding: RAW\r\n\
             centerings: cell cell cell\r\noldmin: 0\r\nlineskip: 1\r\n\r\na line\n"
        );
        let mut file = header.into_bytes();
        file.extend(0..24);
        assert_eq!(read_nrrd(&file).expect("valid").voxels, Voxels::U8((0..24).collect()));
    }
}

#[test]
fn key_value_pairs_are_kept() {
    let file = bytes_file("modality:=CT: head\nempty:=\n");
    let header = nrrd::read_header(&mut &file[..]).expect("valid");
    let pairs: Vec<_> = header.metadata.iter().map(|(k, v)| (k.as_str(), v.as_str())).collect();
    assert_eq!(pairs, [("empty", ""), ("modality", "CT: head")]);
}

#[test]
fn a_comment_in_another_encoding_than_ascii_is_read_over() {
    let mut file = b"NRRD0001\n# caf\xe9\ntype: uint8\ndimension: 3\nsizes: 1 1 1\nencoding: raw\n\n".to_vec();
    file.push(7);
    assert_eq!(read_nrrd(&file).expect("valid").voxels, Voxels::U8(vec![7]));
}

#[test]
fn spacings_scale_the_axes_and_nan_means_one() {
    assert_eq!(grid_of("spacings: 0.5 1e-1 3\n").spacing, DVec3::new(0.5, 0.1, 3.0));
    assert_eq!(grid_of("spacings: 2 nan NaN\n").spacing, DVec3::new(2.0, 1.0, 1.0));
    assert_eq!(grid_of("").spacing, DVec3::ONE);
}

#[test]
fn space_directions_give_spacing_and_direction() {
    let grid = grid_of(
        "space dimension: 3\nspace directions: (0,2,0) (-3, 0, 0) (0,0,0.5)\nspace origin: (1,-2,3.5)\nspacings: 9 9 9\n",
    );
    assert_eq!(grid.spacing, DVec3::new(2.0, 3.0, 0.5));
    assert_eq!(grid.direction, [DVec3::Y, DVec3::NEG_X, DVec3::Z]);
    assert_eq!(grid.origin, DVec3::new(1.0, -2.0, 3.5));
    // The centre of voxel (1, 2, 3), at index-space (1.5, 2.5, 3.5).
    let world = grid.world_from_index().transform_point3(DVec3::new(1.5, 2.5, 3.5));
    assert!(world.distance(DVec3::new(1.0 - 6.0, -2.0 + 2.0, 3.5 + 1.5)) < 1e-12, "{world}");
}

#[test]
fn patient_spaces_become_left_posterior_superior() {
    let geometry = "space directions: (1,0,0) (0,2,0) (0,0,3)\nspace origin: (10,20,30)\n";
    let of = |space: &str| grid_of(&format!("space: {space}\n{geometry}"));
    let lps = of("left-posterior-superior");
    assert_eq!(lps.origin, DVec3::new(10.0, 20.0, 30.0));
    assert_eq!(lps.direction, [DVec3::X, DVec3::Y, DVec3::Z]);
    assert_eq!(lps, of("LPS"));
    assert_eq!(lps, of("scanner-xyz"));
    assert_eq!(lps, of("3D-right-handed"));
    let ras = of("right-anterior-superior");
    assert_eq!(ras.origin, DVec3::new(-10.0, -20.0, 30.0));
    assert_eq!(ras.direction, [DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z]);
    assert_eq!(ras.spacing, DVec3::new(1.0, 2.0, 3.0));
    assert_eq!(ras, of("RAS"));
    let las = of("left-anterior-superior");
    assert_eq!(las.origin, DVec3::new(10.0, -20.0, 30.0));
    assert_eq!(las.direction, [DVec3::X, DVec3::NEG_Y, DVec3::Z]);
    assert_ne!(ras, las);
    // Without directions, the axes are still those of the space.
    assert_eq!(grid_of("space: ras\n").direction, [DVec3::NEG_X, DVec3::NEG_Y, DVec3::Z]);
}

#[test]
fn a_fourth_axis_of_one_sample_may_come_first_or_last() {
    let read = |lines: &str| {
        let header = format!("type: uint8\ndimension: 4\nencoding: raw\n{lines}");
        read_nrrd(&file(&header, &(0..24).collect::<Vec<_>>())).expect(lines).grid
    };
    let first = read("sizes: 1 2 3 4\nspace: lps\nspace directions: none (1,0,0) (0,2,0) (0,0,3)\n");
    assert_eq!((first.dims, first.spacing), ([2, 3, 4], DVec3::new(1.0, 2.0, 3.0)));
    let last = read("sizes: 2 3 4 1\nspacings: 1 2 3 nan\nkinds: domain domain domain time\n");
    assert_eq!((last.dims, last.spacing), ([2, 3, 4], DVec3::new(1.0, 2.0, 3.0)));
    // Both have one sample: the one without a direction goes.
    let both = read("sizes: 1 4 6 1\nspace directions: none (1,0,0) (0,1,0) (0,0,1)\nkinds: vector domain space ???\n");
    assert_eq!(both.dims, [4, 6, 1]);
    assert_eq!(read("sizes: 1 4 6 1\n").dims, [1, 4, 6]);
}

#[test]
fn byte_skip_and_line_skip_find_the_data() {
    let voxels: Vec<u8> = (0..24).collect();
    let header = "type: uint8\ndimension: 3\nsizes: 2 3 4\n";
    let with = |prefix: &[u8], suffix: &[u8]| [prefix, &voxels, suffix].concat();
    let cases = [
        ("encoding: raw\nbyte skip: 5\n", with(b"\n\n\n\n\n", b"")),
        ("encoding: raw\nbyte skip: -1\n", with(b"whatever", b"")),
        ("encoding: raw\nline skip: 2\nbyte skip: 3\n", with(b"one\ntwo\nxyz", b"")),
        ("encoding: raw\n", with(b"", b"trailing bytes")),
        ("encoding: gzip\nbyte skip: 3\n", gzip(&with(b"xyz", b"more"))),
        ("encoding: gzip\nline skip: 1\n", [b"a line\n".to_vec(), gzip(&voxels)].concat()),
        // The members of a gzip file follow each other.
        ("encoding: gzip\n", [gzip(&voxels[..9]), gzip(&voxels[9..])].concat()),
    ];
    for (lines, data) in cases {
        let volume = read_nrrd(&file(&format!("{header}{lines}"), &data)).expect(lines);
        assert_eq!(volume.voxels, Voxels::U8(voxels.clone()), "{lines}");
    }
}
