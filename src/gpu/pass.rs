//! One compute pipeline and its bindings.

use super::context::{Gpu, GpuError};
use super::memory::GpuBuffer;
use super::shaders::{self, Assembled};
use super::uniform::Uniform;

/// A compute pipeline whose bind group layout is read from the shader's own declarations, so that the
/// two cannot differ. All bindings are in group 0: a pass is dispatched a handful of times per picture,
/// which is too few to gain anything by splitting groups.
#[derive(Debug)]
pub struct ComputeStage {
    label: String,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    workgroup: [u32; 3],
}

/// One resource of a pass.
#[derive(Clone, Debug)]
pub enum Binding<'a> {
    /// A whole buffer.
    Buffer(&'a wgpu::Buffer),
    /// Part of a buffer: offset and size in bytes.
    Slice(&'a wgpu::Buffer, u64, u64),
    /// A texture.
    Texture(&'a wgpu::TextureView),
    /// A sampler.
    Sampler(&'a wgpu::Sampler),
}

impl ComputeStage {
    /// Compiles `shaders/<stem>.wgsl`. `values` and `replaced` as in [`shaders::assemble`], `constants`
    /// are the shader's `override`s.
    ///
    /// # Errors
    /// [`GpuError::Device`] naming the shader's file and line.
    pub fn new(
        gpu: &Gpu,
        stem: &str,
        values: &[(&str, u32)],
        replaced: &[(&str, &str)],
        constants: &[(&str, f64)],
    ) -> Result<Self, GpuError> {
        let broken = |e: shaders::ShaderError| GpuError::Device(e.to_string());
        let assembled: Assembled = shaders::assemble(stem, values, replaced).map_err(broken)?;
        let module = assembled.parse().map_err(broken)?;
        let entries = layout_entries(&module);
        let workgroup = module.entry_points[0].workgroup_size;
        gpu.guarded(stem, || {
            let layout = gpu
                .device
                .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(stem), entries: &entries });
            let pipeline_layout = gpu.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(stem),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
            let module = gpu.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(stem),
                source: wgpu::ShaderSource::Wgsl(assembled.wgsl.as_str().into()),
            });
            let pipeline = gpu.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(stem),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some("main"),
                compilation_options: wgpu::PipelineCompilationOptions { constants, ..Default::default() },
                cache: None,
            });
            Ok(Self { label: stem.to_owned(), pipeline, layout, workgroup })
        })
    }

    /// Records one dispatch that covers `invocations` along x, y and z, with `params` as binding 0.
    /// `bindings` are the others as `(number, resource)`.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn record<P: Uniform>(
        &self,
        gpu: &Gpu,
        recorder: &mut Recorder,
        params: &P,
        bindings: &[(u32, Binding<'_>)],
        invocations: [u32; 3],
    ) -> Result<(), GpuError> {
        let [x, y, z] = std::array::from_fn(|axis| invocations[axis].div_ceil(self.workgroup[axis]));
        self.record_with(gpu, recorder, params, bindings, |pass| pass.dispatch_workgroups(x, y, z))
    }

    /// Records one dispatch whose numbers of workgroups an earlier one has written: three words at `offset` bytes.
    ///
    /// # Errors
    /// As [`Gpu::buffer`].
    pub fn record_indirect<P: Uniform>(
        &self,
        gpu: &Gpu,
        recorder: &mut Recorder,
        params: &P,
        bindings: &[(u32, Binding<'_>)],
        (workgroups, offset): (&GpuBuffer, u64),
    ) -> Result<(), GpuError> {
        self.record_with(gpu, recorder, params, bindings, |pass| {
            pass.dispatch_workgroups_indirect(&workgroups.raw, offset);
        })
    }

    fn record_with<P: Uniform>(
        &self,
        gpu: &Gpu,
        recorder: &mut Recorder,
        params: &P,
        bindings: &[(u32, Binding<'_>)],
        dispatch: impl FnOnce(&mut wgpu::ComputePass<'_>),
    ) -> Result<(), GpuError> {
        debug_assert_eq!(self.label, P::STEM, "the parameters belong to another shader");
        let params = gpu.uniform_with(&self.label, params)?;
        let entries: Vec<_> = [(0, Binding::Buffer(&params.raw))]
            .iter()
            .chain(bindings)
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding: *binding, resource: resource.clone().into() })
            .collect();
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(&self.label),
            layout: &self.layout,
            entries: &entries,
        });
        let mut pass = recorder
            .encoder
            .begin_compute_pass(&wgpu::ComputePassDescriptor { label: Some(&self.label), timestamp_writes: None });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &group, &[]);
        dispatch(&mut pass);
        drop(pass);
        recorder.kept.push(params);
        Ok(())
    }
}

/// Commands being recorded, and the small buffers that must live until they have run.
#[derive(Debug)]
pub struct Recorder {
    pub(crate) encoder: wgpu::CommandEncoder,
    kept: Vec<GpuBuffer>,
}

impl Recorder {
    /// Nothing recorded yet.
    pub fn new(gpu: &Gpu, label: &str) -> Self {
        let encoder = gpu.device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some(label) });
        Self { encoder, kept: Vec::new() }
    }

    /// Copies the first `bytes` bytes of a buffer.
    pub fn copy(&mut self, from: &GpuBuffer, to: &GpuBuffer, bytes: u64) {
        self.encoder.copy_buffer_to_buffer(&from.raw, 0, &to.raw, 0, bytes);
    }

    /// Fills a buffer with zeros.
    pub fn clear(&mut self, buffer: &GpuBuffer) {
        self.encoder.clear_buffer(&buffer.raw, 0, None);
    }

    /// Runs the commands and waits for exactly these.
    ///
    /// # Errors
    /// As [`Gpu::submit_and_wait`].
    pub fn run(self, gpu: &Gpu) -> Result<(), GpuError> {
        gpu.submit_and_wait(self.encoder)
    }

    /// Runs the commands, then reads `bytes` bytes of a `MAP_READ` buffer.
    ///
    /// # Errors
    /// As [`Gpu::submit_and_read`].
    pub fn run_and_read<T>(
        self,
        gpu: &Gpu,
        buffer: &GpuBuffer,
        bytes: u64,
        read: impl FnOnce(&[u8]) -> T,
    ) -> Result<T, GpuError> {
        gpu.submit_and_read(self.encoder, &buffer.raw, bytes, read)
    }
}

impl<'a> From<Binding<'a>> for wgpu::BindingResource<'a> {
    fn from(binding: Binding<'a>) -> Self {
        match binding {
            Binding::Buffer(buffer) => buffer.as_entire_binding(),
            Binding::Slice(buffer, offset, size) => {
                let size = wgpu::BufferSize::new(size);
                Self::Buffer(wgpu::BufferBinding { buffer, offset, size })
            }
            Binding::Texture(view) => Self::TextureView(view),
            Binding::Sampler(sampler) => Self::Sampler(sampler),
        }
    }
}

/// Layout entries for the variables that the module declares.
fn layout_entries(module: &naga::Module) -> Vec<wgpu::BindGroupLayoutEntry> {
    // A texture is filterable where the shader has a sampler at all: the variant without one reads texels.
    let has_sampler = module
        .global_variables
        .iter()
        .any(|(_, v)| matches!(module.types[v.ty].inner, naga::TypeInner::Sampler { .. }));
    let mut entries: Vec<_> = module
        .global_variables
        .iter()
        .filter_map(|(_, variable)| {
            let binding = variable.binding.as_ref()?.binding;
            let ty = binding_type(variable, &module.types[variable.ty].inner, has_sampler)?;
            Some(wgpu::BindGroupLayoutEntry { binding, visibility: wgpu::ShaderStages::COMPUTE, ty, count: None })
        })
        .collect();
    entries.sort_by_key(|e| e.binding);
    entries
}

fn binding_type(
    variable: &naga::GlobalVariable,
    inner: &naga::TypeInner,
    has_sampler: bool,
) -> Option<wgpu::BindingType> {
    let buffer = |ty| wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None };
    match (variable.space, inner) {
        (naga::AddressSpace::Uniform, _) => Some(buffer(wgpu::BufferBindingType::Uniform)),
        (naga::AddressSpace::Storage { access }, _) => {
            let read_only = !access.contains(naga::StorageAccess::STORE);
            Some(buffer(wgpu::BufferBindingType::Storage { read_only }))
        }
        (_, naga::TypeInner::Sampler { .. }) => Some(wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering)),
        (_, naga::TypeInner::Image { class, .. }) => Some(match class {
            naga::ImageClass::Storage { format, .. } => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format: match format {
                    naga::StorageFormat::R16Unorm => wgpu::TextureFormat::R16Unorm,
                    _ => wgpu::TextureFormat::Rgba8Snorm,
                },
                view_dimension: wgpu::TextureViewDimension::D3,
            },
            _ => wgpu::BindingType::Texture {
                sample_type: wgpu::TextureSampleType::Float {
                    // The unfiltered variant is named for what it is; see common/value_texels.wgsl.
                    filterable: has_sampler && variable.name.as_deref() != Some("value_texels"),
                },
                view_dimension: wgpu::TextureViewDimension::D3,
                multisampled: false,
            },
        }),
        _ => None,
    }
}
