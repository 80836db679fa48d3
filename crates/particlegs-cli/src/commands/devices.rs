//! `particlegs devices`.

use crate::common::Common;
use clap::Args;
use particlegs_core::Result;

#[derive(Args)]
#[command(after_help = "\
Examples:
  particlegs devices
  particlegs devices --json -

docs/guide/gpu.md says what GPUs are used for, and what to do if none is found.")]
pub struct Arguments {
    #[command(flatten)]
    common: Common,
}

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
    use crate::common::CommandContext;
    use particlegs_core::Result;
    use particlegs_gpu::{Adapter, adapters, advice};
    use serde_json::json;

    /// Lists them.
    pub fn list(context: &CommandContext) -> Result<()> {
        let all = adapters();
        let advice = all.iter().all(|a| a.software).then(advice);
        let mut text: Vec<String> = all.iter().enumerate().map(line).collect();
        text.extend(advice.iter().map(|advice| format!("no GPU: {advice}")));
        let row = |(number, a): (usize, &Adapter)| {
            json!({
                "number": number, "name": a.name, "kind": a.kind, "interface": a.interface, "driver": a.driver,
                "memory_bytes": a.memory, "largest_buffer_bytes": a.largest[0], "largest_binding_bytes": a.largest[1],
                "features": a.features,
            })
        };
        let mut report = json!({ "devices": all.iter().enumerate().map(row).collect::<Vec<_>>() });
        // Without a GPU, say what would help.
        advice.iter().for_each(|advice| report["advice"] = advice.as_str().into());
        context.finish(&text.join("\n"), &report)
    }

    fn line((number, a): (usize, &Adapter)) -> String {
        let memory = a.memory.map_or(String::new(), |b| format!(", {:.1} GiB", b as f64 / f64::from(1 << 30)));
        let features = if a.features.is_empty() { "none".into() } else { a.features.join(", ") };
        format!("{number}: {} ({}{memory}; {}, {}; features: {features})", a.name, a.kind, a.interface, a.driver)
    }
}
