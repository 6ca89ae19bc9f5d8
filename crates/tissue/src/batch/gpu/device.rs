//! A graphics card: buffers, passes, and what is read back.

use super::layout::{Layout, Shared};
use crate::{Error, Result};
use bytemuck::cast_slice;
use std::sync::{Arc, Mutex, PoisonError};
use wgpu::util::DeviceExt;

/// The passes and their entry points, in the order of [`Pass`].
const PASSES: [(Pass, &str); 18] = [
    (Pass::Begin, "begin"),
    (Pass::CellsOfGuess, "cells_of_guess"),
    (Pass::CheckGuess, "check_guess"),
    (Pass::CellsOfFlat, "cells_of_flat"),
    (Pass::GatherGuess, "gather_guess"),
    (Pass::PullGuess, "pull_guess"),
    (Pass::Survey, "survey"),
    (Pass::TurnNodes, "turn_nodes"),
    (Pass::BeforeSolve, "before_solve"),
    (Pass::Solve, "solve"),
    (Pass::AfterSolve, "after_solve"),
    (Pass::CellsOfTrial, "cells_of_trial"),
    (Pass::GatherTrial, "gather_trial"),
    (Pass::PullTrial, "pull_trial"),
    (Pass::Judge, "judge"),
    (Pass::NextRound, "next_round"),
    (Pass::Finish, "finish"),
    (Pass::Respond, "respond"),
];

/// A pass over all columns.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Pass {
    Begin,
    CellsOfGuess,
    CheckGuess,
    CellsOfFlat,
    GatherGuess,
    PullGuess,
    Survey,
    TurnNodes,
    BeforeSolve,
    Solve,
    AfterSolve,
    CellsOfTrial,
    GatherTrial,
    PullTrial,
    Judge,
    NextRound,
    Finish,
    Respond,
}

/// Numbers of `control`: the round, the columns that are not done, and the substep.
const CONTROL: usize = 3;

/// The buffers and passes of a batch on a card.
pub(super) struct Device {
    device: wgpu::Device,
    queue: wgpu::Queue,
    pub name: String,
    data: wgpu::Buffer,
    control: wgpu::Buffer,
    group: wgpu::BindGroup,
    pipelines: Vec<wgpu::ComputePipeline>,
    sizes: [u32; 3],
    padded: u32,
    pub bytes: u64,
    /// The first error that the card's driver told.
    failure: Arc<Mutex<Option<String>>>,
}

impl Device {
    /// Makes the buffers on the fastest card. `inverses` has those of all factors.
    ///
    /// # Errors
    /// [`Error::Gpu`] without a card or driver, and where a buffer is larger than the card allows.
    pub fn new(layout: &Layout, shared: &Shared, inverses: &[f32], counts: [usize; 2]) -> Result<Self> {
        let mut descriptor = wgpu::InstanceDescriptor::new_without_display_handle();
        descriptor.backends = wgpu::Backends::VULKAN;
        let instance = wgpu::Instance::new(descriptor);
        let options = wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            ..Default::default()
        };
        let adapter = pollster::block_on(instance.request_adapter(&options))
            .map_err(|e| Error::Gpu(format!("no graphics card with a Vulkan driver was found: {e}")))?;
        let limits = adapter.limits();
        let info = adapter.get_info();
        for (what, bytes) in [("the instances", layout.bytes()), ("the inverses", 4 * inverses.len() as u64)] {
            let most = limits.max_storage_buffer_binding_size.min(limits.max_buffer_size);
            if bytes > most {
                let (bytes, most) = (bytes / 1_000_000, most / 1_000_000);
                return Err(Error::Gpu(format!(
                    "{what} need {bytes} MB; {} allows {most} MB in one buffer: step fewer instances or nodes",
                    info.name
                )));
            }
        }
        let wanted = wgpu::DeviceDescriptor { required_limits: limits, ..Default::default() };
        let (device, queue) = pollster::block_on(adapter.request_device(&wanted))
            .map_err(|e| Error::Gpu(format!("{} cannot be used: {e}", info.name)))?;
        let failure = Arc::new(Mutex::new(None));
        let report = Arc::clone(&failure);
        device.on_uncaptured_error(Arc::new(move |error: wgpu::Error| {
            // The first error is the cause of the others.
            let mut first = report.lock().unwrap_or_else(PoisonError::into_inner);
            first.get_or_insert(error.to_string());
        }));
        let storage = wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC | wgpu::BufferUsages::COPY_DST;
        let empty = |label, size| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size,
                usage: storage,
                mapped_at_creation: false,
            })
        };
        let filled = |label, contents: &[u8]| {
            let usage = wgpu::BufferUsages::STORAGE;
            device.create_buffer_init(&wgpu::util::BufferInitDescriptor { label: Some(label), contents, usage })
        };
        let data = empty("instances", layout.bytes());
        let control = empty("control", 4 * CONTROL as u64);
        let shape = filled("numbers", cast_slice(&shared.numbers));
        let index = filled("indices", cast_slice(&shared.indices));
        let inverse = filled("inverses", cast_slice(inverses));
        let buffers = [&data, &control, &shape, &index, &inverse];
        let entry = |binding: u32| wgpu::BindGroupLayoutEntry {
            binding,
            visibility: wgpu::ShaderStages::COMPUTE,
            ty: wgpu::BindingType::Buffer {
                ty: wgpu::BufferBindingType::Storage { read_only: binding > 1 },
                has_dynamic_offset: false,
                min_binding_size: None,
            },
            count: None,
        };
        let entries: Vec<_> = (0..buffers.len() as u32).map(entry).collect();
        let bindings =
            device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: None, entries: &entries });
        let places: Vec<_> = (0..).zip(buffers).map(|(binding, b)| entire(binding, b)).collect();
        let group =
            device.create_bind_group(&wgpu::BindGroupDescriptor { label: None, layout: &bindings, entries: &places });
        let text = [
            layout.constants.as_str(),
            include_str!("common.wgsl"),
            include_str!("elastic.wgsl"),
            include_str!("search.wgsl"),
            include_str!("solve.wgsl"),
        ]
        .concat();
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("batch"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: None,
            bind_group_layouts: &[Some(&bindings)],
            immediate_size: 0,
        });
        let pipeline = |(_, name): &(Pass, &str)| {
            device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(name),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            })
        };
        let pipelines = PASSES.iter().map(pipeline).collect();
        let bytes = buffers.iter().map(|buffer| buffer.size()).sum();
        let [nodes, cells] = counts.map(|count| count as u32);
        let (sizes, padded) = ([layout.columns as u32, nodes, cells], layout.padded as u32);
        let own =
            Self { device, queue, name: info.name, data, control, group, pipelines, sizes, padded, bytes, failure };
        own.check()?;
        Ok(own)
    }

    /// Writes numbers of the instances, beginning at an offset (bytes).
    pub fn write(&self, offset: u64, numbers: &[f32]) {
        self.queue.write_buffer(&self.data, offset, cast_slice(numbers));
    }

    /// Begins a substep: its first round.
    pub fn begin_substep(&self, substep: usize) {
        self.queue.write_buffer(&self.control, 0, cast_slice(&[0u32, 0, substep as u32]));
    }

    /// Runs passes, one after the other.
    pub fn run(&self, passes: &[Pass]) {
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        {
            let mut compute = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            compute.set_bind_group(0, &self.group, &[]);
            for pass in passes {
                compute.set_pipeline(&self.pipelines[*pass as usize]);
                let [x, y] = self.workgroups(*pass);
                compute.dispatch_workgroups(x, y, 1);
            }
        }
        self.queue.submit([encoder.finish()]);
    }

    /// Columns that were not done after the last round.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the card was lost.
    pub fn active(&self) -> Result<u32> {
        let bytes = self.read_bytes(&self.control, 0, 4 * CONTROL as u64)?;
        Ok(cast_slice::<u8, u32>(&bytes)[1])
    }

    /// Reads numbers of the instances.
    ///
    /// # Errors
    /// [`Error::Gpu`] if the card was lost.
    pub fn read(&self, offset: u64, count: usize) -> Result<Vec<f32>> {
        let bytes = self.read_bytes(&self.data, offset, 4 * count as u64)?;
        Ok(cast_slice(&bytes).to_vec())
    }

    /// Whether the card did all that it was asked for.
    fn check(&self) -> Result<()> {
        match self.failure.lock().unwrap_or_else(PoisonError::into_inner).as_deref() {
            Some(reason) => Err(Error::Gpu(format!("{} failed: {reason}", self.name))),
            None => Ok(()),
        }
    }

    fn workgroups(&self, pass: Pass) -> [u32; 2] {
        let [columns, nodes, cells] = self.sizes;
        let tiles = columns / 64;
        match pass {
            Pass::CellsOfGuess | Pass::CellsOfFlat | Pass::CellsOfTrial => [tiles, cells],
            Pass::Begin | Pass::GatherGuess | Pass::GatherTrial | Pass::TurnNodes | Pass::Respond => [tiles, nodes],
            Pass::PullGuess | Pass::PullTrial => [tiles, 1],
            Pass::Solve => [tiles, self.padded / 64],
            Pass::NextRound => [1, 1],
            Pass::CheckGuess | Pass::Survey | Pass::BeforeSolve | Pass::AfterSolve | Pass::Judge | Pass::Finish => {
                [columns / 8, 1]
            }
        }
    }

    fn read_bytes(&self, from: &wgpu::Buffer, offset: u64, size: u64) -> Result<Vec<u8>> {
        let lost = |e: &dyn std::fmt::Display| Error::Gpu(format!("{} does not answer: {e}", self.name));
        let usage = wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST;
        let to = self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("read back"),
            size,
            usage,
            mapped_at_creation: false,
        });
        let mut encoder = self.device.create_command_encoder(&wgpu::CommandEncoderDescriptor::default());
        encoder.copy_buffer_to_buffer(from, offset, &to, 0, size);
        self.queue.submit([encoder.finish()]);
        let (send, receive) = std::sync::mpsc::channel();
        to.map_async(wgpu::MapMode::Read, .., move |result| {
            let _ = send.send(result);
        });
        self.device.poll(wgpu::PollType::wait_indefinitely()).map_err(|e| lost(&e))?;
        receive.recv().map_err(|e| lost(&e))?.map_err(|e| lost(&e))?;
        let bytes = to.get_mapped_range(..).map_err(|e| lost(&e))?.to_vec();
        to.unmap();
        self.check()?;
        Ok(bytes)
    }
}

/// A whole buffer at a binding.
fn entire(binding: u32, buffer: &wgpu::Buffer) -> wgpu::BindGroupEntry<'_> {
    wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() }
}
