//! What a volume takes on the GPU, against what is really used.

use std::sync::Arc;

use serde_json::json;
use spao_server::gpu::GpuOptions;
use spao_server::renderer::{AoPolicy, FrameRequest, GpuNeed, MemoryUse, RenderError, Renderer};
use spao_server::volume::{ProceduralKind, Volume, VolumeId};

use super::support::{procedural, scene_of};

/// Memory in use after one picture of a volume's default scene, under a budget.
fn draw(volume: &Arc<Volume>, budget_bytes: u64) -> Result<MemoryUse, RenderError> {
    let options = GpuOptions { memory_budget_bytes: Some(budget_bytes), ..GpuOptions::default() };
    let mut renderer = Renderer::new(&options).expect("tests need an adapter; a software one will do");
    let id = VolumeId("v_1".into());
    renderer.add_volume(id.clone(), volume.clone())?;
    let scene = Arc::new(scene_of(&id, volume, &json!({})));
    renderer.render(&FrameRequest { scene, width: 64, height: 48, ao_policy: AoPolicy::Exact })?;
    Ok(renderer.memory())
}

#[test]
fn a_volume_takes_what_its_size_says_and_fits_where_that_says_so() {
    for (kind, dims) in [
        (ProceduralKind::Gyroid, [64, 64, 64]),
        (ProceduralKind::Gyroid, [130, 60, 40]),
        (ProceduralKind::Cloud, [70, 90, 50]),
    ] {
        let volume = Arc::new(procedural(kind, dims));
        let need = GpuNeed::of(dims, volume.code_map.bytes_per_voxel());
        let used = draw(&volume, 1 << 30).expect("there is room");
        assert_eq!(used.volumes_bytes, need.volume_bytes);
        let occlusion = used.ao_cache_bytes + used.ao_scratch_bytes;
        assert!(occlusion <= need.occlusion_bytes, "{dims:?}: {used:?} is more than {need:?}");
        assert!(2 * occlusion > need.occlusion_bytes, "{dims:?}: {used:?} is far less than {need:?}");

        let smallest =
            (1..1024).map(|mib| mib << 20).find(|&budget| need.fits(budget, u64::MAX)).expect("1 GiB is enough");
        let drawn = draw(&volume, smallest);
        assert!(drawn.is_ok(), "{dims:?} in {smallest}: {drawn:?}");
        let refused = draw(&volume, need.volume_bytes + occlusion / 2);
        assert!(matches!(refused, Err(RenderError::DoesNotFit { .. })), "{dims:?}: {refused:?}");
        assert!(!need.fits(need.volume_bytes + occlusion / 2, u64::MAX));
        assert!(need.fits(smallest, need.binding_bytes) && !need.fits(smallest, need.binding_bytes - 1));
    }
}

#[test]
fn what_grows_with_slices_is_bound_in_pieces_and_what_grows_with_their_size_is_not() {
    let binding = |dims| GpuNeed::of(dims, 1).binding_bytes;
    assert_eq!(binding([256, 256, 256]), binding([256, 256, 1000]));
    assert!(binding([512, 512, 256]) > 3 * binding([256, 256, 256]));
    // No adapter binds less than 128 MiB; slices of some million voxels need more.
    assert!(binding([1000, 1000, 500]) < 128 << 20, "{}", binding([1000, 1000, 500]));
    assert!(binding([2048, 2048, 100]) > 128 << 20, "{}", binding([2048, 2048, 100]));
    let vast = GpuNeed::of([65536, 65536, 65536], 4);
    assert!(!vast.fits(1 << 40, 1 << 40), "{vast:?}");
}
