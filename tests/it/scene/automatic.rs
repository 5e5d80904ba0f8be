//! The transfer function of a document that has none.

use serde_json::json;
use spao_server::scene::{SceneDocument, TransferFunction, automatic_transfer_function, looks_like_hounsfield, preset};

use super::TestVolume;

/// Counts of bell curves `(middle, width, voxels)` over values `lowest..=highest`.
fn bells(lowest: f64, highest: f64, bins: usize, bells: &[(f64, f64, f64)]) -> Vec<u64> {
    let step = (highest - lowest) / bins as f64;
    let count = |bin: usize| {
        let value = lowest + step * (bin as f64 + 0.5);
        let bell = |&(middle, width, voxels): &(f64, f64, f64)| {
            voxels * step / width * (-0.5 * ((value - middle) / width).powi(2)).exp() * 0.4
        };
        bells.iter().map(bell).sum::<f64>() as u64
    };
    (0..bins).map(count).collect()
}

fn volume(lowest: f64, highest: f64, curves: &[(f64, f64, f64)]) -> TestVolume {
    TestVolume::new(lowest, highest, bells(lowest, highest, 1024, curves), true)
}

/// The transfer function, having checked that it makes a valid scene.
fn automatic(volume: &TestVolume) -> TransferFunction {
    let document = SceneDocument::from_json(&json!({"volume": "v_1"})).expect("valid");
    let scene = document.complete(&volume.facts()).expect("valid");
    let again = SceneDocument::from_json(&scene.to_json()).and_then(|document| document.complete(&volume.facts()));
    assert_eq!(again.as_ref(), Ok(&scene));
    assert_eq!(scene.transfer_function, automatic_transfer_function(&volume.facts()));
    scene.transfer_function
}

fn opacity(tf: &TransferFunction, value: f64) -> f64 {
    tf.sample(value).1
}

const AIR: (f64, f64, f64) = (-1000.0, 20.0, 4e6);
const TISSUE: (f64, f64, f64) = (30.0, 60.0, 2e6);
const BONE: (f64, f64, f64) = (700.0, 300.0, 2e5);

#[test]
fn hounsfield_units_are_recognised_and_get_skin_over_bone() {
    let skin_bone = preset("ct_skin_bone").expect("a preset");
    for (lowest, highest) in [(-1024.0, 3071.0), (-3024.0, 3071.0), (-1024.0, 31743.0), (-1000.0, 1500.0)] {
        let ct = volume(lowest, highest, &[AIR, TISSUE, BONE]);
        assert!(looks_like_hounsfield(&ct.facts()), "{lowest} {highest}");
        assert_eq!(automatic(&ct), skin_bone.transfer_function([lowest, highest]));
    }
    let lungs = volume(-1024.0, 1800.0, &[AIR, (-820.0, 60.0, 1e6), TISSUE, BONE]);
    assert!(looks_like_hounsfield(&lungs.facts()));
}

#[test]
fn other_data_is_not_taken_for_hounsfield_units() {
    for (what, other) in [
        ("raw detector values", volume(0.0, 4095.0, &[(24.0, 20.0, 4e6), (1050.0, 60.0, 2e6)])),
        ("a flat computed field", TestVolume::new(-1000.0, 1000.0, vec![1000; 256], false)),
        ("a bell about zero", volume(-1000.0, 1000.0, &[(0.0, 300.0, 1e6)])),
        ("no tissue", volume(-1024.0, 3071.0, &[AIR])),
        ("no air", volume(-1024.0, 3071.0, &[TISSUE, BONE])),
        ("an empty histogram", TestVolume::new(-1024.0, 3071.0, vec![], true)),
        ("a histogram without voxels", TestVolume::new(-1024.0, 3071.0, vec![0; 256], true)),
    ] {
        assert!(!looks_like_hounsfield(&other.facts()), "{what}");
        automatic(&other);
    }
}

#[test]
fn a_background_is_transparent_and_what_is_above_it_visible() {
    for (what, volume, background, foreground) in [
        ("scan in 8 bits", volume(0.0, 255.0, &[(5.0, 4.0, 1e7), (90.0, 15.0, 2e6), (180.0, 20.0, 2e5)]), 10.0, 180.0),
        ("MR image", volume(0.0, 1200.0, &[(15.0, 12.0, 5e6), (300.0, 60.0, 2e6), (450.0, 60.0, 2e6)]), 40.0, 450.0),
        ("sparse vessels", volume(0.0, 255.0, &[(0.0, 1.0, 1.6e7), (120.0, 40.0, 1e5)]), 5.0, 150.0),
        ("background not at the end", volume(0.0, 1300.0, &[(350.0, 20.0, 1e6), (900.0, 60.0, 4e5)]), 390.0, 950.0),
    ] {
        let tf = automatic(&volume);
        assert_eq!(opacity(&tf, background), 0.0, "{what}: {tf:?}");
        assert!(opacity(&tf, foreground) > 0.25, "{what}: {tf:?}");
        assert!(tf.points.windows(2).all(|pair| pair[0].opacity <= pair[1].opacity), "{what}: {tf:?}");
    }
}

#[test]
fn a_few_outliers_do_not_hide_the_rest() {
    let curves = [(20.0, 10.0, 1e7), (300.0, 40.0, 3e6)];
    let mut counts = bells(0.0, 65535.0, 65536, &curves);
    counts[65535] = 3;
    let tf = automatic(&TestVolume::new(0.0, 65535.0, counts, true));
    assert_eq!(opacity(&tf, 60.0), 0.0, "{tf:?}");
    assert!(opacity(&tf, 320.0) > 0.25, "{tf:?}");
}

#[test]
fn a_symmetric_field_without_background_shows_its_upper_half() {
    let tf = automatic(&volume(-1.5, 1.5, &[(0.0, 0.6, 1e6)]));
    assert_eq!(opacity(&tf, -0.5), 0.0, "{tf:?}");
    assert!(opacity(&tf, 1.0) > 0.3, "{tf:?}");
}

#[test]
fn two_values_get_a_surface_half_way_between_them() {
    let mut counts = vec![0; 256];
    (counts[0], counts[255]) = (3000, 1000);
    for volume in [TestVolume::new(0.0, 1.0, counts, true), TestVolume::new(0.0, 1.0, vec![1000, 3000], true)] {
        let tf = automatic(&volume);
        assert_eq!(opacity(&tf, 0.0), 0.0, "{tf:?}");
        assert!(opacity(&tf, 1.0) > 0.25, "{tf:?}");
    }
}

#[test]
fn one_value_is_a_haze() {
    for counts in [vec![], vec![0; 256], vec![500], [vec![500], vec![0; 255]].concat()] {
        let tf = automatic(&TestVolume::new(7.0, 7.0, counts, true));
        assert!(opacity(&tf, 7.0) > 0.0 && opacity(&tf, 7.0) < 0.2, "{tf:?}");
    }
}

#[test]
fn extreme_ranges_still_give_a_valid_scene() {
    for (lowest, highest) in [(-1.7e308, 1.7e308), (0.0, 5e-324), (1e16, 1e16 + 2.0), (-1e-300, 1e-300)] {
        for counts in [vec![1; 300], vec![9, 1], bells(0.0, 1.0, 256, &[(0.1, 0.02, 1e6), (0.7, 0.1, 1e5)])] {
            automatic(&TestVolume::new(lowest, highest, counts, false));
        }
    }
}
