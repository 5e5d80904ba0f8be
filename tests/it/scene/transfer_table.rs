//! Transfer tables against the transfer function they are made of.

use spao_server::scene::{ControlPoint, Rgb, TransferFunction, TransferTable, opacity_table, preset, presets};
use spao_server::volume::CodeMap;

const SPACING: f64 = 0.7;

fn code_maps() -> Vec<CodeMap> {
    vec![
        CodeMap::for_integers(0.0, 255.0),
        CodeMap::for_integers(-1024.0, 3071.0),
        CodeMap::for_integers(0.0, 65535.0),
        CodeMap::for_integers(0.0, 1.0),
        CodeMap::for_integers(7.0, 7.0),
        CodeMap::for_integers(0.0, 1e9),
        CodeMap::for_floats(-1.5, 1.5),
        CodeMap::for_floats(0.25, 0.25),
    ]
}

fn function(points: &[(f64, &str, f64)], opacity_unit_distance: Option<f64>) -> TransferFunction {
    let point = |&(value, color, opacity): &(f64, &str, f64)| {
        let color = Rgb::from_hex(color).expect("a colour");
        ControlPoint { value, color, opacity }
    };
    TransferFunction { points: points.iter().map(point).collect(), opacity_unit_distance }
}

fn functions(code_map: &CodeMap) -> Vec<TransferFunction> {
    let [lowest, highest] = code_map.value_range();
    let at = |fraction: f64| lowest + (highest - lowest) * fraction;
    let dense: Vec<_> = (0..1024).map(|i| (at(f64::from(i) / 1023.0), "#8040c0", f64::from(i % 7) / 6.0)).collect();
    let step = [(at(0.5), "#ff0000", 0.0), (at(0.5), "#00ff00", 1.0)];
    let box_of_steps = [(at(0.3), "#000", 0.0), (at(0.3), "#fff", 0.4), (at(0.6), "#fff", 0.4), (at(0.6), "#000", 0.0)];
    let mut functions = vec![
        function(&[(at(0.4), "#123456", 0.3)], None),
        function(&step, None),
        function(&box_of_steps, Some(2.0)),
        function(&[(at(-2.0), "#000", 1.0), (at(3.0), "#fff", 0.0)], Some(0.1)),
        function(&[(at(2.0), "#000", 0.0), (at(3.0), "#fff", 1.0)], None),
    ];
    if highest > lowest {
        functions.push(function(&dense, Some(1.3)));
    }
    functions.extend(presets().iter().map(|preset| preset.transfer_function([lowest, highest])));
    functions
}

/// Whether a table is what sampling the transfer function entry by entry gives.
fn is_table_of(table: &TransferTable, tf: &TransferFunction, code_map: &CodeMap, step_length: f64) -> bool {
    let k = table.entries_per_code;
    let count = u32::from(code_map.max_code) * k + 1;
    let lengths = [table.opacity.len(), table.color.len(), table.visible_prefix.len() - 1];
    let entries = (0..count).all(|entry| {
        let value = code_map.value_from_code(f64::from(entry) / f64::from(k));
        let [r, g, b] = tf.sample(value).0.0.map(|c| (c * 255.0).round() as u8);
        let opacity = tf.opacity_over(value, step_length, SPACING) as f32;
        table.opacity[entry as usize] == opacity && table.color[entry as usize].to_le_bytes() == [r, g, b, 255]
    });
    let prefix = |entry: usize| table.opacity[..entry].iter().filter(|&&opacity| opacity > 0.0).count();
    let ends = [0, count as usize / 3, count as usize];
    lengths == [count as usize; 3]
        && entries
        && ends.iter().all(|&entry| table.visible_prefix[entry] as usize == prefix(entry))
}

#[test]
fn a_transfer_table_is_the_transfer_function_sampled_entry_by_entry() {
    for code_map in code_maps() {
        for tf in functions(&code_map) {
            let table = TransferTable::new(&tf, &code_map, 0.35, SPACING);
            assert!(is_table_of(&table, &tf, &code_map, 0.35), "{code_map:?} {tf:?}");
        }
    }
}

#[test]
fn the_comparison_notices_another_step_length_point_or_colour() {
    let code_map = CodeMap::for_integers(0.0, 255.0);
    let tf = functions(&code_map).swap_remove(2);
    let table = TransferTable::new(&tf, &code_map, 0.35, SPACING);
    assert!(is_table_of(&table, &tf, &code_map, 0.35));
    assert!(!is_table_of(&table, &tf, &code_map, 0.36));
    for change in [
        |p: &mut ControlPoint| p.value += 1.0,
        |p: &mut ControlPoint| p.opacity += 0.01,
        |p: &mut ControlPoint| p.color.0[2] -= 0.01,
    ] {
        let mut changed = tf.clone();
        change(&mut changed.points[2]);
        assert!(!is_table_of(&table, &changed, &code_map, 0.35));
    }
}

#[test]
fn tables_are_fine_where_codes_are_few_and_never_larger_than_a_code_has_bits() {
    for max_code in [0, 1, 2, 255, 256, 4095, 16382, 16383, 16384, 32767, 65535] {
        let code_map = CodeMap::for_integers(0.0, f64::from(max_code));
        let tf = function(&[(0.0, "#000", 0.0), (1.0, "#fff", 1.0)], None);
        let entries = TransferTable::new(&tf, &code_map, 1.0, 1.0).opacity.len();
        let expected = if max_code == 0 { 1..=1 } else { 16384..=65536 };
        assert!(expected.contains(&entries), "{max_code}: {entries}");
    }
}

#[test]
fn any_visible_is_what_looking_at_every_entry_says() {
    for code_map in code_maps() {
        for tf in functions(&code_map) {
            let table = TransferTable::new(&tf, &code_map, 1.0, SPACING);
            let max = code_map.max_code;
            let k = table.entries_per_code as usize;
            let codes = [0, 1, max / 3, max / 2, max / 2 + 1, max.saturating_sub(1), max].map(|code| code.min(max));
            for low in codes {
                for high in codes.into_iter().filter(|&high| high >= low) {
                    let entries = &table.opacity[usize::from(low) * k..=usize::from(high) * k];
                    let expected = entries.iter().any(|&opacity| opacity > 0.0);
                    assert_eq!(table.any_visible(low, high), expected, "{low}..={high} {tf:?}");
                }
            }
        }
    }
}

#[test]
fn a_peak_between_two_codes_is_visible_between_them_only() {
    let code_map = CodeMap::for_integers(0.0, 255.0);
    let tf = function(&[(100.4, "#fff", 0.0), (100.5, "#fff", 1.0), (100.6, "#fff", 0.0)], None);
    let table = TransferTable::new(&tf, &code_map, 1.0, 1.0);
    assert!(table.any_visible(100, 101) && table.any_visible(0, 255) && table.any_visible(0, u16::MAX));
    assert!(!table.any_visible(100, 100) && !table.any_visible(0, 100) && !table.any_visible(101, 255));
}

#[test]
fn the_opacity_table_has_the_opacity_of_one_voxel_per_code() {
    for code_map in code_maps() {
        for tf in functions(&code_map) {
            let table = opacity_table(&tf, &code_map, SPACING);
            let naive = |code: u16| {
                let value = code_map.value_from_code(f64::from(code));
                (tf.opacity_over(value, SPACING, SPACING) * 65535.0).round() as u16
            };
            let expected: Vec<u16> = (0..=code_map.max_code).map(naive).collect();
            assert!(table == expected, "{code_map:?} {tf:?}");
        }
    }
}

#[test]
fn opacity_is_for_a_ray_of_the_unit_distance() {
    let code_map = CodeMap::for_integers(3.0, 3.0);
    let at_unit = |unit| opacity_table(&function(&[(0.0, "#fff", 0.75)], unit), &code_map, 1.0)[0];
    assert_eq!(at_unit(None), 49151, "0.75 over one spacing");
    assert_eq!(at_unit(Some(2.0)), 32768, "0.5 over half the unit distance");
    assert_eq!(at_unit(Some(0.5)), 61439, "0.9375 over twice the unit distance");
}

#[test]
fn the_upper_point_of_a_step_holds_at_the_value_itself() {
    let code_map = CodeMap::for_integers(0.0, 255.0);
    let tf = function(&[(128.0, "#fff", 0.0), (128.0, "#fff", 1.0)], None);
    let table = opacity_table(&tf, &code_map, 1.0);
    assert_eq!((table[127], table[128]), (0, 65535));
}

#[test]
fn the_bone_preset_leaves_soft_tissue_transparent() {
    let tf = preset("ct_bone").expect("a preset").transfer_function([-1024.0, 3071.0]);
    let table = opacity_table(&tf, &CodeMap::for_integers(-1024.0, 3071.0), 1.0);
    assert!(table[..1024 + 140].iter().all(|&opacity| opacity == 0));
    assert!(table[1024 + 1000] > 60_000);
}
