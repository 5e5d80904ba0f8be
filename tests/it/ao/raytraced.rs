//! The ray-traced method on the GPU against its twin.

use std::sync::Arc;

use glam::DVec3;
use spao_server::scene::{AmbientOcclusion, Radius, TransferFunction};
use spao_server::volume::{Grid, ProceduralKind, Volume, Voxels};

use super::support::{
    DISPLAY_STEP, Errors, Fields, Subject, ct_head, errors, head_transfer_functions, opacities, procedural,
    random_volume, raytraced, some_voxels,
};

/// Sixteen-bit opacities and results, and rays that end where less than 0.0002 is left of them.
const LARGEST: f64 = 0.05 * DISPLAY_STEP;
const RMS: f64 = 0.01 * DISPLAY_STEP;

/// Voxels at which the twin is asked.
const VOXELS: usize = 6_000;

#[track_caller]
fn assert_like_twin(subject: &Subject, what: &str, transfer: &TransferFunction, settings: AmbientOcclusion) {
    let errors = errors(subject, transfer, settings, VOXELS);
    let dims = subject.volume.grid.dims;
    assert!(errors.are_within(LARGEST, RMS), "{dims:?}, {what}, {settings:?}: {errors:?}");
}

fn with_radius(radius: Radius, factor: f64, rays: u32) -> AmbientOcclusion {
    AmbientOcclusion { radius, ..raytraced(6, factor, rays) }
}

/// A part of the CT head with air, skin and bone.
fn part_of_the_head() -> Arc<Volume> {
    let (head, dims, first) = (ct_head(), [46, 38, 31], [40, 6, 50]);
    let at = |i: u32| [i % dims[0], i / dims[0] % dims[1], i / dims[0] / dims[1]];
    let value = |i| head.value_at(std::array::from_fn(|axis| at(i)[axis] + first[axis])) as i16;
    let voxels = (0..dims.iter().product()).map(value).collect();
    Arc::new(Volume::new(Grid::axis_aligned(dims, DVec3::splat(2.0)), Voxels::I16(voxels)).expect("a valid volume"))
}

#[test]
fn a_part_of_the_ct_head_is_like_its_twin() {
    let subject = Subject::new(part_of_the_head());
    for (name, transfer) in head_transfer_functions() {
        for factor in [0.0, 1.0] {
            assert_like_twin(&subject, name, &transfer, raytraced(5, factor, 48));
        }
    }
}

#[test]
fn every_radius_is_like_the_twin() {
    let subject = Subject::new(procedural(ProceduralKind::Boxes, [37, 29, 21]));
    let transfer = opacities(&[(20.0, 0.0), (200.0, 0.7)]);
    for factor in [0.0, 1.0] {
        for levels in [1, 4, 8] {
            assert_like_twin(&subject, "boxes", &transfer, raytraced(levels, factor, 32));
        }
        for radius in [Radius::Voxels(1.0), Radius::Voxels(7.3), Radius::Voxels(1024.0), Radius::Unlimited] {
            assert_like_twin(&subject, "boxes", &transfer, with_radius(radius, factor, 32));
        }
    }
}

#[test]
fn thin_fog_that_stops_no_ray_is_like_the_twin() {
    let subject = Subject::new(procedural(ProceduralKind::Cloud, [33, 40, 27]));
    let [lowest, highest] = subject.volume.code_map.value_range();
    let transfer = opacities(&[(lowest, 0.0), (highest, 0.06)]);
    for factor in [0.0, 1.0] {
        assert_like_twin(&subject, "fog", &transfer, with_radius(Radius::Unlimited, factor, 48));
    }
}

#[test]
fn volumes_of_extreme_shapes_are_like_their_twin() {
    let transfer = opacities(&[(0.0, 0.0), (100.0, 0.1), (1000.0, 1.0)]);
    for dims in [[1, 1, 1], [1, 64, 3], [64, 1, 1], [1, 1, 64], [127, 5, 9], [7, 130, 2]] {
        let subject = Subject::new(random_volume(dims, DVec3::ONE));
        for factor in [0.0, 1.0] {
            assert_like_twin(&subject, "random", &transfer, raytraced(4, factor, 32));
            assert_like_twin(&subject, "random", &transfer, with_radius(Radius::Unlimited, factor, 32));
        }
    }
}

#[test]
fn few_rays_are_like_the_twin_also_where_none_lies_in_the_hemisphere() {
    let subject = Subject::new(random_volume([13, 11, 9], DVec3::ONE));
    let transfer = opacities(&[(0.0, 0.0), (1000.0, 1.0)]);
    for rays in [1, 2, 3, 7] {
        for factor in [0.0, 1.0] {
            assert_like_twin(&subject, "few rays", &transfer, raytraced(4, factor, rays));
        }
    }
}

#[test]
fn the_unit_of_opacity_and_unequal_spacing_are_like_the_twin() {
    let subject = Subject::new(random_volume([17, 21, 14], DVec3::new(3.0, 0.75, 1.5)));
    let points = opacities(&[(50.0, 0.0), (1000.0, 0.9)]);
    for unit in [Some(0.1), Some(4.0)] {
        let transfer = TransferFunction { opacity_unit_distance: unit, ..points.clone() };
        assert_like_twin(&subject, &format!("{unit:?}"), &transfer, raytraced(4, 1.0, 32));
    }
}

#[test]
fn the_comparison_with_the_twin_notices_what_would_be_wrong() {
    let subject = Subject::new(procedural(ProceduralKind::Boxes, [37, 29, 21]));
    let (transfer, settings) = (opacities(&[(20.0, 0.0), (200.0, 0.7)]), raytraced(4, 1.0, 32));
    let gpu = subject.accessibility(&transfer, settings);
    let fields = Fields::new(&subject.volume, &transfer);
    let voxels = some_voxels(&subject.volume, VOXELS);
    let is_like = |twin: &[f64]| Errors::between(&gpu, &voxels, twin).are_within(LARGEST, RMS);
    assert!(is_like(&fields.twin(&settings, &voxels)));
    for other in [
        raytraced(4, 1.0, 33),
        raytraced(4, 0.0, 32),
        raytraced(3, 1.0, 32),
        with_radius(Radius::Voxels(8.5), 1.0, 32),
        with_radius(Radius::Unlimited, 1.0, 32),
    ] {
        assert!(!is_like(&fields.twin(&other, &voxels)), "{other:?}");
    }
    for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
        assert!(!is_like(&fields.twin_off_centre(&settings, &voxels, 0.05 * axis)), "{axis}");
    }
    let denser = Fields::new(&subject.volume, &opacities(&[(20.0, 0.0), (200.0, 0.71)]));
    assert!(!is_like(&denser.twin(&settings, &voxels)));
}
