//! Where the cells of every level lie.

use spao_server::ao::{LevelLayout, level_layouts};
use spao_server::scene::{AmbientOcclusion, AoMethod};

use super::support::{hybrid, mipmap, n_buffer, raytraced};

/// `(shift, width, extent)` of every level.
fn shapes(dims: [u32; 3], settings: &AmbientOcclusion) -> Vec<(u32, u32, [u32; 3])> {
    level_layouts(dims, settings).iter().map(|l| (l.shift, l.width, l.extent)).collect()
}

#[test]
fn n_buffer_levels_keep_the_resolution_and_grow_by_their_windows() {
    // n cells have n + width - 1 windows that meet the volume, and one empty one on either side.
    let expected = [(0, 1, [12, 7, 3]), (0, 2, [13, 8, 4]), (0, 4, [15, 10, 6]), (0, 8, [19, 14, 10])];
    assert_eq!(shapes([10, 5, 1], &n_buffer(3, 1.0)), expected);
}

#[test]
fn mip_levels_halve_the_resolution_rounded_up() {
    let expected = [(0, 1, [12, 7, 3]), (1, 1, [7, 5, 3]), (2, 1, [5, 4, 3]), (3, 1, [4, 3, 3])];
    assert_eq!(shapes([10, 5, 1], &mipmap(3, 1.0)), expected);
}

#[test]
fn hybrid_levels_halve_first_and_then_widen_their_windows() {
    let expected = [(0, 1, [12, 7, 3]), (1, 1, [7, 5, 3]), (1, 2, [8, 6, 4]), (1, 4, [10, 8, 6])];
    assert_eq!(shapes([10, 5, 1], &hybrid(3, 1, 1.0)), expected);
    assert_eq!(shapes([10, 5, 1], &hybrid(3, 0, 1.0)), shapes([10, 5, 1], &n_buffer(3, 1.0)));
    assert_eq!(shapes([10, 5, 1], &hybrid(3, 3, 1.0)), shapes([10, 5, 1], &mipmap(3, 1.0)));
}

#[test]
fn the_reference_needs_level_0_only_and_off_none() {
    assert_eq!(shapes([10, 5, 1], &raytraced(6, 1.0, 8)), [(0, 1, [12, 7, 3])]);
    let off = AmbientOcclusion { method: AoMethod::Off, ..AmbientOcclusion::default() };
    assert_eq!(shapes([10, 5, 1], &off), []);
}

#[test]
fn rows_and_slices_hold_what_a_look_up_at_the_last_cell_touches() {
    for dims in [[1, 1, 1], [1, 64, 3], [127, 5, 9], [128, 128, 105], [512, 512, 512]] {
        for settings in [n_buffer(8, 2.0), mipmap(8, 2.0), hybrid(8, 3, 2.0)] {
            for layout in level_layouts(dims, &settings) {
                let [x, y, z] = layout.extent;
                assert_eq!(layout.row_words, x.div_ceil(2), "two cells a word");
                assert!(layout.slice_words > layout.row_words * y, "a row and a word beyond the last cell");
                assert_eq!(layout.slice_bytes() % 256, 0, "bindings start at slices");
                assert_eq!(layout.bytes(), layout.slice_bytes() * u64::from(z));
                let info = layout.info(3);
                assert_eq!(
                    (info.extent, info.row_words, info.slice_words),
                    (layout.extent, x.div_ceil(2), layout.slice_words)
                );
                assert_eq!((info.first_slice, info.width), (3, layout.width as f32));
                assert_eq!(info.inverse_scale * f32::from(1_u16 << layout.shift), 1.0);
            }
        }
    }
}

/// The largest volumes that adapters allow do not overflow: 2048 voxels along each axis.
#[test]
fn the_largest_volume_has_levels_of_the_right_size() {
    let layouts = level_layouts([2048; 3], &n_buffer(8, 1.0));
    let cells: u64 = layouts[8].extent.map(u64::from).iter().product();
    assert_eq!(layouts[8].extent, [2048 + 257; 3]);
    assert!(layouts[8].bytes() > 2 * cells && layouts[8].bytes() < 2 * cells + cells / 100);
}

/// Slices that enter an interpolation at index-space z, clamped to the level, with a weight that is not 0.
fn touched(layout: &LevelLayout, z: f64) -> std::ops::RangeInclusive<u32> {
    let last = f64::from(layout.extent[2] - 1);
    let cell = (z / f64::from(1_u32 << layout.shift) + 0.5 * f64::from(layout.width)).clamp(0.0, last);
    cell.floor() as u32..=cell.ceil() as u32
}

#[test]
fn the_slices_around_an_interval_are_those_that_look_ups_touch_and_few_more() {
    for settings in [n_buffer(6, 1.0), mipmap(6, 1.0), hybrid(6, 2, 1.0)] {
        for layout in level_layouts([9, 8, 37], &settings) {
            for (low, high) in [(-100.0, -90.0), (-3.0, 0.5), (0.5, 0.5), (7.25, 21.75), (36.5, 60.0), (99.0, 100.0)] {
                let slices = layout.slices_around(low, high);
                assert!(slices.start < slices.end && slices.end <= layout.extent[2], "{slices:?} of {layout:?}");
                let (first, last) = (*touched(&layout, low).start(), *touched(&layout, high).end());
                assert!(slices.start <= first && last < slices.end, "{low} {high} {slices:?} of {layout:?}");
                assert!(slices.start + 2 > first && slices.end <= last + 4, "{low} {high} {slices:?} of {layout:?}");
            }
        }
    }
}
