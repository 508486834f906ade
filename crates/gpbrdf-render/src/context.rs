//! The graphics device.

use std::fmt;
use std::sync::{Arc, Mutex, OnceLock, PoisonError};
use std::time::Duration;

use crate::error::{Error, Result};

/// How long the device may work before it is taken for stuck.
const PATIENCE: Duration = Duration::from_secs(120);

/// Waits for everything that was submitted.
const WAIT: wgpu::PollType = wgpu::PollType::Wait { submission_index: None, timeout: Some(PATIENCE) };

/// Which adapter to use.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdapterChoice {
    /// The fastest one, which may be a program on the processor.
    #[default]
    Any,
    /// A GPU only.
    Hardware,
}

/// A graphics device and its queue: one of its own, or one that a window or another renderer has opened.
///
/// Two features are requested, and only where the adapter has them: filtering of 32-bit textures
/// ([`Context::float32_filterable`]) and arithmetic in f64 ([`Context::f64_arithmetic`]).
#[derive(Clone)]
pub struct Context {
    device: wgpu::Device,
    queue: wgpu::Queue,
    info: wgpu::AdapterInfo,
    /// Why the device is gone, once it is.
    lost: Arc<OnceLock<String>>,
    /// What the device has rejected outside of [`Context::guard`], until that or [`Context::wait`] tells it.
    rejected: Arc<Mutex<Option<String>>>,
}

impl fmt::Debug for Context {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Context").field("adapter", &self.describe()).finish_non_exhaustive()
    }
}

impl Context {
    /// The features that this crate uses where the adapter has them.
    pub const OPTIONAL_FEATURES: wgpu::Features =
        wgpu::Features::FLOAT32_FILTERABLE.union(wgpu::Features::SHADER_F64);

    /// The limits that this crate requests: those of modest devices, but for buffers and pictures the largest
    /// sizes of the adapter.
    #[must_use]
    pub fn required_limits(adapter: &wgpu::Adapter) -> wgpu::Limits {
        let most = adapter.limits();
        wgpu::Limits {
            max_buffer_size: most.max_buffer_size,
            max_storage_buffer_binding_size: most.max_storage_buffer_binding_size,
            max_storage_buffers_per_shader_stage: most.max_storage_buffers_per_shader_stage.min(8),
            ..wgpu::Limits::downlevel_defaults().using_resolution(most)
        }
    }

    /// Opens a device. The environment variables `WGPU_BACKEND` (`vulkan`, `metal`, `dx12`, `gl`) and
    /// `WGPU_ADAPTER_NAME` (a part of the name) narrow the choice.
    ///
    /// # Errors
    /// [`Error::NoAdapter`] when no adapter is suitable, [`Error::Device`] when it opens no device.
    pub fn open(choice: AdapterChoice) -> Result<Self> {
        let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle_from_env());
        let adapter = choose(&instance, choice)?;
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("gpbrdf"),
            required_features: adapter.features() & Self::OPTIONAL_FEATURES,
            required_limits: Self::required_limits(&adapter),
            // A block stays as long as one of many buffers is left in it.
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        }))
        .map_err(|error| Error::Device { adapter: adapter.get_info().name, message: error.to_string() })?;
        let context = Self::from_device(&adapter, device, queue);
        let lost = context.lost.clone();
        context.device.set_device_lost_callback(move |reason, message| {
            let _first_reason_stays = lost.set(format!("{reason:?} {message}"));
        });
        // Without this wgpu panics, for example where a device is lost between two guards.
        let rejected = context.rejected.clone();
        context.device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            rejected.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error.to_string());
        }));
        Ok(context)
    }

    /// Works on a device that the caller has opened on `adapter`. Its features decide which of the optional
    /// ones are used. The caller, not this context, is notified when the device is lost, and handles what it rejects
    /// outside of [`Context::guard`].
    #[must_use]
    pub fn from_device(adapter: &wgpu::Adapter, device: wgpu::Device, queue: wgpu::Queue) -> Self {
        Self { device, queue, info: adapter.get_info(), lost: Arc::default(), rejected: Arc::default() }
    }

    /// The device.
    #[must_use]
    pub fn device(&self) -> &wgpu::Device {
        &self.device
    }

    /// Its queue.
    #[must_use]
    pub fn queue(&self) -> &wgpu::Queue {
        &self.queue
    }

    /// The adapter of the device.
    #[must_use]
    pub fn info(&self) -> &wgpu::AdapterInfo {
        &self.info
    }

    /// The adapter for people: `llvmpipe (LLVM 15.0.6, 256 bits), Vulkan, software`.
    #[must_use]
    pub fn describe(&self) -> String {
        let kind = match self.info.device_type {
            wgpu::DeviceType::Cpu => "software",
            wgpu::DeviceType::DiscreteGpu => "discrete GPU",
            wgpu::DeviceType::IntegratedGpu => "integrated GPU",
            wgpu::DeviceType::VirtualGpu => "virtual GPU",
            wgpu::DeviceType::Other => "of unknown kind",
        };
        format!("{}, {:?}, {kind}", self.info.name, self.info.backend)
    }

    /// Whether the adapter is a GPU, not a program on the processor.
    #[must_use]
    pub fn is_hardware(&self) -> bool {
        is_hardware(&self.info)
    }

    /// Whether textures of 32-bit floats can be filtered.
    #[must_use]
    pub fn float32_filterable(&self) -> bool {
        self.device.features().contains(wgpu::Features::FLOAT32_FILTERABLE)
    }

    /// Whether shaders can compute in f64.
    #[must_use]
    pub fn f64_arithmetic(&self) -> bool {
        self.device.features().contains(wgpu::Features::SHADER_F64)
    }

    /// Runs `work` and turns what the device reports meanwhile into an error. `what` names the work in the
    /// message.
    ///
    /// # Errors
    /// [`Error::OutOfMemory`], [`Error::Lost`], or [`Error::Gpu`] when the device rejects a part of the work.
    pub fn guard<T>(&self, what: &str, work: impl FnOnce() -> T) -> Result<T> {
        use wgpu::ErrorFilter::{Internal, OutOfMemory, Validation};
        let scopes = [Internal, OutOfMemory, Validation].map(|filter| self.device.push_error_scope(filter));
        let result = work();
        let mut first = None;
        for scope in scopes.into_iter().rev() {
            let error = pollster::block_on(scope.pop());
            first = first.or(error);
        }
        let rejected = self.take_rejected();
        if first.is_some() || rejected.is_some() {
            // A lost device may be the cause. It is reported when the device is polled.
            let _polled = self.device.poll(WAIT);
        }
        self.check_lost(what)?;
        match first {
            None => rejected.map_or(Ok(result), |message| Err(Error::Gpu { what: what.to_owned(), message })),
            Some(wgpu::Error::OutOfMemory { .. }) => Err(Error::OutOfMemory { what: what.to_owned() }),
            Some(error) => Err(Error::Gpu { what: what.to_owned(), message: error.to_string() }),
        }
    }

    fn take_rejected(&self) -> Option<String> {
        self.rejected.lock().unwrap_or_else(PoisonError::into_inner).take()
    }

    fn check_lost(&self, what: &str) -> Result<()> {
        match self.lost.get() {
            Some(message) => {
                Err(Error::Lost { what: what.to_owned(), message: message.trim_end().to_owned() })
            }
            None => Ok(()),
        }
    }

    /// Waits until everything submitted is done.
    ///
    /// # Errors
    /// [`Error::Lost`] when the device is gone or takes over two minutes, [`Error::Gpu`] when it has rejected anything.
    pub fn wait(&self, what: &str) -> Result<()> {
        let done = self.device.poll(WAIT);
        self.check_lost(what)?;
        if let Some(message) = self.take_rejected() {
            return Err(Error::Gpu { what: what.to_owned(), message });
        }
        done.map(drop).map_err(|error| Error::Lost { what: what.to_owned(), message: error.to_string() })
    }

    /// A pipeline from WGSL, with the layout that the shader implies.
    ///
    /// # Errors
    /// Those of [`Context::guard`].
    pub fn compute_pipeline(&self, label: &str, source: &str, entry: &str) -> Result<wgpu::ComputePipeline> {
        self.guard(label, || {
            let module = self.device.create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(label),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
            self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(label),
                layout: None,
                module: &module,
                entry_point: Some(entry),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        })
    }

    /// Binds resources to the given bindings of group 0 of a pipeline.
    pub(crate) fn bind_group<'a>(
        &self,
        pipeline: &wgpu::ComputePipeline,
        resources: impl IntoIterator<Item = (u32, wgpu::BindingResource<'a>)>,
    ) -> wgpu::BindGroup {
        let entries: Vec<_> = resources
            .into_iter()
            .map(|(binding, resource)| wgpu::BindGroupEntry { binding, resource })
            .collect();
        self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        })
    }

    /// Binds buffers to the given bindings of group 0 of a pipeline.
    pub(crate) fn bind_buffers(
        &self,
        pipeline: &wgpu::ComputePipeline,
        buffers: &[(u32, &wgpu::Buffer)],
    ) -> wgpu::BindGroup {
        self.bind_group(
            pipeline,
            buffers.iter().map(|&(binding, buffer)| (binding, buffer.as_entire_binding())),
        )
    }

    /// Submits one dispatch.
    pub(crate) fn dispatch(
        &self,
        pipeline: &wgpu::ComputePipeline,
        group: &wgpu::BindGroup,
        count: [u32; 3],
    ) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        pass.set_pipeline(pipeline);
        pass.set_bind_group(0, group, &[]);
        pass.dispatch_workgroups(count[0], count[1], count[2]);
        drop(pass);
        self.queue.submit([encoder.finish()]);
    }

    /// A buffer that holds `bytes`, padded with zeros to at least 16 bytes and to a multiple of 4.
    ///
    /// # Errors
    /// [`Error::Limit`] above the largest binding of the device, and those of [`Context::guard`].
    pub fn buffer_of(
        &self,
        label: &'static str,
        bytes: &[u8],
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer> {
        let buffer = self.empty_buffer(label, bytes.len() as u64, usage | wgpu::BufferUsages::COPY_DST)?;
        let whole = bytes.len() / 4 * 4;
        self.guard(label, || {
            self.queue.write_buffer(&buffer, 0, &bytes[..whole]);
            if whole < bytes.len() {
                let mut last = [0; 4];
                last[..bytes.len() - whole].copy_from_slice(&bytes[whole..]);
                self.queue.write_buffer(&buffer, whole as u64, &last);
            }
        })?;
        Ok(buffer)
    }

    /// A uniform buffer that holds `value`.
    ///
    /// # Errors
    /// Those of [`Context::buffer_of`].
    pub(crate) fn uniform(&self, value: &impl bytemuck::NoUninit) -> Result<wgpu::Buffer> {
        self.buffer_of("uniforms", bytemuck::bytes_of(value), wgpu::BufferUsages::UNIFORM)
    }

    /// A buffer of zeros, of at least 16 bytes and a multiple of 4.
    ///
    /// # Errors
    /// Those of [`Context::buffer_of`].
    pub fn empty_buffer(
        &self,
        label: &'static str,
        size: u64,
        usage: wgpu::BufferUsages,
    ) -> Result<wgpu::Buffer> {
        let limits = self.device.limits();
        let largest = limits.max_buffer_size.min(limits.max_storage_buffer_binding_size);
        if size > largest {
            return Err(Error::Limit {
                what: label,
                expected: format!("at most {largest} bytes"),
                found: format!("{size} bytes"),
            });
        }
        self.guard(label, || {
            self.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: size.max(16).next_multiple_of(4),
                usage,
                mapped_at_creation: false,
            })
        })
    }
}

fn is_hardware(info: &wgpu::AdapterInfo) -> bool {
    matches!(
        info.device_type,
        wgpu::DeviceType::DiscreteGpu | wgpu::DeviceType::IntegratedGpu | wgpu::DeviceType::VirtualGpu
    )
}

/// The best adapter with compute shaders: discrete before integrated before virtual before software, and
/// Vulkan, Metal and DX12 before GL.
fn choose(instance: &wgpu::Instance, choice: AdapterChoice) -> Result<wgpu::Adapter> {
    let wanted = std::env::var("WGPU_ADAPTER_NAME").unwrap_or_default().to_lowercase();
    let all = pollster::block_on(instance.enumerate_adapters(wgpu::Backends::all()));
    let names: Vec<String> = all.iter().map(|a| format!("\"{}\"", a.get_info().name)).collect();
    let rank = |adapter: &wgpu::Adapter| {
        let info = adapter.get_info();
        let kind = match info.device_type {
            wgpu::DeviceType::DiscreteGpu => 0,
            wgpu::DeviceType::IntegratedGpu => 1,
            wgpu::DeviceType::VirtualGpu => 2,
            wgpu::DeviceType::Other => 3,
            wgpu::DeviceType::Cpu => 4,
        };
        (kind, info.backend == wgpu::Backend::Gl)
    };
    let usable = |adapter: &wgpu::Adapter| {
        let info = adapter.get_info();
        let compute =
            adapter.get_downlevel_capabilities().flags.contains(wgpu::DownlevelFlags::COMPUTE_SHADERS);
        compute
            && (choice == AdapterChoice::Any || is_hardware(&info))
            && info.name.to_lowercase().contains(&wanted)
    };
    all.into_iter().filter(usable).min_by_key(rank).ok_or_else(|| Error::NoAdapter {
        found: if names.is_empty() { "none".to_owned() } else { format!("only {}", names.join(", ")) },
    })
}
