//! N-buffers in their plain form, the yardstick of the full build: a texture pass of eight look-ups for each level,
//! then a gather over all voxels (SPAO 1.2.3). Needs 16-bit normalised textures.

use std::time::{Duration, Instant};

use crate::ao::AoSource;
use crate::gpu::{Binding, Category, ComputeStage, Gpu, GpuError, GpuTexture, Recorder, uniform};
use crate::scene::AmbientOcclusion;

uniform! {
    /// Parameters of `bench_plain_classify`.
    PlainClassifyParams in "bench_plain_classify" {
        dims: [u32; 3],
        code_scale: f32,
    }
}

uniform! {
    /// Parameters of `bench_plain_level`.
    PlainLevelParams in "bench_plain_level" {
        dims: [u32; 3],
        far: i32,
        near: i32,
        _padding: [u32; 3],
    }
}

uniform! {
    /// Parameters of `bench_plain_gather`.
    PlainGatherParams in "bench_plain_gather" {
        dims: [u32; 3],
        normalise: f32,
        normal_factor: f32,
        _padding: [u32; 3],
    }
}

/// Compiled passes and textures.
pub(super) struct PlainForm {
    classify: ComputeStage,
    level: ComputeStage,
    gather: ComputeStage,
    levels: Vec<GpuTexture>,
    accessibility: GpuTexture,
    sampler: wgpu::Sampler,
}

impl PlainForm {
    pub(super) fn new(gpu: &Gpu, dims: [u32; 3], levels: u32) -> Result<Self, GpuError> {
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::STORAGE_BINDING;
        let format = wgpu::TextureFormat::R16Unorm;
        let texture = || gpu.texture_3d("plain level", Category::AoScratch, dims, format, usage);
        Ok(Self {
            classify: ComputeStage::new(gpu, "bench_plain_classify", &[], &[], &[])?,
            level: ComputeStage::new(gpu, "bench_plain_level", &[], &[], &[])?,
            gather: ComputeStage::new(gpu, "bench_plain_gather", &[("LEVELS", levels)], &[], &[])?,
            levels: (0..=levels).map(|_| texture()).collect::<Result<_, _>>()?,
            accessibility: texture()?,
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                ..Default::default()
            }),
        })
    }

    /// Computes accessibility everywhere; says how long that took.
    pub(super) fn run(&self, gpu: &Gpu, source: &AoSource, settings: &AmbientOcclusion) -> Result<Duration, GpuError> {
        let dims = source.values.dims();
        let mut table = bytemuck::cast_slice(&source.opacity_table).to_vec();
        table.resize(table.len().next_multiple_of(4), 0);
        let table = gpu.storage_with("plain opacity table", Category::AoScratch, &table)?;
        let begin = Instant::now();
        gpu.guarded("the plain form", || {
            let mut recorder = Recorder::new(gpu, "plain form");
            let params = PlainClassifyParams { dims, code_scale: source.code_scale };
            let bindings = [
                (1, Binding::Texture(&source.values.view)),
                (2, Binding::Buffer(&table.raw)),
                (3, Binding::Texture(&self.levels[0].view)),
            ];
            self.classify.record(gpu, &mut recorder, &params, &bindings, dims)?;
            for level in 1..self.levels.len() {
                // Texel i of level 0 is voxel i, of the others the window around the lower corner of voxel i.
                let (far, near) = if level == 1 { (-1, 0) } else { (-(1 << (level - 2)), 1 << (level - 2)) };
                let params = PlainLevelParams { dims, far, near, _padding: [0; 3] };
                let bindings = [
                    (1, Binding::Texture(&self.levels[level - 1].view)),
                    (2, Binding::Texture(&self.levels[level].view)),
                ];
                self.level.record(gpu, &mut recorder, &params, &bindings, dims)?;
            }
            let normal_factor = settings.normal_factor as f32;
            let params = PlainGatherParams { dims, normalise: source.normalise(), normal_factor, _padding: [0; 3] };
            let mut bindings = vec![
                (1, Binding::Texture(&source.values.view)),
                (2, Binding::Texture(&self.accessibility.view)),
                (3, Binding::Sampler(&self.sampler)),
            ];
            bindings.extend((10..).zip(&self.levels).map(|(at, level)| (at, Binding::Texture(&level.view))));
            self.gather.record(gpu, &mut recorder, &params, &bindings, dims)?;
            recorder.run(gpu)
        })?;
        Ok(begin.elapsed())
    }
}
