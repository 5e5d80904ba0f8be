//! The measure of open surfaces on volumes small enough to count by hand.

use spao_server::reference::{OpacityField, surface_reference};

use super::support::{assert_close, random_opacity};

/// Opaque below the layer z = 4; every even column of layer 4 is surface, and nothing else.
fn ground(dims: [u32; 3]) -> OpacityField {
    OpacityField::from_fn(dims, |[.., k]| if k < 4 { 1.0 } else { 0.0 })
}

fn per_voxel(dims: [u32; 3], value: impl Fn([u32; 3]) -> f64) -> Vec<f64> {
    OpacityField::from_fn(dims, value).alpha
}

#[test]
fn four_fifths_of_the_surface_do_not_exceed_the_reference() {
    let dims = [20, 5, 9];
    // Ten even columns along x, in each row: accessibilities 0.00, 0.02, ... 0.18.
    let accessibility = per_voxel(dims, |[i, ..]| f64::from(i) / 100.0);
    assert_close(surface_reference(&ground(dims), &accessibility), 0.14, 1e-12);
    let reversed = per_voxel(dims, |[i, ..]| f64::from(19 - i) / 100.0);
    assert_close(surface_reference(&ground(dims), &reversed), 0.15, 1e-12);
}

#[test]
fn only_clear_even_voxels_beside_opaque_ones_count() {
    let dims = [12, 10, 9];
    let opacity = ground(dims);
    let surface = |[i, j, k]: [u32; 3]| k == 4 && i % 2 == 0 && j % 2 == 0;
    let only_there = per_voxel(dims, |v| if surface(v) { 0.3 } else { 0.9 });
    assert_eq!(surface_reference(&opacity, &only_there), 0.3);
    // From the side and from above counts as well; voxels outside do not.
    for (axis, at) in [(0, 4), (1, 4), (2, 4)] {
        let slab = OpacityField::from_fn([9; 3], |v| if v[axis] > at { 1.0 } else { 0.0 });
        let accessibility = per_voxel([9; 3], |v| if v[axis] == at { 0.4 } else { 0.8 });
        assert_eq!(surface_reference(&slab, &accessibility), 0.4);
    }
}

#[test]
fn without_a_surface_the_reference_is_1() {
    let dims = [6, 6, 6];
    let dark = vec![0.1; 216];
    assert_eq!(surface_reference(&OpacityField::from_fn(dims, |_| 0.0), &dark), 1.0);
    assert_eq!(surface_reference(&OpacityField::from_fn(dims, |_| 1.0), &dark), 1.0);
    assert_eq!(surface_reference(&OpacityField::from_fn([1; 3], |_| 0.5), &[0.1]), 1.0);
}

#[test]
fn voxels_weigh_as_much_as_they_are_clear_and_their_densest_neighbour_is_opaque() {
    // Along x at even places 0, 2, 4: weights 0.5 · 0.8, 0.9 · 0.8 and 1 · 0.2.
    let opacity = OpacityField { dims: [5, 1, 1], alpha: vec![0.5, 0.8, 0.1, 0.2, 0.0] };
    let at = |a: [f64; 3]| surface_reference(&opacity, &[a[0], 0.0, a[1], 0.0, a[2]]);
    // Total 1.32, four fifths 1.056: less than the first two together, 1.12, and more than the others, 0.92 and 0.6.
    assert_eq!(at([0.1, 0.2, 0.3]), 0.2);
    assert_eq!(at([0.1, 0.3, 0.2]), 0.3);
    assert_eq!(at([0.3, 0.2, 0.1]), 0.3);
    assert_eq!(at([0.2, 0.1, 0.3]), 0.2);
    // With more weight on the last one all are needed.
    let opacity = OpacityField { alpha: vec![0.5, 0.8, 0.1, 0.4, 0.0], ..opacity };
    assert_eq!(surface_reference(&opacity, &[0.1, 0.0, 0.2, 0.0, 0.3]), 0.3);
}

#[test]
fn a_more_open_volume_has_a_larger_reference() {
    let opacity = random_opacity([11, 9, 7], 71);
    let accessibility: Vec<f64> = random_opacity([11, 9, 7], 72).alpha;
    let raised: Vec<f64> = accessibility.iter().map(|a| 0.5 + 0.5 * a).collect();
    let reference = surface_reference(&opacity, &accessibility);
    assert_close(surface_reference(&opacity, &raised), 0.5 + 0.5 * reference, 1e-12);
    assert!(reference > 0.5 && reference < 1.0, "{reference}");
}
