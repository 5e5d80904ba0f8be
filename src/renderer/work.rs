//! The renderer: what is resident, the compiled passes, and the pieces that jobs share.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;

use super::jobs::{AccessibilityJob, FrameJob};
use super::occlusion::{Coverage, Occlusion, Wish};
use super::request::{AccessibilityVolume, Frame, FrameRequest, MemoryUse, RenderError, RendererInfo, Residency};
use super::resident::ResidentVolume;
use super::volumes::{UploadJob, Volumes};
use crate::ao::{Accessibility, AoBuild, AoKey, AoSource, AoStages, Pyramid};
use crate::gpu::{Category, ComputeStage, Gpu, GpuError, GpuOptions, GpuTexture};
use crate::scene::Scene;
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
    pub(super) volumes: Volumes,
    pub(super) occlusion: Occlusion,
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
        Ok(Self { gpu, info, stages, volumes: Volumes::default(), occlusion: Occlusion::default() })
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
        self.occlusion.forget_volume(id);
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

    /// A build of a scene's ambient occlusion from nothing, past all that is kept, for measuring and for tests.
    /// The scene's method must not be `Off`.
    ///
    /// # Errors
    /// [`RenderError::UnknownVolume`], [`RenderError::DoesNotFit`].
    pub fn fresh_ao_build(&self, scene: &Scene, coverage: Coverage) -> Result<AoBuild, RenderError> {
        let pyramid = self.new_pyramid(scene)?;
        self.ao_update(scene, coverage, pyramid)
    }

    /// An update of a pyramid of the scene's volume and structure, past all that is kept.
    ///
    /// # Errors
    /// [`RenderError::UnknownVolume`], [`RenderError::DoesNotFit`].
    pub fn ao_update(
        &self,
        scene: &Scene,
        coverage: Coverage,
        pyramid: Rc<RefCell<Pyramid>>,
    ) -> Result<AoBuild, RenderError> {
        let resident = self.resident(&scene.volume)?;
        Ok(Wish::new(&resident, scene, coverage).build(&self.gpu, &self.stages.ao, pyramid)?)
    }

    /// What a build of the scene's ambient occlusion reads.
    ///
    /// # Errors
    /// [`RenderError::UnknownVolume`].
    pub fn ao_source(&self, scene: &Scene) -> Result<AoSource, RenderError> {
        Ok(Wish::new(&*self.resident(&scene.volume)?, scene, Coverage::Visible).source)
    }

    /// What the scene's ambient occlusion is known by.
    ///
    /// # Errors
    /// [`RenderError::UnknownVolume`].
    pub fn ao_key(&self, scene: &Scene) -> Result<AoKey, RenderError> {
        Ok(Wish::new(&*self.resident(&scene.volume)?, scene, Coverage::Visible).key)
    }

    /// The samples of a finished result, x fastest, in [0, 1].
    ///
    /// # Errors
    /// [`RenderError::Device`], [`RenderError::DoesNotFit`].
    pub fn read_accessibility(&self, result: &Accessibility) -> Result<Vec<f32>, RenderError> {
        Ok(super::jobs::read_accessibility(&self.gpu, &result.texture)?)
    }

    /// A pyramid of the scene's volume and structure that holds nothing yet, for measuring and for tests.
    ///
    /// # Errors
    /// [`RenderError::UnknownVolume`], [`RenderError::DoesNotFit`].
    pub fn new_pyramid(&self, scene: &Scene) -> Result<Rc<RefCell<Pyramid>>, RenderError> {
        let resident = self.resident(&scene.volume)?;
        Ok(Wish::new(&resident, scene, Coverage::Visible).new_pyramid(&self.gpu)?)
    }

    /// The device and the passes that a build is advanced with.
    pub fn ao_tools(&self) -> (&Gpu, &AoStages) {
        (&self.gpu, &self.stages.ao)
    }

    pub(super) fn keep_volume(&mut self, id: VolumeId, resident: ResidentVolume) {
        // What was derived from an earlier volume of this name is of no use for the new one.
        self.remove_volume(&id);
        self.volumes.insert(id, resident);
    }

    /// Volumes on the GPU and their bytes; the others are in host memory.
    pub fn residents(&self) -> Vec<(VolumeId, u64)> {
        self.volumes.residents()
    }

    /// Volumes on their way back to the GPU, and the share that is there.
    pub fn arriving(&self) -> Vec<(VolumeId, f64)> {
        self.volumes.arriving()
    }

    /// A volume that is on the GPU.
    fn resident(&self, id: &VolumeId) -> Result<Rc<ResidentVolume>, RenderError> {
        self.volumes.peek(id).ok_or_else(|| RenderError::UnknownVolume(id.clone()))
    }

    /// Makes room for what failed, so that it can be tried again; false where that would not help. What can be
    /// computed again goes first, then volumes that nobody looks at now.
    pub(super) fn make_room(&mut self, error: &RenderError) -> bool {
        let RenderError::DoesNotFit { needed_bytes, .. } = error else { return false };
        let budget = &self.gpu.budget;
        let evictable = self.occlusion.evictable_bytes() + self.volumes.evictable_bytes();
        let kept = budget.used_bytes().saturating_sub(evictable);
        kept.saturating_add(*needed_bytes) <= budget.limit_bytes()
            && (self.occlusion.evict_one() || self.volumes.evict_one())
    }

    /// Adds what is resident to an out-of-memory error.
    pub(super) fn with_resident<T>(&self, result: Result<T, GpuError>) -> Result<T, RenderError> {
        result.map_err(|e| self.explain(e.into()))
    }

    pub(super) fn explain(&self, mut error: RenderError) -> RenderError {
        if let RenderError::DoesNotFit { resident, .. } = &mut error {
            *resident = self.volumes.residents();
        }
        error
    }
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
