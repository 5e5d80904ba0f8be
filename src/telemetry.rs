//! The log: one line per event on standard error, as text or JSON, filtered by `RUST_LOG`.

use tracing_subscriber::EnvFilter;

use crate::config::LogFormat;

/// Used when `RUST_LOG` is not set. The graphics libraries report every missing extension of a driver
/// as a warning; a log that cries wolf is not read.
const DEFAULT_FILTER: &str = "info,wgpu_core=warn,wgpu_hal=error,naga=error";

/// Starts logging; later calls change nothing.
pub fn init(format: LogFormat) {
    let filter = EnvFilter::try_from_default_env().unwrap_or_else(|_| EnvFilter::new(DEFAULT_FILTER));
    let builder = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    // An error means that a log is running already, in tests for instance: leave it as it is.
    let _ = match format {
        LogFormat::Text => builder.with_ansi(false).try_init(),
        LogFormat::Json => builder.json().flatten_event(true).try_init(),
    };
}
