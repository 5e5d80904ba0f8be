//! Procedural volumes: the same every time, and what they claim to be.

use glam::DVec3;
use spao_server::volume::procedural::sphere_on_plane;
use spao_server::volume::{Limits, ProceduralKind, ProceduralSpec, Volume, VoxelType, Voxels};

use super::assert_names;

/// All of them.
pub(super) const KINDS: [ProceduralKind; 8] = [
    ProceduralKind::Gyroid,
    ProceduralKind::MarschnerLobb,
    ProceduralKind::Menger,
    ProceduralKind::Mandelbulb,
    ProceduralKind::Cloud,
    ProceduralKind::SphereFlake,
    ProceduralKind::Boxes,
    ProceduralKind::SphereOnPlane,
];

fn spec(kind: ProceduralKind, dims: [u32; 3]) -> ProceduralSpec {
    ProceduralSpec { kind, dims, seed: 0, spacing: None }
}

fn make(kind: ProceduralKind, dims: [u32; 3]) -> Volume {
    spec(kind, dims).generate(&Limits::default()).expect("a valid specification")
}

#[test]
fn every_kind_is_the_same_whatever_the_number_of_threads() {
    let threads = |n: usize| rayon::ThreadPoolBuilder::new().num_threads(n).build().expect("a thread pool");
    for kind in KINDS {
        let dims = [37, 32, 41];
        let one = threads(1).install(|| make(kind, dims));
        let many = threads(5).install(|| make(kind, dims));
        assert_eq!(one.voxels, many.voxels, "{kind:?}");
        assert_eq!(one.sha256_hex(), many.sha256_hex());
        assert_eq!(one.voxels.voxel_type(), spec(kind, dims).voxel_type());
        let other = make(kind, [37, 32, 42]);
        assert_ne!(one.sha256_hex(), other.sha256_hex(), "{kind:?}");
    }
}

#[test]
fn every_kind_has_something_to_show_at_any_size() {
    for kind in KINDS {
        for dims in [[1, 1, 1], [1, 7, 2], [64, 64, 64]] {
            let volume = make(kind, dims);
            assert_eq!(volume.grid.dims, dims);
            let [lo, hi] = volume.code_map.value_range();
            assert!(dims[0] < 64 || hi - lo >= 0.6 * hi && hi >= 200.0, "{kind:?} {lo} {hi}");
        }
    }
}

#[test]
fn the_seed_chooses_the_noise() {
    for kind in [ProceduralKind::Cloud, ProceduralKind::Gyroid] {
        let with = |seed| {
            let spec = ProceduralSpec { seed, ..spec(kind, [24; 3]) };
            spec.generate(&Limits::default()).expect("valid").sha256_hex()
        };
        assert_eq!(with(3), with(3));
        assert_ne!(with(3), with(4));
        assert_ne!(with(3), with(3 + (1 << 40)), "all 64 bits count");
    }
}

#[test]
fn boxes_are_like_no_mirror_image_of_themselves() {
    let n = 16;
    let volume = make(ProceduralKind::Boxes, [n; 3]);
    let value = |[i, j, k]: [u32; 3]| volume.value_at([i, j, k]);
    let permutations = [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]];
    for permutation in permutations {
        for flips in 0..8_u32 {
            let moved = |p: [u32; 3]| {
                let q: [u32; 3] = std::array::from_fn(|a| p[permutation[a]]);
                std::array::from_fn(|a| if flips >> a & 1 == 1 { n - 1 - q[a] } else { q[a] })
            };
            let same = (0..n * n * n).all(|i| {
                let p = [i % n, i / n % n, i / n / n];
                value(p) == value(moved(p))
            });
            assert_eq!(same, permutation == [0, 1, 2] && flips == 0, "{permutation:?} {flips:03b}");
        }
    }
}

#[test]
fn boxes_number_one_two_and_three_along_x_y_and_z() {
    let volume = make(ProceduralKind::Boxes, [64; 3]);
    for (axis, boxes) in [(0, 1), (1, 2), (2, 3)] {
        // Along the axis through the middle of the corner cube; that cube is one box more.
        let line: Vec<f64> = (0..64)
            .map(|i| {
                let mut p = [8; 3];
                p[axis] = i;
                volume.value_at(p)
            })
            .collect();
        let begins = line.windows(2).filter(|pair| pair[0] == 0.0 && pair[1] > 0.0).count();
        assert_eq!(begins, boxes + 1, "axis {axis}");
    }
}

#[test]
fn the_sphere_lies_on_the_plane() {
    let dims = [40, 48, 64];
    let volume = make(ProceduralKind::SphereOnPlane, dims);
    let geometry = sphere_on_plane::geometry(dims);
    assert_eq!((geometry.plane_z, geometry.radius), (16.0, 10.0));
    assert_eq!(geometry.centre, DVec3::new(20.0, 24.0, 26.0));
    assert_eq!(volume.value_at([20, 24, 26]), 255.0);
    assert_eq!([15, 16].map(|k| volume.value_at([0, 0, k])), [255.0, 0.0]);
    assert_eq!([34, 36].map(|k| volume.value_at([20, 24, k])), [255.0, 0.0]);
    // The sum of coverage is the sphere's volume.
    let Voxels::U8(values) = &volume.voxels else { panic!("not u8") };
    let above: f64 = values[16 * 40 * 48..].iter().map(|&v| f64::from(v) / 255.0).sum();
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 1000.0;
    assert!((above / exact - 1.0).abs() < 0.01, "{above} {exact}");
}

#[test]
fn the_sponge_has_the_holes_of_a_menger_sponge() {
    let volume = make(ProceduralKind::Menger, [27; 3]);
    let Voxels::U8(values) = &volume.voxels else { panic!("not u8") };
    assert_eq!(values.iter().filter(|&&v| v == 255).count(), 20 * 20 * 20, "20 of 27 cubes on each of 3 levels");
    assert!(values.iter().all(|v| [0, 255].contains(v)));
    assert_eq!(volume.value_at([13, 13, 0]), 0.0, "a hole through the middle of a face");
    assert_eq!(volume.value_at([13, 0, 0]), 255.0, "none along the middle of an edge");
    assert_eq!(volume.value_at([0, 0, 0]), 255.0);
    assert_eq!(volume.value_at([1, 1, 0]), 0.0, "the smallest hole");
    // Another size has the same shape.
    let odd = make(ProceduralKind::Menger, [64, 50, 70]);
    assert_eq!(odd.value_at([32, 25, 3]), 0.0);
}

#[test]
fn the_test_signal_is_the_formula() {
    let volume = make(ProceduralKind::MarschnerLobb, [40; 3]);
    let [x, y, z] = [3, 17, 31].map(|i| 2.0 * (f64::from(i) + 0.5) / 40.0 - 1.0);
    let pi = std::f64::consts::PI;
    let r = f64::hypot(x, y);
    let ripple = (2.0 * pi * 6.0 * (pi * r / 2.0).cos()).cos();
    let expected = 65535.0 * (1.0 - (pi * z / 2.0).sin() + 0.25 * (1.0 + ripple)) / 2.5;
    assert!((volume.value_at([3, 17, 31]) - expected).abs() <= 0.5);
    assert!((volume.value_at([3, 17, 30]) - expected).abs() > 100.0, "the comparison sees nothing");
}

#[test]
fn fractals_are_solid_inside_and_empty_outside() {
    let n = 64;
    for (kind, least, most) in [(ProceduralKind::Mandelbulb, 0.1, 0.4), (ProceduralKind::SphereFlake, 0.05, 0.15)] {
        let volume = make(kind, [n; 3]);
        assert_eq!(volume.value_at([n / 2; 3]), 255.0, "{kind:?}");
        assert_eq!(volume.value_at([0; 3]), 0.0, "{kind:?}");
        let Voxels::U8(values) = &volume.voxels else { panic!("not u8") };
        let solid = values.iter().filter(|&&v| v > 127).count() as f64 / values.len() as f64;
        assert!((least..most).contains(&solid), "{kind:?} {solid}");
    }
}

#[test]
fn a_cloud_is_translucent_and_ends_before_the_border() {
    let n = 48;
    let volume = make(ProceduralKind::Cloud, [n; 3]);
    let Voxels::U16(values) = &volume.voxels else { panic!("not u16") };
    let share = |of: &dyn Fn(u16) -> bool| values.iter().filter(|&&v| of(v)).count() as f64 / values.len() as f64;
    assert!(share(&|v| v == 65535) < 0.02, "little is saturated: {}", share(&|v| v == 65535));
    assert!(share(&|v| v > 1000) > 0.05, "{}", share(&|v| v > 1000));
    let side = values.iter().take((n * n) as usize).filter(|&&v| v > 0).count();
    assert_eq!(side, 0);
}

#[test]
fn dims_are_limited_and_spacing_is_checked() {
    let generate = |spec: ProceduralSpec| spec.generate(&Limits::default());
    assert_names(generate(spec(ProceduralKind::Gyroid, [0, 4, 4])), "dims", "at least 1");
    assert_names(generate(spec(ProceduralKind::Gyroid, [4097, 1, 1])), "dims", "the limit is 4096");
    assert_names(generate(spec(ProceduralKind::Gyroid, [4096; 3])), "dims", "voxels");
    let limits = Limits { max_bytes: 100, ..Limits::default() };
    assert_names(spec(ProceduralKind::Cloud, [4, 4, 4]).generate(&limits), "dims", "128 bytes needed");
    assert!(spec(ProceduralKind::Boxes, [4, 4, 4]).generate(&limits).is_ok());
    let flat = ProceduralSpec { spacing: Some([1.0, 0.0, 1.0]), ..spec(ProceduralKind::Boxes, [4; 3]) };
    assert_names(generate(flat.clone()), "spacing", "0");
    let stretched = ProceduralSpec { spacing: Some([1.0, 2.0, 0.5]), ..flat };
    assert_eq!(generate(stretched).expect("valid").grid.spacing, DVec3::new(1.0, 2.0, 0.5));
}

#[test]
fn a_specification_is_read_strictly_from_json() {
    let read = serde_json::from_str::<ProceduralSpec>;
    let spec = read(r#"{"kind": "sphere_on_plane", "dims": [256, 256, 128]}"#).expect("valid");
    assert_eq!((spec.kind, spec.dims, spec.seed), (ProceduralKind::SphereOnPlane, [256, 256, 128], 0));
    assert_eq!(spec.voxel_type(), VoxelType::U8);
    for bad in [
        r#"{"kind": "gyroid"}"#,
        r#"{"kind": "gyroid", "dims": [1, 2]}"#,
        r#"{"kind": "gyroid", "dims": [1, 2, -3]}"#,
        r#"{"kind": "torus", "dims": [1, 2, 3]}"#,
        r#"{"kind": "gyroid", "dims": [1, 2, 3], "sead": 4}"#,
    ] {
        assert!(read(bad).is_err(), "{bad}");
    }
}
