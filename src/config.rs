//! The command line and the environment, parsed into ranged values; every limit of the server is here.

use std::net::SocketAddr;
use std::path::PathBuf;
use std::time::Duration;

use clap::{Args, Parser, Subcommand, ValueEnum};

use crate::gpu::GpuOptions;
use crate::sources::AllowedSource;

/// Exit codes, the same for every subcommand.
const AFTER_HELP: &str = "Exit codes: 0 done, 1 failed, 2 wrong usage.";

/// The whole command line.
#[derive(Debug, Parser)]
#[command(name = "spao-server", version, about, after_help = AFTER_HELP)]
pub struct Cli {
    /// What to do.
    #[command(subcommand)]
    pub command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub enum Command {
    /// Serve volumes and scenes over HTTP.
    Serve(Box<ServeArgs>),
    /// Draw one picture of one volume into a file.
    Render(RenderArgs),
    /// Compute the accessibility volume of one volume into a NumPy or NRRD file.
    Ao(Box<AoArgs>),
    /// Print what a volume file holds, as JSON.
    Inspect(InspectArgs),
    /// Print the OpenAPI document.
    Openapi,
    /// Ask a running server whether it is ready: exit code 0 when it is, 1 when not.
    Healthcheck(HealthcheckArgs),
    /// Measure.
    #[command(subcommand)]
    Bench(BenchCommand),
    /// Compare every GPU pass with its plain reference on this machine's adapter.
    Selftest(GpuArgs),
}

/// Which adapter, and how much of it.
#[derive(Args, Clone, Debug, Default)]
pub struct GpuArgs {
    /// Refuse adapters that compute on the CPU.
    #[arg(long, env = "SPAO_REQUIRE_GPU", value_parser = clap::builder::BoolishValueParser::new(), num_args = 0..=1, default_missing_value = "true", default_value = "false")]
    pub require_gpu: bool,
    /// Use the first adapter whose name contains this text.
    #[arg(long, env = "SPAO_ADAPTER", value_name = "TEXT")]
    pub adapter: Option<String>,
    /// GPU memory that may be used at most, in bytes or with K, M, G (powers of 1024); by default 4G, on software
    /// adapters half of main memory.
    #[arg(long, env = "SPAO_GPU_MEMORY", value_name = "BYTES", value_parser = parse_bytes)]
    pub gpu_memory: Option<u64>,
}

impl GpuArgs {
    /// What the renderer is opened with.
    pub fn options(&self) -> GpuOptions {
        GpuOptions {
            require_gpu: self.require_gpu,
            adapter: self.adapter.clone(),
            memory_budget_bytes: self.gpu_memory,
            ..GpuOptions::default()
        }
    }
}

/// Arguments of `serve`.
#[derive(Args, Clone, Debug)]
pub struct ServeArgs {
    /// Address and port to listen on; port 0 picks a free one.
    #[arg(long, env = "SPAO_ADDR", default_value = "127.0.0.1:8080")]
    pub addr: SocketAddr,
    /// Key that requests must carry as `Authorization: Bearer KEY`; may be given several times. The
    /// environment takes several, separated by commas.
    #[arg(long = "api-key", env = "SPAO_API_KEYS", value_name = "KEY", value_delimiter = ',', hide_env_values = true)]
    pub api_keys: Vec<String>,
    /// Serve a non-loopback address without any key.
    #[arg(long)]
    pub no_auth: bool,
    /// Directory that `{"source": {"path": ...}}` may read from.
    #[arg(long, env = "SPAO_DATA_DIR", value_name = "DIR")]
    pub data_dir: Option<PathBuf>,
    /// URL below which `{"source": {"url": ...}}` may fetch (https, http, s3, gs, az); may be given several times. Without
    /// any, nothing is fetched.
    #[arg(long = "allow-source", env = "SPAO_ALLOW_SOURCES", value_name = "URL", value_delimiter = ',', value_parser = AllowedSource::parse)]
    pub allow_sources: Vec<AllowedSource>,
    /// Fetch over http and https from addresses of private networks and of this machine too.
    #[arg(long, env = "SPAO_ALLOW_PRIVATE_SOURCES", value_parser = clap::builder::BoolishValueParser::new(), num_args = 0..=1, default_missing_value = "true", default_value = "false")]
    pub allow_private_sources: bool,
    /// Show all fields of a file's header in `/v1/volumes/{id}/metadata`, also those that may name a patient.
    #[arg(long, env = "SPAO_KEEP_IDENTITY", value_parser = clap::builder::BoolishValueParser::new(), num_args = 0..=1, default_missing_value = "true", default_value = "false")]
    pub keep_identity: bool,
    /// Volume to load at the start, with a default scene: a file (of several, `FILE#series=4` or
    /// `FILE#channel=1`; a part, `FILE#region=X0,Y0,Z0,X1,Y1,Z1`), or `procedural:KIND:SIZE`; may be given several times.
    #[arg(long = "volume", env = "SPAO_VOLUME", value_name = "VOLUME")]
    pub volumes: Vec<String>,
    /// Origin that browsers may call from, or `*`; may be given several times.
    #[arg(long = "allow-origin", env = "SPAO_ALLOW_ORIGINS", value_name = "ORIGIN", value_delimiter = ',')]
    pub allow_origins: Vec<String>,
    /// Form of the log on standard error.
    #[arg(long, env = "SPAO_LOG_FORMAT", value_enum, default_value_t = LogFormat::Text)]
    pub log_format: LogFormat,
    /// Seconds that requests in flight may take to finish after SIGTERM.
    #[arg(long, env = "SPAO_DRAIN_TIMEOUT", value_name = "SECONDS", default_value = "10", value_parser = parse_seconds)]
    pub drain_timeout: Duration,
    /// The limits.
    #[command(flatten)]
    pub limits: Limits,
    /// Adapter and memory.
    #[command(flatten)]
    pub gpu: GpuArgs,
}

/// Everything that bounds what clients can ask for. `GET /v1/server` shows them.
#[derive(Args, Clone, Debug)]
pub struct Limits {
    /// Longest volume file, in bytes or with K, M, G.
    #[arg(long = "max-upload", env = "SPAO_MAX_UPLOAD", value_name = "BYTES", default_value = "2G", value_parser = parse_bytes)]
    pub max_upload_bytes: u64,
    /// Most voxels of one volume.
    #[arg(long, env = "SPAO_MAX_VOXELS", value_name = "COUNT", default_value = "1073741824", value_parser = clap::value_parser!(u64).range(1..))]
    pub max_voxels: u64,
    /// Most pixels of a picture along each axis.
    #[arg(long = "max-image", env = "SPAO_MAX_IMAGE", value_name = "PIXELS", default_value = "4096", value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub max_image_axis: u32,
    /// Most volumes, those on their way included.
    #[arg(long, env = "SPAO_MAX_VOLUMES", value_name = "COUNT", default_value = "64", value_parser = parse_count)]
    pub max_volumes: usize,
    /// Most scenes.
    #[arg(long, env = "SPAO_MAX_SCENES", value_name = "COUNT", default_value = "256", value_parser = parse_count)]
    pub max_scenes: usize,
    /// Seconds that one request may take; an upload may take as long between two pieces of its body.
    #[arg(long, env = "SPAO_REQUEST_TIMEOUT", value_name = "SECONDS", default_value = "120", value_parser = parse_seconds)]
    pub request_timeout: Duration,
}

impl Limits {
    /// Longest JSON body. A transfer function of ten thousand points stays below.
    pub const MAX_JSON_BYTES: usize = 1 << 20;
    /// Volumes read at the same time: each may hold the file, of `max_upload_bytes`, and its decoded voxels.
    pub const CONCURRENT_LOADS: usize = 2;
    /// Loads that wait for one of [`Self::CONCURRENT_LOADS`]; four files at most, with theirs, may come meanwhile.
    pub const WAITING_LOADS: usize = 16;
    /// Pictures and accessibility volumes in progress, waiting ones included: each may hold a whole picture.
    pub const CONCURRENT_RENDERS: usize = 32;
    /// Streams that may be open: each costs a task and a few pictures of memory.
    pub const CONCURRENT_STREAMS: usize = 256;
    /// Longest upload in all: a client that sends a byte now and then must not hold a slot for ever.
    pub const MAX_UPLOAD_TIME: Duration = Duration::from_secs(3600);
    /// Most bins of a histogram.
    pub const MAX_HISTOGRAM_BINS: u32 = 65536;
}

/// Form of log lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LogFormat {
    /// For people.
    Text,
    /// One JSON object a line.
    Json,
}

/// Arguments of `render`.
#[derive(Args, Clone, Debug)]
pub struct RenderArgs {
    /// A volume file (of several, `FILE#series=4` or `FILE#channel=1`; a part, `FILE#region=X0,Y0,Z0,X1,Y1,Z1`), or `procedural:KIND:SIZE`.
    pub volume: String,
    /// Scene document (JSON); its `volume` may be missing. Without it: the default scene.
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// Picture file; its ending names the format unless `--format` does.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Pixels across; the scene's viewport when missing.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub width: Option<u32>,
    /// Pixels down; the scene's viewport when missing.
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=16384))]
    pub height: Option<u32>,
    /// `png`, `jpeg` or `webp`.
    #[arg(long, value_enum)]
    pub format: Option<crate::encode::ImageFormat>,
    /// Adapter and memory.
    #[command(flatten)]
    pub gpu: GpuArgs,
}

/// Arguments of `ao`. Flags override the scene's `ambient_occlusion`.
#[derive(Args, Clone, Debug)]
pub struct AoArgs {
    /// A volume file (of several, `FILE#series=4` or `FILE#channel=1`; a part, `FILE#region=X0,Y0,Z0,X1,Y1,Z1`), or `procedural:KIND:SIZE`.
    pub volume: String,
    /// Scene document (JSON); its `volume` may be missing. Without it: the default scene.
    #[arg(long, value_name = "FILE")]
    pub scene: Option<PathBuf>,
    /// `.npy` or `.nrrd` file.
    #[arg(short, long, value_name = "FILE")]
    pub output: PathBuf,
    /// Method: `spao`, `raytraced`, ...
    #[arg(long)]
    pub method: Option<String>,
    /// Structure of `spao`: `n_buffer`, `mipmap`, `hybrid`.
    #[arg(long)]
    pub structure: Option<String>,
    /// Levels L, 1..=8.
    #[arg(long)]
    pub levels: Option<u32>,
    /// Mip levels m of `hybrid`.
    #[arg(long)]
    pub mip_levels: Option<u32>,
    /// Normal factor f, 0..=2.
    #[arg(long)]
    pub normal_factor: Option<f64>,
    /// Directions of `raytraced`.
    #[arg(long)]
    pub rays: Option<u32>,
    /// Reach of `raytraced`: voxels, or `unlimited`.
    #[arg(long)]
    pub radius: Option<String>,
    /// Adapter and memory.
    #[command(flatten)]
    pub gpu: GpuArgs,
}

/// Arguments of `inspect`.
#[derive(Args, Clone, Debug)]
pub struct InspectArgs {
    /// A volume file (of several, `FILE#series=4` or `FILE#channel=1`; a part, `FILE#region=X0,Y0,Z0,X1,Y1,Z1`), or `procedural:KIND:SIZE`.
    pub volume: String,
    /// Bins of the histogram summary.
    #[arg(long, default_value = "16", value_parser = clap::value_parser!(u32).range(1..=i64::from(Limits::MAX_HISTOGRAM_BINS)))]
    pub bins: u32,
}

/// Arguments of `healthcheck`.
#[derive(Args, Clone, Debug)]
pub struct HealthcheckArgs {
    /// Where the server listens; an unspecified address (0.0.0.0, ::) is asked on the loopback interface.
    #[arg(long, env = "SPAO_ADDR", default_value = "127.0.0.1:8080")]
    pub addr: SocketAddr,
}

/// What can be measured.
#[derive(Clone, Debug, Subcommand)]
pub enum BenchCommand {
    /// Ambient-occlusion passes, as in the papers' tables.
    Ao(BenchAoArgs),
    /// Edits of a transfer function, beside builds from nothing.
    Edit(BenchEditArgs),
}

/// Arguments of `bench ao`.
#[derive(Args, Clone, Debug)]
pub struct BenchAoArgs {
    /// Volume to measure: a file, or `procedural:KIND:SIZE`; may be given several times.
    #[arg(long = "volume", value_name = "VOLUME")]
    pub volumes: Vec<String>,
    /// Voxels per axis of the procedural volumes used when no volume is named.
    #[arg(long, default_value = "128", value_parser = clap::value_parser!(u32).range(8..=1024))]
    pub size: u32,
    /// Runs of each row, the median of which is reported.
    #[arg(long, default_value = "5", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub runs: u32,
    /// Adapter and memory.
    #[command(flatten)]
    pub gpu: GpuArgs,
}

/// Arguments of `bench edit`.
#[derive(Args, Clone, Debug)]
pub struct BenchEditArgs {
    /// Volume to measure, in Hounsfield units: a file.
    #[arg(long, value_name = "VOLUME", default_value = "data/visible-human-head.nrrd")]
    pub volume: String,
    /// Transfer function that is edited: a preset for CT.
    #[arg(long, value_name = "PRESET", default_value = "ct_skin_bone")]
    pub preset: String,
    /// Rounds of each row, the median of which is reported.
    #[arg(long, default_value = "5", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub rounds: u32,
    /// Adapter and memory.
    #[command(flatten)]
    pub gpu: GpuArgs,
}

/// Why a configuration cannot be served.
#[derive(Debug, thiserror::Error, PartialEq, Eq)]
pub enum ConfigError {
    /// Anyone could reach the server.
    #[error(
        "{0} is reachable from other machines: give at least one --api-key (or SPAO_API_KEYS), or say --no-auth to serve everyone"
    )]
    OpenToEveryone(SocketAddr),
    /// A key that a client could not send, or that anyone could guess.
    #[error("--api-key must be 8 or more visible ASCII characters")]
    BadKey,
    /// Keys and their absence asked for at once.
    #[error("--no-auth and --api-key exclude each other")]
    KeyAndNoAuth,
    /// Something that cannot be an `Origin` header.
    #[error("--allow-origin `{0}` is not an origin such as https://viewer.example or http://localhost:5173")]
    BadOrigin(String),
    /// No such directory.
    #[error("--data-dir `{}` is not a directory", .0.display())]
    BadDataDir(PathBuf),
}

impl ServeArgs {
    /// Checks what single arguments cannot say.
    ///
    /// # Errors
    /// The first [`ConfigError`].
    pub fn validate(&self) -> Result<(), ConfigError> {
        if self.no_auth && !self.api_keys.is_empty() {
            return Err(ConfigError::KeyAndNoAuth);
        }
        if self.api_keys.iter().any(|key| key.len() < 8 || !key.bytes().all(|b| b.is_ascii_graphic())) {
            return Err(ConfigError::BadKey);
        }
        if !self.addr.ip().is_loopback() && self.api_keys.is_empty() && !self.no_auth {
            return Err(ConfigError::OpenToEveryone(self.addr));
        }
        if let Some(bad) = self.allow_origins.iter().find(|o| *o != "*" && !is_origin(o)) {
            return Err(ConfigError::BadOrigin(bad.clone()));
        }
        match &self.data_dir {
            Some(dir) if !dir.is_dir() => Err(ConfigError::BadDataDir(dir.clone())),
            _ => Ok(()),
        }
    }
}

/// `scheme://host[:port]` and nothing after it, as browsers send it.
fn is_origin(text: &str) -> bool {
    text.split_once("://").is_some_and(|(scheme, host)| {
        !scheme.is_empty()
            && scheme.bytes().all(|b| b.is_ascii_lowercase())
            && !host.is_empty()
            && host.bytes().all(|b| b.is_ascii_graphic() && !b.is_ascii_uppercase() && b != b'/')
    })
}

/// A number of bytes: `1000`, `64K`, `512M`, `2G` (powers of 1024).
fn parse_bytes(text: &str) -> Result<u64, String> {
    let (digits, unit) = match text.char_indices().last() {
        Some((at, 'K' | 'k')) => (&text[..at], 1 << 10),
        Some((at, 'M' | 'm')) => (&text[..at], 1 << 20),
        Some((at, 'G' | 'g')) => (&text[..at], 1 << 30),
        _ => (text, 1),
    };
    let number: u64 = digits.parse().map_err(|_| "expected bytes such as 1000, 64K, 512M or 2G".to_owned())?;
    number.checked_mul(unit).filter(|&bytes| bytes > 0).ok_or_else(|| "out of range".to_owned())
}

/// A positive number of seconds, at most a day; fractions are fine.
fn parse_seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "expected seconds".to_owned())?;
    if seconds > 0.0 && seconds <= 86_400.0 {
        Ok(Duration::from_secs_f64(seconds))
    } else {
        Err("expected more than 0 and at most 86400 seconds".into())
    }
}

/// A count, 1..=100000.
fn parse_count(text: &str) -> Result<usize, String> {
    text.parse().ok().filter(|n| (1..=100_000).contains(n)).ok_or_else(|| "expected 1 to 100000".into())
}
