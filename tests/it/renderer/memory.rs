//! What does not fit is refused with its numbers and leaves nothing behind; what is removed is gone.

use std::sync::Arc;

use serde_json::json;
use spao_server::gpu::GpuOptions;
use spao_server::renderer::{AoPolicy, Coverage, FrameJob, FrameRequest, MemoryUse, RenderError, Renderer, Turn};
use spao_server::scene::Scene;
use spao_server::volume::VolumeId;

use super::support::{Studio, boxes, scene_of, volume_of};

fn open(budget_bytes: u64) -> Renderer {
    let options = GpuOptions { memory_budget_bytes: Some(budget_bytes), ..GpuOptions::default() };
    Renderer::new(&options).expect("tests need an adapter; a software one will do")
}

fn request(scene: &Scene, width: u32, height: u32) -> FrameRequest {
    FrameRequest { scene: Arc::new(scene.clone()), width, height, ao_policy: AoPolicy::Exact }
}

/// `(needed, budget, resident)` of an error about memory.
#[track_caller]
fn does_not_fit<T: std::fmt::Debug>(result: Result<T, RenderError>) -> (u64, u64, Vec<(VolumeId, u64)>) {
    match result {
        Err(RenderError::DoesNotFit { needed_bytes, budget_bytes, resident, .. }) => {
            (needed_bytes, budget_bytes, resident)
        }
        other => panic!("{other:?} is not about memory"),
    }
}

#[test]
fn a_volume_that_nobody_added_is_unknown() {
    let mut studio = Studio::new(boxes());
    let before = studio.renderer.memory();
    let scene = Scene { volume: VolumeId("v_other".into()), ..studio.scene(&json!({})) };
    let unknown = |error: RenderError| matches!(error, RenderError::UnknownVolume(id) if id.0 == "v_other");
    assert!(unknown(studio.renderer.render(&request(&scene, 8, 8)).expect_err("unknown")));
    assert!(unknown(studio.renderer.accessibility(Arc::new(scene.clone())).expect_err("unknown")));
    assert!(unknown(studio.renderer.fresh_ao_build(&scene, Coverage::Everywhere).expect_err("unknown")));
    studio.renderer.remove_volume(&scene.volume);
    assert_eq!(studio.renderer.memory(), before);
}

#[test]
fn a_volume_beyond_the_budget_is_refused_with_numbers_and_nothing_of_it_remains() {
    let volume = Arc::new(volume_of([64, 48, 32], |[i, ..]| i as u16 * 100));
    let voxels = volume.grid.voxel_count();
    // 2 bytes of value and 4 of gradient per voxel.
    let needed = 6 * voxels;
    for budget in [needed - 1, voxels, 1024] {
        let mut renderer = open(budget);
        let before = renderer.memory();
        let id = VolumeId("v_large".into());
        let answer = does_not_fit(renderer.add_volume(id.clone(), volume.clone()));
        assert_eq!((answer.0, answer.1), (needed, budget));
        assert_eq!(answer.2, []);
        assert_eq!(renderer.memory(), before);
        let scene = scene_of(&id, &volume, &json!({}));
        let answer = renderer.render(&request(&scene, 8, 8));
        assert!(matches!(answer, Err(RenderError::UnknownVolume(_))), "{answer:?}");
    }
    // A second one takes the place of the first, which comes back when it is looked at.
    let mut renderer = open(2 * needed - 1);
    let (first, second) = (VolumeId("v_1".into()), VolumeId("v_2".into()));
    let residency = renderer.add_volume(first.clone(), volume.clone()).expect("one fits");
    assert_eq!(residency.gpu_bytes, needed);
    assert_eq!(renderer.memory().volumes_bytes, needed);
    let plain = scene_of(&first, &volume, &json!({"ambient_occlusion": {"method": "off"}}));
    let picture = renderer.render(&request(&plain, 8, 8)).expect("a small picture fits").rgba;
    renderer.add_volume(second.clone(), volume).expect("the first makes room");
    assert_eq!(renderer.residents(), [(second, needed)]);
    let again = renderer.render(&request(&plain, 8, 8)).expect("it comes back").rgba;
    assert_eq!(renderer.residents(), [(first, needed)]);
    assert_eq!(again, picture);
}

#[test]
fn ambient_occlusion_and_pictures_beyond_the_budget_are_refused_and_leave_nothing() {
    let volume = Arc::new(volume_of([64, 48, 32], |[i, ..]| i as u16 * 100));
    let bytes = 6 * volume.grid.voxel_count();
    let mut renderer = open(bytes + 300_000);
    let id = VolumeId("v_1".into());
    renderer.add_volume(id.clone(), volume.clone()).expect("the volume fits");
    let before = renderer.memory();
    let occluded = scene_of(&id, &volume, &json!({}));
    let plain = scene_of(&id, &volume, &json!({"ambient_occlusion": {"method": "off"}}));

    let (needed, budget, resident) = does_not_fit(renderer.render(&request(&occluded, 16, 16)));
    assert!(needed > 300_000 && budget == bytes + 300_000, "{needed} {budget}");
    assert_eq!(resident, [(id.clone(), bytes)]);
    assert_eq!(renderer.memory(), before);
    does_not_fit(renderer.accessibility(Arc::new(occluded)));
    assert_eq!(renderer.memory(), before);

    does_not_fit(renderer.render(&request(&plain, 512, 512)));
    assert_eq!(renderer.memory(), before);
    renderer.render(&request(&plain, 16, 16)).expect("a small picture fits");
    assert_eq!(renderer.memory(), before);
}

#[test]
fn finished_accessibility_makes_room_for_what_is_wanted_now() {
    let volume = Arc::new(volume_of([64, 48, 32], |[i, j, k]| (i * j + 40 * k) as u16));
    let (volume_bytes, result_bytes) = (6 * volume.grid.voxel_count(), 2 * volume.grid.voxel_count());
    let id = VolumeId("v_1".into());
    let scene = |levels: u32| scene_of(&id, &volume, &json!({"ambient_occlusion": {"levels": levels}}));
    let mut ample = open(64 << 20);
    ample.add_volume(id.clone(), volume.clone()).expect("the volume fits");
    let expected: Vec<_> = (1..=4).map(|l| ample.render(&request(&scene(l), 16, 16)).expect("it fits").rgba).collect();
    assert_eq!(ample.memory().ao_cache_bytes, 4 * result_bytes);
    // The largest build, its result included.
    let before = ample.memory().used_bytes;
    let build = ample.fresh_ao_build(&scene(4), Coverage::Everywhere).expect("it fits");
    let build_bytes = ample.memory().used_bytes - before;
    drop(build);
    assert_eq!(ample.memory().used_bytes, before);

    // One result besides: more of them have to go, for the next build as well as for tables and pixels.
    let parameters = 256 << 10;
    let mut tight = open(volume_bytes + result_bytes + build_bytes + parameters);
    tight.add_volume(id.clone(), volume.clone()).expect("the volume fits");
    for _ in 0..2 {
        for (levels, expected) in (1..=4).zip(&expected) {
            let frame = tight.render(&request(&scene(levels), 16, 16)).expect("older results make room");
            assert_eq!(&frame.rgba, expected);
            let memory = tight.memory();
            assert!(memory.used_bytes <= memory.budget_bytes, "{memory:?}");
        }
    }

    // For a picture: one that needs all that the cached results hold, and not the last one, which it is drawn with.
    let cached = tight.memory();
    let pixels = (cached.budget_bytes - cached.used_bytes) / 8;
    let side = u32::try_from((pixels + result_bytes / 16).isqrt()).expect("a small picture");
    assert!(cached.ao_cache_bytes >= 2 * result_bytes, "{cached:?}");
    let plain = scene_of(&id, &volume, &json!({"ambient_occlusion": {"method": "off"}}));
    tight.render(&request(&plain, side, side)).expect("results make room for pixels");
    let derived = |memory: &MemoryUse| memory.ao_cache_bytes + memory.ao_scratch_bytes;
    assert!(derived(&tight.memory()) < derived(&cached));

    // For a volume; but what cannot fit anyway costs no result.
    tight.render(&request(&scene(1), 16, 16)).expect("it fits");
    let before = tight.memory();
    assert!(before.ao_cache_bytes > 0);
    let huge = Arc::new(volume_of([256, 128, 64], |_| 300));
    does_not_fit(tight.add_volume(VolumeId("v_huge".into()), huge));
    does_not_fit(tight.render(&request(&plain, 4096, 4096)));
    assert_eq!(tight.memory(), before);
    let room = before.budget_bytes - before.used_bytes;
    let slices = u32::try_from((room + result_bytes / 2) / (5 * 64 * 64)).expect("a small volume");
    let other = Arc::new(volume_of([64, 64, slices], |[i, ..]| i as u16));
    tight.add_volume(VolumeId("v_2".into()), other).expect("results make room for a volume");
    assert!(derived(&tight.memory()) < derived(&before));
}

#[test]
fn ten_volumes_that_do_not_fit_together_are_all_usable_one_after_another() {
    let volumes: Vec<_> =
        (1..=10).map(|n| Arc::new(volume_of([64, 48, 32], move |[i, j, _]| i as u16 * n + j as u16))).collect();
    let scenes: Vec<_> =
        (0..).zip(&volumes).map(|(n, v)| scene_of(&VolumeId(format!("v_{n}")), v, &json!({}))).collect();
    let mut ample = open(1 << 30);
    // Room for three volumes and the ambient occlusion of one.
    let bytes = 6 * volumes[0].grid.voxel_count();
    let mut tight = open(3 * bytes + (24 << 20));
    for (volume, scene) in volumes.iter().zip(&scenes) {
        ample.add_volume(scene.volume.clone(), volume.clone()).expect("there is room for all");
        tight.add_volume(scene.volume.clone(), volume.clone()).expect("others make room");
    }
    for round in 0..3 {
        for scene in &scenes {
            let expected = ample.render(&request(scene, 24, 18)).expect("there is room for all").rgba;
            let got = tight.render(&request(scene, 24, 18)).expect("others make room").rgba;
            assert_eq!(got, expected, "round {round}");
            let memory = tight.memory();
            assert!(memory.used_bytes <= memory.budget_bytes, "{memory:?}");
        }
    }
    assert!(ample.memory().used_bytes > tight.memory().budget_bytes, "all of it fits: the test shows nothing");
}

#[test]
fn a_volume_that_comes_back_tells_how_far_it_is_until_it_is_there_or_nobody_waits() {
    let volumes = [1_u16, 2].map(|n| Arc::new(volume_of([128, 128, 160], move |[i, ..]| i as u16 * n)));
    let ids = [1, 2].map(|n| VolumeId(format!("v_{n}")));
    let bytes = 6 * volumes[0].grid.voxel_count();
    let mut renderer = open(bytes + bytes / 2);
    let off = json!({"ambient_occlusion": {"method": "off"}});
    let scenes = [0, 1].map(|n| scene_of(&ids[n], &volumes[n], &off));
    for n in [0, 1] {
        renderer.add_volume(ids[n].clone(), volumes[n].clone()).expect("the other makes room");
    }
    let mut told = Vec::new();
    let mut job = FrameJob::new(request(&scenes[0], 16, 16));
    while let Turn::Pending(_) = job.advance(&mut renderer).expect("the other makes room") {
        told.extend(renderer.arriving());
    }
    assert!(told.len() > 3 && told.iter().all(|(id, _)| *id == ids[0]), "{told:?}");
    assert!(told.is_sorted_by(|a, b| a.1 < b.1) && told[told.len() - 1].1 < 1.0, "{told:?}");
    assert_eq!(renderer.arriving(), []);
    drop(job);

    let mut left = FrameJob::new(request(&scenes[1], 16, 16));
    for _ in 0..2 {
        assert!(matches!(left.advance(&mut renderer), Ok(Turn::Pending(_))));
    }
    assert_eq!(renderer.arriving().len(), 1);
    drop(left);
    assert_eq!(renderer.arriving(), []);
}

#[test]
fn an_axis_beyond_the_adapters_textures_is_named() {
    let mut renderer = open(1 << 30);
    let limit = renderer.info().max_volume_axis;
    let before = renderer.memory();
    for (axis, name) in "xyz".chars().enumerate() {
        let mut dims = [1; 3];
        dims[axis] = limit + 1;
        let volume = Arc::new(volume_of(dims, |_| 1));
        let answer = renderer.add_volume(VolumeId("v_long".into()), volume);
        let Err(RenderError::AxisTooLong { axis, size, limit: allowed }) = answer else { panic!("{answer:?}") };
        assert_eq!((axis, size, allowed), (name, limit + 1, limit));
        assert_eq!(renderer.memory(), before);
    }
}

#[test]
fn adding_drawing_and_removing_again_and_again_takes_no_more_memory() {
    let volume = Arc::new(boxes());
    let mut renderer = open(64 << 20);
    let before = renderer.memory();
    let mut kept_levels = None;
    for round in 0..20 {
        let id = VolumeId(format!("v_{}", round % 3));
        renderer.add_volume(id.clone(), volume.clone()).expect("the volume fits");
        for document in [json!({"ambient_occlusion": {"levels": 3}}), json!({"ambient_occlusion": {"method": "off"}})] {
            let scene = scene_of(&id, &volume, &document);
            renderer.render(&request(&scene, 24, 16)).expect("the picture is drawn");
        }
        let during = renderer.memory();
        assert!(during.volumes_bytes > before.volumes_bytes && during.ao_cache_bytes > before.ao_cache_bytes);
        // Levels stay for the next edit, and nothing else.
        let levels = *kept_levels.get_or_insert(during.ao_scratch_bytes);
        assert!(levels > before.ao_scratch_bytes && during.ao_scratch_bytes == levels, "round {round}");
        renderer.remove_volume(&id);
        assert_eq!(renderer.memory(), before, "round {round}");
    }
}

#[test]
fn a_volume_that_replaces_another_of_its_name_is_drawn_as_itself() {
    let mut studio = Studio::new(volume_of([20, 20, 20], |[i, ..]| i as u16));
    let scene = studio.scene(&json!({}));
    let first = studio.picture(&scene, [24, 24]);
    let before = studio.renderer.memory();
    studio.renderer.remove_volume(&studio.id);
    let other = Arc::new(volume_of([20, 20, 20], |[.., k]| 19 - k as u16));
    studio.renderer.add_volume(studio.id.clone(), other).expect("it fits");
    let second = studio.picture(&scene, [24, 24]);
    assert!(first != second, "an old result is shown");
    assert_eq!(studio.renderer.memory(), before);
}
