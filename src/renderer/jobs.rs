//! Jobs: state machines that do a slice of work each time they are advanced.

use std::cell::RefCell;
use std::rc::Rc;
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::exposure::exposure;
use super::occlusion::{AtHand, Coverage, Wish};
use super::raycast::{depth_prefix, raycast_params};
use super::request::{
    AccessibilityVolume, AoPolicy, AoReport, AoState, AoUpdate, Frame, FrameRequest, RenderError, StageTimings,
};
use super::resident::ResidentVolume;
use super::volumes::Needed;
use super::work::{Renderer, Turn};
use crate::ao::{Accessibility, AoBuild, AoKey};
use crate::gpu::{Binding, Category, Gpu, GpuError, GpuTexture, Recorder};
use crate::scene::{AoMethod, Scene};

/// The part that pictures and downloads share: from a scene to its accessibility volume.
#[derive(Debug)]
struct AoProgress {
    coverage: Coverage,
    build: Option<(AoKey, Rc<RefCell<AoBuild>>)>,
    elapsed: Duration,
}

/// Accessibility of a scene, `None` where it is off, and how it came about.
type Finished = (Option<AtHand>, AoReport);

impl AoProgress {
    fn new(coverage: Coverage) -> Self {
        Self { coverage, build: None, elapsed: Duration::ZERO }
    }

    fn advance(
        &mut self,
        renderer: &mut Renderer,
        resident: &ResidentVolume,
        scene: &Scene,
    ) -> Result<Turn<Finished>, RenderError> {
        let begin = Instant::now();
        let (key, build) = match &self.build {
            Some(build) => build.clone(),
            None => {
                if scene.ambient_occlusion.method == AoMethod::Off {
                    return Ok(Turn::Done((None, report(resident, AoState::Off, AoUpdate::Off))));
                }
                let Some(begun) = self.begin(renderer, resident, scene)? else { return Ok(Turn::Pending(0.0)) };
                match begun {
                    Begun::Finished(result) => {
                        let report =
                            AoReport { version: result.version, ..report(resident, AoState::Exact, AoUpdate::Cached) };
                        return Ok(Turn::Done((Some(at_hand_of(&result)), report)));
                    }
                    Begun::Build(key, build) => self.build.insert((key, build)).clone(),
                }
            }
        };
        let turn = build.borrow_mut().advance(&renderer.gpu, &renderer.stages.ao);
        let finished = renderer.with_resident(turn)?;
        self.elapsed += begin.elapsed();
        if !finished {
            return Ok(Turn::Pending(build.borrow().fraction()));
        }
        // A volume that was removed meanwhile has no further use for the result.
        let keep = renderer.volumes.knows(key.volume());
        let result = renderer.occlusion.finish(&renderer.gpu, &key, &build, keep);
        let Some((result, work)) = renderer.with_resident(result)? else { return Ok(Turn::Pending(1.0)) };
        // What comes next may update the same pyramid.
        self.build = None;
        let report = AoReport {
            version: result.version,
            bricks_classified: work.classified,
            bricks_recomputed: work.recomputed,
            elapsed: self.elapsed,
            ..report(resident, AoState::Exact, if work.incremental { AoUpdate::Incremental } else { AoUpdate::Full })
        };
        Ok(Turn::Done((Some(at_hand_of(&result)), report)))
    }

    /// Looks for a result, else joins or begins a build; `None` while an update of another kind has to be waited for.
    fn begin(
        &self,
        renderer: &mut Renderer,
        resident: &ResidentVolume,
        scene: &Scene,
    ) -> Result<Option<Begun>, RenderError> {
        let wish = Wish::new(resident, scene, self.coverage);
        if let Some(result) = renderer.occlusion.finished(&wish.key) {
            return Ok(Some(Begun::Finished(result)));
        }
        let key = wish.key.clone();
        if let Some(build) = renderer.occlusion.under_way(&key) {
            return Ok(Some(Begun::Build(key, build)));
        }
        let pyramid = loop {
            let pyramid = renderer.occlusion.pyramid(&renderer.gpu, &wish);
            match renderer.with_resident(pyramid) {
                Err(error) if renderer.make_room(&error) => {}
                result => break result?,
            }
        };
        let Some(pyramid) = pyramid else { return Ok(None) };
        // Held from here on: room for the rest of the build is not made of the pyramid that it starts from.
        loop {
            let build = renderer.occlusion.build(&renderer.gpu, &renderer.stages.ao, wish.clone(), pyramid.clone());
            match renderer.with_resident(build) {
                Err(error) if renderer.make_room(&error) => {}
                result => return Ok(Some(Begun::Build(key, result?))),
            }
        }
    }
}

/// How a wish for accessibility begins.
enum Begun {
    Finished(Rc<Accessibility>),
    Build(AoKey, Rc<RefCell<AoBuild>>),
}

fn at_hand_of(result: &Accessibility) -> AtHand {
    AtHand { texture: result.texture.clone(), surface_reference: result.surface_reference, version: result.version }
}

/// A report of nothing done.
fn report(resident: &ResidentVolume, state: AoState, update: AoUpdate) -> AoReport {
    AoReport {
        state,
        update,
        version: 0,
        bricks: resident.contents.ranges.len() as u64,
        bricks_classified: 0,
        bricks_recomputed: 0,
        elapsed: Duration::ZERO,
    }
}

/// What can be used at once, exact or not.
fn at_hand(renderer: &mut Renderer, resident: &ResidentVolume, scene: &Scene) -> Finished {
    if scene.ambient_occlusion.method == AoMethod::Off {
        return (None, report(resident, AoState::Off, AoUpdate::Off));
    }
    let (result, exact) = renderer.occlusion.at_hand(&Wish::new(resident, scene, Coverage::Visible).key);
    let state = if exact { AoState::Exact } else { AoState::Refining };
    let update = if result.is_some() { AoUpdate::Cached } else { AoUpdate::Off };
    let version = result.as_ref().map_or(0, |r| r.version);
    (result, AoReport { version, ..report(resident, state, update) })
}

/// One picture.
#[derive(Debug)]
pub struct FrameJob {
    request: FrameRequest,
    volume: Needed,
    ao: AoProgress,
}

impl FrameJob {
    /// Nothing is done yet.
    pub fn new(request: FrameRequest) -> Self {
        let volume = Needed::new(request.scene.volume.clone());
        Self { request, volume, ao: AoProgress::new(Coverage::Visible) }
    }

    /// Does a slice of the work.
    ///
    /// # Errors
    /// Any [`RenderError`] of this picture.
    pub fn advance(&mut self, renderer: &mut Renderer) -> Result<Turn<Frame>, RenderError> {
        let resident = match self.volume.advance(renderer)? {
            Turn::Pending(fraction) => return Ok(Turn::Pending(fraction)),
            Turn::Done(resident) => resident,
        };
        let (accessibility, ao) = match self.request.ao_policy {
            AoPolicy::AtHand => at_hand(renderer, &resident, &self.request.scene),
            AoPolicy::Exact => match self.ao.advance(renderer, &resident, &self.request.scene)? {
                Turn::Pending(fraction) => return Ok(Turn::Pending(fraction)),
                Turn::Done(done) => done,
            },
        };
        loop {
            let result = draw(renderer, &resident, &self.request, accessibility.as_ref(), ao);
            match renderer.with_resident(result) {
                Err(error) if renderer.make_room(&error) => {}
                result => break result.map(Turn::Done),
            }
        }
    }
}

/// Casts the rays and brings the picture back.
fn draw(
    renderer: &Renderer,
    resident: &ResidentVolume,
    request: &FrameRequest,
    accessibility: Option<&AtHand>,
    ao: AoReport,
) -> Result<Frame, GpuError> {
    let (gpu, stages) = (&renderer.gpu, &renderer.stages);
    let FrameRequest { scene, width, height, .. } = request;
    let begin = Instant::now();
    let table = resident.transfer_table(scene);
    let distance = resident.occupancy(&table);
    let size = [*width, *height];
    let bricks = resident.contents.dims;
    let exposure = exposure(scene, accessibility.map_or(1.0, |a| a.surface_reference));
    let params = raycast_params(scene, &resident.volume.grid, &table, resident.code_scale, bricks, size, exposure);
    let bytes = u64::from(*width) * u64::from(*height) * 4;
    let storage = |label, data: &[u8]| gpu.storage_with(label, Category::Frame, data);
    let distance = storage("brick distance", &distance)?;
    let depths = storage("depth table", bytemuck::cast_slice(&depth_prefix(&table)))?;
    let colors = storage("color table", bytemuck::cast_slice(&table.color))?;
    let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC;
    let picture = gpu.buffer("picture", Category::Frame, bytes, usage)?;
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let readback = gpu.buffer("picture read-back", Category::Frame, bytes, usage)?;
    gpu.guarded("ray casting", || {
        let mut recorder = Recorder::new(gpu, "raycast");
        let bindings = [
            (1, Binding::Texture(&resident.values.view)),
            (2, Binding::Sampler(&stages.linear_sampler)),
            (3, Binding::Texture(&resident.gradients.view)),
            (4, Binding::Texture(&accessibility.map_or(&stages.white, |a| &a.texture).view)),
            (5, Binding::Buffer(&distance.raw)),
            (6, Binding::Buffer(&depths.raw)),
            (7, Binding::Buffer(&colors.raw)),
            (8, Binding::Buffer(&picture.raw)),
        ];
        let stage = stages.raycast.choose(accessibility.is_some(), &resident.values);
        stage.record(gpu, &mut recorder, &params, &bindings, [*width, *height, 1])?;
        recorder.run(gpu)?;
        let raycast = begin.elapsed();
        let mut recorder = Recorder::new(gpu, "read-back");
        recorder.copy(&picture, &readback, bytes);
        let rgba = recorder.run_and_read(gpu, &readback, bytes, <[u8]>::to_vec)?;
        let timings =
            StageTimings { queue: Duration::ZERO, ao: ao.elapsed, raycast, readback: begin.elapsed() - raycast };
        Ok(Frame { width: *width, height: *height, rgba, timings, ao })
    })
}

/// A scene's ambient occlusion, so that its next exact picture need not wait for it.
#[derive(Debug)]
pub struct PrepareJob {
    scene: Arc<Scene>,
    volume: Needed,
    ao: AoProgress,
}

impl PrepareJob {
    /// Nothing is done yet.
    pub fn new(scene: Arc<Scene>) -> Self {
        Self::covering(scene, Coverage::Visible)
    }

    fn covering(scene: Arc<Scene>, coverage: Coverage) -> Self {
        Self { volume: Needed::new(scene.volume.clone()), scene, ao: AoProgress::new(coverage) }
    }

    /// Does a slice of the work.
    ///
    /// # Errors
    /// Any [`RenderError`] of this job.
    pub fn advance(&mut self, renderer: &mut Renderer) -> Result<Turn<AoReport>, RenderError> {
        Ok(match self.compute(renderer)? {
            Turn::Pending(fraction) => Turn::Pending(fraction),
            Turn::Done((_, (_, report))) => Turn::Done(report),
        })
    }

    /// As [`Self::advance`], with the volume and the accessibility itself.
    fn compute(&mut self, renderer: &mut Renderer) -> Result<Turn<(Rc<ResidentVolume>, Finished)>, RenderError> {
        let resident = match self.volume.advance(renderer)? {
            Turn::Pending(fraction) => return Ok(Turn::Pending(fraction)),
            Turn::Done(resident) => resident,
        };
        Ok(match self.ao.advance(renderer, &resident, &self.scene)? {
            Turn::Pending(fraction) => Turn::Pending(fraction),
            Turn::Done(finished) => Turn::Done((resident, finished)),
        })
    }
}

/// A download of accessibility.
#[derive(Debug)]
pub struct AccessibilityJob(PrepareJob);

impl AccessibilityJob {
    /// Nothing is done yet.
    pub fn new(scene: Arc<Scene>) -> Self {
        Self(PrepareJob::covering(scene, Coverage::Everywhere))
    }

    /// Does a slice of the work.
    ///
    /// # Errors
    /// Any [`RenderError`] of this job.
    pub fn advance(&mut self, renderer: &mut Renderer) -> Result<Turn<AccessibilityVolume>, RenderError> {
        let (resident, (accessibility, ao)) = match self.0.compute(renderer)? {
            Turn::Pending(fraction) => return Ok(Turn::Pending(fraction)),
            Turn::Done(done) => done,
        };
        let begin = Instant::now();
        let dims = resident.volume.grid.dims;
        let values = match accessibility {
            None => vec![1.0; usize::try_from(resident.volume.grid.voxel_count()).unwrap_or(0)],
            Some(result) => renderer.with_resident(read_accessibility(&renderer.gpu, &result.texture))?,
        };
        let timings = StageTimings { ao: ao.elapsed, readback: begin.elapsed(), ..StageTimings::default() };
        // Samples lie at voxel centres.
        Ok(Turn::Done(AccessibilityVolume { dims, values, first: [0.5; 3], step: [1.0; 3], timings }))
    }
}

/// Reads a texture of 16-bit samples slice by slice, so that the read-back buffer stays small.
pub(super) fn read_accessibility(gpu: &Gpu, texture: &GpuTexture) -> Result<Vec<f32>, GpuError> {
    let [x, y, z] = texture.dims();
    let row_bytes = (2 * x).next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let bytes = u64::from(row_bytes) * u64::from(y);
    let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
    let buffer = gpu.buffer("accessibility read-back", Category::Frame, bytes, usage)?;
    let decode: fn([u8; 2]) -> f32 = match texture.format() {
        wgpu::TextureFormat::R16Float => |a| half::f16::from_le_bytes(a).to_f32(),
        _ => |a| f32::from(u16::from_le_bytes(a)) / 65535.0,
    };
    let mut values = Vec::with_capacity(x as usize * y as usize * z as usize);
    for slice in 0..z {
        gpu.guarded("reading accessibility", || {
            let mut recorder = Recorder::new(gpu, "accessibility read-back");
            recorder.encoder.copy_texture_to_buffer(
                wgpu::TexelCopyTextureInfo {
                    texture: &texture.raw,
                    mip_level: 0,
                    origin: wgpu::Origin3d { x: 0, y: 0, z: slice },
                    aspect: wgpu::TextureAspect::All,
                },
                wgpu::TexelCopyBufferInfo {
                    buffer: &buffer.raw,
                    layout: wgpu::TexelCopyBufferLayout {
                        offset: 0,
                        bytes_per_row: Some(row_bytes),
                        rows_per_image: Some(y),
                    },
                },
                wgpu::Extent3d { width: x, height: y, depth_or_array_layers: 1 },
            );
            recorder.run_and_read(gpu, &buffer, bytes, |data| {
                for row in data.chunks_exact(row_bytes as usize) {
                    values.extend(row[..2 * x as usize].chunks_exact(2).map(|a| decode([a[0], a[1]])));
                }
            })
        })?;
    }
    Ok(values)
}
