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

        let smallest = (1..1024).map(|mib| mib << 20).find(|&budget| need.fits(budget)).expect("1 GiB is enough");
        let drawn = draw(&volume, smallest);
        assert!(drawn.is_ok(), "{dims:?} in {smallest}: {drawn:?}");
        let refused = draw(&volume, need.volume_bytes + occlusion / 2);
        assert!(matches!(refused, Err(RenderError::DoesNotFit { .. })), "{dims:?}: {refused:?}");
        assert!(!need.fits(need.volume_bytes + occlusion / 2));
    }
}
