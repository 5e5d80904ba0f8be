//! A volume as it is asked for: from where, how much of it, and how fine.

use std::sync::Arc;

use serde::Deserialize;
use serde_json::{Value, json};

use super::entry::NewVolume;
use super::loading::VolumeSource;
use super::place::Loading;
use crate::renderer::{GpuNeed, RendererInfo};
use crate::volume::{
    Derived, Limits, LoadWatch, Region, Resolution, Shape, Volume, VolumeError, VoxelType, factor_that_fits,
    parse_region, reduced_dims, region_dims,
};

/// Bins that a scene's defaults are derived from.
const FACT_BINS: u32 = 256;

/// Longest axis that is read although the adapter cannot take it, to be averaged or cropped.
const LONGEST_AXIS: u32 = 1 << 16;

/// What to do with voxels for which there is no room.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Reduce {
    /// Blocks of them are averaged, as small as they can be.
    #[default]
    Auto,
    /// The volume is refused.
    Never,
}

impl Reduce {
    /// By its name in the API.
    pub fn from_name(name: &str) -> Option<Self> {
        match name {
            "auto" => Some(Self::Auto),
            "never" => Some(Self::Never),
            _ => None,
        }
    }
}

/// How much of a source is wanted.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Extent {
    /// A part of it; all of it with `None`.
    pub region: Option<Region>,
    /// What to do with what is too large.
    pub reduce: Reduce,
}

/// What the GPU has room for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Room {
    /// Most voxels along an axis.
    pub max_axis: u32,
    /// Bytes of GPU memory that may be used.
    pub budget_bytes: u64,
    /// Most bytes that can be bound at once.
    pub largest_binding: u64,
    /// Bytes of a voxel of more than 256 values.
    pub wide_texel_bytes: u64,
}

impl Room {
    /// Of an adapter and its budget.
    pub fn of(info: &RendererInfo, budget_bytes: u64) -> Self {
        let wide_texel_bytes = if info.texture_16bit_norm { 2 } else { 4 };
        let (max_axis, largest_binding) = (info.max_volume_axis, info.max_storage_binding_bytes);
        Self { max_axis, budget_bytes, largest_binding, wide_texel_bytes }
    }

    /// What a volume takes; `code_bytes` are those of a voxel's code, 1 or 2.
    pub fn need(&self, dims: [u32; 3], code_bytes: u64) -> GpuNeed {
        GpuNeed::of(dims, if code_bytes == 1 { 1 } else { self.wide_texel_bytes })
    }

    /// How many voxels are to be averaged into one so that a volume fits, if it were the only one; 1 where nothing helps.
    pub fn factor(&self, dims: [u32; 3], code_bytes: u64) -> [u32; 3] {
        let fits = |dims| self.need(dims, code_bytes).fits(self.budget_bytes, self.largest_binding);
        factor_that_fits(dims, self.max_axis, fits).unwrap_or([1; 3])
    }
}

/// What a volume will be, before its voxels are there.
#[derive(Clone, Debug, PartialEq)]
pub struct Plan {
    /// Voxels along x, y, z.
    pub dims: [u32; 3],
    /// Type of the voxels.
    pub voxel_type: VoxelType,
    /// How much of its source it is.
    pub resolution: Resolution,
}

/// A volume to be loaded.
#[derive(Clone, Debug)]
pub struct LoadRequest {
    /// From where.
    pub source: VolumeSource,
    /// How much.
    pub extent: Extent,
}

impl From<VolumeSource> for LoadRequest {
    /// All of it.
    fn from(source: VolumeSource) -> Self {
        Self { source, extent: Extent::default() }
    }
}

impl Extent {
    /// The limits for reading: what is cropped or averaged later may be longer than the adapter takes.
    fn limits(&self, limits: &Limits) -> Limits {
        match self {
            Self { region: None, reduce: Reduce::Never } => *limits,
            _ => Limits { max_axis: limits.max_axis.max(LONGEST_AXIS), ..*limits },
        }
    }

    /// A source's JSON with the part of it that is meant.
    pub fn add_to(&self, mut source: Value) -> Value {
        if let Some(region) = self.region {
            source["region"] = json!(region);
        }
        source
    }
}

impl LoadRequest {
    /// A volume named on the command line: `procedural:KIND:SIZE` (or `KIND:X,Y,Z`), a file or folder, one of the
    /// volumes in it (`study.zip#series=4`, `cells.tif#channel=1`), or a part (`head.nrrd#region=0,0,0,64,64,64`).
    ///
    /// # Errors
    /// Names `procedural`, `channel` or `region` if they are wrong, or `path` if there is no such file.
    pub fn from_argument(argument: &str) -> Result<Self, VolumeError> {
        let (source, region) = match argument.rsplit_once("#region=") {
            Some((source, text)) if !std::path::Path::new(argument).exists() => (source, Some(parse_region(text)?)),
            _ => (argument, None),
        };
        let extent = Extent { region, ..Extent::default() };
        Ok(Self { source: VolumeSource::from_argument(source)?, extent })
    }

    /// The source as the API shows it.
    pub fn to_json(&self) -> Value {
        self.extent.add_to(self.source.to_json())
    }

    /// Reads or computes the voxels, takes the part that is wanted, and averages what there is no room for. Takes
    /// seconds: never on an async worker. At most the source's voxels and those of the volume are in memory.
    ///
    /// # Errors
    /// What is wrong with the source; names `region`; [`VolumeError::Cancelled`].
    pub fn load(self, limits: &Limits, room: Option<&Room>, watch: &LoadWatch) -> Result<Volume, VolumeError> {
        let Self { source, extent } = self;
        let mut volume = source.load(&extent.limits(limits), watch)?;
        // A file in memory is of no use any more.
        drop(source);
        if let Some(region) = &extent.region {
            volume = volume.cropped(region, watch)?;
        }
        if let (Reduce::Auto, Some(room)) = (extent.reduce, room) {
            let factor = room.factor(volume.grid.dims, volume.code_map.bytes_per_voxel());
            if factor != [1; 3] {
                volume = volume.averaged(factor, watch)?;
            }
        }
        Ok(volume)
    }

    /// What the volume would be, as far as that is known without its voxels; reads an upload whole.
    ///
    /// # Errors
    /// What is wrong with the source, as far as it was looked at; names `region`.
    pub fn plan(&self, limits: &Limits, room: &Room) -> Result<Plan, VolumeError> {
        let Shape { dims: full_dims, voxel_type, .. } = self.source.peek(&self.extent.limits(limits))?;
        let region = self.extent.region;
        let dims = region.map_or(Ok(full_dims), |region| region_dims(&region, full_dims))?;
        let factor = match self.extent.reduce {
            Reduce::Auto => room.factor(dims, voxel_type.bytes().min(2)),
            Reduce::Never => [1; 3],
        };
        let resolution = Resolution { full_dims, factor, region };
        Ok(Plan { dims: reduced_dims(dims, factor), voxel_type, resolution })
    }

    /// [`LoadRequest::load`], and all that is derived from the voxels.
    ///
    /// # Errors
    /// As [`LoadRequest::load`].
    pub fn prepare(self, limits: &Limits, room: Option<&Room>) -> Result<NewVolume, VolumeError> {
        let (name, watch) = (self.source.default_name(), LoadWatch::default());
        NewVolume::derive(name, self.load(limits, room, &watch)?, &watch)
    }

    /// [`LoadRequest::load`] for a place among the volumes, which is told what comes and how far it is, and all that
    /// is derived from the voxels.
    ///
    /// # Errors
    /// As [`LoadRequest::load`].
    pub fn prepare_for(self, loading: &Loading, limits: &Limits, room: &Room) -> Result<NewVolume, VolumeError> {
        let volume = self.load(limits, Some(room), loading.watch())?;
        loading.reveal(&volume);
        NewVolume::derive(loading.name.clone(), volume, loading.watch())
    }
}

impl NewVolume {
    fn derive(name: String, volume: Volume, watch: &LoadWatch) -> Result<Self, VolumeError> {
        let Derived { histogram, sha256 } = volume.derive(FACT_BINS, watch)?;
        Ok(Self { name, histogram, sha256, volume: Arc::new(volume) })
    }
}
