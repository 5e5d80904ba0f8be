//! Opening the adapter, submitting work and waiting for it.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use thiserror::Error;

use super::memory::Budget;

/// Longest wait for one submission. Work is cut into slices of well under a second, so a minute means
/// that the driver hangs.
const SUBMISSION_TIMEOUT: Duration = Duration::from_secs(60);

/// Memory of a GPU that may be used when nobody says otherwise. wgpu does not tell the size of a heap; this suits
/// common cards, and where there is less, the driver's own budget is respected too.
const HARDWARE_BUDGET_BYTES: u64 = 4 << 30;

/// Percentage of what the driver grants this process (VK_EXT_memory_budget) from which on allocations are refused.
const DRIVER_BUDGET_PERCENT: u8 = 95;

/// Storage buffers that one pass binds at most: nine ambient-occlusion levels, tables and an output.
const STORAGE_BUFFERS_PER_PASS: u32 = 12;

/// Which adapter to open and how much of it to use.
#[derive(Clone, Debug, Default)]
pub struct GpuOptions {
    /// Refuse software adapters.
    pub require_gpu: bool,
    /// Part of the adapter's name, any case.
    pub adapter: Option<String>,
    /// Bytes that all buffers and textures together may take.
    pub memory_budget_bytes: Option<u64>,
    /// Use only what every adapter has, so that fallbacks can be tested anywhere.
    pub baseline_features_only: bool,
    /// Largest storage binding, where the adapter allows more, so that windowed bindings can be tested with
    /// small volumes.
    pub max_storage_binding_bytes: Option<u64>,
}

/// What can go wrong on the device.
#[derive(Clone, Debug, Error)]
pub enum GpuError {
    /// No adapter, or none that is good enough.
    #[error("{0}")]
    NoAdapter(String),
    /// An allocation is over the budget, over the adapter's limits, or the driver refused it.
    #[error("{what} needs {needed_bytes} bytes of GPU memory, {used_bytes} of {budget_bytes} are in use")]
    OutOfMemory {
        /// Label of the allocation.
        what: String,
        /// Its size.
        needed_bytes: u64,
        /// In use when it was asked for.
        used_bytes: u64,
        /// Allowed.
        budget_bytes: u64,
    },
    /// The driver reported an error or hangs.
    #[error("{0}")]
    Device(String),
    /// The device is lost; nothing will work on it any more.
    #[error("the graphics device was lost: {0}")]
    Lost(String),
}

/// An open device. Lives and dies on one thread.
#[derive(Debug)]
pub struct Gpu {
    pub(crate) device: wgpu::Device,
    pub(crate) queue: wgpu::Queue,
    /// Adapter facts.
    pub adapter: wgpu::AdapterInfo,
    /// Limits the device was opened with: the adapter's own.
    pub limits: wgpu::Limits,
    /// r16unorm textures can be sampled with a filter.
    pub texture_16bit_norm: bool,
    /// Counts every allocation.
    pub budget: Budget,
    lost: Arc<AtomicBool>,
}

impl Gpu {
    /// Opens the best adapter that fits `options`: discrete before integrated before software.
    ///
    /// # Errors
    /// [`GpuError::NoAdapter`] naming what was found; [`GpuError::Device`] when it cannot be opened.
    pub fn new(options: &GpuOptions) -> Result<Self, GpuError> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::PRIMARY;
        descriptor.flags = wgpu::InstanceFlags::empty();
        descriptor.memory_budget_thresholds.for_resource_creation = Some(DRIVER_BUDGET_PERCENT);
        let instance = wgpu::Instance::new(descriptor);
        let found = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY));
        let adapter = choose(found, options)?;
        let info = adapter.get_info();
        let mut limits = adapter.limits();
        let largest_binding = options.max_storage_binding_bytes.unwrap_or(u64::MAX);
        limits.max_storage_buffer_binding_size = limits.max_storage_buffer_binding_size.min(largest_binding);
        if limits.max_storage_buffers_per_shader_stage < STORAGE_BUFFERS_PER_PASS {
            return Err(GpuError::NoAdapter(format!(
                "adapter `{}` allows {} storage buffers in a pass, {STORAGE_BUFFERS_PER_PASS} are needed",
                info.name, limits.max_storage_buffers_per_shader_stage
            )));
        }
        let optional = if options.baseline_features_only {
            wgpu::Features::empty()
        } else {
            wgpu::Features::TEXTURE_FORMAT_16BIT_NORM
        };
        let features = adapter.features() & optional;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("spao-server"),
            required_features: features,
            required_limits: limits.clone(),
            memory_hints: wgpu::MemoryHints::Performance,
            ..Default::default()
        }))
        .map_err(|e| GpuError::Device(format!("cannot open adapter `{}`: {e}", info.name)))?;
        let lost = Arc::new(AtomicBool::new(false));
        watch_for_loss(&device, &lost);
        let software = info.device_type == wgpu::DeviceType::Cpu;
        let budget = options.memory_budget_bytes.unwrap_or_else(|| default_budget_bytes(software, main_memory_bytes));
        let budget = Budget::new(budget);
        let texture_16bit_norm = features.contains(wgpu::Features::TEXTURE_FORMAT_16BIT_NORM);
        Ok(Self { device, queue, adapter: info, limits, texture_16bit_norm, budget, lost })
    }

    /// True for adapters that compute on the CPU.
    pub fn is_software(&self) -> bool {
        self.adapter.device_type == wgpu::DeviceType::Cpu
    }

    /// True once the device is lost.
    pub fn is_lost(&self) -> bool {
        self.lost.load(Ordering::Acquire)
    }

    /// Runs `work` so that validation and memory errors become its error and nobody else's.
    ///
    /// # Errors
    /// The first error that was reported meanwhile, else what `work` returns: a rejected command is the cause of
    /// the wait for it that fails.
    pub fn guarded<T>(&self, what: &str, work: impl FnOnce() -> Result<T, GpuError>) -> Result<T, GpuError> {
        let memory = self.device.push_error_scope(wgpu::ErrorFilter::OutOfMemory);
        let validation = self.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let internal = self.device.push_error_scope(wgpu::ErrorFilter::Internal);
        let result = work();
        let errors = [internal, validation, memory].map(|scope| pollster::block_on(scope.pop()));
        if self.is_lost() {
            return Err(GpuError::Lost(what.to_owned()));
        }
        match errors.into_iter().flatten().next() {
            None => result,
            Some(wgpu::Error::OutOfMemory { .. }) => Err(self.budget.out_of_memory(what, 0)),
            Some(error) => Err(GpuError::Device(format!("{what}: {error}"))),
        }
    }

    /// Submits commands and waits for exactly these.
    ///
    /// # Errors
    /// [`GpuError::Device`] after a minute; [`GpuError::Lost`].
    pub fn submit_and_wait(&self, encoder: wgpu::CommandEncoder) -> Result<(), GpuError> {
        let index = self.queue.submit([encoder.finish()]);
        let wait = wgpu::PollType::Wait { submission_index: Some(index), timeout: Some(SUBMISSION_TIMEOUT) };
        self.device.poll(wait).map_err(|e| GpuError::Device(format!("waiting for the device: {e}")))?;
        if self.is_lost() { Err(GpuError::Lost("while waiting".into())) } else { Ok(()) }
    }

    /// Submits `encoder`, then copies `bytes` bytes of a `MAP_READ` buffer to the host with `read`.
    ///
    /// # Errors
    /// As [`Self::submit_and_wait`], and [`GpuError::Device`] when mapping fails.
    pub fn submit_and_read<T>(
        &self,
        encoder: wgpu::CommandEncoder,
        buffer: &wgpu::Buffer,
        bytes: u64,
        read: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        encoder.map_buffer_on_submit(buffer, wgpu::MapMode::Read, 0..bytes, |_| ());
        self.submit_and_wait(encoder)?;
        let view = buffer
            .get_mapped_range(0..bytes)
            .map_err(|e| GpuError::Device(format!("mapping a read-back buffer: {e}")))?;
        let value = read(&view);
        drop(view);
        buffer.unmap();
        Ok(value)
    }
}

/// The budget when nobody gives one. A software adapter takes main memory, where the host copies of volumes are as
/// well, and gets half of it.
pub fn default_budget_bytes(software: bool, main_memory_bytes: impl FnOnce() -> u64) -> u64 {
    if software { main_memory_bytes() / 2 } else { HARDWARE_BUDGET_BYTES }
}

/// Main memory that this process may use: the machine's, or what a container leaves of it.
fn main_memory_bytes() -> u64 {
    let mut system = sysinfo::System::new();
    system.refresh_memory();
    let container = system.cgroup_limits().map_or(u64::MAX, |limits| limits.total_memory);
    system.total_memory().min(container)
}

fn watch_for_loss(device: &wgpu::Device, lost: &Arc<AtomicBool>) {
    let flag = lost.clone();
    device.set_device_lost_callback(move |reason, message| {
        flag.store(true, Ordering::Release);
        if !matches!(reason, wgpu::DeviceLostReason::Destroyed) {
            tracing::error!(?reason, message, "graphics device lost");
        }
    });
    // Every job runs in error scopes; what arrives here is a bug, but never worth the whole server.
    device.on_uncaptured_error(Arc::new(|error| tracing::error!(%error, "uncaptured graphics error")));
}

fn choose(found: Vec<wgpu::Adapter>, options: &GpuOptions) -> Result<wgpu::Adapter, GpuError> {
    let names: Vec<String> = found.iter().map(|a| a.get_info().name).collect();
    let wanted = options.adapter.as_ref().map(|n| n.to_lowercase());
    let mut fitting: Vec<wgpu::Adapter> = found
        .into_iter()
        .filter(|a| {
            let info = a.get_info();
            wanted.as_ref().is_none_or(|n| info.name.to_lowercase().contains(n))
                && !(options.require_gpu && info.device_type == wgpu::DeviceType::Cpu)
        })
        .collect();
    fitting.sort_by_key(|a| match a.get_info().device_type {
        wgpu::DeviceType::DiscreteGpu => 0,
        wgpu::DeviceType::IntegratedGpu => 1,
        wgpu::DeviceType::VirtualGpu => 2,
        wgpu::DeviceType::Other => 3,
        wgpu::DeviceType::Cpu => 4,
    });
    if fitting.is_empty() {
        let found = if names.is_empty() { "none".to_owned() } else { names.join(", ") };
        let asked = match (&options.adapter, options.require_gpu) {
            (Some(name), true) => format!("no hardware adapter named like `{name}`, and one is required"),
            (Some(name), false) => format!("no adapter named like `{name}`"),
            (None, true) => "no hardware adapter, and one is required".to_owned(),
            (None, false) => "no graphics adapter; install a Vulkan driver (Debian: mesa-vulkan-drivers)".to_owned(),
        };
        return Err(GpuError::NoAdapter(format!("{asked}; found: {found}")));
    }
    Ok(fitting.swap_remove(0))
}
