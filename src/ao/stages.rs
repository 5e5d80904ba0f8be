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
        let half_word = |yes: bool| [("SHIFT_BY_HALF_WORD", f64::from(u8::from(yes)))];
        let half_floats = f64::from(u8::from(sample_format(gpu) == wgpu::TextureFormat::R16Float));
        let packed = [("HALF_FLOATS", half_floats)];
        Ok(Self {
            half_floats,
            surface: ComputeStage::new(gpu, "ao_surface", &[], &[], &packed)?,
            classify: ComputeStage::new(gpu, "ao_classify", &[], &[], &[])?,
            mipmap_level: ComputeStage::new(gpu, "ao_mipmap_level", &[], &[], &[])?,
            nbuffer_first_level: ComputeStage::new(gpu, "ao_nbuffer_level", &[], &[], &half_word(true))?,
            nbuffer_level: ComputeStage::new(gpu, "ao_nbuffer_level", &[], &[], &half_word(false))?,
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
        let stage = Rc::new(ComputeStage::new(gpu, "ao_spao", &[("LEVELS", levels)], &[], &constants)?);
        self.spao.borrow_mut().insert((levels, offset), stage.clone());
        Ok(stage)
    }
}
