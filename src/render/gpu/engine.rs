//! Runs shader entry points on named buffers.

use super::timing::Timing;
use super::{EntryPoint, Gpu, PassTime, shaders, store::Store};
use phasmid_core::error::{Error, Result};
use std::collections::{BTreeMap, HashMap};
use std::ops::Range;
use std::sync::Arc;
use wgpu::naga::valid::{Capabilities, ValidationFlags, Validator};
use wgpu::naga::{AddressSpace, StorageAccess};

/// Runs compute passes on a GPU.
pub(crate) struct Engine {
    gpu: Arc<Gpu>,
    store: Store,
    modules: HashMap<&'static str, Arc<Module>>,
    pipelines: Vec<(EntryPoint, Pipeline)>,
    timing: Timing,
}

/// Recorded passes that have not been submitted yet.
pub(crate) struct Commands(wgpu::CommandEncoder);

struct Module {
    shader: wgpu::ShaderModule,
    /// For each entry point, the buffers that it uses: name, binding, and whether access is
    /// read-only.
    used: HashMap<String, Vec<(String, u32, bool)>>,
}

struct Pipeline {
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    module: Arc<Module>,
    /// Bind group, and the generation of the store for which it was built.
    bound: Option<(u64, wgpu::BindGroup)>,
}

impl Gpu {
    /// Waits until all submitted work is done.
    pub(super) fn wait(&self) -> Result<()> {
        self.poll(wgpu::PollType::wait_indefinitely())
    }

    /// Waits until a submission is done.
    pub(super) fn wait_for(&self, submission: wgpu::SubmissionIndex) -> Result<()> {
        self.poll(wgpu::PollType::Wait {
            submission_index: Some(submission),
            timeout: None,
        })
    }

    fn poll(&self, how: wgpu::PollType) -> Result<()> {
        let done = self.device.poll(how);
        if let Err(e) = done {
            self.fail(e);
        }
        self.check()
    }
}

impl Engine {
    pub(crate) fn new(gpu: Arc<Gpu>) -> Self {
        Self {
            store: Store::new(gpu.clone()),
            gpu,
            modules: HashMap::new(),
            pipelines: Vec::new(),
            timing: Timing::off(),
        }
    }

    pub(crate) fn gpu(&self) -> &Arc<Gpu> {
        &self.gpu
    }

    /// Writes a buffer's contents.
    pub(crate) fn write(&mut self, name: &'static str, bytes: &[u8]) {
        self.store.write(name, bytes);
    }

    /// Ensures that a buffer has a capacity of at least `bytes` bytes.
    pub(crate) fn reserve(&mut self, name: &'static str, bytes: u64) {
        self.store.reserve(name, bytes);
    }

    /// Writes a part of a buffer. The part must consist of whole words and lie within the buffer's
    /// capacity.
    pub(crate) fn write_at(&mut self, name: &str, offset: u64, bytes: &[u8]) {
        self.store.write_at(name, offset, bytes);
    }

    /// Ensures that a buffer of any size exists, for shaders that bind the buffer but do not use it.
    pub(crate) fn provide(&mut self, name: &'static str) {
        self.store.provide(name);
    }

    /// Returns a buffer's capacity in bytes; 0 if it does not exist.
    pub(crate) fn size(&self, name: &str) -> u64 {
        self.store.size(name)
    }

    /// Creates an empty list of passes.
    pub(crate) fn commands(&self) -> Commands {
        Commands(self.gpu.device.create_command_encoder(&Default::default()))
    }

    /// Adds a pass with the given number of workgroups.
    ///
    /// # Errors
    /// Returns an error if the driver rejects the shader or if the GPU has failed.
    pub(crate) fn run(
        &mut self,
        commands: &mut Commands,
        stage: &EntryPoint,
        [x, y, z]: [u32; 3],
    ) -> Result<()> {
        self.pass(commands, stage, |pass, _| {
            pass.dispatch_workgroups(x, y, z);
            Ok(())
        })
    }

    /// Adds a pass whose workgroup count, three words at a byte offset, is read from a buffer.
    ///
    /// # Errors
    /// Returns an error under the same conditions as [`Self::run`].
    pub(crate) fn run_indirect(
        &mut self,
        commands: &mut Commands,
        stage: &EntryPoint,
        groups: &str,
        offset: u64,
    ) -> Result<()> {
        self.pass(commands, stage, |pass, store| {
            pass.dispatch_workgroups_indirect(store.get(groups)?, offset);
            Ok(())
        })
    }

    fn pass(
        &mut self,
        commands: &mut Commands,
        stage: &EntryPoint,
        dispatch: impl FnOnce(&mut wgpu::ComputePass<'_>, &Store) -> Result<()>,
    ) -> Result<()> {
        let index = self.pipeline(stage)?;
        let name = format!("{}/{}", stage.shader, stage.entry);
        let (stage, pipeline) = &mut self.pipelines[index];
        let group = pipeline.bind(&self.gpu, &self.store, stage)?;
        let mut pass = commands.0.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(&name),
            timestamp_writes: self.timing.writes(&name),
        });
        pass.set_pipeline(&pipeline.pipeline);
        pass.set_bind_group(0, &group, &[]);
        dispatch(&mut pass, &self.store)
    }

    /// Submits passes to the GPU.
    pub(crate) fn submit(&self, commands: Commands) -> wgpu::SubmissionIndex {
        self.gpu.queue.submit([commands.0.finish()])
    }

    /// Adds a copy of a part of a buffer, in whole words, into a buffer of the caller.
    pub(super) fn copy_out(
        &self,
        commands: &mut Commands,
        name: &str,
        bytes: Range<u64>,
        to: &wgpu::Buffer,
        offset: u64,
    ) -> Result<()> {
        let from = self.store.get(name)?;
        let length = bytes.end - bytes.start;
        commands
            .0
            .copy_buffer_to_buffer(from, bytes.start, to, offset, length);
        Ok(())
    }

    /// Reads part of a buffer, in whole words, after waiting for all submitted work.
    ///
    /// # Errors
    /// Returns an error if the GPU has failed.
    pub(crate) fn read_back(&self, name: &str, bytes: Range<u64>) -> Result<Vec<u8>> {
        let length = bytes.end - bytes.start;
        if length == 0 {
            return Ok(Vec::new());
        }
        let to = self.gpu.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size: length,
            usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let mut commands = self.commands();
        self.copy_out(&mut commands, name, bytes, &to, 0)?;
        self.submit(commands);
        to.map_async(wgpu::MapMode::Read, .., |_| {});
        self.gpu.wait()?;
        let view = to.get_mapped_range(..).map_err(Error::device)?;
        Ok(view.to_vec())
    }

    /// Enables the timing of passes if the adapter supports timestamps.
    pub(crate) fn time_passes(&mut self) {
        self.timing = Timing::on(&self.gpu);
    }

    /// Returns the time spent in passes since timing was enabled, by shader and entry point.
    pub(crate) fn times(&mut self) -> BTreeMap<String, PassTime> {
        self.timing.collect(&self.gpu)
    }

    fn pipeline(&mut self, stage: &EntryPoint) -> Result<usize> {
        if let Some(i) = self.pipelines.iter().position(|(s, _)| s == stage) {
            return Ok(i);
        }
        let module = self.module(stage.shader)?;
        let pipeline = Pipeline::new(&self.gpu, module, stage)?;
        self.gpu.check()?;
        self.pipelines.push((stage.clone(), pipeline));
        Ok(self.pipelines.len() - 1)
    }

    fn module(&mut self, name: &'static str) -> Result<Arc<Module>> {
        if let Some(module) = self.modules.get(name) {
            return Ok(module.clone());
        }
        let module = Arc::new(Module::new(&self.gpu, name)?);
        self.modules.insert(name, module.clone());
        Ok(module)
    }
}

impl Module {
    fn new(gpu: &Gpu, name: &str) -> Result<Self> {
        let source = shaders::assemble(name)?;
        let wrong = |e: String| Error::device(format!("shader {name}: {e}"));
        let module = wgpu::naga::front::wgsl::parse_str(&source)
            .map_err(|e| wrong(e.emit_to_string(&source)))?;
        let info = Validator::new(ValidationFlags::all(), Capabilities::empty())
            .validate(&module)
            .map_err(|e| wrong(e.emit_to_string(&source)))?;
        let used = module.entry_points.iter().enumerate().map(|(i, entry)| {
            let of_entry = info.get_entry_point(i);
            let variables = module.global_variables.iter();
            let bound = variables.filter(|(handle, _)| !of_entry[*handle].is_empty());
            let bound = bound.filter_map(|(_, variable)| {
                let binding = variable.binding?.binding;
                let only_reads = match variable.space {
                    AddressSpace::Storage { access } => !access.contains(StorageAccess::STORE),
                    _ => true,
                };
                Some((variable.name.clone()?, binding, only_reads))
            });
            (entry.name.clone(), bound.collect())
        });
        let used = used.collect();
        let shader = gpu
            .device
            .create_shader_module(wgpu::ShaderModuleDescriptor {
                label: Some(name),
                source: wgpu::ShaderSource::Wgsl(source.into()),
            });
        Ok(Self { shader, used })
    }

    fn used(&self, stage: &EntryPoint) -> Result<&[(String, u32, bool)]> {
        let (shader, entry) = (stage.shader, stage.entry);
        match self.used.get(entry) {
            Some(used) => Ok(used),
            None => Err(Error::device(format!("shader {shader} has no {entry}"))),
        }
    }
}

impl Pipeline {
    fn new(gpu: &Gpu, module: Arc<Module>, stage: &EntryPoint) -> Result<Self> {
        let entries: Vec<_> = module
            .used(stage)?
            .iter()
            .map(|&(_, binding, read_only)| wgpu::BindGroupLayoutEntry {
                binding,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer {
                    ty: wgpu::BufferBindingType::Storage { read_only },
                    has_dynamic_offset: false,
                    min_binding_size: None,
                },
                count: None,
            })
            .collect();
        let layout = gpu
            .device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
                label: Some(stage.shader),
                entries: &entries,
            });
        let pipeline_layout = gpu
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(stage.shader),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
        let constants = stage.all_constants();
        let constants: Vec<_> = constants.iter().map(|(n, v)| (n.as_str(), *v)).collect();
        let pipeline = gpu
            .device
            .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(stage.shader),
                layout: Some(&pipeline_layout),
                module: &module.shader,
                entry_point: Some(stage.entry),
                compilation_options: wgpu::PipelineCompilationOptions {
                    constants: &constants,
                    zero_initialize_workgroup_memory: false,
                },
                cache: None,
            });
        Ok(Self {
            pipeline,
            layout,
            module,
            bound: None,
        })
    }

    fn bind(&mut self, gpu: &Gpu, store: &Store, stage: &EntryPoint) -> Result<wgpu::BindGroup> {
        if let Some((generation, group)) = &self.bound
            && *generation == store.generation()
        {
            return Ok(group.clone());
        }
        let mut entries = Vec::new();
        for (name, binding, _) in self.module.used(stage)? {
            entries.push(wgpu::BindGroupEntry {
                binding: *binding,
                resource: store.get(name)?.as_entire_binding(),
            });
        }
        let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some(stage.shader),
            layout: &self.layout,
            entries: &entries,
        });
        self.bound = Some((store.generation(), group.clone()));
        Ok(group)
    }
}

#[cfg(test)]
impl Engine {
    /// Returns an engine on any available adapter, which may be a software adapter.
    pub(crate) fn for_tests() -> Self {
        Self::new(Gpu::open(true).expect("a Vulkan adapter: install mesa-vulkan-drivers"))
    }

    /// Runs the entry point `main` of a shader that maps the words of `input` to `output`.
    pub(crate) fn call(
        &mut self,
        shader: &'static str,
        input: &[u32],
        output_len: usize,
        threads: usize,
    ) -> Vec<u32> {
        let stage = EntryPoint::new(shader, "main", &crate::Plan::default());
        self.call_stage(&stage, input, output_len, threads)
    }

    /// Same as `call`, for any entry point with its constants.
    pub(crate) fn call_stage(
        &mut self,
        stage: &EntryPoint,
        input: &[u32],
        output_len: usize,
        threads: usize,
    ) -> Vec<u32> {
        self.write("input", bytemuck::cast_slice(input));
        self.write("output", &vec![0; output_len * 4]);
        let mut commands = self.commands();
        self.run(&mut commands, stage, super::grid(threads))
            .unwrap();
        self.submit(commands);
        let bytes = self.read_back("output", 0..output_len as u64 * 4).unwrap();
        bytemuck::pod_collect_to_vec(&bytes)
    }
}

/// Reads the first `count` elements of a buffer.
pub(crate) fn words<T: bytemuck::Pod>(engine: &Engine, name: &str, count: u64) -> Result<Vec<T>> {
    let bytes = engine.read_back(name, 0..count * size_of::<T>() as u64)?;
    Ok(bytemuck::pod_collect_to_vec(&bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn invocations_are_numbered_in_grids_of_any_size() {
        let mut engine = Engine::for_tests();
        let count = 65535 * 64 + 1000;
        let input: Vec<u32> = (0..count).map(|i| i ^ 0x5555).collect();
        let output = engine.call("tests/linear_test", &input, input.len(), input.len());
        for (i, (from, to)) in (0..count).zip(input.iter().zip(&output)) {
            assert_eq!(from + i, *to);
        }
    }

    #[test]
    #[ignore = "needs a Vulkan adapter"]
    fn each_pass_is_counted_and_timed() {
        let mut engine = Engine::for_tests();
        engine.time_passes();
        engine.call("tests/linear_test", &[1; 1000], 1000, 1000);
        let times = engine.times();
        if engine.gpu().tick_ns.is_some() {
            assert_eq!(times["tests/linear_test/main"].runs, 1);
        }
    }
}
