//! What pictures go through at the end, on a graphics processor: the discontinuity buffer ([`filter`]) and tone mapping
//! ([`tone`]), as compute shaders. What the processor computes (`frame::parts`, `frame::tone`) is the oracle they are
//! tested against; nothing but what people look at comes from here, and whatever fails here is done there.

pub mod filter;
pub mod tone;

use std::sync::{Arc, Mutex, PoisonError};

/// Which graphics processors may be used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, clap::ValueEnum)]
pub enum Allowed {
    /// A real one, if there is one.
    #[default]
    Auto,
    /// None: everything on the processor.
    Off,
    /// Also one that is a program on the processor, which is slower than doing without: for tests.
    Software,
}

/// A graphics processor that has been opened; clones share it.
#[derive(Clone)]
pub struct Gpu {
    device: wgpu::Device,
    queue: wgpu::Queue,
    name: String,
    /// What went wrong and was not asked about.
    failed: Arc<Mutex<Option<String>>>,
}

/// A buffer that is kept from picture to picture, as long as its size stays.
#[derive(Default)]
struct Kept(Option<wgpu::Buffer>);

/// Invocations of a workgroup along x; shaders say the same.
const GROUP: u32 = 64;

impl Gpu {
    /// Opens one.
    ///
    /// # Errors
    /// In words: there is none that may be used.
    pub fn open(allowed: Allowed) -> Result<Self, String> {
        if allowed == Allowed::Off {
            return Err("switched off".into());
        }
        let descriptor = wgpu::InstanceDescriptor {
            backends: wgpu::Backends::VULKAN,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        };
        let instance = wgpu::Instance::new(descriptor);
        let wanted = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&wanted)).map_err(|_| "there is none".to_string())?;
        let info = adapter.get_info();
        if info.device_type == wgpu::DeviceType::Cpu && allowed != Allowed::Software {
            return Err(format!("{} is a program on the processor, which is slower than doing without", info.name));
        }
        let descriptor = wgpu::DeviceDescriptor { required_limits: adapter.limits(), ..Default::default() };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|error| format!("{} cannot be opened: {error}", info.name))?;
        let failed = Arc::new(Mutex::new(None));
        let noted = Arc::clone(&failed);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            noted.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        Ok(Self { device, queue, name: info.name, failed })
    }

    /// What it is called.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// A shader's entry points, made ready.
    fn kernels<const N: usize>(&self, source: &str, entries: [&str; N]) -> [wgpu::ComputePipeline; N] {
        let source = wgpu::ShaderSource::Wgsl(source.into());
        let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor { label: None, source });
        entries.map(|entry| {
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: None,
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        })
    }

    /// Words that a shader reads.
    fn input(&self, kept: &mut Kept, bytes: &[u8]) -> Result<wgpu::Buffer, String> {
        let usage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST;
        let buffer = self.sized(kept, bytes.len() as u64, usage)?;
        self.queue.write_buffer(&buffer, 0, bytes);
        Ok(buffer)
    }

    /// Room that a shader writes, bytes.
    fn room(&self, kept: &mut Kept, size: u64) -> Result<wgpu::Buffer, String> {
        self.sized(kept, size, wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC)
    }

    fn sized(&self, kept: &mut Kept, size: u64, usage: wgpu::BufferUsages) -> Result<wgpu::Buffer, String> {
        self.fits(size)?;
        if kept.0.as_ref().is_none_or(|buffer| buffer.size() != size) {
            let descriptor = wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false };
            kept.0 = Some(self.device.create_buffer(&descriptor));
        }
        kept.0.clone().ok_or_else(|| "there is no buffer".into())
    }

    fn fits(&self, size: u64) -> Result<(), String> {
        let most = self.device.limits().max_storage_buffer_binding_size;
        if size <= most { Ok(()) } else { Err(format!("the picture needs {size} bytes at once, {most} are possible")) }
    }

    /// Runs kernels one after the other, each over so many pixels, and gives what is then in `result`; it comes by way of
    /// `back`.
    fn run(
        &self,
        kernels: &[(&wgpu::ComputePipeline, &[(u32, &wgpu::Buffer)])],
        [width, height]: [u32; 2],
        result: &wgpu::Buffer,
        back: &mut Kept,
    ) -> Result<Vec<u8>, String> {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        for (pipeline, buffers) in kernels {
            let entries: Vec<_> = buffers
                .iter()
                .map(|(binding, buffer)| wgpu::BindGroupEntry {
                    binding: *binding,
                    resource: buffer.as_entire_binding(),
                })
                .collect();
            let group = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
                label: None,
                layout: &pipeline.get_bind_group_layout(0),
                entries: &entries,
            });
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &group, &[]);
            pass.dispatch_workgroups(width.div_ceil(GROUP), height, 1);
        }
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let size = result.size();
        let back = self.sized(back, size, usage)?;
        encoder.copy_buffer_to_buffer(result, 0, &back, 0, size);
        self.queue.submit([encoder.finish()]);
        back.map_async(wgpu::MapMode::Read, .., |_| {});
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        if let Some(reason) = self.failed.lock().unwrap_or_else(PoisonError::into_inner).clone() {
            return Err(reason);
        }
        waited.map_err(|error| error.to_string())?;
        let bytes = back.get_mapped_range(..).map_err(|error| error.to_string())?.to_vec();
        back.unmap();
        Ok(bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Any adapter; where there is none, tests say that they were skipped.
    pub(super) fn any() -> Option<Gpu> {
        let gpu = Gpu::open(Allowed::Software);
        gpu.map_err(|reason| eprintln!("skipped: no graphics processor, not even a software one: {reason}")).ok()
    }

    #[test]
    fn programs_on_the_processor_are_not_chosen_by_themselves() {
        let Some(gpu) = any() else { return };
        if gpu.name().contains("llvmpipe") {
            let refused = Gpu::open(Allowed::Auto).err().unwrap_or_default();
            assert!(refused.contains("slower") || refused.is_empty(), "{refused}");
        }
        assert_eq!(Gpu::open(Allowed::Off).err().as_deref(), Some("switched off"));
    }
}
