//! The subcommands. Exit codes: 0 done, 1 failed, 2 wrong usage.

mod ao;
mod healthcheck;
mod inspect;
mod local;
mod render;

use std::io::{Write, stderr, stdout};
use std::process::ExitCode;
use std::time::Duration;

use clap::Parser;

use crate::config::{Cli, Command, ConfigError, LogFormat, ServeArgs};
use crate::{api, app, bench, selftest, telemetry};

/// Exit code of wrong usage, the one that the argument parser uses too.
const USAGE: u8 = 2;

/// Time that work on other threads may take after everything is done; pictures nobody waits for are in it.
const LAST_WORK: Duration = Duration::from_millis(200);

/// Parses the command line and does what it says.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    match run(cli.command) {
        Ok(code) => code,
        Err(error) => {
            // The last words: if standard error is closed, there is no one to tell.
            let _ = writeln!(stderr(), "error: {error:#}");
            if error.is::<ConfigError>() { ExitCode::from(USAGE) } else { ExitCode::FAILURE }
        }
    }
}

fn run(command: Command) -> anyhow::Result<ExitCode> {
    telemetry::init(match &command {
        Command::Serve(args) => args.log_format,
        _ => LogFormat::Text,
    });
    let out = &mut stdout();
    match command {
        Command::Serve(args) => serve(*args, out)?,
        Command::Render(args) => render::run(&args)?,
        Command::Ao(args) => ao::run(&args)?,
        Command::Inspect(args) => inspect::run(&args, out)?,
        Command::Openapi => out.write_all(api::OPENAPI.as_bytes())?,
        Command::Healthcheck(args) => return healthcheck::run(&args, out),
        Command::Bench(command) => bench::run(&command, out)?,
        Command::Selftest(args) => {
            let passed = selftest::run(&args.options(), out)?;
            return Ok(if passed { ExitCode::SUCCESS } else { ExitCode::FAILURE });
        }
    }
    Ok(ExitCode::SUCCESS)
}

fn serve(args: ServeArgs, out: &mut dyn Write) -> anyhow::Result<()> {
    args.validate()?;
    let runtime = tokio::runtime::Builder::new_multi_thread().enable_all().build()?;
    let outcome = runtime.block_on(app::serve(args, out));
    runtime.shutdown_timeout(LAST_WORK);
    outcome
}
