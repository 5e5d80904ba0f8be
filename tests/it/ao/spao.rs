//! SPAO on the GPU against its twin. Levels have 16 bits, so what is left of an error is a few of their roundings, and
//! where windows begin at every second cell only, that box means between them are interpolated.

use glam::DVec3;
use spao_server::ao::level_layouts;
use spao_server::scene::{AmbientOcclusion, TransferFunction};
use spao_server::volume::ProceduralKind;

use super::support::{
    DISPLAY_STEP, Errors, Fields, Subject, boxes, ct_head, errors, head_transfer_functions, hybrid, mipmap, n_buffer,
    opacities, procedural, random_volume, some_voxels, volume_of,
};

const LARGEST: f64 = 0.05 * DISPLAY_STEP;
const RMS: f64 = 0.01 * DISPLAY_STEP;

/// The same with windows that begin at every second cell.
const LARGEST_BETWEEN: f64 = 0.4 * DISPLAY_STEP;
const RMS_BETWEEN: f64 = 0.035 * DISPLAY_STEP;

/// Largest and root mean square error that is allowed for the settings.
fn tolerance(dims: [u32; 3], settings: &AmbientOcclusion) -> (f64, f64) {
    // Windows of one cell, those of mip levels, are interpolated by the twin as well.
    let layouts = level_layouts(dims, settings);
    let between = layouts.iter().any(|l| l.source.is_some_and(|s| s.scale == 2 && s.distance > 1));
    if between { (LARGEST_BETWEEN, RMS_BETWEEN) } else { (LARGEST, RMS) }
}

#[track_caller]
fn assert_like_twin(subject: &Subject, what: &str, transfer: &TransferFunction, settings: AmbientOcclusion) {
    let errors = errors(subject, transfer, settings, 120_000);
    let dims = subject.volume.grid.dims;
    let (largest, rms) = tolerance(dims, &settings);
    assert!(errors.are_within(largest, rms), "{dims:?}, {what}, {settings:?}: {errors:?}");
}

#[test]
fn only_windows_of_more_than_32_cells_are_compared_more_loosely() {
    let loose = |settings| tolerance([61, 47, 33], &settings) == (LARGEST_BETWEEN, RMS_BETWEEN);
    assert!(
        !loose(n_buffer(5, 2.0)) && !loose(mipmap(8, 2.0)) && !loose(hybrid(6, 2, 1.0)) && !loose(hybrid(6, 1, 1.0))
    );
    assert!(loose(n_buffer(6, 0.0)) && loose(n_buffer(8, 1.0)) && loose(hybrid(8, 1, 1.0)));
}

#[test]
fn the_ct_head_over_n_buffers_is_like_its_twin() {
    let head = Subject::new(ct_head());
    for (name, transfer) in head_transfer_functions() {
        for factor in [0.0, 1.0] {
            for levels in [5, 6] {
                assert_like_twin(&head, name, &transfer, n_buffer(levels, factor));
            }
        }
    }
}

#[test]
fn the_ct_head_over_mip_levels_and_hybrids_is_like_its_twin() {
    let head = Subject::new(ct_head());
    for (name, transfer) in head_transfer_functions() {
        assert_like_twin(&head, name, &transfer, mipmap(6, 1.0));
        assert_like_twin(&head, name, &transfer, hybrid(6, 2, 1.0));
    }
}

#[test]
fn boxes_without_any_symmetry_are_like_their_twin_with_all_levels_and_factors() {
    let subject = Subject::new(boxes());
    let transfer = opacities(&[(20.0, 0.0), (200.0, 0.7)]);
    for levels in [1, 3, 5, 6, 8] {
        for factor in [0.0, 0.5, 1.0, 2.0] {
            assert_like_twin(&subject, "boxes", &transfer, n_buffer(levels, factor));
        }
    }
    for factor in [0.0, 1.0, 2.0] {
        assert_like_twin(&subject, "boxes", &transfer, mipmap(6, factor));
        for mips in [1, 2, 3] {
            assert_like_twin(&subject, "boxes", &transfer, hybrid(6, mips, factor));
        }
    }
    for levels in [1, 8] {
        assert_like_twin(&subject, "boxes", &transfer, mipmap(levels, 1.0));
        assert_like_twin(&subject, "boxes", &transfer, hybrid(levels, 1, 1.0));
    }
}

#[test]
fn volumes_of_extreme_shapes_are_like_their_twin() {
    let transfer = opacities(&[(0.0, 0.0), (100.0, 0.1), (1000.0, 1.0)]);
    for dims in [[1, 1, 1], [1, 64, 3], [64, 1, 1], [1, 1, 64], [127, 5, 9], [2, 2, 2], [129, 9, 8], [7, 130, 2]] {
        let subject = Subject::new(random_volume(dims, DVec3::ONE));
        for factor in [0.0, 1.0] {
            for settings in [n_buffer(5, factor), mipmap(6, factor), hybrid(6, 2, factor), n_buffer(8, factor)] {
                assert_like_twin(&subject, "random", &transfer, settings);
            }
        }
    }
}

#[test]
fn values_of_8_and_16_bits_and_floats_are_like_their_twin() {
    use spao_server::volume::{Grid, Volume, Voxels};
    for kind in [ProceduralKind::Gyroid, ProceduralKind::Cloud, ProceduralKind::MarschnerLobb] {
        let volume = procedural(kind, [40, 33, 29]);
        let [lowest, highest] = volume.code_map.value_range();
        let at = |share: f64| lowest + share * (highest - lowest);
        let transfer = opacities(&[(at(0.3), 0.0), (at(0.8), 0.6)]);
        assert_like_twin(&Subject::new(volume.clone()), "procedural", &transfer, n_buffer(6, 1.0));

        let floats = (0..volume.voxels.len()).map(|i| (volume.voxels.value(i) * 1e-3 - 7.0) as f32).collect();
        let floats = Volume::new(volume.grid.clone(), Voxels::F32(floats)).expect("a valid volume");
        let transfer = opacities(&[(at(0.3) * 1e-3 - 7.0, 0.0), (at(0.8) * 1e-3 - 7.0, 0.6)]);
        assert_like_twin(&Subject::new(floats.into()), "floats", &transfer, n_buffer(6, 1.0));
    }
    // One value only: no normal, no contrast.
    let flat =
        Volume::new(Grid::axis_aligned([5, 6, 7], DVec3::ONE), Voxels::I16(vec![-3; 210])).expect("a valid volume");
    assert_like_twin(&Subject::new(flat.into()), "flat", &opacities(&[(0.0, 0.3)]), n_buffer(6, 1.0));
}

#[test]
fn the_unit_of_opacity_and_unequal_spacing_are_like_the_twin() {
    let spacing = DVec3::new(3.0, 0.75, 1.5);
    let subject = Subject::new(random_volume([24, 37, 19], spacing));
    let points = opacities(&[(50.0, 0.0), (1000.0, 0.9)]);
    let mut results = Vec::new();
    for unit in [None, Some(0.75), Some(0.1), Some(4.0)] {
        let transfer = TransferFunction { opacity_unit_distance: unit, ..points.clone() };
        for settings in [n_buffer(6, 1.0), mipmap(4, 0.5)] {
            assert_like_twin(&subject, &format!("{unit:?}"), &transfer, settings);
        }
        results.push(subject.accessibility(&transfer, n_buffer(6, 1.0)));
    }
    assert!(results[0] == results[1], "the smallest spacing is the default");
    assert!(results[0] != results[2] && results[0] != results[3]);
    // METHODS work in index space: with the opacity of a voxel given, spacing does not matter.
    let stretched = Subject::new(random_volume([24, 37, 19], DVec3::new(0.75, 9.0, 0.75)));
    assert!(stretched.accessibility(&points, n_buffer(6, 1.0)) == results[0]);
}

/// A result and its twin at every voxel.
fn control() -> (Subject, TransferFunction, AmbientOcclusion, Vec<f32>) {
    let subject = Subject::new(boxes());
    let (transfer, settings) = (opacities(&[(20.0, 0.0), (200.0, 0.7)]), n_buffer(5, 1.0));
    let gpu = subject.accessibility(&transfer, settings);
    (subject, transfer, settings, gpu)
}

#[test]
fn the_comparison_with_the_twin_notices_what_would_be_wrong() {
    let (subject, transfer, settings, gpu) = control();
    let fields = Fields::new(&subject.volume, &transfer);
    let voxels = some_voxels(&subject.volume, usize::MAX);
    let twin = fields.twin(&settings, &voxels);
    let is_like = |gpu: &[f32], twin: &[f64]| Errors::between(gpu, &voxels, twin).are_within(LARGEST, RMS);
    assert!(is_like(&gpu, &twin));

    let [nx, ny, nz] = subject.volume.grid.dims.map(|n| n as usize);
    let place = |i: usize| [i % nx, i / nx % ny, i / nx / ny];
    let moved = |from: &dyn Fn([usize; 3]) -> [usize; 3]| -> Vec<f32> {
        voxels.iter().map(|&i| from(place(i))).map(|[x, y, z]| gpu[(z % nz * ny + y % ny) * nx + x % nx]).collect()
    };
    assert!(is_like(&moved(&|p| p), &twin));
    for (wrong, result) in [
        ("x and y swapped", moved(&|[x, y, z]| [y, x, z])),
        ("y and z swapped", moved(&|[x, y, z]| [x, z, y])),
        ("x flipped", moved(&|[x, y, z]| [nx - 1 - x, y, z])),
        ("y flipped", moved(&|[x, y, z]| [x, ny - 1 - y, z])),
        ("z flipped", moved(&|[x, y, z]| [x, y, nz - 1 - z])),
        ("a voxel off along x", moved(&|[x, y, z]| [x + 1, y, z])),
        ("a voxel off along z", moved(&|[x, y, z]| [x, y, z + 1])),
    ] {
        assert!(!is_like(&result, &twin), "{wrong}");
    }
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        // Windows that are not centred: half a voxel already shows.
        assert!(!is_like(&gpu, &fields.twin_off_centre(&settings, &voxels, 0.5 * axis)), "{axis}");
        assert!(!is_like(&gpu, &fields.twin_off_centre(&settings, &voxels, -0.05 * axis)), "{axis}");
    }
    for other in [n_buffer(4, 1.0), n_buffer(5, 0.99), mipmap(5, 1.0), hybrid(5, 1, 1.0)] {
        assert!(!is_like(&gpu, &fields.twin(&other, &voxels)), "{other:?}");
    }
    let mut perturbed = gpu.clone();
    perturbed[12_345] += 0.1 / 255.0;
    assert!(!is_like(&perturbed, &twin));
}

#[test]
fn the_looser_comparison_notices_half_a_voxel_and_other_levels_and_factors() {
    let (subject, transfer, _, _) = control();
    let settings = n_buffer(6, 1.0);
    let gpu = subject.accessibility(&transfer, settings);
    let fields = Fields::new(&subject.volume, &transfer);
    let voxels = some_voxels(&subject.volume, usize::MAX);
    let is_like = |twin: &[f64]| Errors::between(&gpu, &voxels, twin).are_within(LARGEST_BETWEEN, RMS_BETWEEN);
    assert!(is_like(&fields.twin(&settings, &voxels)));
    for offset in [DVec3::X, DVec3::Y, DVec3::Z] {
        assert!(!is_like(&fields.twin_off_centre(&settings, &voxels, 0.2 * offset)), "{offset}");
    }
    for other in [n_buffer(5, 1.0), n_buffer(6, 0.95), mipmap(6, 1.0), hybrid(6, 1, 1.0)] {
        assert!(!is_like(&fields.twin(&other, &voxels)), "{other:?}");
    }
}

#[test]
fn the_comparison_with_the_twin_notices_one_other_voxel_in_the_volume() {
    let (subject, transfer, settings, gpu) = control();
    let original = &subject.volume;
    let voxels = some_voxels(original, usize::MAX);
    let dims = original.grid.dims;
    let same = volume_of(dims, DVec3::ONE, |at| original.value_at(at) as u16);
    let other = volume_of(dims, DVec3::ONE, |at| if at == [30, 5, 4] { 255 } else { original.value_at(at) as u16 });
    let is_like = |volume| {
        let twin = Fields::new(volume, &transfer).twin(&settings, &voxels);
        Errors::between(&gpu, &voxels, &twin).are_within(LARGEST, RMS)
    };
    assert!(is_like(&same) && !is_like(&other));
}
