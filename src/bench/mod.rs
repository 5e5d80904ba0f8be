//! `spao-server bench`: what passes cost on this machine, beside a plain copy of the same bytes.

mod ao;
mod copy;
mod edit;
mod plain;

pub use plain::{PlainClassifyParams, PlainGatherParams, PlainLevelParams};

use std::io::Write;

use crate::config::BenchCommand;

/// Runs a benchmark and prints its table.
///
/// # Errors
/// When a volume cannot be loaded or does not fit, or the adapter fails.
pub fn run(command: &BenchCommand, out: &mut dyn Write) -> anyhow::Result<()> {
    match command {
        BenchCommand::Ao(args) => ao::run(args, out),
        BenchCommand::Edit(args) => edit::run(args, out),
    }
}
