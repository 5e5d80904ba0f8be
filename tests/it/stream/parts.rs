//! The stream's parts that need no server: whose turn it is, how large pictures are, what has changed.

use std::time::Duration;

use proptest::prelude::*;
use serde_json::{Map, Value, json};
use spao_server::api::Quality;
use spao_server::render_thread::Turns;
use spao_server::scene::merge_patch_between;

fn turns(jobs: &[(&str, u32)]) -> Turns<u32> {
    let mut turns = Turns::default();
    jobs.iter().for_each(|(group, job)| turns.push((*group).into(), *job));
    turns
}

#[test]
fn groups_take_turns_however_many_jobs_they_have() {
    let mut turns = turns(&[("a", 1), ("a", 2), ("a", 3), ("a", 4), ("b", 10), ("c", 20), ("b", 11)]);
    assert_eq!(turns.len(), 7);
    let order: Vec<u32> = std::iter::from_fn(|| turns.pop().map(|(_, job)| job)).collect();
    assert_eq!(order, [1, 10, 20, 2, 11, 3, 4]);
    assert!(turns.is_empty() && turns.pop().is_none());
}

#[test]
fn unfinished_jobs_go_behind_and_nobody_waits_more_than_a_round() {
    // One scene with ten watchers and long work, another with one watcher.
    let mut turns = turns(&[("few", 100)]);
    (0..10).for_each(|job| turns.push("many".into(), job));
    let mut served = Vec::new();
    for _ in 0..40 {
        let (group, job) = turns.pop().expect("jobs are pushed back");
        served.push(job);
        turns.push(group, job);
    }
    assert_eq!(served.iter().filter(|job| **job == 100).count(), 20, "{served:?}");
    let of_many: Vec<u32> = served.into_iter().filter(|job| *job != 100).collect();
    assert_eq!(of_many, (0..10).chain(0..10).collect::<Vec<_>>());
}

/// Time of a picture on a machine that takes so long for one at full size.
fn time_at(quality: Quality, full_size: Duration) -> Duration {
    full_size.mul_f64(quality.scale().powi(2))
}

#[test]
fn moving_pictures_become_small_enough_to_be_fast_and_then_keep_their_size() {
    for (full_ms, software) in [(10, false), (10, true), (150, true), (400, true), (400, false), (5000, true)] {
        let mut quality = Quality::new(software);
        let full = Duration::from_millis(full_ms);
        let mut scales = Vec::new();
        for _ in 0..40 {
            quality.observe(time_at(quality, full));
            scales.push(quality.scale());
        }
        assert!(scales[20..].iter().all(|scale| *scale == scales[20]), "{full_ms} ms: {scales:?}");
        let scale = quality.scale();
        assert!((0.25..=1.0).contains(&scale) && (scale * 8.0).fract() == 0.0, "{scale}");
        let took = time_at(quality, full);
        assert!(took < Duration::from_millis(90) || scale == 0.25, "{full_ms} ms: {took:?} at {scale}");
        assert!(took > Duration::from_millis(30) || scale == 1.0, "{full_ms} ms: {took:?} at {scale}");
    }
}

#[test]
fn moving_pictures_have_at_least_a_pixel() {
    let mut quality = Quality::new(true);
    assert_eq!(quality.moving_size(640, 480), [320, 240]);
    assert_eq!(Quality::new(false).moving_size(640, 480), [640, 480]);
    for _ in 0..10 {
        quality.observe(Duration::from_secs(10));
    }
    assert_eq!(quality.moving_size(640, 480), [160, 120]);
    assert_eq!(quality.moving_size(1, 2), [1, 1]);
    quality.observe(Duration::ZERO);
    assert!(quality.scale() > 0.25);
}

/// JSON without nulls inside of objects, which a merge patch cannot express.
fn document() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        any::<bool>().prop_map(Value::from),
        (-5..5i32).prop_map(Value::from),
        "[a-c]{0,2}".prop_map(Value::from),
        prop::collection::vec(prop_oneof![Just(Value::Null), (0..3i32).prop_map(Value::from)], 0..3)
            .prop_map(Value::from),
    ];
    let value = leaf.prop_recursive(4, 32, 5, |inner| object(inner).boxed());
    object(value)
}

fn object(value: impl Strategy<Value = Value>) -> impl Strategy<Value = Value> {
    prop::collection::btree_map("[a-d]", value, 0..5).prop_map(|map| Value::Object(Map::from_iter(map)))
}

proptest! {
    #[test]
    fn the_patch_between_two_documents_leads_from_one_to_the_other(before in document(), after in document()) {
        let patch = merge_patch_between(&before, &after);
        let mut merged = before.clone();
        json_patch::merge(&mut merged, &patch);
        prop_assert_eq!(&merged, &after);
        prop_assert_eq!(patch == json!({}), before == after);
    }
}

#[test]
fn the_patch_names_only_what_has_changed() {
    let before = json!({ "a": { "b": 1, "c": [1, 2] }, "d": "x", "e": 1 });
    let after = json!({ "a": { "b": 2, "c": [1, 2] }, "d": "x", "f": { "g": true } });
    let patch = json!({ "a": { "b": 2 }, "f": { "g": true }, "e": null });
    assert_eq!(merge_patch_between(&before, &after), patch);
    assert_ne!(merge_patch_between(&before, &before), patch);
}
