//! `particlegs devices`.

use crate::common::Common;
use clap::Args;
use particlegs::Result;

#[derive(Args)]
#[command(after_help = "\
Examples:
  particlegs devices
  particlegs devices --json -

docs/guide/gpu.md says what cards do, and how to get one to be seen.")]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
}

/// Lists them.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.start()?;
    #[cfg(feature = "gpu")]
    return adapter_list::list(&context);
    #[cfg(not(feature = "gpu"))]
    {
        drop(context);
        Err(crate::device::no_gpu_support())
    }
}

#[cfg(feature = "gpu")]
mod adapter_list {
    use crate::common::Context;
    use particlegs::Result;
    use particlegs_gpu::{Adapter, adapters, advice};
    use serde::Serialize;

    #[derive(Serialize)]
    struct DevicesReport {
        devices: Vec<DeviceRow>,
        /// What would help where there is no card.
        #[serde(skip_serializing_if = "Option::is_none")]
        advice: Option<String>,
    }

    #[derive(Serialize)]
    struct DeviceRow {
        number: usize,
        name: String,
        kind: &'static str,
        interface: String,
        driver: String,
        memory_bytes: Option<u64>,
        largest_buffer_bytes: u64,
        largest_binding_bytes: u64,
        features: Vec<&'static str>,
    }

    /// Lists them.
    pub fn list(context: &Context) -> Result<()> {
        let all = adapters();
        let advice = all.iter().all(|a| a.software).then(advice);
        let row = |(number, a): (usize, _)| {
            let Adapter { name, interface, driver, kind, memory, largest, features, .. } = a;
            let [largest_buffer_bytes, largest_binding_bytes] = largest;
            DeviceRow {
                number,
                name,
                kind,
                interface,
                driver,
                memory_bytes: memory,
                largest_buffer_bytes,
                largest_binding_bytes,
                features,
            }
        };
        let devices: Vec<DeviceRow> = all.into_iter().enumerate().map(row).collect();
        let mut text: Vec<String> = devices.iter().map(line).collect();
        text.extend(advice.iter().map(|advice| format!("no graphics card: {advice}")));
        context.finish(&text.join("\n"), &DevicesReport { devices, advice })
    }

    fn line(r: &DeviceRow) -> String {
        let memory = r.memory_bytes.map_or(String::new(), |b| format!(", {:.1} GiB", b as f64 / f64::from(1 << 30)));
        let features = if r.features.is_empty() { "none".into() } else { r.features.join(", ") };
        format!("{}: {} ({}{memory}; {}, {}; features: {features})", r.number, r.name, r.kind, r.interface, r.driver)
    }
}
