//! TIFF stacks against what tifffile reads from the same files (`tests/data/tiff/make.py`), and damaged ones.

use std::fs;
use std::path::{Path, PathBuf};

use glam::DVec3;
use proptest::prelude::*;
use serde_json::Value;
use spao_server::volume::{Choice, Format, Limits, Volume, VolumeError, format};

use super::assert_names;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data/tiff")
}

fn fixture(name: &str) -> Vec<u8> {
    fs::read(folder().join(name)).expect("the fixture is there")
}

fn read_tiff(bytes: &[u8], channel: Option<u32>) -> Result<Volume, VolumeError> {
    let choice = Choice { channel, ..Choice::default() };
    format::read_chosen(bytes, Format::Tiff, None, &choice, &Limits::default())
}

fn expected() -> Value {
    serde_json::from_slice(&fixture("expected.json")).expect("JSON")
}

fn numbers(json: &Value) -> Vec<f64> {
    json.as_array().expect("an array").iter().map(|v| v.as_f64().expect("a number")).collect()
}

#[track_caller]
fn assert_as_expected(volume: &Volume, expected: &Value) {
    let grid = &volume.grid;
    assert_eq!(volume.voxels.voxel_type().name(), expected["type"], "type");
    assert_eq!(grid.dims.map(f64::from).to_vec(), numbers(&expected["dims"]), "dims");
    let spacing = DVec3::from_slice(&numbers(&expected["spacing"]));
    assert!((grid.spacing / spacing - 1.0).abs().max_element() < 1e-9, "spacing {}", grid.spacing);
    for (index, value) in numbers(&expected["voxels"]).into_iter().enumerate() {
        let read = volume.voxels.value(index);
        assert!(read == value, "voxel {index} is {read}, expected {value}");
    }
}

#[test]
fn every_type_packing_and_metadata_is_read_as_tifffile_reads_it() {
    let expected = expected();
    let cases = expected.as_object().expect("an object");
    assert!(cases.len() >= 24, "{}", cases.len());
    for (name, expected) in cases {
        println!("{name}");
        // Of files with two channels, the second one was recorded.
        let channel = (name.contains("channels") || name.contains("order")).then_some(1);
        let bytes = fixture(name);
        assert_eq!(Format::detect(None, None, &bytes).expect("recognised"), Format::Tiff);
        let volume = read_tiff(&bytes, channel).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_as_expected(&volume, expected);
        assert!(!volume.about.patient_axes);
        let choice = Choice { channel, ..Choice::default() };
        let peeked = format::peek_chosen(name, &folder(), None, &choice, &Limits::default());
        let peeked = peeked.expect("headers are enough");
        assert_eq!((peeked.dims, peeked.voxel_type), (volume.grid.dims, volume.voxels.voxel_type()), "{name}");
        let is_placed = name.contains("ome") || name.contains("imagej");
        assert_eq!(peeked.spacing, is_placed.then(|| volume.grid.spacing.to_array()), "{name}");
    }
}

#[test]
#[should_panic(expected = "voxel 7 is")]
fn the_comparison_notices_one_voxel() {
    let mut expected = expected()["u2.tif"].clone();
    expected["voxels"][7] = (expected["voxels"][7].as_f64().expect("a number") + 1.0).into();
    assert_as_expected(&read_tiff(&fixture("u2.tif"), None).expect("valid"), &expected);
}

#[test]
#[should_panic(expected = "spacing")]
fn the_comparison_notices_another_spacing() {
    let mut expected = expected()["ome.ome.tif"].clone();
    expected["spacing"][2] = 1.5.into();
    assert_as_expected(&read_tiff(&fixture("ome.ome.tif"), None).expect("valid"), &expected);
}

#[test]
fn the_first_of_several_channels_is_shown_and_the_others_are_named() {
    let volume = read_tiff(&fixture("ome_channels.ome.tif"), None).expect("valid");
    let notes = volume.about.notes.join(" ");
    assert!(notes.contains("Of 2 channels the first is shown: channel=0 (`DAPI`), channel=1 (`GFP`)."), "{notes}");
    assert!(notes.contains("Of 2 time points the first is shown."), "{notes}");
    let second = read_tiff(&fixture("ome_channels.ome.tif"), Some(1)).expect("valid");
    assert_ne!(second.voxels, volume.voxels);
    let third = read_tiff(&fixture("ome_channels.ome.tif"), Some(2));
    assert_names(third, "channel", "2 is not a channel of this file; it has channel=0 (`DAPI`), channel=1 (`GFP`)");
    assert_names(read_tiff(&fixture("u2.tif"), Some(1)), "channel", "1 is not a channel");
}

#[test]
fn a_plain_stack_says_that_its_spacing_is_not_known() {
    let notes = read_tiff(&fixture("u2.tif"), None).expect("valid").about.notes.join(" ");
    assert!(notes.contains("does not say how far apart"), "{notes}");
}

#[test]
fn the_header_tells_how_voxels_are_stored_and_withholds_free_text() {
    for (name, fields) in [
        ("u2.tif", &[("VoxelType", "u16"), ("ImageWidth", "5")][..]),
        ("ome_channels.ome.tif", &[("SizeC", "2"), ("SizeT", "2")][..]),
        ("imagej.tif", &[("frames", "1")][..]),
    ] {
        let about = read_tiff(&fixture(name), None).expect("valid").about;
        let (shown, withheld) = about.without_identity();
        for (field, value) in fields {
            assert!(shown.contains(&&((*field).to_owned(), (*value).to_owned())), "{name} lacks {field}: {shown:?}");
        }
        let text = format!("{shown:?}");
        assert!(!text.contains("ImageDescription") && !text.contains("DAPI"), "{name}: {text}");
        // Negative control: the description is there, with the names of channels.
        let has_description = about.header.iter().any(|(name, _)| name == "ImageDescription");
        assert_eq!(usize::from(has_description), withheld, "{name}");
    }
    let header = format!("{:?}", read_tiff(&fixture("ome_channels.ome.tif"), None).expect("valid").about.header);
    assert!(header.contains("DAPI"), "{header}");
}

#[test]
fn pictures_that_are_no_stack_of_grey_values_are_refused() {
    let refused = |name: &str, says: &str| assert_names(read_tiff(&fixture(name), None), "pages", says);
    refused("colour.tif", "RGB(8) is in colour; expected one grey value per voxel");
    refused("zstd.tif", "ZSTD");
    refused("sizes.tif", "page 2 has 5 x 6 voxels of type u16, the first has 5 x 4 voxels of type u16");
}

#[test]
fn metadata_that_contradict_the_pages_are_refused() {
    let changed = |from: &str, to: &str| {
        let mut bytes = fixture("ome.ome.tif");
        let at = bytes.windows(from.len()).position(|part| part == from.as_bytes()).expect("it is there");
        bytes[at..at + from.len()].copy_from_slice(to.as_bytes());
        read_tiff(&bytes, None)
    };
    assert!(changed("SizeZ=\"3\"", "SizeZ=\"3\"").is_ok());
    assert_names(changed("SizeZ=\"3\"", "SizeZ=\"9\""), "description", "slice 3, channel 0 is not in this file");
    assert_names(changed("SizeZ=\"3\"", "SizeZ=\"0\""), "description", "a size is 0");
    assert_names(changed("SizeZ=\"3\"", "SizeZ=\"x\""), "description", "`x` is not a whole number");
    assert_names(changed("XYCZT", "XYCCT"), "description", "`XYCCT` is not an order");
    assert_names(changed("\"0.25\"", "\"-1.5\""), "description", "PhysicalSizeX `-1.5` is not a length");
    assert_names(changed("<Pixels", "<Pix<ls"), "description", "OME-XML");
}

#[test]
fn truncated_and_too_large_files_are_refused() {
    let bytes = fixture("u2.tif");
    assert_names(read_tiff(&bytes[..bytes.len() - 20], None), "pages", "");
    assert_names(read_tiff(&bytes[..8], None), "pages", "");
    assert_names(read_tiff(b"", None), "pages", "");
    let limits = Limits { max_axis: 4, max_voxels: 4096, max_bytes: 8192 };
    let read = format::read_chosen(&bytes, Format::Tiff, None, &Choice::default(), &limits);
    assert_names(read, "dims", "5 voxels along an axis needed, the limit is 4");
}

proptest! {
    #![proptest_config(super::seeded(1500))]

    #[test]
    fn any_tiff_with_changed_bytes_is_read_or_refused(
        which in any::<usize>(),
        changes in prop::collection::vec((0.0..1.0, prop_oneof![any::<u8>(), Just(0), Just(1), Just(0xFF)]), 1..6),
        end in prop::option::weighted(0.2, 0.0..1.0),
    ) {
        let expected = expected();
        let names: Vec<&String> = expected.as_object().expect("an object").keys().collect();
        let mut file = fixture(names[which % names.len()]);
        for (at, byte) in changes {
            let at = (at * file.len() as f64) as usize;
            file[at] = byte;
        }
        if let Some(end) = end {
            file.truncate((end * file.len() as f64) as usize);
        }
        let limits = Limits { max_axis: 64, max_voxels: 4096, max_bytes: 1 << 16 };
        match format::read_chosen(&file, Format::Tiff, None, &Choice::default(), &limits) {
            Ok(volume) => {
                prop_assert_eq!(volume.grid.voxel_count(), volume.voxels.len() as u64);
                prop_assert!(volume.grid.check().is_ok());
            }
            Err(error) => prop_assert!(!error.field().is_empty() && error.to_string().len() < 2000, "{}", error),
        }
    }
}
