//! `inspect`: what a volume file holds.

use std::io::Write;

use serde_json::json;

use super::local;
use crate::config::InspectArgs;
use crate::session::describe;

pub(super) fn run(args: &InspectArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    let loaded = local::load(&args.volume, None)?;
    let volume = &loaded.volume;
    let histogram = volume.histogram(args.bins)?;
    let mut json = describe(volume);
    json["name"] = json!(loaded.name);
    json["host_bytes"] = json!(volume.host_bytes());
    json["sha256"] = json!(loaded.sha256);
    json["nan_count"] = json!(volume.nan_count);
    json["histogram"] = json!({ "range": histogram.range, "counts": histogram.counts });
    serde_json::to_writer_pretty(&mut *out, &json)?;
    writeln!(out)?;
    Ok(())
}
