//! A quick check that this machine's adapter computes what the plain reference computes.

use std::io::Write;
use std::sync::Arc;

use anyhow::{Context, ensure};
use serde_json::json;

use crate::gpu::GpuOptions;
use crate::reference::{OpacityField, RaytracedAo, SpaoAo, ValueField};
use crate::renderer::{AoPolicy, FrameRequest, Renderer};
use crate::scene::{AoMethod, Scene, SceneDocument};
use crate::session::{LoadRequest, volume_facts};
use crate::volume::{Limits, Volume, VolumeId};

/// Asymmetric on all axes, odd sizes, and a second's work at most.
const VOLUME: &str = "procedural:boxes:37,29,23";

/// Largest difference of accessibility that is accepted: what METHODS allows between implementations.
const TOLERANCE: f64 = 2.0 / 255.0;

/// Checks every ambient-occlusion method against its f64 twin and draws a picture; prints a line for each.
/// True when all passed.
///
/// # Errors
/// When the adapter cannot be opened or a job fails.
pub fn run(options: &GpuOptions, out: &mut dyn Write) -> anyhow::Result<bool> {
    let source = LoadRequest::from_argument(VOLUME)?.prepare(&Limits::default(), None)?;
    let mut renderer = Renderer::new(options)?;
    writeln!(out, "adapter: {} ({})", renderer.info().adapter, renderer.info().driver_info)?;
    let id = VolumeId("selftest".into());
    renderer.add_volume(id.clone(), source.volume.clone())?;
    let mut passed = true;
    let cases = [
        json!({"method": "spao", "structure": "n_buffer", "levels": 5}),
        json!({"method": "spao", "structure": "n_buffer", "levels": 5, "normal_factor": 0}),
        json!({"method": "spao", "structure": "mipmap", "levels": 5}),
        json!({"method": "spao", "structure": "hybrid", "levels": 5, "mip_levels": 2}),
        json!({"method": "raytraced", "levels": 4, "rays": 64}),
    ];
    let facts = volume_facts(&id, &source.volume, &source.histogram);
    for case in cases {
        let document = SceneDocument::from_json(&json!({"volume": id.0, "ambient_occlusion": case}))?;
        let scene = Arc::new(document.complete(&facts)?);
        let worst = worst_difference(&mut renderer, &source.volume, &scene)?;
        let verdict = if worst <= TOLERANCE { "ok" } else { "FAILED" };
        passed &= worst <= TOLERANCE;
        writeln!(out, "{verdict:6} accessibility {case}: largest difference {worst:.5}")?;
    }
    let scene = SceneDocument::from_json(&json!({"volume": id.0}))?.complete(&facts)?;
    let frame =
        renderer.render(&FrameRequest { scene: Arc::new(scene), width: 64, height: 64, ao_policy: AoPolicy::Exact })?;
    let visible = frame.rgba.chunks_exact(4).any(|pixel| pixel[..3].iter().any(|&c| c > 64));
    writeln!(out, "{:6} picture", if visible { "ok" } else { "FAILED" })?;
    Ok(passed && visible)
}

fn worst_difference(renderer: &mut Renderer, volume: &Volume, scene: &Arc<Scene>) -> anyhow::Result<f64> {
    let computed = renderer.accessibility(scene.clone()).context("computing accessibility")?;
    let values: Vec<f64> = (0..volume.voxels.len()).map(|i| volume.voxels.value(i)).collect();
    let grid = &volume.grid;
    let opacity = OpacityField::from_values(grid.dims, &values, &scene.transfer_function, grid.smallest_spacing());
    let field = ValueField::from_values(grid.dims, &values, &volume.code_map);
    let expected = match scene.ambient_occlusion.method {
        AoMethod::Raytraced => RaytracedAo::new(&opacity, &field, &scene.ambient_occlusion).at_voxel_centres(),
        AoMethod::Spao | AoMethod::Off => SpaoAo::new(&opacity, &field, &scene.ambient_occlusion).at_voxel_centres(),
    };
    ensure!(expected.len() == computed.values.len(), "the accessibility volume has another size");
    let differences = expected.iter().zip(&computed.values).map(|(e, &c)| (e - f64::from(c)).abs());
    // A NaN must not pass for small.
    Ok(differences.fold(0.0, |worst, d| {
        if d <= worst {
            worst
        } else if d.is_nan() {
            f64::INFINITY
        } else {
            d
        }
    }))
}
