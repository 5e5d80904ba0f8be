//! A volume on the GPU.

use std::rc::Rc;
use std::sync::Arc;

use super::raycast::{GradientParams, gradient_basis};
use super::request::RenderError;
use crate::gpu::{Binding, Category, ComputeStage, Gpu, GpuError, GpuTexture, Recorder};
use crate::volume::{Bricks, Volume};

/// Voxels that are sent, or whose gradients are computed, in one go: bounds the staging memory and the time that
/// others wait. On two CPU cores it takes less than a picture, so that a stream keeps more than half of its pictures.
const SLAB_VOXELS: u64 = 1 << 20;

/// Longest gradient of the normalised value: three differences of half the range.
pub(super) const LONGEST_GRADIENT: f32 = 0.866_025_4;

/// Textures of one volume, and the host copy they can be rebuilt from.
#[derive(Debug)]
pub(super) struct ResidentVolume {
    pub(super) volume: Arc<Volume>,
    pub(super) values: Rc<GpuTexture>,
    pub(super) gradients: GpuTexture,
    pub(super) contents: Arc<Bricks>,
    /// Codes per stored value: 255 or 65535.
    pub(super) code_scale: f32,
}

impl ResidentVolume {
    pub(super) fn bytes(&self) -> u64 {
        self.values.bytes() + self.gradients.bytes()
    }
}

/// A volume on its way to the GPU, slab by slab.
#[derive(Debug)]
pub(super) struct Upload {
    resident: ResidentVolume,
    texel_bytes: u64,
    next_slice: u32,
    next_gradient_slice: u32,
    codes: Vec<u8>,
}

impl Upload {
    /// Checks and reserves.
    pub(super) fn new(gpu: &Gpu, volume: Arc<Volume>) -> Result<Self, RenderError> {
        let dims = volume.grid.dims;
        let limit = gpu.limits.max_texture_dimension_3d;
        if let Some((axis, &size)) = "xyz".chars().zip(&dims).find(|a| *a.1 > limit) {
            return Err(RenderError::AxisTooLong { axis, size, limit });
        }
        let (format, texel_bytes, code_scale) = value_format(gpu, &volume);
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST;
        let voxels = volume.grid.voxel_count();
        gpu.budget.check("the volume", voxels * (texel_bytes + 4))?;
        let values = gpu.texture_3d("values", Category::Volume, dims, format, usage)?;
        let usage = wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::STORAGE_BINDING;
        let gradients = gpu.texture_3d("gradients", Category::Volume, dims, wgpu::TextureFormat::Rgba8Snorm, usage)?;
        let contents = volume.bricks();
        let resident = ResidentVolume { volume, values: Rc::new(values), gradients, contents, code_scale };
        Ok(Self { resident, texel_bytes, next_slice: 0, next_gradient_slice: 0, codes: Vec::new() })
    }

    /// Sends or derives one slab; true when all is there.
    pub(super) fn advance(&mut self, gpu: &Gpu, gradient: &ComputeStage) -> Result<bool, GpuError> {
        let [x, y, z] = self.resident.volume.grid.dims;
        let slices = u32::try_from(SLAB_VOXELS / (u64::from(x) * u64::from(y))).unwrap_or(u32::MAX).max(1);
        gpu.guarded("uploading a volume", || {
            let mut recorder = Recorder::new(gpu, "upload");
            if self.next_slice < z {
                let end = z.min(self.next_slice + slices);
                self.write_slab(gpu, self.next_slice..end);
                self.next_slice = end;
            } else {
                let end = z.min(self.next_gradient_slice + slices);
                self.record_gradients(gpu, &mut recorder, gradient, self.next_gradient_slice..end)?;
                self.next_gradient_slice = end;
            }
            recorder.run(gpu)
        })?;
        Ok(self.next_gradient_slice == z)
    }

    /// Share that is done, in [0, 1].
    pub(super) fn fraction(&self) -> f64 {
        let slices = f64::from(self.resident.volume.grid.dims[2]);
        f64::from(self.next_slice + self.next_gradient_slice) / (2.0 * slices)
    }

    pub(super) fn finish(self) -> ResidentVolume {
        self.resident
    }

    fn write_slab(&mut self, gpu: &Gpu, slices: std::ops::Range<u32>) {
        let [x, y, _] = self.resident.volume.grid.dims;
        self.resident.volume.write_codes(slices.clone(), &mut self.codes);
        let widened;
        let data: &[u8] = if self.texel_bytes == 4 {
            // r32float holds the same numbers that a 16-bit normalised texture would give.
            widened = widen(&self.codes, self.resident.volume.code_map.bytes_per_voxel());
            bytemuck::cast_slice(&widened)
        } else {
            &self.codes
        };
        let row_bytes = u64::from(x) * self.texel_bytes;
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                texture: &self.resident.values.raw,
                mip_level: 0,
                origin: wgpu::Origin3d { x: 0, y: 0, z: slices.start },
                aspect: wgpu::TextureAspect::All,
            },
            data,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: u32::try_from(row_bytes).ok(),
                rows_per_image: Some(y),
            },
            wgpu::Extent3d { width: x, height: y, depth_or_array_layers: slices.end - slices.start },
        );
    }

    fn record_gradients(
        &self,
        gpu: &Gpu,
        recorder: &mut Recorder,
        stage: &ComputeStage,
        slices: std::ops::Range<u32>,
    ) -> Result<(), GpuError> {
        let resident = &self.resident;
        let max_code = resident.volume.code_map.max_code;
        let params = GradientParams {
            dims: resident.volume.grid.dims,
            first_slice: slices.start,
            normal_from_index: gradient_basis(&resident.volume.grid),
            normalise: if max_code == 0 { 0.0 } else { resident.code_scale / f32::from(max_code) },
            max_length: LONGEST_GRADIENT,
            _padding: [0; 2],
        };
        let bindings = [(1, Binding::Texture(&resident.values.view)), (2, Binding::Texture(&resident.gradients.view))];
        let [x, y, _] = params.dims;
        stage.record(gpu, recorder, &params, &bindings, [x, y, slices.end - slices.start])
    }
}

/// Format, bytes per texel and codes per stored value.
fn value_format(gpu: &Gpu, volume: &Volume) -> (wgpu::TextureFormat, u64, f32) {
    if !gpu.texture_16bit_norm && volume.code_map.bytes_per_voxel() == 2 {
        (wgpu::TextureFormat::R32Float, 4, 65535.0)
    } else if volume.code_map.bytes_per_voxel() == 2 {
        (wgpu::TextureFormat::R16Unorm, 2, 65535.0)
    } else {
        (wgpu::TextureFormat::R8Unorm, 1, 255.0)
    }
}

fn widen(codes: &[u8], bytes_per_code: u64) -> Vec<f32> {
    debug_assert_eq!(bytes_per_code, 2, "8-bit codes have a texture format everywhere");
    codes.chunks_exact(2).map(|c| f32::from(u16::from_le_bytes([c[0], c[1]])) / 65535.0).collect()
}
