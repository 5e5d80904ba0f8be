//! Values to codes and back.

use proptest::prelude::*;
use spao_server::volume::{CodeMap, Voxels};

use super::volume;

/// The ends of the range have the end codes, and every code comes back from the value it stands for.
#[track_caller]
fn assert_covers(map: &CodeMap, lowest: f64, highest: f64) {
    assert_eq!(map.value_range(), [lowest, highest]);
    assert!(map.step > 0.0, "{map:?}");
    assert_eq!(map.code_from_value(lowest), 0, "{map:?}");
    assert_eq!(map.code_from_value(highest), map.max_code, "{map:?}");
    for code in [0, 1, 2, 127, 255, 256, 32767, 65534, 65535].into_iter().filter(|c| *c <= map.max_code) {
        let value = map.value_from_code(f64::from(code));
        assert!(value.is_finite(), "{map:?} code {code}");
        // Where codes are finer than floats, several stand for one value.
        if map.step > 4.0 * f64::EPSILON * lowest.abs().max(highest.abs()) {
            assert_eq!(map.code_from_value(value), code, "{map:?}");
            let share = f64::from(code) / f64::from(map.max_code.max(1));
            assert!((map.normalised(value) - share).abs() <= 1e-4 || map.step < f64::MIN_POSITIVE, "{map:?} {code}");
        }
    }
    assert_eq!([map.normalised(lowest), map.normalised(highest)], [0.0, if highest > lowest { 1.0 } else { 0.0 }]);
}

#[test]
fn extreme_ranges_keep_their_ends() {
    for [lo, hi] in [
        [0.0, 1.0],
        [-1024.0, 3071.5],
        [f64::MIN, f64::MAX],
        [-f64::MAX / 2.0, f64::MAX],
        [1e300, 1.000_000_1e300],
        [0.0, f64::MIN_POSITIVE],
        [0.0, 5e-324],
        [-5e-324, 5e-324],
        [0.0, 98_000.0 * 5e-324],
        [1.0, 1.0 + f64::EPSILON],
        [f64::from(f32::MIN), f64::from(f32::MAX)],
        [7.0, 7.0],
    ] {
        assert_covers(&CodeMap::for_floats(lo, hi), lo, hi);
    }
}

#[test]
#[should_panic(expected = "left: 32768")]
fn the_coverage_helper_notices_a_wrong_step() {
    let map = CodeMap::for_floats(0.0, 1.0);
    assert_covers(&CodeMap { step: 2.0 * map.step, ..map }, 0.0, 1.0);
}

#[test]
fn two_neighbouring_floats_have_different_codes() {
    for [lo, hi] in [[1.0, 1.0 + f64::EPSILON], [0.0, 5e-324], [1e300, 1e300_f64.next_up()]] {
        let map = CodeMap::for_floats(lo, hi);
        assert_ne!(map.code_from_value(lo), map.code_from_value(hi), "{map:?}");
    }
}

#[test]
fn nan_and_values_outside_the_range_have_the_end_codes() {
    let map = CodeMap::for_integers(-10.0, 90.0);
    assert_eq!(map.code_from_value(f64::NAN), 0);
    assert_eq!([f64::NEG_INFINITY, -11.0].map(|v| map.code_from_value(v)), [0, 0]);
    assert_eq!([f64::INFINITY, 91.0, 1e9].map(|v| map.code_from_value(v)), [100; 3]);
}

#[test]
fn a_span_of_65536_integers_is_lossless_and_one_more_is_not() {
    let map = CodeMap::for_integers(-32768.0, 32767.0);
    assert!(map.lossless);
    assert_eq!((map.max_code, map.bytes_per_voxel()), (65535, 2));
    let map = CodeMap::for_integers(-32768.0, 32768.0);
    assert!(!map.lossless);
    assert_covers(&map, -32768.0, 32768.0);
    assert_eq!(CodeMap::for_integers(3.0, 258.0).bytes_per_voxel(), 1);
    assert_eq!(CodeMap::for_integers(3.0, 259.0).bytes_per_voxel(), 2);
}

#[test]
fn integers_beyond_the_exact_range_of_f64_are_not_called_lossless() {
    let first = 1_u64 << 63;
    let map = volume([2, 1, 1], Voxels::U64(vec![first, first + 100])).code_map;
    assert!(!map.lossless, "both round to the same f64");
    let exact = (1_i64 << 53) - 100;
    let map = volume([2, 1, 1], Voxels::I64(vec![exact, exact + 100])).code_map;
    assert!(map.lossless);
    assert_eq!(map.max_code, 100);
    assert_covers(&volume([2, 1, 1], Voxels::I64(vec![i64::MIN, i64::MAX])).code_map, i64::MIN as f64, i64::MAX as f64);
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(300) })]

    #[test]
    fn sixteen_bit_integers_survive_codes_bit_by_bit(values in prop::collection::vec(any::<i16>(), 1..50)) {
        let map = volume([values.len() as u32, 1, 1], Voxels::I16(values.clone())).code_map;
        prop_assert!(map.lossless);
        for value in values {
            let code = map.code_from_value(f64::from(value));
            prop_assert_eq!(map.value_from_code(f64::from(code)), f64::from(value));
        }
    }

    #[test]
    fn floats_come_back_within_half_a_step(values in prop::collection::vec(-1e30_f32..1e30, 2..50)) {
        let map = volume([values.len() as u32, 1, 1], Voxels::F32(values.clone())).code_map;
        for value in values.into_iter().map(f64::from) {
            let back = map.value_from_code(f64::from(map.code_from_value(value)));
            prop_assert!((back - value).abs() <= 0.5001 * map.step, "{} {} {:?}", value, back, map);
        }
    }

    #[test]
    fn any_finite_range_is_covered(a in any::<f64>(), b in any::<f64>()) {
        prop_assume!(a.is_finite() && b.is_finite());
        assert_covers(&CodeMap::for_floats(a.min(b), a.max(b)), a.min(b), a.max(b));
    }
}
