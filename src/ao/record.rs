//! The commands of each step of a build.

use std::ops::Range;

use super::build::{AoBuild, DISPATCH_WORDS};
use super::params::{
    ClassifyParams, CollectBricksParams, CollectParams, LevelBlocks, LevelInfo, MAX_LEVELS, MipmapParams,
    NBufferParams, SpaoParams,
};
use super::plan::Step;
use super::pyramid::Pyramid;
use super::stages::AoStages;
use crate::gpu::{Binding, Gpu, GpuError, Recorder};
use crate::volume::BRICK;

impl AoBuild {
    /// What comes before the first step: the result begins as the last one was.
    pub(super) fn record_begin(&self, recorder: &mut Recorder) {
        if let Some(base) = &self.base {
            let size =
                wgpu::Extent3d { width: self.dims[0], height: self.dims[1], depth_or_array_layers: self.dims[2] };
            let (from, to) = (base.texture.raw.as_image_copy(), self.target.raw.as_image_copy());
            recorder.encoder.copy_texture_to_texture(from, to, size);
        }
    }

    pub(super) fn record(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        number: u32,
        step: &Step,
    ) -> Result<(), GpuError> {
        let pyramid = &*self.pyramid.borrow();
        match step {
            Step::Level { level, layers, candidates } => {
                let level = *level as usize;
                self.record_collect(gpu, stages, recorder, pyramid, (number, level, candidates))?;
                self.record_level(gpu, stages, recorder, pyramid, (number, level, layers))?;
                if pyramid.is_mirrored() {
                    let slices = pyramid.layouts[level].slices_of(layers);
                    copy_window(recorder, pyramid, level, slices.clone(), slices.start);
                }
                Ok(())
            }
            Step::Combine { layers, candidates } => {
                self.record_collect_bricks(gpu, stages, recorder, pyramid, (number, candidates))?;
                self.record_combine(gpu, stages, recorder, pyramid, (number, layers))
            }
            Step::Surface { layers, bricks } => {
                let slices = pyramid.cuts(gpu, stages.sampled, &self.settings).surface_slices(layers);
                let window = (slices.start, window(pyramid, 0, slices));
                let first = self.work.levels.iter().chain([&self.work.bricks]).map(Vec::len).sum::<usize>() as u32;
                let list = first + bricks.start..first + bricks.end;
                self.surface.record(
                    gpu,
                    stages,
                    recorder,
                    &pyramid.layouts[0],
                    window,
                    (&self.target, &self.candidates, list),
                )
            }
            Step::Trace(rows) => {
                let Some(tracer) = &self.tracer else { return Ok(()) };
                let level = (&pyramid.layouts[0], &pyramid.levels[0]);
                let Some(samples) = &self.samples else { return Ok(()) };
                tracer.record(gpu, stages, recorder, level, rows.clone(), samples, self.row_words)?;
                let origin = wgpu::Origin3d { x: 0, y: rows.start % self.dims[1], z: rows.start / self.dims[1] };
                self.copy_samples(recorder, origin, rows.end - rows.start, 1, Direction::ToTarget);
                Ok(())
            }
        }
    }

    fn record_collect(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        pyramid: &Pyramid,
        (number, level, candidates): (u32, usize, &Range<u32>),
    ) -> Result<(), GpuError> {
        let layout = &pyramid.layouts[level];
        // Level 0 has no source; all its candidates must be done.
        let before = level.saturating_sub(1);
        let source = &pyramid.layouts[before];
        let first = self.work.levels[..level].iter().map(Vec::len).sum::<usize>() as u32;
        let params = CollectParams {
            tiles: layout.tiles(),
            tile: layout.tile,
            source_blocks: source.blocks(),
            source_extent: source.extent,
            first_flag: pyramid.first_flags[before],
            first_candidate: first + candidates.start,
            candidate_count: candidates.len() as u32,
            scale: layout.source.map_or(1, |s| s.scale as i32),
            offset: layout.source.map_or(0, |s| s.offset),
            distance: layout.source.map_or(0, |s| s.distance as i32),
            dispatch: DISPATCH_WORDS * number,
            _padding: 0,
        };
        let bindings = [
            (1, Binding::Buffer(&self.candidates.raw)),
            (2, Binding::Buffer(&pyramid.changed.raw)),
            (3, Binding::Buffer(&pyramid.list.raw)),
            (4, Binding::Buffer(&self.dispatches.raw)),
        ];
        stages.collect.record(gpu, recorder, &params, &bindings, [params.candidate_count, 1, 1])
    }

    fn record_level(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        pyramid: &Pyramid,
        (number, level, layers): (u32, usize, &Range<u32>),
    ) -> Result<(), GpuError> {
        let layout = &pyramid.layouts[level];
        let slices = layout.slices_of(layers);
        let target = window(pyramid, level, slices.clone());
        let lists = [(3, Binding::Buffer(&pyramid.list.raw)), (4, Binding::Buffer(&pyramid.changed.raw))];
        let dispatch = (&self.dispatches, 4 * u64::from(DISPATCH_WORDS * number));
        let Some(source) = layout.source else {
            let params = ClassifyParams {
                level: layout.info(slices.start),
                dims: self.dims,
                origin: layout.origin,
                tiles: layout.tiles(),
                code_scale: self.source.code_scale,
            };
            let bindings = [
                (1, Binding::Texture(&self.source.values.view)),
                (2, Binding::Buffer(&pyramid.opacity_table.raw)),
                (3, target),
                (4, Binding::Buffer(&pyramid.list.raw)),
                (5, Binding::Buffer(&pyramid.changed.raw)),
            ];
            return stages.classify.record_indirect(gpu, recorder, &params, &bindings, dispatch);
        };
        let from = pyramid.cuts(gpu, stages.sampled, &self.settings).source_slices(level, layers);
        let (source_info, target_level) = (pyramid.layouts[level - 1].info(from[0].start), layout.info(slices.start));
        let [list, changed] = lists;
        let mut bindings = vec![(2, target), list, changed];
        let (tiles, first_flag) = (layout.tiles(), pyramid.first_flags[level]);
        if layout.is_mip_level() {
            bindings.push((1, window(pyramid, level - 1, from[0].clone())));
            let params = MipmapParams {
                source: source_info,
                target_level,
                tiles,
                first_flag,
                offset: source.offset,
                _padding: [0; 3],
            };
            return stages.mipmap_level.record_indirect(gpu, recorder, &params, &bindings, dispatch);
        }
        bindings.extend((10..).zip(&from).map(|(number, slices)| (number, window(pyramid, level - 1, slices.clone()))));
        let [blocks_x, blocks_y, _] = layout.blocks();
        let params = NBufferParams {
            source: source_info,
            target_level,
            tiles,
            first_flag,
            rows_log2: layout.tile[1].trailing_zeros(),
            shift_log2: (source.distance / source.scale).trailing_zeros(),
            near: source.offset + source.distance as i32,
            _padding: 0,
            blocks: [blocks_x, blocks_y],
            _padding_2: [0; 2],
            first_slices: [0, 1, 2].map(|p: usize| from[p].start),
            _padding_3: 0,
        };
        let stage = match (source.scale, source.distance) {
            (1, 1) => &stages.nbuffer_first_level,
            (1, _) => &stages.nbuffer_level,
            _ => &stages.nbuffer_subsampled_level,
        };
        stage.record_indirect(gpu, recorder, &params, &bindings, dispatch)
    }

    fn record_collect_bricks(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        pyramid: &Pyramid,
        (number, candidates): (u32, &Range<u32>),
    ) -> Result<(), GpuError> {
        let mut levels = [bytemuck::Zeroable::zeroed(); MAX_LEVELS];
        let mut level_blocks = [bytemuck::Zeroable::zeroed(); MAX_LEVELS];
        for (level, layout) in pyramid.layouts.iter().enumerate() {
            levels[level] = layout.info(0);
            level_blocks[level] = LevelBlocks { blocks: layout.blocks(), first_flag: pyramid.first_flags[level] };
        }
        let first = self.work.levels.iter().map(Vec::len).sum::<usize>() as u32;
        let params = CollectBricksParams {
            levels,
            level_blocks,
            bricks: self.wanted.dims(),
            level_count: pyramid.layouts.len() as u32,
            first_candidate: first + candidates.start,
            candidate_count: candidates.len() as u32,
            dispatch: DISPATCH_WORDS * number,
            half_offset: (0.5 * self.settings.normal_factor) as f32,
        };
        let bindings = [
            (1, Binding::Buffer(&self.candidates.raw)),
            (2, Binding::Buffer(&pyramid.changed.raw)),
            (3, Binding::Buffer(&pyramid.list.raw)),
            (4, Binding::Buffer(&self.dispatches.raw)),
            (5, Binding::Buffer(&pyramid.steepest.raw)),
        ];
        stages.collect_bricks.record(gpu, recorder, &params, &bindings, [params.candidate_count, 1, 1])
    }

    fn record_combine(
        &self,
        gpu: &Gpu,
        stages: &AoStages,
        recorder: &mut Recorder,
        pyramid: &Pyramid,
        (number, layers): (u32, &Range<u32>),
    ) -> Result<(), GpuError> {
        let cuts = pyramid.cuts(gpu, stages.sampled, &self.settings);
        let mut levels: [LevelInfo; MAX_LEVELS] = [bytemuck::Zeroable::zeroed(); MAX_LEVELS];
        let mut inverse_sizes = [[0.0; 4]; MAX_LEVELS];
        let slab = cuts.slab(layers).unwrap_or_else(|| layers.clone());
        let fresh_windows = !pyramid.is_mirrored() && self.windows_hold.replace(Some(slab.start)) != Some(slab.start);
        let mut bindings =
            vec![(1, Binding::Texture(&self.source.values.view)), (3, Binding::Buffer(&pyramid.list.raw))];
        match &self.samples {
            Some(samples) => bindings.push((2, Binding::Buffer(&samples.raw))),
            None => {
                bindings.push((2, Binding::Texture(&self.target.view)));
                bindings.push((4, Binding::Sampler(&stages.linear_sampler)));
            }
        }
        for (binding, (level, layout)) in (10..).zip(pyramid.layouts.iter().enumerate()) {
            let slices = if pyramid.is_mirrored() { 0..layout.extent[2] } else { cuts.window(level, &slab) };
            levels[level] = layout.info(slices.start);
            if stages.sampled {
                let texture = &pyramid.windows[level];
                let [x, y, z] = texture.dims().map(|n| 1.0 / n as f32);
                inverse_sizes[level] = [x, y, z, 0.0];
                if fresh_windows {
                    copy_window(recorder, pyramid, level, slices, 0);
                }
                bindings.push((binding, Binding::Texture(&texture.view)));
            } else {
                bindings.push((binding, window(pyramid, level, slices)));
            }
        }
        let slices = slab.start * BRICK..(slab.end * BRICK).min(self.dims[2]);
        let params = SpaoParams {
            levels,
            inverse_sizes,
            dims: self.dims,
            first_slice: slices.start,
            bricks: self.wanted.dims(),
            row_words: self.row_words,
            normalise: self.source.normalise(),
            normal_factor: self.settings.normal_factor as f32,
            _padding: [0; 2],
        };
        let origin = wgpu::Origin3d { x: 0, y: 0, z: slices.start };
        let count = slices.end - slices.start;
        self.copy_samples(recorder, origin, self.dims[1], count, Direction::FromTarget);
        let stage = stages.spao(gpu, self.settings.levels, self.settings.normal_factor)?;
        let dispatch = (&self.dispatches, 4 * u64::from(DISPATCH_WORDS * number));
        stage.record_indirect(gpu, recorder, &params, &bindings, dispatch)?;
        self.copy_samples(recorder, origin, self.dims[1], count, Direction::ToTarget);
        Ok(())
    }

    fn copy_samples(
        &self,
        recorder: &mut Recorder,
        origin: wgpu::Origin3d,
        rows: u32,
        slices: u32,
        direction: Direction,
    ) {
        let Some(samples) = &self.samples else { return };
        let layout = wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(self.row_words * 4),
            rows_per_image: Some(rows),
        };
        let buffer = wgpu::TexelCopyBufferInfo { buffer: &samples.raw, layout };
        let texture = wgpu::TexelCopyTextureInfo { origin, ..self.target.raw.as_image_copy() };
        let size = wgpu::Extent3d { width: self.dims[0], height: rows, depth_or_array_layers: slices };
        match direction {
            Direction::ToTarget => recorder.encoder.copy_buffer_to_texture(buffer, texture, size),
            Direction::FromTarget => recorder.encoder.copy_texture_to_buffer(texture, buffer, size),
        }
    }
}

/// Which way samples are copied.
#[derive(Clone, Copy)]
enum Direction {
    ToTarget,
    FromTarget,
}

/// The slices of a level as a binding.
fn window(pyramid: &Pyramid, level: usize, slices: Range<u32>) -> Binding<'_> {
    let bytes = pyramid.layouts[level].slice_bytes();
    Binding::Slice(&pyramid.levels[level].raw, u64::from(slices.start) * bytes, slices.len() as u64 * bytes)
}

/// Copies slices of a level to where the texture unit can read them, from slice `to` on.
fn copy_window(recorder: &mut Recorder, pyramid: &Pyramid, level: usize, slices: Range<u32>, to: u32) {
    let layout = &pyramid.layouts[level];
    let [width, height, _] = layout.extent;
    let from = wgpu::TexelCopyBufferLayout {
        offset: u64::from(slices.start) * layout.slice_bytes(),
        bytes_per_row: Some(layout.row_words * 4),
        rows_per_image: Some(layout.slice_words / layout.row_words),
    };
    recorder.encoder.copy_buffer_to_texture(
        wgpu::TexelCopyBufferInfo { buffer: &pyramid.levels[level].raw, layout: from },
        wgpu::TexelCopyTextureInfo {
            origin: wgpu::Origin3d { x: 0, y: 0, z: to },
            ..pyramid.windows[level].raw.as_image_copy()
        },
        wgpu::Extent3d { width, height, depth_or_array_layers: slices.len() as u32 },
    );
}
