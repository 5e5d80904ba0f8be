//! From a source of voxels to a volume in host memory.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::volume::format::{bare_name, load_watched, peek_chosen, read_watched};
use crate::volume::{
    Choice, Format, Limits, LoadWatch, ProceduralKind, ProceduralSpec, RawSpec, Shape, Volume, VolumeError,
};

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
    /// What is wrong with the source; [`VolumeError::Cancelled`].
    pub fn load(&self, limits: &Limits, watch: &LoadWatch) -> Result<Volume, VolumeError> {
        match self {
            Self::Upload { bytes, format, raw, choice } => {
                read_watched(bytes, *format, raw.as_ref(), choice, limits, watch)
            }
            Self::Path { path, choice, data_dir } => load_watched(path, data_dir, None, choice, limits, watch),
            Self::Fetched { bytes, format, choice, .. } => read_watched(bytes, *format, None, choice, limits, watch),
            Self::Procedural(spec) => spec.generate_watched(limits, watch),
        }
    }

    /// Dims and voxel type, as far as they are known without the voxels; reads an upload whole.
    ///
    /// # Errors
    /// What is wrong with the source, as far as it was looked at.
    pub fn peek(&self, limits: &Limits) -> Result<Shape, VolumeError> {
        let shape = match self {
            Self::Upload { .. } | Self::Fetched { .. } => {
                let volume = self.load(limits, &LoadWatch::default())?;
                Shape::of(&volume.grid, volume.voxels.voxel_type())
            }
            Self::Path { path, choice, data_dir } => peek_chosen(path, data_dir, None, choice, limits)?,
            Self::Procedural(spec) => Shape { dims: spec.dims, voxel_type: spec.voxel_type(), spacing: spec.spacing },
        };
        limits.check("dims", shape.dims, shape.voxel_type)?;
        Ok(shape)
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
