//! Empty-space skipping: the map of distances, and that rays that leap see the same.

use serde_json::{Value, json};
use spao_server::renderer::brick_distance;
use spao_server::scene::{Scene, TransferTable};
use spao_server::volume::{ProceduralKind, Volume};

use super::support::{Difference, SIZE, Studio, boxes, oblique, procedural};

/// By looking at every pair of bricks.
fn brute_force(dims: [u32; 3], visible: &[bool]) -> Vec<u8> {
    let [nx, ny, _] = dims.map(|n| n as usize);
    let place = |b: usize| [b % nx, b / nx % ny, b / nx / ny];
    let apart = |a: usize, b: usize| (0..3).map(|i| place(a)[i].abs_diff(place(b)[i])).max().unwrap_or(0);
    let nearest = |a: usize| (0..visible.len()).filter(|&b| visible[b]).map(|b| apart(a, b)).min();
    (0..visible.len()).map(|a| nearest(a).map_or(255, |d| d.min(255)) as u8).collect()
}

/// Sparser for a larger `one_of`.
fn random_visibility(count: usize, one_of: u64, seed: u64) -> Vec<bool> {
    let mut state = seed;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        state >> 33
    };
    (0..count).map(|_| next() % one_of == 0).collect()
}

#[test]
fn distances_are_those_to_the_nearest_visible_brick() {
    let mut checked = 0;
    for dims in [[1, 1, 1], [7, 1, 1], [1, 9, 1], [1, 1, 8], [5, 6, 1], [4, 5, 6], [13, 3, 7]] {
        let count = dims.iter().product::<u32>() as usize;
        for (seed, one_of) in (1..).zip([1, 2, 8, 40, 200, u64::MAX]) {
            let visible = random_visibility(count, one_of, seed);
            assert_eq!(brick_distance(dims, |b| visible[b]), brute_force(dims, &visible), "{dims:?} {one_of}");
            checked += visible.iter().filter(|v| !**v).count();
        }
    }
    assert!(checked > 500, "enough bricks that are not visible themselves");
}

#[test]
fn distances_end_at_255() {
    let dims = [600, 1, 1];
    let visible: Vec<bool> = (0..600).map(|b| b == 20).collect();
    let distance = brick_distance(dims, |b| visible[b]);
    assert_eq!(distance, brute_force(dims, &visible));
    assert_eq!((distance[0], distance[20], distance[275], distance[599]), (20, 0, 255, 255));
    assert!(brick_distance([3, 4, 5], |_| false).iter().all(|&d| d == 255));
}

/// Share of bricks that rays may leap over.
fn invisible_bricks(volume: &Volume, scene: &Scene) -> f64 {
    let grid = &volume.grid;
    let step = grid.smallest_spacing() / scene.rendering.sampling_rate;
    let table = TransferTable::new(&scene.transfer_function, &volume.code_map, step, grid.smallest_spacing());
    let bricks = volume.bricks();
    let ranges = &bricks.ranges;
    ranges.iter().filter(|[low, high]| !table.any_visible(*low, *high)).count() as f64 / ranges.len() as f64
}

/// The scene with so much opacity where there was none.
fn with_floor(scene: &Scene, opacity: f64) -> Scene {
    let mut scene = scene.clone();
    for point in &mut scene.transfer_function.points {
        point.opacity = point.opacity.max(opacity);
    }
    scene
}

/// Opacity that counts as visible, so that nothing is skipped, and that nobody can see.
const UNSEEN: f64 = 1e-12;

/// The picture with leaps against the one without.
fn difference(studio: &mut Studio, scene: &Scene, floor: f64) -> Difference {
    let all = with_floor(scene, floor);
    assert!(invisible_bricks(&studio.volume, scene) > 0.3, "nothing to skip");
    assert_eq!(invisible_bricks(&studio.volume, &all), 0.0, "something is skipped");
    let size = [SIZE, SIZE];
    let (leaping, marching) = (studio.picture(scene, size), studio.picture(&all, size));
    assert!(marching.pixels.iter().any(|p| p[0] > 60), "nothing to see");
    Difference::between_pictures(&leaping, &marching)
}

fn same(difference: &Difference) -> bool {
    // Sums of optical depths in f32 may round differently once in a while.
    difference.is_within(0.01, 0.0, 1.001)
}

/// Values above 50, in steep and in soft steps.
fn document(opacity: f64, camera: Value, rate: f64) -> Value {
    json!({
        "transfer_function": {"points": [
            {"value": 50, "color": "#cc4422", "opacity": 0.0}, {"value": 130, "color": "#ffffff", "opacity": opacity}
        ]},
        "camera": camera,
        "ambient_occlusion": {"method": "off"},
        "rendering": {"sampling_rate": rate}
    })
}

fn sparse_volumes() -> [Volume; 3] {
    [
        procedural(ProceduralKind::Boxes, [61, 53, 47]),
        oblique(procedural(ProceduralKind::Boxes, [49, 57, 64])),
        oblique(procedural(ProceduralKind::SphereFlake, [72, 66, 60])),
    ]
}

#[test]
fn leaping_over_empty_bricks_changes_no_picture() {
    for volume in sparse_volumes() {
        let center = volume.grid.center();
        let mut studio = Studio::new(volume);
        let from = |x: f64, y: f64, z: f64| json!({"eye": [center.x + x, center.y + y, center.z + z], "target": center.to_array()});
        let cameras = [
            json!(null),
            json!({"projection": "orthographic"}),
            from(-120.0, 0.0, 0.0),
            from(0.0, 120.0, 0.0),
            json!({"eye": [center.x, center.y, center.z + 120.0], "target": center.to_array(), "up": [0, 1, 0]}),
            from(70.0, 80.0, -60.0),
            // From among the boxes.
            from(-3.0, 4.0, 5.0),
        ];
        for camera in cameras {
            for (opacity, rate) in [(0.9, 1.0), (0.1, 0.37), (0.2, 2.5)] {
                let scene = studio.scene(&document(opacity, camera.clone(), rate));
                let difference = difference(&mut studio, &scene, UNSEEN);
                assert!(same(&difference), "{difference:?} for {camera} at {rate}");
            }
        }
    }
}

#[test]
fn a_leap_too_far_or_a_sliver_of_fog_would_be_noticed() {
    let mut studio = Studio::new(boxes());
    let scene = studio.scene(&document(0.9, json!(null), 1.0));
    assert!(same(&difference(&mut studio, &scene, UNSEEN)));
    assert!(!same(&difference(&mut studio, &scene, 1e-3)));
}

/// Two shells of opposite slope: the ray crosses many thin visible layers on its way through invisible bricks' edges.
#[test]
fn thin_shells_between_empty_bricks_are_not_leapt_over() {
    let mut studio = Studio::new(oblique(procedural(ProceduralKind::SphereOnPlane, [63, 59, 66])));
    for rate in [0.5, 1.0, 3.0] {
        let mut shell = document(0.9, json!(null), rate);
        shell["transfer_function"] = json!({"points": [
            {"value": 120, "color": "#ffffff", "opacity": 0.0}, {"value": 127, "color": "#ffffff", "opacity": 0.8},
            {"value": 134, "color": "#ffffff", "opacity": 0.0}
        ]});
        let scene = studio.scene(&shell);
        let difference = difference(&mut studio, &scene, UNSEEN);
        assert!(same(&difference), "{difference:?} at {rate}");
    }
}
