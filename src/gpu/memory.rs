//! Buffers and textures that are counted while they live.

use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use super::context::{Gpu, GpuError};

/// What an allocation is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Category {
    /// Volumes and their gradients.
    Volume,
    /// Finished accessibility volumes.
    AoCache,
    /// Ambient-occlusion levels and scratch.
    AoScratch,
    /// Tables, picture and read-back buffers.
    Frame,
}

/// Counts bytes by category and refuses what is over the limit.
#[derive(Clone, Debug)]
pub struct Budget {
    limit_bytes: u64,
    used: Arc<[AtomicU64; 4]>,
}

impl Budget {
    pub(super) fn new(limit_bytes: u64) -> Self {
        Self { limit_bytes, used: Arc::default() }
    }

    /// Bytes allowed.
    pub fn limit_bytes(&self) -> u64 {
        self.limit_bytes
    }

    /// Bytes in use for one purpose.
    pub fn used_by(&self, category: Category) -> u64 {
        self.used[category as usize].load(Ordering::Relaxed)
    }

    /// Bytes in use.
    pub fn used_bytes(&self) -> u64 {
        self.used.iter().map(|u| u.load(Ordering::Relaxed)).sum()
    }

    /// The error for an allocation that does not fit.
    pub fn out_of_memory(&self, what: &str, needed_bytes: u64) -> GpuError {
        GpuError::OutOfMemory {
            what: what.to_owned(),
            needed_bytes,
            used_bytes: self.used_bytes(),
            budget_bytes: self.limit_bytes,
        }
    }

    /// Checks that `bytes` more would fit.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`].
    pub fn check(&self, what: &str, bytes: u64) -> Result<(), GpuError> {
        if self.used_bytes().saturating_add(bytes) > self.limit_bytes {
            return Err(self.out_of_memory(what, bytes));
        }
        Ok(())
    }

    fn take(&self, what: &str, category: Category, bytes: u64) -> Result<Share, GpuError> {
        self.check(what, bytes)?;
        self.used[category as usize].fetch_add(bytes, Ordering::Relaxed);
        Ok(Share { budget: self.clone(), category, bytes })
    }
}

/// Gives its bytes back when dropped.
#[derive(Debug)]
struct Share {
    budget: Budget,
    category: Category,
    bytes: u64,
}

impl Drop for Share {
    fn drop(&mut self) {
        self.budget.used[self.category as usize].fetch_sub(self.bytes, Ordering::Relaxed);
    }
}

/// A counted buffer; its memory is released with it.
#[derive(Debug)]
pub struct GpuBuffer {
    pub(crate) raw: wgpu::Buffer,
    share: Share,
}

/// A counted texture with a view of all of it.
#[derive(Debug)]
pub struct GpuTexture {
    pub(crate) raw: wgpu::Texture,
    pub(crate) view: wgpu::TextureView,
    share: Share,
}

impl GpuBuffer {
    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.share.bytes
    }
}

impl Drop for GpuBuffer {
    fn drop(&mut self) {
        // At once, not when the last command that names it has been forgotten: the budget counts on it.
        self.raw.destroy();
    }
}

impl GpuTexture {
    /// Size in bytes.
    pub fn bytes(&self) -> u64 {
        self.share.bytes
    }

    /// The texture unit can interpolate this format on every adapter.
    pub fn is_filterable(&self) -> bool {
        self.raw.format() != wgpu::TextureFormat::R32Float
    }

    /// Format of the texels.
    pub(crate) fn format(&self) -> wgpu::TextureFormat {
        self.raw.format()
    }

    /// Texels along x, y, z.
    pub fn dims(&self) -> [u32; 3] {
        [self.raw.width(), self.raw.height(), self.raw.depth_or_array_layers()]
    }
}

impl Drop for GpuTexture {
    fn drop(&mut self) {
        self.raw.destroy();
    }
}

impl Gpu {
    /// A buffer of at least `bytes` bytes (rounded up to words), zeroed.
    ///
    /// # Errors
    /// [`GpuError::OutOfMemory`] over the budget or the adapter's largest buffer, or when the driver refuses.
    pub fn buffer(
        &self,
        label: &str,
        category: Category,
        bytes: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<GpuBuffer, GpuError> {
        let bytes = bytes.max(4).checked_next_multiple_of(4).unwrap_or(u64::MAX);
        if bytes > self.limits.max_buffer_size {
            return Err(self.budget.out_of_memory(label, bytes));
        }
        let share = self.budget.take(label, category, bytes)?;
        let raw = self.allocated(label, bytes, || {
            Ok(self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage,
                mapped_at_creation: false,
            }))
        })?;
        Ok(GpuBuffer { raw, share })
    }

    /// Runs what allocates `bytes` bytes; where the driver has none left, the error says how many were wanted.
    fn allocated<T>(&self, label: &str, bytes: u64, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
        self.guarded(label, work).map_err(|error| match error {
            GpuError::OutOfMemory { .. } => self.budget.out_of_memory(label, bytes),
            error => error,
        })
    }

    /// A storage buffer with these contents.
    ///
    /// # Errors
    /// As [`Self::buffer`].
    pub fn storage_with(&self, label: &str, category: Category, contents: &[u8]) -> Result<GpuBuffer, GpuError> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        self.buffer_with(label, category, contents, usage)
    }

    /// A uniform buffer with these contents.
    ///
    /// # Errors
    /// As [`Self::buffer`].
    pub fn uniform_with<T: bytemuck::Pod>(&self, label: &str, contents: &T) -> Result<GpuBuffer, GpuError> {
        let usage = wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST;
        self.buffer_with(label, Category::Frame, bytemuck::bytes_of(contents), usage)
    }

    /// A buffer with these contents; `usage` must allow it to be copied to.
    ///
    /// # Errors
    /// As [`Self::buffer`].
    pub fn buffer_with(
        &self,
        label: &str,
        category: Category,
        contents: &[u8],
        usage: wgpu::BufferUsages,
    ) -> Result<GpuBuffer, GpuError> {
        let buffer = self.buffer(label, category, contents.len() as u64, usage)?;
        let whole = contents.len() & !3;
        if whole > 0 {
            self.queue.write_buffer(&buffer.raw, 0, &contents[..whole]);
        }
        if whole < contents.len() {
            let mut last = [0_u8; 4];
            last[..contents.len() - whole].copy_from_slice(&contents[whole..]);
            self.queue.write_buffer(&buffer.raw, whole as u64, &last);
        }
        Ok(buffer)
    }

    /// A 3D texture.
    ///
    /// # Errors
    /// As [`Self::buffer`].
    pub fn texture_3d(
        &self,
        label: &str,
        category: Category,
        dims: [u32; 3],
        format: wgpu::TextureFormat,
        usage: wgpu::TextureUsages,
    ) -> Result<GpuTexture, GpuError> {
        let texel = u64::from(format.block_copy_size(None).unwrap_or(4));
        let bytes = dims.iter().map(|&n| u64::from(n)).product::<u64>() * texel;
        if bytes > self.limits.max_buffer_size {
            return Err(self.budget.out_of_memory(label, bytes));
        }
        let share = self.budget.take(label, category, bytes)?;
        let raw = self.allocated(label, bytes, || {
            Ok(self.device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width: dims[0], height: dims[1], depth_or_array_layers: dims[2] },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D3,
                format,
                usage,
                view_formats: &[],
            }))
        })?;
        let view = raw.create_view(&wgpu::TextureViewDescriptor::default());
        Ok(GpuTexture { raw, view, share })
    }
}
