//! NRRD headers that nobody would write: refused or read, never a panic.

use proptest::prelude::*;
use spao_server::volume::format::read_bytes;
use spao_server::volume::{Format, Limits};

use super::nrrd::bytes_file;
use super::read_nrrd;

/// A field that the format has, or nearly.
fn name() -> impl Strategy<Value = String> {
    let names = [
        "type",
        "dimension",
        "sizes",
        "encoding",
        "endian",
        "spacings",
        "space",
        "space dimension",
        "space origin",
        "space directions",
        "kinds",
        "byte skip",
        "line skip",
        "data file",
        "content",
        "Sizes",
        "siezs",
        "#",
        "key:=",
    ];
    prop::sample::select(names.to_vec()).prop_map(str::to_owned)
}

/// A value that some field has, or text.
fn value() -> impl Strategy<Value = String> {
    let values = [
        "uint8",
        "short",
        "double",
        "block",
        "3",
        "4",
        "0",
        "-1",
        "1 1 1",
        "2 3 4",
        "1 2 3 1",
        "99999999 99999999 1",
        "raw",
        "gzip",
        "ascii",
        "hex",
        "little",
        "big",
        "RAS",
        "lps",
        "(1,0,0) (0,1,0) (0,0,1)",
        "none none none none",
        "none (1,0,0) (0,1,0) (0,0,1)",
        "(0,0,0)",
        "((,)",
        "(1,,2) ()",
        "nan nan nan",
        "1 -1 inf",
        "1e308 1e308 1e308",
        "LIST",
        "LIST 2",
        "a%d 1 3 1",
        "%",
        "%d 0 0 0",
        "%99999999999999999999d 0 1 1",
        "18446744073709551616",
    ];
    prop_oneof![4 => prop::sample::select(values.to_vec()).prop_map(str::to_owned), 1 => "\\PC{0,40}"]
}

fn header() -> impl Strategy<Value = String> {
    let line = (name(), value()).prop_map(|(name, value)| format!("{name}: {value}\n"));
    prop::collection::vec(line, 0..12).prop_map(|lines| format!("NRRD0004\n{}\n", lines.concat()))
}

proptest! {
    #![proptest_config(super::seeded(400))]

    #[test]
    fn any_bytes_are_refused_without_a_panic(bytes in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = read_nrrd(&bytes);
        let _ = read_nrrd(&[b"NRRD0005\n", &bytes[..]].concat());
    }

    #[test]
    fn any_mixture_of_fields_is_read_or_refused(
        header in header(),
        data in prop::collection::vec(any::<u8>(), 0..64),
    ) {
        let file = [header.as_bytes(), &data].concat();
        let limits = Limits { max_axis: 64, max_voxels: 4096, max_bytes: 8192 };
        match read_bytes(&file, Format::Nrrd, None, &limits) {
            Ok(volume) => {
                prop_assert_eq!(volume.grid.voxel_count(), volume.voxels.len() as u64);
                prop_assert!(volume.grid.check().is_ok());
            }
            Err(error) => prop_assert!(!error.field().is_empty()),
        }
    }

    #[test]
    fn a_valid_file_with_one_changed_byte_is_read_or_refused(position in 0_usize..200, byte in any::<u8>()) {
        let mut file = bytes_file("space: RAS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nspace origin: (1,2,3)\n");
        let position = position % file.len();
        file[position] = byte;
        if let Err(error) = read_nrrd(&file) {
            prop_assert!(!error.to_string().is_empty());
        }
    }
}
