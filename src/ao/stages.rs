//! The compiled passes of ambient occlusion.

use std::cell::RefCell;
use std::collections::HashMap;
use std::rc::Rc;

use crate::gpu::{ComputeStage, Gpu, GpuError};

/// Pipelines, compiled once. `ao_spao` has one per number of levels and with or without the normal's offset.
#[derive(Debug)]
pub struct AoStages {
    pub(super) classify: ComputeStage,
    pub(super) mipmap_level: ComputeStage,
    pub(super) nbuffer_first_level: ComputeStage,
    pub(super) nbuffer_level: ComputeStage,
    pub(super) nbuffer_subsampled_level: ComputeStage,
    pub(super) collect: ComputeStage,
    pub(super) collect_bricks: ComputeStage,
    pub(super) linear_sampler: wgpu::Sampler,
    /// Levels are looked up through the texture unit.
    pub(super) sampled: bool,
    pub(super) raytraced: ComputeStage,
    pub(super) surface: ComputeStage,
    half_floats: f64,
    spao: RefCell<HashMap<(u32, bool), Rc<ComputeStage>>>,
}

/// Format of accessibility volumes. Sixteen bits: deep cavities have small values, which exposure makes large.
pub(super) fn sample_format(gpu: &Gpu) -> wgpu::TextureFormat {
    if gpu.texture_16bit_norm { wgpu::TextureFormat::R16Unorm } else { wgpu::TextureFormat::R16Float }
}

impl AoStages {
    /// Compiles the passes.
    ///
    /// # Errors
    /// [`GpuError::Device`] naming the shader.
    pub fn new(gpu: &Gpu) -> Result<Self, GpuError> {
        let linear_sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
            label: Some("ao levels"),
            mag_filter: wgpu::FilterMode::Linear,
            min_filter: wgpu::FilterMode::Linear,
            ..Default::default()
        });
        let half_floats = f64::from(u8::from(sample_format(gpu) == wgpu::TextureFormat::R16Float));
        let packed = [("HALF_FLOATS", half_floats)];
        Ok(Self {
            half_floats,
            linear_sampler,
            sampled: gpu.texture_16bit_norm,
            surface: ComputeStage::new(gpu, "ao_surface", &[], &[], &[])?,
            collect: ComputeStage::new(gpu, "ao_collect", &[], &[], &[])?,
            collect_bricks: ComputeStage::new(gpu, "ao_collect_bricks", &[], &[], &[])?,
            classify: ComputeStage::new(gpu, "ao_classify", &[], &[], &[])?,
            mipmap_level: ComputeStage::new(gpu, "ao_mipmap_level", &[], &[], &[])?,
            nbuffer_first_level: ComputeStage::new(gpu, "ao_nbuffer_level", &[], &[], &[("SHIFT_BY_HALF_WORD", 1.0)])?,
            nbuffer_level: ComputeStage::new(gpu, "ao_nbuffer_level", &[], &[], &[])?,
            nbuffer_subsampled_level: ComputeStage::new(gpu, "ao_nbuffer_level", &[], &[], &[("SUBSAMPLED", 1.0)])?,
            raytraced: ComputeStage::new(gpu, "ao_raytraced", &[], &[], &packed)?,
            spao: RefCell::default(),
        })
    }

    /// The combining pass for `levels` levels; compiled when first asked for.
    pub(super) fn spao(&self, gpu: &Gpu, levels: u32, normal_factor: f64) -> Result<Rc<ComputeStage>, GpuError> {
        let offset = normal_factor != 0.0;
        if let Some(stage) = self.spao.borrow().get(&(levels, offset)) {
            return Ok(stage.clone());
        }
        let constants = [("OFFSET_BY_NORMAL", f64::from(u8::from(offset))), ("HALF_FLOATS", self.half_floats)];
        // The sampled variant packs nothing.
        let constants = &constants[..if self.sampled { 1 } else { 2 }];
        let by_hand = [("common/spao_sampled", "common/spao_words")];
        let replaced: &[_] = if self.sampled { &[] } else { &by_hand };
        let stage = Rc::new(ComputeStage::new(gpu, "ao_spao", &[("LEVELS", levels)], replaced, constants)?);
        self.spao.borrow_mut().insert((levels, offset), stage.clone());
        Ok(stage)
    }
}
