//! Long builds beside other work: turns, clients that leave, and builds that several wait for.

use std::sync::Arc;
use std::time::{Duration, Instant};

use spao_server::gpu::GpuOptions;
use spao_server::render_thread::RenderHandle;
use spao_server::renderer::{AoPolicy, AoState, AoUpdate, Coverage, FrameRequest, Renderer};
use spao_server::scene::{AmbientOcclusion, Radius, Scene};
use spao_server::volume::ProceduralKind;

use super::support::{Subject, boxes, n_buffer, opacities, procedural, raytraced};

/// Longer than anything here takes on the slowest machine.
const PATIENCE: Duration = Duration::from_secs(60);

fn spawn() -> RenderHandle {
    RenderHandle::spawn(GpuOptions::default()).expect("tests need an adapter; a software one will do").0
}

/// A build of many minutes on a software adapter, and of seconds on a fast one.
fn slow_scene(subject: &Subject) -> Arc<Scene> {
    let settings = AmbientOcclusion { radius: Radius::Unlimited, ..raytraced(8, 0.0, 4096) };
    Arc::new(subject.scene(&opacities(&[(0.0, 0.0), (255.0, 0.001)]), settings))
}

fn slow_subject(renderer: &RenderHandle) -> Subject {
    Subject::on(renderer.clone(), procedural(ProceduralKind::Gyroid, [160, 160, 160]))
}

async fn until(what: &str, condition: impl Fn() -> bool) {
    let begin = Instant::now();
    while !condition() {
        assert!(begin.elapsed() < PATIENCE, "{what} takes too long");
        tokio::time::sleep(Duration::from_millis(5)).await;
    }
}

fn frame(subject: &Subject, settings: AmbientOcclusion) -> FrameRequest {
    let scene = Arc::new(subject.scene(&opacities(&[(20.0, 0.0), (200.0, 0.7)]), settings));
    FrameRequest { scene, width: 40, height: 30, ao_policy: AoPolicy::Exact }
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_picture_is_answered_while_a_long_build_goes_on_and_the_build_ends_when_its_client_leaves() {
    let renderer = spawn();
    // Blocking calls, so outside of the runtime's workers.
    let (long, short) =
        tokio::task::block_in_place(|| (slow_subject(&renderer), Subject::on(renderer.clone(), boxes())));
    let scene = slow_scene(&long);
    let slow = tokio::spawn({
        let (renderer, scene) = (renderer.clone(), scene.clone());
        async move { renderer.accessibility(scene).await }
    });
    let voxels = |subject: &Subject| subject.volume.grid.voxel_count();
    // What a build writes to counts as a result from its start; its levels stay for the next one.
    let results = || renderer.memory().ao_cache_bytes;
    until("the start of the long build", || results() == 2 * voxels(&long)).await;
    for factor in [0.0, 0.5, 1.0] {
        let frame = renderer.render(frame(&short, n_buffer(4, factor))).await.expect("the picture is drawn");
        assert_eq!(frame.rgba.len(), 40 * 30 * 4);
        assert!(!slow.is_finished(), "the picture came after the long build");
    }
    until("keeping the pictures' results", || results() == 2 * voxels(&long) + 3 * 2 * voxels(&short)).await;

    slow.abort();
    // The results of the pictures stay; the one that was not finished does not.
    until("the end of the abandoned build", || results() == 3 * 2 * voxels(&short)).await;
    assert!(slow.await.is_err_and(|e| e.is_cancelled()));
    renderer.render(frame(&short, n_buffer(5, 1.0))).await.expect("the renderer works on");
    tokio::task::block_in_place(|| drop((long, short)));
    until("giving everything back", || {
        let left = renderer.memory();
        (left.volumes_bytes, left.ao_cache_bytes, left.ao_scratch_bytes) == (0, 0, 0)
    })
    .await;
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn jobs_that_want_the_same_result_share_one_build_and_the_last_to_leave_ends_it() {
    let renderer = spawn();
    let long = tokio::task::block_in_place(|| slow_subject(&renderer));
    let ask = || {
        let (renderer, scene) = (renderer.clone(), slow_scene(&long));
        tokio::spawn(async move { renderer.accessibility(scene).await })
    };
    let first = ask();
    let one_result = 2 * long.volume.grid.voxel_count();
    let results = || renderer.memory().ao_cache_bytes;
    until("the start of the build", || results() == one_result).await;
    let second = ask();
    // The second job has had its turns once a third one, of another kind, has been answered.
    let scene = long.scene(&opacities(&[(0.0, 0.5)]), AmbientOcclusion { levels: 1, ..n_buffer(1, 0.0) });
    renderer.accessibility(Arc::new(scene)).await.expect("the build succeeds");
    until("keeping the third job's result", || results() == 2 * one_result).await;
    first.abort();
    tokio::time::sleep(Duration::from_millis(300)).await;
    assert_eq!(results(), 2 * one_result, "the second job still waits for it");
    second.abort();
    until("the end of the abandoned build", || results() == one_result).await;
    tokio::task::block_in_place(|| drop(long));
}

/// A slider moves: the last edit comes while an earlier one is still being computed.
#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn an_update_goes_on_from_where_the_one_under_way_ends_and_builds_nothing_anew_beside_it() {
    let renderer = spawn();
    // An update takes several turns.
    let subject = tokio::task::block_in_place(|| slow_subject(&renderer));
    let scene = |opacity: f64| {
        let functions = opacities(&[(20.0, 0.0), (200.0, opacity)]);
        FrameRequest {
            scene: Arc::new(subject.scene(&functions, n_buffer(6, 1.0))),
            width: 24,
            height: 16,
            ao_policy: AoPolicy::Exact,
        }
    };
    let first = renderer.render(scene(0.7)).await.expect("the picture is drawn");
    assert_eq!(first.ao.update, AoUpdate::Full);
    let levels = renderer.memory().ao_scratch_bytes;
    // All of them are asked for before any of them is begun.
    let (a, b, c) = tokio::join!(renderer.render(scene(0.6)), renderer.render(scene(0.5)), renderer.render(scene(0.4)));
    for frame in [a, b, c] {
        let ao = frame.expect("the picture is drawn").ao;
        assert_eq!((ao.update, ao.state), (AoUpdate::Incremental, AoState::Exact), "{ao:?}");
    }
    assert_eq!(renderer.memory().ao_scratch_bytes, levels, "there is one set of levels");
    let fresh = spawn();
    let other = tokio::task::block_in_place(|| slow_subject(&fresh));
    let request = FrameRequest {
        scene: Arc::new(other.scene(&opacities(&[(20.0, 0.0), (200.0, 0.4)]), n_buffer(6, 1.0))),
        ..scene(0.4)
    };
    let expected = fresh.render(request).await.expect("the picture is drawn").rgba;
    assert!(renderer.render(scene(0.4)).await.expect("it is cached").rgba == expected, "as from nothing");
    tokio::task::block_in_place(|| drop((subject, other)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_result_is_computed_once_for_all_who_ask_and_again_for_a_new_volume_of_the_same_name() {
    let renderer = spawn();
    let subject = tokio::task::block_in_place(|| Subject::on(renderer.clone(), boxes()));
    let scene = Arc::new(subject.scene(&opacities(&[(20.0, 0.0), (200.0, 0.7)]), n_buffer(6, 1.0)));
    let (a, b) = tokio::join!(renderer.accessibility(scene.clone()), renderer.accessibility(scene.clone()));
    let c = renderer.accessibility(scene.clone()).await.expect("it comes from the cache");
    assert!(a.expect("the build succeeds").values == c.values && b.expect("it shares the build").values == c.values);
    assert_eq!(c.timings.ao, Duration::ZERO);
    let one_result = 2 * subject.volume.grid.voxel_count();
    until("counting", || renderer.memory().ao_cache_bytes == one_result).await;

    let other = procedural(ProceduralKind::Gyroid, [61, 47, 33]);
    renderer.add_volume(subject.id.clone(), other.clone()).await.expect("it fits");
    // Results of the volume before are of no use.
    until("forgetting", || renderer.memory().ao_cache_bytes == 0).await;
    let fresh = tokio::task::block_in_place(|| Subject::on(renderer.clone(), other));
    let replaced = renderer.accessibility(scene.clone()).await.expect("the build succeeds");
    let expected = Scene { volume: fresh.id.clone(), ..(*scene).clone() };
    let expected = renderer.accessibility(Arc::new(expected)).await.expect("the build succeeds");
    assert!(replaced.values == expected.values && replaced.values != c.values);
    tokio::task::block_in_place(|| drop((subject, fresh)));
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_volume_that_is_removed_during_a_build_leaves_nothing_behind() {
    let renderer = spawn();
    let subject =
        tokio::task::block_in_place(|| Subject::on(renderer.clone(), procedural(ProceduralKind::Boxes, [64; 3])));
    let settings = raytraced(5, 1.0, 64);
    let scene = Arc::new(subject.scene(&opacities(&[(20.0, 0.0), (200.0, 0.7)]), settings));
    let job = tokio::spawn({
        let renderer = renderer.clone();
        async move { renderer.accessibility(scene).await }
    });
    until("the start of the build", || renderer.memory().ao_scratch_bytes > 0 || job.is_finished()).await;
    tokio::task::block_in_place(|| drop(subject));
    // Who waited for it still gets it.
    let result = job.await.expect("the job was not aborted").expect("the build succeeds");
    assert_eq!(result.values.len(), 64 * 64 * 64);
    until("the end of the job", || renderer.memory().ao_scratch_bytes == 0).await;
    let left = renderer.memory();
    assert_eq!((left.volumes_bytes, left.ao_cache_bytes), (0, 0));
}

#[test]
fn a_build_says_how_much_of_it_is_done_and_hands_out_one_result() {
    let mut renderer = Renderer::new(&GpuOptions::default()).expect("tests need an adapter; a software one will do");
    let subject = Subject::new(procedural(ProceduralKind::Boxes, [48, 47, 46]));
    renderer.add_volume(subject.id.clone(), subject.volume.clone()).expect("it fits");
    for settings in [n_buffer(6, 1.0), raytraced(5, 1.0, 256)] {
        let scene = subject.scene(&opacities(&[(20.0, 0.0), (200.0, 0.7)]), settings);
        let mut build = renderer.fresh_ao_build(&scene, Coverage::Everywhere).expect("it fits");
        let (gpu, stages) = renderer.ao_tools();
        assert!(build.finish(gpu, 1).expect("the device works").is_none(), "nothing is done yet");
        let mut fractions = vec![build.fraction()];
        while !build.advance(gpu, stages).expect("the build succeeds") {
            fractions.push(build.fraction());
        }
        fractions.push(build.fraction());
        assert!(fractions.is_sorted() && fractions[0] == 0.0 && fractions.ends_with(&[1.0]), "{fractions:?}");
        // Jobs share a build, and each of them asks.
        for version in [7, 8] {
            let (result, _) = build.finish(gpu, version).expect("the device works").expect("all is done");
            assert_eq!(result.version, 7);
        }
        assert!(!build.has_failed());
    }
}
