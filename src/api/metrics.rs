//! `GET /metrics`: what is in use now, in the Prometheus text format.

use std::fmt::Write as _;

use axum::extract::State;
use axum::http::header;
use axum::response::IntoResponse;

use super::AppState;
use super::extract::QueryParams;
use crate::error::ApiError;

/// Media type of version 0.0.4 of the text format.
const MEDIA_TYPE: &str = "text/plain; version=0.0.4; charset=utf-8";

/// `GET /metrics`
pub(super) async fn show(State(state): State<AppState>, query: QueryParams) -> Result<impl IntoResponse, ApiError> {
    query.finish()?;
    let memory = state.renderer.memory();
    let volumes = state.volumes.list();
    let resident = volumes.iter().filter(|volume| state.renderer.gpu_bytes(&volume.id).is_some()).count();
    let host_bytes: u64 = volumes.iter().map(|volume| volume.volume.host_bytes()).sum();
    let info = state.renderer.info();
    let mut text = String::new();
    gauge(&mut text, "spao_gpu_memory_budget_bytes", "GPU memory that may be used.", &[("", memory.budget_bytes)]);
    let by_use = [
        (r#"{use="volumes"}"#, memory.volumes_bytes),
        (r#"{use="ao_cache"}"#, memory.ao_cache_bytes),
        (r#"{use="ao_scratch"}"#, memory.ao_scratch_bytes),
        (r#"{use="other"}"#, memory.other_bytes()),
    ];
    gauge(&mut text, "spao_gpu_memory_used_bytes", "GPU memory in use, counted at every allocation.", &by_use);
    gauge(&mut text, "spao_volumes_host_bytes", "Host memory of the voxels of all volumes.", &[("", host_bytes)]);
    let counts = state.volumes.counts();
    let by_state = [
        (r#"{state="resident"}"#, resident as u64),
        (r#"{state="evicted"}"#, (volumes.len() - resident) as u64),
        (r#"{state="loading"}"#, counts.loading as u64),
        (r#"{state="failed"}"#, counts.failed as u64),
    ];
    gauge(
        &mut text,
        "spao_volumes",
        "Volumes: on the GPU, in host memory only, on their way, not to be had.",
        &by_state,
    );
    gauge(&mut text, "spao_scenes", "Scenes.", &[("", state.scenes.list().len() as u64)]);
    let software = u64::from(info.software);
    gauge(&mut text, "spao_software_adapter", "1 where pictures are computed on the CPU.", &[("", software)]);
    Ok(([(header::CONTENT_TYPE, MEDIA_TYPE)], text))
}

/// One metric: its help, its type and a line for each set of labels.
fn gauge(text: &mut String, name: &str, help: &str, values: &[(&str, u64)]) {
    let _ = writeln!(text, "# HELP {name} {help}\n# TYPE {name} gauge");
    for (labels, value) in values {
        let _ = writeln!(text, "{name}{labels} {value}");
    }
}
