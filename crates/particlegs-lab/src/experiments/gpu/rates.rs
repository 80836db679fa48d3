//! Highest rates of a device, beside which its measurements stand.

use particlegs_core::Result;
use particlegs_gpu::Device;
use particlegs_gpu::kernel::{BufferUse, Kernel};
use std::time::{Duration, Instant};

/// Bytes of what is copied, and words that are added to: as many as a picture of 1920 x 1080 has.
const BYTES: u64 = 128 << 20;
const WORDS: u64 = 1 << 21;
/// Threads that add, and additions of each.
const ADDERS: [u32; 2] = [16384, 64];
/// Threads that compute, in groups, and operations of each: as many as operations_main.wgsl has.
const COMPUTERS: [u32; 2] = [4096, 256 * 32];
/// Approximate time of each measurement.
const LONG: Duration = Duration::from_millis(500);

/// Rates of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rates {
    /// Bytes a second that are read and written, each counted, where they are copied from buffer to buffer.
    pub copied_bytes: f64,
    /// Atomic additions a second to words of a plane.
    pub additions: f64,
    /// Operations of float32 a second: products and sums.
    pub operations: f64,
}

impl Rates {
    /// Measures them; takes about a second.
    pub fn measure(device: &Device) -> Result<Rates> {
        use wgpu::BufferUsages as Usage;
        let usage = Usage::STORAGE | Usage::COPY_SRC | Usage::COPY_DST;
        let [from, to] = ["copied", "copy"].map(|label| device.buffer(label, BYTES, usage));
        let copied = rate(device, |encoder| encoder.copy_buffer_to_buffer(&from, 0, &to, 0, BYTES))?;
        let words = device.buffer("words", 4 * WORDS, usage);
        let kernel = Kernel::new(device, "additions", &[include_str!("additions_main.wgsl")], &[BufferUse::Write]);
        let bound = kernel.bind(device, &[&words]);
        let added = rate(device, |encoder| {
            kernel.run(&mut encoder.begin_compute_pass(&Default::default()), &bound, [ADDERS[0], 1]);
        })?;
        let kernel = Kernel::new(device, "operations", &[include_str!("operations_main.wgsl")], &[BufferUse::Write]);
        let bound = kernel.bind(device, &[&words]);
        let computed = rate(device, |encoder| {
            kernel.run(&mut encoder.begin_compute_pass(&Default::default()), &bound, [COMPUTERS[0], 1]);
        })?;
        let each = |[groups, operations]: [u32; 2]| f64::from(64 * groups) * f64::from(operations);
        Ok(Rates {
            copied_bytes: 2.0 * BYTES as f64 * copied,
            additions: each(ADDERS) * added,
            operations: each(COMPUTERS) * computed,
        })
    }
}

/// Runs of `each` a second.
fn rate(device: &Device, each: impl Fn(&mut wgpu::CommandEncoder)) -> Result<f64> {
    let run = |times: usize| -> Result<f64> {
        let started = Instant::now();
        for _ in 0..times {
            let mut encoder = device.device.create_command_encoder(&Default::default());
            each(&mut encoder);
            device.queue.submit([encoder.finish()]);
        }
        device.wait()?;
        Ok(started.elapsed().as_secs_f64())
    };
    // The first run also compiles and allocates, so the second one is timed.
    run(1)?;
    let times = (LONG.as_secs_f64() / run(1)?).clamp(1.0, 10_000.0) as usize;
    Ok(times as f64 / run(times)?)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_gpu::{AdapterChoice, Checks};

    #[test]
    #[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
    fn a_device_copies_adds_and_computes() {
        let device = Device::open(AdapterChoice::Number(0), Checks::On).unwrap();
        let rates = Rates::measure(&device).unwrap();
        eprintln!("{rates:?}");
        // A machine that does less is no machine.
        assert!(rates.copied_bytes > 1e7 && rates.additions > 1e5 && rates.operations > 1e7, "{rates:?}");
    }
}
