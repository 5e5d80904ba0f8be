//! Histograms against counting one by one.

use spao_server::volume::{MAX_BINS, Volume, Voxels};

use super::{assert_names, volume};

/// The documented rule, one voxel after the other.
fn naive(volume: &Volume, bins: u32) -> Vec<u64> {
    let [lo, hi] = volume.code_map.value_range();
    let mut counts = vec![0; bins as usize];
    for value in (0..volume.voxels.len()).map(|i| volume.voxels.value(i)).filter(|v| !v.is_nan()) {
        let bin = if hi > lo { ((value - lo) * f64::from(bins) / (hi - lo)).floor() as usize } else { 0 };
        counts[bin.min(bins as usize - 1)] += 1;
    }
    counts
}

fn ramp(n: u32) -> Volume {
    volume([n, 10, 1], Voxels::I32((0..n as i32 * 10).map(|i| (i * 7919) % 1013 - 300).collect()))
}

#[test]
fn counts_are_those_of_counting_one_by_one() {
    let floats = volume([1000, 1, 1], Voxels::F64((0..1000).map(|i| (f64::from(i) * 0.37).sin() * 1e-3).collect()));
    for volume in [ramp(300), floats] {
        for bins in [1, 2, 255, 256, 1013, MAX_BINS] {
            let histogram = volume.histogram(bins).expect("a valid number of bins");
            assert_eq!(histogram.counts, naive(&volume, bins), "{bins} bins");
            assert_eq!(histogram.counts.iter().sum::<u64>(), volume.voxels.len() as u64);
            assert_eq!(histogram.range, volume.code_map.value_range());
        }
    }
}

#[test]
fn one_changed_voxel_changes_the_counts() {
    let volume = ramp(300);
    let mut changed = volume.clone();
    let Voxels::I32(values) = &mut changed.voxels else { panic!("not i32") };
    values[1234] += if values[1234] < 700 { 5 } else { -5 };
    assert_ne!(volume.histogram(1013).expect("valid").counts, naive(&changed, 1013));
}

#[test]
fn more_than_one_task_counts_every_voxel_once() {
    let volume = volume([128, 128, 150], Voxels::U8((0..128 * 128 * 150_u32).map(|i| (i % 251) as u8).collect()));
    assert_eq!(volume.histogram(251).expect("valid").counts, naive(&volume, 251));
}

#[test]
fn with_a_bin_per_integer_every_integer_has_its_bin() {
    let volume = volume([256, 1, 1], Voxels::U8((0..=255).collect()));
    assert_eq!(volume.histogram(256).expect("valid").counts, vec![1; 256]);
}

#[test]
fn a_constant_volume_is_all_in_bin_0_and_nan_in_none() {
    let volume = volume([4, 1, 1], Voxels::F32(vec![2.5, f32::NAN, 2.5, 2.5]));
    let histogram = volume.histogram(3).expect("valid");
    assert_eq!((histogram.range, histogram.counts), ([2.5, 2.5], vec![3, 0, 0]));
}

#[test]
fn the_widest_range_of_floats_does_not_overflow() {
    let volume = volume([3, 1, 1], Voxels::F64(vec![f64::MIN, 1.0, f64::MAX]));
    assert_eq!(volume.histogram(4).expect("valid").counts, [1, 0, 1, 1]);
}

#[test]
fn no_bins_and_too_many_are_errors() {
    let volume = ramp(1);
    assert_names(volume.histogram(0), "bins", "0 is not in 1 to 65536");
    assert_names(volume.histogram(MAX_BINS + 1), "bins", "65537");
}
