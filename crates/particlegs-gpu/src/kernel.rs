//! A kernel: a pipeline, and what is bound to it.

use crate::Device;
use crate::device::{Checks, KernelWatch};
use std::sync::Arc;

/// The end of kernels that write grey levels.
pub(crate) const FOUR_LEVELS: &str = include_str!("four_levels_main.wgsl");

/// A kernel's use of a buffer.
#[derive(Clone, Copy, Debug)]
pub enum BufferUse {
    /// Records that all threads read.
    Uniform,
    Read,
    Write,
}

/// A kernel whose entry is `main`.
pub struct Kernel {
    label: &'static str,
    pipeline: wgpu::ComputePipeline,
    layout: wgpu::BindGroupLayout,
    watch: Option<Arc<dyn KernelWatch>>,
}

impl Kernel {
    /// Of sources in WGSL one behind the other, with buffers for the bindings from 0 on.
    pub fn new(device: &Device, label: &'static str, sources: &[&str], uses: &[BufferUse]) -> Kernel {
        let source = wgpu::ShaderSource::Wgsl(sources.join("\n").into());
        let module = wgpu::ShaderModuleDescriptor { label: Some(label), source };
        let module = match device.checks {
            Checks::On => device.device.create_shader_module(module),
            // SAFETY: the crate's own kernels, which tests run with checks: their indices are within, their loops end.
            Checks::Off => unsafe {
                let checks =
                    wgpu::ShaderRuntimeChecks { force_loop_bounding: false, ..wgpu::ShaderRuntimeChecks::checked() };
                device.device.create_shader_module_trusted(module, checks)
            },
        };
        let entry = |(binding, usage): (usize, &BufferUse)| {
            let ty = match usage {
                BufferUse::Uniform => wgpu::BufferBindingType::Uniform,
                BufferUse::Read => wgpu::BufferBindingType::Storage { read_only: true },
                BufferUse::Write => wgpu::BufferBindingType::Storage { read_only: false },
            };
            wgpu::BindGroupLayoutEntry {
                binding: binding as u32,
                visibility: wgpu::ShaderStages::COMPUTE,
                ty: wgpu::BindingType::Buffer { ty, has_dynamic_offset: false, min_binding_size: None },
                count: None,
            }
        };
        let entries: Vec<_> = uses.iter().enumerate().map(entry).collect();
        let layout = device
            .device
            .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor { label: Some(label), entries: &entries });
        let pipeline_layout = device.device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some(label),
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let pipeline = device.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some(label),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some("main"),
            compilation_options: Default::default(),
            cache: None,
        });
        Kernel { label, pipeline, layout, watch: device.watch.clone() }
    }

    /// With buffers for its bindings.
    pub fn bind(&self, device: &Device, buffers: &[&wgpu::Buffer]) -> wgpu::BindGroup {
        let entries: Vec<_> = buffers
            .iter()
            .enumerate()
            .map(|(k, b)| wgpu::BindGroupEntry { binding: k as u32, resource: b.as_entire_binding() })
            .collect();
        let descriptor = wgpu::BindGroupDescriptor { label: Some(self.label), layout: &self.layout, entries: &entries };
        device.device.create_bind_group(&descriptor)
    }

    /// Runs over groups of threads within a pass.
    pub fn run(&self, pass: &mut wgpu::ComputePass<'_>, bound: &wgpu::BindGroup, groups: [u32; 2]) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, bound, &[]);
        let run = |pass: &mut wgpu::ComputePass<'_>| pass.dispatch_workgroups(groups[0], groups[1], 1);
        match &self.watch {
            None => run(pass),
            Some(watch) => watch.around(self.label, pass, &run),
        }
    }
}
