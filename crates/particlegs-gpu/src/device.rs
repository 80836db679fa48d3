//! An adapter that was opened.

use crate::adapters::{AdapterChoice, chosen, memory_of};
use particlegs_core::picture::Size;
use particlegs_core::{Error, Hint, Result};
use std::sync::{Arc, Mutex, PoisonError};

/// Whether the program checks every index and every loop of its kernels while they run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Checks {
    /// No: kernels are this crate's own, and their loops end. Bounds on loops cost up to a hundredfold on some drivers
    /// (gfx-rs/wgpu issue 7698).
    Off,
    On,
}

/// Runs kernels, for example between two readings of a clock, and counts what is read back.
pub trait KernelWatch: Send + Sync {
    /// `run` dispatches the kernel of this name.
    fn around(&self, kernel: &'static str, pass: &mut wgpu::ComputePass<'_>, run: &dyn Fn(&mut wgpu::ComputePass<'_>));

    /// Called when `bytes` of a buffer are read back.
    fn reads(&self, _bytes: u64) {}
}

/// Bytes that any GPU can hold.
const UNKNOWN_ROOM: u64 = 1 << 30;

/// A device and its queue.
pub struct Device {
    pub device: wgpu::Device,
    pub queue: wgpu::Queue,
    pub(crate) checks: Checks,
    /// The watch that runs its kernels, where it was opened with one.
    pub(crate) watch: Option<Arc<dyn KernelWatch>>,
    name: String,
    /// Bytes of its own memory, where that is known.
    memory: Option<u64>,
    /// The first thing that went wrong since it was last asked.
    fault: Arc<Mutex<Option<DeviceFault>>>,
}

enum DeviceFault {
    Memory,
    Lost(String),
    Other(String),
}

impl Device {
    /// Opens an adapter with the limits that it has and without any feature.
    pub fn open(choice: AdapterChoice, checks: Checks) -> Result<Device> {
        Device::open_watched(choice, checks, wgpu::Features::empty(), |_| None)
    }

    /// [`Device::open`], with the features of these that the adapter has, and somebody who runs its kernels.
    pub fn open_watched(
        choice: AdapterChoice,
        checks: Checks,
        features: wgpu::Features,
        watch: impl FnOnce(&wgpu::Device) -> Option<Arc<dyn KernelWatch>>,
    ) -> Result<Device> {
        let adapter = chosen(choice)?;
        let (name, memory) = (adapter.get_info().name, memory_of(&adapter));
        let descriptor = wgpu::DeviceDescriptor {
            label: Some("particlegs"),
            required_features: adapter.features() & features,
            // wgpu's default limits would allow a binding only 128 MiB on any device.
            required_limits: adapter.limits(),
            memory_hints: wgpu::MemoryHints::MemoryUsage,
            ..Default::default()
        };
        let opened = pollster::block_on(adapter.request_device(&descriptor));
        let (device, queue) = opened.map_err(|e| Error::argument(format!("device {name}: {e}")))?;
        let fault: Arc<Mutex<Option<DeviceFault>>> = Arc::default();
        let note = |fault: &Arc<Mutex<Option<DeviceFault>>>| {
            let fault = fault.clone();
            move |new: DeviceFault| {
                // Later faults mostly follow from the first one.
                fault.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(new);
            }
        };
        let (of_errors, of_loss) = (note(&fault), note(&fault));
        device.on_uncaptured_error(Arc::new(move |e| {
            of_errors(match e {
                wgpu::Error::OutOfMemory { .. } => DeviceFault::Memory,
                other => DeviceFault::Other(other.to_string()),
            });
        }));
        device.set_device_lost_callback(move |reason, text| {
            // Somebody destroyed it on purpose: the loss is no fault.
            if reason != wgpu::DeviceLostReason::Destroyed {
                of_loss(DeviceFault::Lost(text));
            }
        });
        let watch = watch(&device);
        Ok(Device { device, queue, checks, watch, name, memory, fault })
    }

    pub fn name(&self) -> &str {
        &self.name
    }

    /// Bytes of the largest part of a buffer that a kernel sees.
    pub fn largest_binding(&self) -> u64 {
        let limits = self.device.limits();
        limits.max_storage_buffer_binding_size.min(limits.max_buffer_size)
    }

    /// Bytes that may stay on it from picture to picture: half of its own memory, little where that is not known.
    pub fn room(&self) -> u64 {
        self.memory.map_or(UNKNOWN_ROOM, |m| m / 2)
    }

    /// Whatever went wrong on the device since this was last asked.
    pub fn check(&self) -> Result<()> {
        let fault = self.fault.lock().unwrap_or_else(PoisonError::into_inner).take();
        // wgpu's messages have several lines, but an error is one line.
        let line = |text: &str| text.split_whitespace().collect::<Vec<_>>().join(" ");
        let (message, hint) = match fault {
            None => return Ok(()),
            Some(DeviceFault::Memory) => (
                "its memory is too small for this".into(),
                Hint::from("use a smaller picture, or ").option("device", "cpu"),
            ),
            Some(DeviceFault::Lost(text)) => (
                format!("it was lost through a reset or its driver ({})", line(&text)),
                Hint::from("run again; to continue training from its checkpoint use ").option("resume", ""),
            ),
            Some(DeviceFault::Other(text)) => (line(&text), Hint::default()),
        };
        Err(Error::input_with(format!("device {}", self.name), message, hint))
    }

    /// Waits until all that was given to it is done.
    pub fn wait(&self) -> Result<()> {
        let waited = self.device.poll(wgpu::PollType::wait_indefinitely());
        self.check()?;
        waited.map(drop).map_err(|e| Error::input(format!("device {}", self.name), e.to_string()))
    }

    /// Refuses a `subject` that takes more bytes in a buffer than the device can bind.
    pub(crate) fn holds(&self, subject: &str, bytes: u64) -> Result<()> {
        let most = self.largest_binding();
        if bytes <= most {
            return Ok(());
        }
        let message = format!("{subject}: device {} can bind only {most} bytes", self.name);
        Err(Error::argument_with(format!("{message}, but {bytes} are needed"), Hint::use_cpu()))
    }

    /// Refuses a picture that takes more bytes in a buffer than the device can bind, or has no pixels.
    pub(crate) fn fits(&self, size: Size, bytes: u64) -> Result<()> {
        let most = self.largest_binding();
        if bytes <= most && size.pixels() > 0 {
            return Ok(());
        }
        let message = format!("{}x{}: device {} can bind only {most} bytes", size.width, size.height, self.name);
        Err(Error::argument_with(format!("{message}, too few for such a picture"), Hint::use_cpu()))
    }

    /// A buffer of zeros.
    pub fn buffer(&self, label: &str, bytes: u64, usage: wgpu::BufferUsages) -> wgpu::Buffer {
        // Empty buffers cannot be bound.
        let size = bytes.max(16).next_multiple_of(16);
        self.device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(label),
            size,
            usage,
            mapped_at_creation: false,
        })
    }

    /// A buffer with these bytes.
    pub(crate) fn filled<T: bytemuck::NoUninit>(
        &self,
        label: &str,
        data: &[T],
        usage: wgpu::BufferUsages,
    ) -> wgpu::Buffer {
        let bytes: &[u8] = bytemuck::cast_slice(data);
        let buffer = self.buffer(label, bytes.len() as u64, usage | wgpu::BufferUsages::COPY_DST);
        self.queue.write_buffer(&buffer, 0, bytes);
        buffer
    }

    /// The bytes of a buffer, once all that was given to the device is done.
    pub fn read(&self, from: &wgpu::Buffer, bytes: u64) -> Result<Vec<u8>> {
        // Buffers are copied in whole words.
        let size = bytes.next_multiple_of(4);
        self.watch.iter().for_each(|watch| watch.reads(size));
        let usage = wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ;
        let to = self.buffer("read back", size, usage);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(from, 0, &to, 0, size);
        self.queue.submit([encoder.finish()]);
        // A failure shows below, in `wait` or when the range is taken.
        to.map_async(wgpu::MapMode::Read, .., |_| {});
        self.wait()?;
        let mapped = to.get_mapped_range(..size);
        let mapped = mapped.map_err(|e| Error::input(format!("device {}", self.name), e.to_string()))?;
        Ok(mapped[..bytes as usize].to_vec())
    }
}
