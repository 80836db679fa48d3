//! Adapters to draw on.

use particlegs_core::{Error, Hint, Result};

/// A GPU, or a program that stands in for one.
#[derive(Clone, Debug)]
pub struct Adapter {
    pub name: String,
    /// Vulkan, Metal or DX12.
    pub interface: String,
    /// The driver and its version.
    pub driver: String,
    /// Its kind, in words.
    pub kind: &'static str,
    /// Whether it is a software adapter that runs on the CPU.
    pub software: bool,
    /// Bytes of its own memory, where that is known.
    pub memory: Option<u64>,
    /// Bytes of the largest buffer, and of the largest part of one that a kernel sees.
    pub largest: [u64; 2],
    /// Features that kernels may use where there are some.
    pub features: Vec<&'static str>,
}

/// The adapter to open.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AdapterChoice {
    /// The first real GPU.
    Gpu,
    /// By its place in [`adapters`], from 0: software too.
    Number(usize),
}

/// Features that are told, and what they are called.
const FEATURES: [(wgpu::Features, &str); 4] = [
    (wgpu::Features::SUBGROUP, "subgroups"),
    (wgpu::Features::SHADER_F16, "f16"),
    (wgpu::Features::SHADER_FLOAT32_ATOMIC, "float atomics"),
    (wgpu::Features::TIMESTAMP_QUERY, "timestamps"),
];

/// All adapters, in the order of their numbers.
pub fn adapters() -> Vec<Adapter> {
    found().iter().map(described).collect()
}

/// Adapters as wgpu has them.
fn found() -> Vec<wgpu::Adapter> {
    let instance = wgpu::Instance::new(wgpu::InstanceDescriptor::new_without_display_handle());
    pollster::block_on(instance.enumerate_adapters(wgpu::Backends::PRIMARY))
}

fn is_software(info: &wgpu::AdapterInfo) -> bool {
    info.device_type == wgpu::DeviceType::Cpu
}

fn described(adapter: &wgpu::Adapter) -> Adapter {
    let (info, limits, features) = (adapter.get_info(), adapter.limits(), adapter.features());
    let kind = match info.device_type {
        wgpu::DeviceType::DiscreteGpu => "GPU",
        wgpu::DeviceType::IntegratedGpu => "integrated",
        wgpu::DeviceType::VirtualGpu => "virtual GPU",
        wgpu::DeviceType::Cpu => "software",
        wgpu::DeviceType::Other => "unknown kind",
    };
    // Either of the two may be empty.
    let driver = [info.driver.as_str(), info.driver_info.as_str()].join(" ").trim().to_string();
    Adapter {
        memory: memory_of(adapter),
        largest: [limits.max_buffer_size, limits.max_storage_buffer_binding_size],
        features: FEATURES.iter().filter(|(f, _)| features.contains(*f)).map(|(_, name)| *name).collect(),
        software: is_software(&info),
        interface: format!("{:?}", info.backend),
        name: info.name,
        driver,
        kind,
    }
}

/// Bytes of the memory that is the adapter's own; Vulkan alone says.
#[cfg(not(target_vendor = "apple"))]
pub(crate) fn memory_of(adapter: &wgpu::Adapter) -> Option<u64> {
    // SAFETY: the handles are used while the adapter lives, for a question that changes nothing.
    let bytes = unsafe {
        let vulkan = adapter.as_hal::<wgpu::hal::api::Vulkan>()?;
        let instance = vulkan.shared_instance().raw_instance();
        let memory = instance.get_physical_device_memory_properties(vulkan.raw_physical_device());
        let heaps = &memory.memory_heaps[..memory.memory_heap_count as usize];
        // The bit of heaps that are the device's own is the first (VK_MEMORY_HEAP_DEVICE_LOCAL_BIT).
        heaps.iter().filter(|h| h.flags.as_raw() & 1 != 0).map(|h| h.size).sum()
    };
    Some(bytes)
}

#[cfg(target_vendor = "apple")]
pub(crate) fn memory_of(_adapter: &wgpu::Adapter) -> Option<u64> {
    None
}

/// The adapter of a choice.
pub(crate) fn chosen(choice: AdapterChoice) -> Result<wgpu::Adapter> {
    let mut all = found();
    let place = match choice {
        AdapterChoice::Gpu => all.iter().position(|a| !is_software(&a.get_info())),
        AdapterChoice::Number(n) => (n < all.len()).then_some(n),
    };
    let Some(place) = place else {
        let message = match choice {
            AdapterChoice::Gpu => format!("no usable GPU: {}", advice()),
            AdapterChoice::Number(n) => format!("there is no device {n}: `particlegs devices` lists {}", all.len()),
        };
        return Err(Error::argument_with(message, Hint::default()));
    };
    Ok(all.swap_remove(place))
}

/// Advice for a machine whose GPU is there and is not found, by what the machine looks like.
pub fn advice() -> String {
    let exists = |path: &str| std::path::Path::new(path).exists();
    let nvidia = exists("/proc/driver/nvidia/version") || exists("/dev/nvidiactl");
    let drm = std::fs::read_dir("/dev/dri").is_ok_and(|mut d| d.next().is_some());
    let loader = ["/usr/lib/x86_64-linux-gnu", "/usr/lib/aarch64-linux-gnu", "/usr/lib64", "/usr/lib"]
        .iter()
        .any(|folder| exists(&format!("{folder}/libvulkan.so.1")));
    let manifests = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
    let icd = |word: &str| {
        let named = |folder: &&str| {
            let files = std::fs::read_dir(folder).into_iter().flatten().flatten();
            files.into_iter().any(|f| f.file_name().to_string_lossy().contains(word))
        };
        manifests.iter().any(named)
    };
    if !cfg!(target_os = "linux") {
        return "is a driver of the GPU's vendor installed?".into();
    }
    match (nvidia, drm, loader) {
        (true, _, false) => {
            "the NVIDIA driver is installed, but no Vulkan loader (Debian: `apt-get install libvulkan1`)".into()
        }
        (true, _, true) if !icd("nvidia") => "an NVIDIA driver is there, but no Vulkan manifest of it: in a container \
             set NVIDIA_DRIVER_CAPABILITIES=all and install libXext (Debian: libxext6), else name its file by \
             VK_DRIVER_FILES, e.g. with {\"file_format_version\": \"1.0.0\", \"ICD\": {\"library_path\": \
             \"libEGL_nvidia.so.0\", \"api_version\": \"1.3\"}} in it"
            .into(),
        (true, ..) => "an NVIDIA driver and its Vulkan manifest are there, but it does not start: in a container set \
             NVIDIA_DRIVER_CAPABILITIES=all, install libXext (Debian: libxext6), and see `vulkaninfo --summary`"
            .into(),
        (_, true, false) => {
            "there is a GPU, but no Vulkan loader (Debian: `apt-get install libvulkan1 mesa-vulkan-drivers`)".into()
        }
        (_, true, true) => {
            "a GPU is there, but no Vulkan driver for it (Debian, AMD and Intel: `apt-get install mesa-vulkan-drivers`), \
             or you may not use it (groups `render`, `video`)"
                .into()
        }
        _ => "this machine has no /dev/dri and no NVIDIA driver".into(),
    }
}
