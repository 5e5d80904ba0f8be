//! The renderer: what is resident, the compiled passes, and the pieces that jobs share.

use std::cell::RefCell;
use std::collections::{BTreeMap, HashMap};
use std::rc::{Rc, Weak};
use std::sync::Arc;

use super::jobs::{AccessibilityJob, FrameJob, UploadJob};
use super::occupancy::brick_distance;
use super::request::{AccessibilityVolume, Frame, FrameRequest, MemoryUse, RenderError, RendererInfo, Residency};
use super::resident::ResidentVolume;
use crate::ao::{Accessibility, AoBuild, AoCache, AoKey, AoSource, AoStages};
use crate::gpu::{Category, ComputeStage, Gpu, GpuError, GpuOptions, GpuTexture};
use crate::scene::{AoMethod, Scene, TransferTable, opacity_table};
use crate::volume::{Volume, VolumeId};

/// What one turn of a job came to.
#[derive(Debug)]
pub enum Turn<T> {
    /// More turns are needed; the share that is done, in [0, 1].
    Pending(f64),
    /// The result.
    Done(T),
}

/// Everything that lives on the device.
#[derive(Debug)]
pub struct Renderer {
    pub(super) gpu: Gpu,
    info: RendererInfo,
    pub(super) stages: Stages,
    volumes: BTreeMap<VolumeId, Rc<ResidentVolume>>,
    ao_cache: AoCache,
    /// Builds under way, owned by the jobs that wait for them: a build that nobody wants ends at once.
    ao_builds: HashMap<AoKey, Weak<RefCell<AoBuild>>>,
    ao_versions: u64,
}

/// Compiled passes.
#[derive(Debug)]
pub(super) struct Stages {
    pub(super) gradient: ComputeStage,
    pub(super) raycast: RaycastStages,
    pub(super) ao: AoStages,
    pub(super) linear_sampler: wgpu::Sampler,
    /// Stands in where ambient occlusion is off.
    pub(super) white: GpuTexture,
}

/// The ray caster's variants.
#[derive(Debug)]
pub(super) struct RaycastStages {
    pub(super) occluded: ComputeStage,
    pub(super) open: ComputeStage,
    /// For r32float values: `(occluded, open)`; only on adapters without 16-bit normalised textures.
    pub(super) texels: Option<(ComputeStage, ComputeStage)>,
}

impl Renderer {
    /// Opens the adapter and compiles the passes.
    ///
    /// # Errors
    /// [`RenderError::NoAdapter`], [`RenderError::Device`].
    pub fn new(options: &GpuOptions) -> Result<Self, RenderError> {
        let gpu = Gpu::new(options)?;
        let info = describe(&gpu);
        if info.software {
            tracing::info!(adapter = info.adapter, "software adapter: pictures are computed on the CPU");
        }
        let stages = Stages::new(&gpu)?;
        Ok(Self {
            gpu,
            info,
            stages,
            volumes: BTreeMap::new(),
            ao_cache: AoCache::default(),
            ao_builds: HashMap::new(),
            ao_versions: 0,
        })
    }

    /// The adapter in use.
    pub fn info(&self) -> &RendererInfo {
        &self.info
    }

    /// Memory in use now.
    pub fn memory(&self) -> MemoryUse {
        let budget = &self.gpu.budget;
        MemoryUse {
            budget_bytes: budget.limit_bytes(),
            used_bytes: budget.used_bytes(),
            volumes_bytes: budget.used_by(Category::Volume),
            ao_cache_bytes: budget.used_by(Category::AoCache),
            ao_scratch_bytes: budget.used_by(Category::AoScratch),
        }
    }

    /// True once the device is lost: nothing will work any more.
    pub fn is_lost(&self) -> bool {
        self.gpu.is_lost()
    }

    /// Makes a volume resident.
    ///
    /// # Errors
    /// [`RenderError::DoesNotFit`], [`RenderError::AxisTooLong`], [`RenderError::Device`]; nothing remains then.
    pub fn add_volume(&mut self, id: VolumeId, volume: Arc<Volume>) -> Result<Residency, RenderError> {
        let mut job = UploadJob::new(id, volume);
        loop {
            if let Turn::Done(residency) = job.advance(self)? {
                return Ok(residency);
            }
        }
    }

    /// Frees a volume and what was derived from it; unknown ids are fine.
    pub fn remove_volume(&mut self, id: &VolumeId) {
        self.volumes.remove(id);
        self.ao_cache.forget_volume(id);
        self.ao_builds.retain(|key, build| key.volume() != id && build.strong_count() > 0);
    }

    /// Draws one exact picture.
    ///
    /// # Errors
    /// Any [`RenderError`] of this picture.
    pub fn render(&mut self, request: &FrameRequest) -> Result<Frame, RenderError> {
        let mut job = FrameJob::new(request.clone());
        loop {
            if let Turn::Done(frame) = job.advance(self)? {
                return Ok(frame);
            }
        }
    }

    /// The accessibility volume of a scene's settings.
    ///
    /// # Errors
    /// Any [`RenderError`] of this job.
    pub fn accessibility(&mut self, scene: Arc<Scene>) -> Result<AccessibilityVolume, RenderError> {
        let mut job = AccessibilityJob::new(scene);
        loop {
            if let Turn::Done(volume) = job.advance(self)? {
                return Ok(volume);
            }
        }
    }

    /// A build of a scene's ambient occlusion from nothing, past all caches, for measuring.
    /// The scene's method must not be `Off`.
    ///
    /// # Errors
    /// [`RenderError::UnknownVolume`], [`RenderError::DoesNotFit`].
    pub fn fresh_ao_build(&self, scene: &Scene) -> Result<AoBuild, RenderError> {
        let resident = self.resident(&scene.volume)?;
        let source = self.ao_source(&resident, scene);
        Ok(AoBuild::new(&self.gpu, source, scene.ambient_occlusion)?)
    }

    /// The device and the passes that a build is advanced with.
    pub fn ao_tools(&self) -> (&Gpu, &AoStages) {
        (&self.gpu, &self.stages.ao)
    }

    pub(super) fn keep_volume(&mut self, id: VolumeId, resident: ResidentVolume) {
        // What was derived from an earlier volume of this name is of no use for the new one.
        self.remove_volume(&id);
        self.volumes.insert(id, Rc::new(resident));
    }

    pub(super) fn resident(&self, id: &VolumeId) -> Result<Rc<ResidentVolume>, RenderError> {
        self.volumes.get(id).cloned().ok_or_else(|| RenderError::UnknownVolume(id.clone()))
    }

    /// The finished accessibility volume of a scene, or the build to advance.
    pub(super) fn ao(&mut self, resident: &ResidentVolume, scene: &Scene) -> Result<Ao, RenderError> {
        if scene.ambient_occlusion.method == AoMethod::Off {
            return Ok(Ao::Off);
        }
        let key = AoKey::new(&scene.volume, &Self::ao_opacity_table(resident, scene), &scene.ambient_occlusion);
        if let Some(accessibility) = self.ao_cache.get(&key) {
            return Ok(Ao::Ready(accessibility));
        }
        let under_way = self.ao_builds.get(&key).and_then(Weak::upgrade);
        if let Some(build) = under_way.filter(|build| !build.borrow().has_failed()) {
            return Ok(Ao::Building(key, build));
        }
        let source = self.ao_source(resident, scene);
        let build = loop {
            let build = AoBuild::new(&self.gpu, source.clone(), scene.ambient_occlusion);
            match self.with_resident(build) {
                Err(error) if self.make_room(&error) => {}
                result => break result?,
            }
        };
        let build = Rc::new(RefCell::new(build));
        self.ao_builds.retain(|_, b| b.strong_count() > 0);
        self.ao_builds.insert(key.clone(), Rc::downgrade(&build));
        Ok(Ao::Building(key, build))
    }

    /// What is at hand for a scene without computing anything, and whether it is what the scene asks for.
    pub(super) fn ao_at_hand(&mut self, resident: &ResidentVolume, scene: &Scene) -> (Option<Rc<Accessibility>>, bool) {
        let table = Self::ao_opacity_table(resident, scene);
        let key = AoKey::new(&scene.volume, &table, &scene.ambient_occlusion);
        match self.ao_cache.get(&key) {
            Some(exact) => (Some(exact), true),
            None => (self.ao_cache.latest_of(&scene.volume), false),
        }
    }

    fn ao_opacity_table(resident: &ResidentVolume, scene: &Scene) -> Vec<u16> {
        let volume = &resident.volume;
        opacity_table(&scene.transfer_function, &volume.code_map, volume.grid.smallest_spacing())
    }

    /// Takes the result of a finished build; any job that waits for it may be the first to come.
    pub(super) fn finish_ao(
        &mut self,
        key: &AoKey,
        build: &RefCell<AoBuild>,
    ) -> Result<Option<Rc<Accessibility>>, RenderError> {
        if let Some(accessibility) = self.ao_cache.get(key) {
            return Ok(Some(accessibility));
        }
        self.ao_builds.remove(key);
        let finished = build.borrow_mut().finish(&self.gpu, self.ao_versions + 1);
        let Some(accessibility) = self.with_resident(finished)?.map(Rc::new) else { return Ok(None) };
        self.ao_versions += 1;
        // A volume that was removed meanwhile has no further use for it.
        if self.volumes.contains_key(key.volume()) {
            self.ao_cache.insert(key.clone(), accessibility.clone());
        }
        Ok(Some(accessibility))
    }

    /// Drops a cached result so that what failed can be tried again; false where that would not help.
    pub(super) fn make_room(&mut self, error: &RenderError) -> bool {
        let RenderError::DoesNotFit { needed_bytes, .. } = error else { return false };
        let budget = &self.gpu.budget;
        let without_cache = budget.used_bytes() - budget.used_by(Category::AoCache);
        without_cache.saturating_add(*needed_bytes) <= budget.limit_bytes() && self.ao_cache.evict_one()
    }

    /// Adds what is resident to an out-of-memory error.
    pub(super) fn with_resident<T>(&self, result: Result<T, GpuError>) -> Result<T, RenderError> {
        result.map_err(|e| self.explain(e.into()))
    }

    pub(super) fn explain(&self, mut error: RenderError) -> RenderError {
        if let RenderError::DoesNotFit { resident, .. } = &mut error {
            *resident = self.volumes.iter().map(|(id, v)| (id.clone(), v.bytes())).collect();
        }
        error
    }

    pub(super) fn transfer_table(resident: &ResidentVolume, scene: &Scene) -> TransferTable {
        let grid = &resident.volume.grid;
        let step = super::raycast::step_length(scene, grid);
        TransferTable::new(&scene.transfer_function, &resident.volume.code_map, step, grid.smallest_spacing())
    }

    pub(super) fn occupancy(resident: &ResidentVolume, table: &TransferTable) -> Vec<u8> {
        let ranges = &resident.brick_ranges;
        brick_distance(ranges.dims, |brick| {
            let [low, high] = ranges.ranges[brick];
            table.any_visible(low, high)
        })
    }

    fn ao_source(&self, resident: &ResidentVolume, scene: &Scene) -> AoSource {
        let volume = &resident.volume;
        let brick_distance = match scene.ambient_occlusion.method {
            AoMethod::Raytraced => Self::occupancy(resident, &Self::transfer_table(resident, scene)),
            AoMethod::Off | AoMethod::Spao => Vec::new(),
        };
        AoSource {
            values: resident.values.clone(),
            code_scale: resident.code_scale,
            max_code: volume.code_map.max_code,
            opacity_table: Rc::new(Self::ao_opacity_table(resident, scene)),
            brick_distance: Rc::new(brick_distance),
            bricks: resident.brick_ranges.dims,
        }
    }
}

/// Ambient occlusion of a picture.
#[derive(Debug)]
pub(super) enum Ao {
    Off,
    Ready(Rc<Accessibility>),
    Building(AoKey, Rc<RefCell<AoBuild>>),
}

impl RaycastStages {
    /// The variant for a volume's values, with or without ambient occlusion.
    pub(super) fn choose(&self, occluded: bool, values: &GpuTexture) -> &ComputeStage {
        let (with, without) = match &self.texels {
            Some((with, without)) if !values.is_filterable() => (with, without),
            _ => (&self.occluded, &self.open),
        };
        if occluded { with } else { without }
    }
}

impl Stages {
    fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let raycast = |occluded: f64, replaced: &[(&str, &str)]| {
            ComputeStage::new(gpu, "raycast", &[], replaced, &[("OCCLUDED", occluded)])
        };
        let by_hand = [("common/value_filtered", "common/value_texels")];
        let texels =
            if gpu.texture_16bit_norm { None } else { Some((raycast(1.0, &by_hand)?, raycast(0.0, &by_hand)?)) };
        let linear_sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("linear"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let usage = wgpu::TextureUsages::TEXTURE_BINDING;
        let white = gpu.texture_3d("white", Category::Frame, [1; 3], wgpu::TextureFormat::R8Unorm, usage)?;
        Ok(Self {
            gradient: ComputeStage::new(gpu, "gradient", &[], &[], &[])?,
            raycast: RaycastStages { occluded: raycast(1.0, &[])?, open: raycast(0.0, &[])?, texels },
            ao: AoStages::new(gpu)?,
            linear_sampler,
            white,
        })
    }
}

fn describe(gpu: &Gpu) -> RendererInfo {
    RendererInfo {
        adapter: gpu.adapter.name.clone(),
        backend: gpu.adapter.backend.to_string(),
        driver: gpu.adapter.driver.clone(),
        driver_info: gpu.adapter.driver_info.clone(),
        software: gpu.is_software(),
        texture_16bit_norm: gpu.texture_16bit_norm,
        max_volume_axis: gpu.limits.max_texture_dimension_3d,
        max_storage_binding_bytes: gpu.limits.max_storage_buffer_binding_size,
        max_buffer_bytes: gpu.limits.max_buffer_size,
    }
}

impl From<GpuError> for RenderError {
    fn from(error: GpuError) -> Self {
        match error {
            GpuError::NoAdapter(message) => Self::NoAdapter(message),
            GpuError::OutOfMemory { what, needed_bytes, budget_bytes, .. } => {
                Self::DoesNotFit { what, needed_bytes, budget_bytes, resident: Vec::new() }
            }
            GpuError::Device(message) => Self::Device(message),
            GpuError::Lost(_) => Self::Gone,
        }
    }
}
