//! From a source of voxels to a volume in host memory, and how many may be on their way at once.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::{Value, json};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};

use super::volumes::NewVolume;
use crate::error::ApiError;
use crate::volume::format::{bare_name, load_chosen, peek_chosen, read_chosen};
use crate::volume::{Choice, Format, Limits, ProceduralKind, ProceduralSpec, RawSpec, Shape, Volume, VolumeError};

/// Bins that a scene's defaults are derived from.
const FACT_BINS: u32 = 256;

/// Where voxels come from.
#[derive(Clone, Debug)]
pub enum VolumeSource {
    /// The bytes of a file.
    Upload {
        /// The whole file.
        bytes: Vec<u8>,
        /// Its format.
        format: Format,
        /// What a file without a header holds.
        raw: Option<RawSpec>,
        /// Which of several volumes in it is meant.
        choice: Choice,
    },
    /// The bytes of a file that was fetched.
    Fetched {
        /// Where from, as it may be shown.
        url: String,
        /// The whole file.
        bytes: Vec<u8>,
        /// Its format.
        format: Format,
        /// Which of several volumes in it.
        choice: Choice,
    },
    /// A file, or a folder of files.
    Path {
        /// Relative to `data_dir`, which it cannot leave.
        path: String,
        /// Which of several volumes in it is meant.
        choice: Choice,
        /// The directory that may be read.
        data_dir: PathBuf,
    },
    /// Computed.
    Procedural(ProceduralSpec),
}

impl VolumeSource {
    /// A volume named on the command line: `procedural:KIND:SIZE` (or `KIND:X,Y,Z`), a file or folder, or one of the
    /// volumes in it (`study.zip#series=4`, `cells.tif#channel=1`).
    ///
    /// # Errors
    /// Names `procedural`, `channel` if that is not a number, or `path` if there is no such file.
    pub fn from_argument(argument: &str) -> Result<Self, VolumeError> {
        if let Some(text) = argument.strip_prefix("procedural:") {
            return procedural_from_argument(text).map(Self::Procedural);
        }
        let io = |source| VolumeError::Io { field: format!("path `{argument}`"), source };
        let (file, choice) = file_and_choice(argument)?;
        // Resolved first: on the command line a symbolic link may lead anywhere.
        let path = Path::new(file).canonicalize().map_err(io)?;
        let (Some(directory), Some(file)) = (path.parent(), path.file_name().and_then(|name| name.to_str())) else {
            return Err(io(std::io::ErrorKind::InvalidFilename.into()));
        };
        Ok(Self::Path { path: file.to_owned(), choice, data_dir: directory.to_owned() })
    }

    /// What the volume is called when nobody names it.
    pub fn default_name(&self) -> String {
        match self {
            Self::Upload { .. } => "upload".into(),
            Self::Fetched { url: path, .. } | Self::Path { path, .. } => {
                bare_name(&Path::new(path).file_name().unwrap_or_default().to_string_lossy()).to_owned()
            }
            Self::Procedural(spec) => json!(spec.kind).as_str().unwrap_or_default().into(),
        }
    }

    /// The source as the API shows it.
    pub fn to_json(&self) -> Value {
        match self {
            Self::Upload { bytes, format, .. } => {
                json!({ "upload": { "format": format.name(), "bytes": bytes.len() } })
            }
            Self::Fetched { url, .. } => json!({ "url": url }),
            Self::Path { path, choice, .. } => {
                let mut json = json!({ "path": path });
                if let Some(series) = &choice.series {
                    json["series"] = json!(series);
                }
                if let Some(channel) = choice.channel {
                    json["channel"] = json!(channel);
                }
                if let Some(scale) = choice.scale {
                    json["scale"] = json!(scale);
                }
                json
            }
            Self::Procedural(spec) => json!({ "procedural": spec }),
        }
    }

    /// Reads or computes the voxels. Takes seconds: never on an async worker.
    ///
    /// # Errors
    /// What is wrong with the source.
    pub fn load(&self, limits: &Limits) -> Result<Volume, VolumeError> {
        match self {
            Self::Upload { bytes, format, raw, choice } => read_chosen(bytes, *format, raw.as_ref(), choice, limits),
            Self::Path { path, choice, data_dir } => load_chosen(path, data_dir, None, choice, limits),
            Self::Fetched { bytes, format, choice, .. } => read_chosen(bytes, *format, None, choice, limits),
            Self::Procedural(spec) => spec.generate(limits),
        }
    }

    /// Dims and voxel type, as far as they are known without the voxels; reads an upload whole.
    ///
    /// # Errors
    /// What is wrong with the source, as far as it was looked at.
    pub fn peek(&self, limits: &Limits) -> Result<Shape, VolumeError> {
        let shape = match self {
            Self::Upload { .. } | Self::Fetched { .. } => {
                let volume = self.load(limits)?;
                let (dims, spacing) = (volume.grid.dims, Some(volume.grid.spacing.to_array()));
                Shape { dims, voxel_type: volume.voxels.voxel_type(), spacing }
            }
            Self::Path { path, choice, data_dir } => peek_chosen(path, data_dir, None, choice, limits)?,
            Self::Procedural(spec) => Shape { dims: spec.dims, voxel_type: spec.voxel_type(), spacing: spec.spacing },
        };
        limits.check("dims", shape.dims, shape.voxel_type)?;
        Ok(shape)
    }

    /// [`VolumeSource::load`], and all that is derived from the voxels.
    ///
    /// # Errors
    /// What is wrong with the source.
    pub fn prepare(self, name: Option<String>, limits: &Limits) -> Result<NewVolume, VolumeError> {
        let volume = self.load(limits)?;
        // Here, where it keeps nobody waiting.
        volume.bricks();
        Ok(NewVolume {
            name: name.unwrap_or_else(|| self.default_name()),
            histogram: volume.histogram(FACT_BINS)?,
            sha256: volume.sha256_hex(),
            source: self.to_json(),
            volume: Arc::new(volume),
        })
    }
}

/// `FILE`, `FILE#series=NAME` or `FILE#channel=NUMBER` or `FILE#scale=NUMBER`; a file that is really called so is meant itself.
fn file_and_choice(argument: &str) -> Result<(&str, Choice), VolumeError> {
    let mut choice = Choice::default();
    match argument.rsplit_once('#') {
        Some((file, which)) if !Path::new(argument).exists() => {
            if let Some(series) = which.strip_prefix("series=") {
                choice.series = Some(series.to_owned());
            } else if let Some(channel) = which.strip_prefix("channel=") {
                choice.channel = Some(counted("channel", channel)?);
            } else if let Some(scale) = which.strip_prefix("scale=") {
                choice.scale = Some(counted("scale", scale)?);
            } else {
                return Ok((argument, choice));
            }
            Ok((file, choice))
        }
        _ => Ok((argument, choice)),
    }
}

fn counted(field: &str, number: &str) -> Result<u32, VolumeError> {
    number.parse().map_err(|_| VolumeError::Malformed {
        field: field.into(),
        message: format!("`{number}` is not a whole number, counted from 0"),
    })
}

/// `KIND:SIZE` or `KIND:X,Y,Z`: voxels along every axis, or along each.
fn procedural_from_argument(text: &str) -> Result<ProceduralSpec, VolumeError> {
    let malformed = || VolumeError::Malformed {
        field: "procedural".into(),
        message: format!("`{text}` is not KIND:SIZE or KIND:X,Y,Z, such as gyroid:128"),
    };
    let (kind, size) = text.split_once(':').ok_or_else(malformed)?;
    let kind: ProceduralKind = serde_json::from_value(kind.into()).map_err(|_| malformed())?;
    let sizes: Result<Vec<u32>, _> = size.split(',').map(str::parse).collect();
    let dims = match sizes.map_err(|_| malformed())?[..] {
        [n] => [n; 3],
        [x, y, z] => [x, y, z],
        _ => return Err(malformed()),
    };
    Ok(ProceduralSpec { kind, dims, seed: 0, spacing: None })
}

/// Lets a few volumes be loaded at once, and a few more wait.
#[derive(Debug)]
pub struct Admission {
    waiting: Arc<Semaphore>,
    loading: Arc<Semaphore>,
}

/// Held while a volume is loaded, by whoever does the work at the moment.
#[derive(Debug)]
pub struct LoadPermit {
    _waiting: OwnedSemaphorePermit,
    _loading: OwnedSemaphorePermit,
}

impl Admission {
    /// `loading` at once, `waiting` more in line.
    pub fn new(loading: usize, waiting: usize) -> Self {
        Self { waiting: Arc::new(Semaphore::new(loading + waiting)), loading: Arc::new(Semaphore::new(loading)) }
    }

    /// Waits in line.
    ///
    /// # Errors
    /// `busy` when the line is full.
    pub async fn enter(&self) -> Result<LoadPermit, ApiError> {
        let waiting = self.waiting.clone().try_acquire_owned().map_err(|_| ApiError::busy())?;
        let loading = self.loading.clone().acquire_owned().await.map_err(ApiError::internal)?;
        Ok(LoadPermit { _waiting: waiting, _loading: loading })
    }
}
