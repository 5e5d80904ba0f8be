//! Where the cells of every level lie.

use spao_server::ao::{LevelLayout, level_layouts};
use spao_server::scene::{AmbientOcclusion, AoMethod};

use super::support::{hybrid, mipmap, n_buffer, raytraced};

/// `(shift, width, origin, extent)` of every level.
fn shapes(dims: [u32; 3], settings: &AmbientOcclusion) -> Vec<(u32, u32, u32, [u32; 3])> {
    level_layouts(dims, settings).iter().map(|l| (l.shift, l.width, l.origin, l.extent)).collect()
}

const SIZES: [[u32; 3]; 7] =
    [[1, 1, 1], [10, 5, 1], [1, 64, 3], [127, 5, 9], [37, 29, 41], [128, 128, 105], [300, 300, 300]];

fn settings() -> [AmbientOcclusion; 6] {
    [n_buffer(8, 2.0), n_buffer(5, 0.0), mipmap(8, 2.0), hybrid(8, 3, 2.0), hybrid(8, 1, 1.0), raytraced(6, 1.0, 8)]
}

/// Every layout of every size and setting, with the one before.
fn all_layouts() -> Vec<([u32; 3], Option<LevelLayout>, LevelLayout)> {
    let mut all = Vec::new();
    for dims in SIZES {
        for settings in settings() {
            let layouts = level_layouts(dims, &settings);
            let before = std::iter::once(None).chain(layouts.iter().copied().map(Some));
            all.extend(before.zip(&layouts).map(|(before, layout)| (dims, before, *layout)));
        }
    }
    all
}

#[test]
fn n_buffer_levels_keep_the_resolution_and_grow_by_their_windows() {
    // A brick's edge before the volume, then what the windows reach, and two empty cells behind.
    let expected = [(0, 1, 8, [20, 15, 11]), (0, 2, 9, [21, 16, 12]), (0, 4, 11, [23, 18, 14])];
    assert_eq!(shapes([10, 5, 1], &n_buffer(2, 1.0)), expected);
}

#[test]
fn mip_levels_halve_the_resolution_rounded_up() {
    let found: Vec<_> = level_layouts([10, 5, 1], &mipmap(4, 1.0)).iter().map(|l| (l.shift, l.width)).collect();
    assert_eq!(found, [(0, 1), (1, 1), (2, 1), (3, 1), (4, 1)]);
    for (dims, _, layout) in all_layouts() {
        assert_eq!(layout.extent, dims.map(|n| n.div_ceil(1 << layout.shift) + layout.origin + 2));
    }
}

#[test]
fn hybrid_levels_halve_first_and_then_widen_their_windows() {
    let found: Vec<_> = level_layouts([10, 5, 1], &hybrid(4, 2, 1.0)).iter().map(|l| (l.shift, l.width)).collect();
    assert_eq!(found, [(0, 1), (1, 1), (2, 1), (2, 2), (2, 4)]);
    assert_eq!(shapes([10, 5, 1], &hybrid(3, 0, 1.0)), shapes([10, 5, 1], &n_buffer(3, 1.0)));
    assert_eq!(shapes([10, 5, 1], &hybrid(3, 3, 1.0)), shapes([10, 5, 1], &mipmap(3, 1.0)));
}

#[test]
fn windows_of_more_than_32_cells_begin_at_every_second_cell() {
    let found: Vec<_> = level_layouts([10, 5, 1], &n_buffer(8, 1.0)).iter().map(|l| (l.shift, l.width)).collect();
    assert_eq!(found, [(0, 1), (0, 2), (0, 4), (0, 8), (0, 16), (0, 32), (1, 32), (2, 32), (3, 32)]);
    let found: Vec<_> = level_layouts([10, 5, 1], &hybrid(8, 1, 1.0)).iter().map(|l| (l.shift, l.width)).collect();
    assert_eq!(found[5..], [(1, 16), (1, 32), (2, 32), (3, 32)]);
}

#[test]
fn the_reference_needs_level_0_only_and_off_none() {
    assert_eq!(shapes([10, 5, 1], &raytraced(6, 1.0, 8)), [(0, 1, 8, [20, 15, 11])]);
    let off = AmbientOcclusion { method: AoMethod::Off, ..AmbientOcclusion::default() };
    assert_eq!(shapes([10, 5, 1], &off), []);
}

/// Voxels that the window of a cell covers, along one axis.
fn window(layout: &LevelLayout, cell: u32) -> std::ops::Range<i64> {
    let begin = (i64::from(cell) - i64::from(layout.origin)) << layout.shift;
    begin..begin + (i64::from(layout.width) << layout.shift)
}

#[test]
fn the_first_and_the_last_two_windows_lie_outside_and_those_between_leave_no_voxel_out() {
    for (dims, _, layout) in all_layouts() {
        for (n, extent) in dims.map(i64::from).into_iter().zip(layout.extent) {
            assert!(window(&layout, 1).end <= 0, "{layout:?}");
            assert!(window(&layout, extent - 2).start >= n, "{layout:?}");
            // A look-up beyond either end is clamped to a cell that is zero: any window that meets a voxel is stored.
            assert_eq!(window(&layout, 1).start - window(&layout, 0).start, 1 << layout.shift);
        }
    }
}

/// Whether the windows that a cell is the mean of are the halves of its own window; those that are not stored are
/// empty.
fn halves_are_right(n: u32, axis: usize, before: &LevelLayout, layout: &LevelLayout) -> bool {
    let Some(source) = layout.source else { return false };
    (0..layout.extent[axis]).all(|cell| {
        let first = i64::from(source.scale) * i64::from(cell) + i64::from(source.offset);
        let whole = window(layout, cell);
        let middle = (whole.start + whole.end) / 2;
        let right = |at: i64, wanted: std::ops::Range<i64>| match u32::try_from(at) {
            Ok(at) if at < before.extent[axis] => window(before, at) == wanted,
            _ => wanted.end <= 0 || wanted.start >= i64::from(n),
        };
        right(first, whole.start..middle) && right(first + i64::from(source.distance), middle..whole.end)
    })
}

#[test]
fn every_window_is_made_of_its_halves_in_the_level_before() {
    for (dims, before, layout) in all_layouts() {
        let Some(before) = before else {
            assert_eq!((layout.source, layout.shift, layout.width), (None, 0, 1));
            continue;
        };
        for (axis, n) in dims.into_iter().enumerate() {
            assert!(halves_are_right(n, axis, &before, &layout), "{before:?} {layout:?}");
        }
        let mut wrong = layout;
        wrong.source = layout.source.map(|s| spao_server::ao::LevelSource { offset: s.offset - 1, ..s });
        assert!(!halves_are_right(dims[1], 1, &before, &wrong), "{layout:?}");
    }
}

#[test]
fn the_cells_that_cells_are_made_from_are_those_that_are_read_and_no_more() {
    for (_, before, layout) in all_layouts() {
        let (Some(before), Some(source)) = (before, layout.source) else { continue };
        for axis in 0..3 {
            let last = i64::from(before.extent[axis]) - 1;
            for start in (0..layout.extent[axis]).step_by(3) {
                let end = (start + 1 + start % 9).min(layout.extent[axis]);
                let reads = (start..end).flat_map(|cell| {
                    let first = i64::from(source.scale * cell) + i64::from(source.offset);
                    [first, first + i64::from(source.distance)].map(|c| c.clamp(0, last) as u32)
                });
                let (low, high) = (reads.clone().min().expect("cells"), reads.max().expect("cells"));
                assert_eq!(layout.source_cells(&before, axis, start..end), low..high + 1, "{layout:?} {start}..{end}");
            }
        }
    }
    let first = level_layouts([9; 3], &n_buffer(2, 1.0))[0];
    assert_eq!(first.source_cells(&first, 0, 3..5), 0..0, "level 0 is made from no level");
}

#[test]
fn a_look_up_is_at_the_window_that_is_centred_at_the_position() {
    for (_, _, layout) in all_layouts() {
        for cell in 0..layout.extent[0] {
            let window = window(&layout, cell);
            let centre = 0.5 * (window.start + window.end) as f64;
            let looked_up = centre / f64::from(1_u32 << layout.shift) + layout.lookup_offset();
            assert_eq!(looked_up, f64::from(cell), "{layout:?}");
        }
    }
}

#[test]
fn rows_and_slices_hold_what_a_look_up_at_the_last_cell_touches_and_can_be_copied() {
    for (_, _, layout) in all_layouts() {
        let [x, y, z] = layout.extent;
        assert!(2 * layout.row_words >= x && layout.row_words % 64 == 0, "two cells a word, rows of 256 bytes");
        assert!(layout.slice_words > layout.row_words * y, "a row and a word beyond the last cell");
        assert_eq!(layout.slice_words % layout.row_words, 0, "whole rows");
        assert_eq!(layout.slice_bytes() % 256, 0, "bindings start at slices");
        assert_eq!(layout.bytes(), layout.slice_bytes() * u64::from(z));
        let info = layout.info(3);
        let rows = (info.extent, info.row_words, info.slice_words);
        assert_eq!(rows, (layout.extent, layout.row_words, layout.slice_words));
        assert_eq!((info.first_slice, f64::from(info.lookup_offset)), (3, layout.lookup_offset()));
        assert_eq!(info.inverse_scale * f32::from(1_u16 << layout.shift), 1.0);
    }
}

#[test]
fn tiles_cover_every_cell_once_and_every_brick_lies_in_one_tile_of_level_0() {
    for (_, before, layout) in all_layouts() {
        let tiles = layout.tiles();
        for (axis, count) in tiles.into_iter().enumerate() {
            assert!(count * layout.tile[axis] >= layout.extent[axis]);
            assert!((count - 1) * layout.tile[axis] < layout.extent[axis]);
            assert!(layout.tile[axis].is_power_of_two());
        }
        assert_eq!(layout.tile_cells(), layout.tile.map(u64::from).iter().product::<u64>());
        let slices: Vec<u32> = (0..tiles[2]).flat_map(|layer| layout.slices_of(&(layer..layer + 1))).collect();
        assert_eq!(slices, (0..layout.extent[2]).collect::<Vec<_>>());
        if before.is_none() {
            assert!(layout.origin % 8 == 0 && layout.tile.iter().all(|n| n % 8 == 0));
        }
        // Windows that share what they read lie in one tile.
        if let Some(source) = layout.source {
            assert_eq!(layout.tile[1] % (2 * source.distance / source.scale), 0, "{layout:?}");
            assert_eq!(layout.tile[0] % (2 * source.distance / source.scale), 0, "{layout:?}");
        }
    }
}

/// The largest volumes that adapters allow do not overflow: 2048 voxels along each axis.
#[test]
fn the_largest_volume_has_levels_of_the_right_size() {
    let layouts = level_layouts([2048; 3], &n_buffer(5, 1.0));
    let cells: u64 = layouts[5].extent.map(u64::from).iter().product();
    assert_eq!(layouts[5].extent, [2048 + 8 + 31 + 2; 3]);
    assert!(layouts[5].bytes() > 2 * cells && layouts[5].bytes() < 2 * cells + cells / 5);
}

/// Cells that enter an interpolation at an index-space position, clamped to the level, with a weight that is not 0.
fn touched(layout: &LevelLayout, axis: usize, at: f64) -> std::ops::RangeInclusive<u32> {
    let last = f64::from(layout.extent[axis] - 1);
    let cell = (at / f64::from(1_u32 << layout.shift) + layout.lookup_offset()).clamp(0.0, last);
    cell.floor() as u32..=cell.ceil() as u32
}

#[test]
fn the_cells_around_an_interval_are_those_that_look_ups_touch_and_few_more() {
    for settings in [n_buffer(8, 1.0), mipmap(6, 1.0), hybrid(6, 2, 1.0)] {
        for layout in level_layouts([9, 8, 37], &settings) {
            for (low, high) in [(-300.0, -290.0), (-3.0, 0.5), (0.5, 0.5), (7.25, 21.75), (36.5, 60.0), (299.0, 300.0)]
            {
                for axis in 0..3 {
                    let cells = layout.cells_around(axis, low, high);
                    assert!(cells.start < cells.end && cells.end <= layout.extent[axis], "{cells:?} of {layout:?}");
                    let (first, last) = (*touched(&layout, axis, low).start(), *touched(&layout, axis, high).end());
                    assert!(cells.start <= first && last < cells.end, "{low} {high} {cells:?} of {layout:?}");
                    let few = cells.start + 2 > first && cells.end <= last + 4;
                    assert!(few, "{low} {high} {cells:?} of {layout:?}");
                }
            }
        }
    }
}
