//! `bench ao`: the rows of the SPAO paper's Table 1.1 for this adapter.

use std::io::Write;
use std::sync::Arc;
use std::time::Duration;

use serde_json::{Value, json};

use super::copy::copy_time;
use crate::ao::Step;
use crate::config::BenchAoArgs;
use crate::renderer::{Coverage, Renderer};
use crate::scene::{Scene, SceneDocument};
use crate::session::{LoadRequest, NewVolume, volume_facts};
use crate::volume::{Limits, VolumeId};

/// Slices of the volume that rays are traced for; the whole is scaled up from them.
const TRACED_SLICES: u32 = 2;

/// One row of the table.
struct Row {
    name: String,
    elapsed: Duration,
    /// Bytes that the pass has to read and write at least.
    bytes: u64,
    note: String,
}

/// Prints a table for each volume.
pub(super) fn run(args: &BenchAoArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let default = format!("procedural:gyroid:{}", args.size);
    let volumes = if args.volumes.is_empty() { vec![default] } else { args.volumes.clone() };
    let mut renderer = Renderer::new(&args.gpu.options())?;
    writeln!(out, "adapter: {} ({})", renderer.info().adapter, renderer.info().driver_info)?;
    for (number, argument) in volumes.iter().enumerate() {
        let volume = LoadRequest::from_argument(argument)?.prepare(&Limits::default(), None)?;
        let id = VolumeId(format!("bench-{number}"));
        renderer.add_volume(id.clone(), volume.volume.clone())?;
        let [x, y, z] = volume.volume.grid.dims;
        writeln!(out, "\n{argument}, {x} x {y} x {z}, median of {} runs", args.runs)?;
        for structure in ["n_buffer", "mipmap"] {
            let scene = scene(&id, &volume, &json!({"method": "spao", "structure": structure}))?;
            for (coverage, what) in [(Coverage::Everywhere, "everywhere"), (Coverage::Visible, "where visible")] {
                let rows = spao_rows(&renderer, &scene, coverage, args.runs)?;
                print_table(&renderer, &format!("{structure} {what}"), &rows, out)?;
            }
        }
        let scene = scene(&id, &volume, &json!({"method": "raytraced", "rays": 512}))?;
        let row = traced_row(&mut renderer, &scene, &volume)?;
        print_table(&renderer, "raytraced", &[row], out)?;
        renderer.remove_volume(&id);
    }
    Ok(())
}

fn scene(id: &VolumeId, volume: &NewVolume, ambient_occlusion: &Value) -> anyhow::Result<Arc<Scene>> {
    let document = SceneDocument::from_json(&json!({"volume": id.0, "ambient_occlusion": ambient_occlusion}))?;
    Ok(Arc::new(document.complete(&volume_facts(id, &volume.volume, &volume.histogram))?))
}

/// Time per level, all levels, combination and total, each the median over the runs.
fn spao_rows(renderer: &Renderer, scene: &Scene, coverage: Coverage, runs: u32) -> anyhow::Result<Vec<Row>> {
    let levels = scene.ambient_occlusion.levels as usize;
    let mut samples: Vec<Vec<Duration>> = vec![Vec::new(); levels + 4];
    let mut level_bytes = Vec::new();
    // One run more: the first compiles and touches memory.
    for run in 0..=runs {
        let mut build = renderer.fresh_ao_build(scene, coverage)?;
        level_bytes = build.level_bytes();
        let (gpu, stages) = renderer.ao_tools();
        let mut sums = vec![Duration::ZERO; levels + 2];
        for step in build.run_profiled(gpu, stages)? {
            let row = match step.step {
                Step::Level { level, .. } => level as usize,
                Step::Combine { .. } | Step::Surface { .. } | Step::Trace(_) => levels + 1,
            };
            sums[row] += step.elapsed;
        }
        if run == 0 {
            continue;
        }
        let all_levels: Duration = sums[..=levels].iter().sum();
        let total = all_levels + sums[levels + 1];
        let combined = sums.pop().unwrap_or_default();
        for (row, elapsed) in sums.into_iter().chain([all_levels, combined, total]).enumerate() {
            samples[row].push(elapsed);
        }
    }
    let voxels = level_bytes[0] / 2;
    let all: u64 = level_bytes.iter().sum();
    // Level 0 reads codes; the others read the level before; combining reads all levels, the normal's
    // neighbours and writes samples.
    let moved: Vec<u64> =
        (0..=levels).map(|l| level_bytes[l] + if l == 0 { 2 * voxels } else { level_bytes[l - 1] }).collect();
    let combine = all + 4 * voxels;
    let names = (0..=levels).map(|l| format!("level {l}"));
    let names = names.chain(["levels total".into(), "AO computation".into(), "total".into()]);
    let total_levels: u64 = moved.iter().sum();
    let bytes = moved.iter().copied().chain([total_levels, combine, total_levels + combine]);
    Ok(names
        .zip(bytes)
        .zip(samples)
        .map(|((name, bytes), mut times)| {
            times.sort();
            Row { name, elapsed: times[times.len() / 2], bytes, note: String::new() }
        })
        .collect())
}

/// 512 rays to a voxel take minutes to hours on a CPU: a few slices in the middle, scaled up, and said so.
fn traced_row(renderer: &mut Renderer, scene: &Arc<Scene>, volume: &NewVolume) -> anyhow::Result<Row> {
    let mut build = renderer.fresh_ao_build(scene, Coverage::Everywhere)?;
    let (gpu, stages) = renderer.ao_tools();
    let [_, y, z] = volume.volume.grid.dims;
    let count = TRACED_SLICES.min(z);
    let first = (z - count) / 2;
    build.keep_rows(first * y..(first + count) * y);
    let times = build.run_profiled(gpu, stages)?;
    let measured: Duration = times.iter().map(|t| t.elapsed).sum();
    let note = if count == z { String::new() } else { format!("scaled up from {count} of {z} slices") };
    Ok(Row {
        name: "total".into(),
        elapsed: measured.mul_f64(f64::from(z) / f64::from(count)),
        bytes: 4 * volume.volume.grid.voxel_count(),
        note,
    })
}

fn print_table(renderer: &Renderer, title: &str, rows: &[Row], out: &mut dyn Write) -> anyhow::Result<()> {
    let (gpu, _) = renderer.ao_tools();
    writeln!(out, "\n{title:26} {:>12} {:>10} {:>10} {:>8}", "ms", "MB moved", "copy ms", "ratio")?;
    for row in rows {
        // Half of what a copy moves is read, half is written.
        let copy = copy_time(gpu, row.bytes / 2)?;
        let ratio = row.elapsed.as_secs_f64() / copy.as_secs_f64().max(1e-9);
        let (ms, copy_ms) = (row.elapsed.as_secs_f64() * 1e3, copy.as_secs_f64() * 1e3);
        let megabytes = row.bytes as f64 / 1e6;
        let line = format!("{:26} {ms:12.2} {megabytes:10.1} {copy_ms:10.2} {ratio:8.1}  {}", row.name, row.note);
        writeln!(out, "{}", line.trim_end())?;
    }
    Ok(())
}
