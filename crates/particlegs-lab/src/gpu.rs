//! The time of each kernel of a picture or a step, by the device's clock before and after it, where it has one.

use particlegs_core::Result;
use particlegs_gpu::{AdapterChoice, Checks, Device, KernelWatch};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use wgpu::BufferUsages as Use;

/// Features that a device must offer for that.
const WANTED: wgpu::Features = wgpu::Features::TIMESTAMP_QUERY.union(wgpu::Features::TIMESTAMP_QUERY_INSIDE_PASSES);
/// Kernels that are timed together, at most: a set of queries has 4096 at most.
const MOST: usize = 2048;

/// A clock that kernels are timed by while somebody asks.
struct Timer {
    queries: wgpu::QuerySet,
    /// The names of the kernels that were run since somebody asked; `None` = nobody does.
    asked: Mutex<Option<Vec<&'static str>>>,
}

/// A kernel in what was timed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KernelTime {
    pub kernel: &'static str,
    /// Number of its runs.
    pub runs: usize,
    /// Seconds of all its runs.
    pub seconds: f64,
}

/// A device whose kernels are timed where it has a clock.
pub struct TimedDevice {
    pub device: Arc<Device>,
    timer: Option<Arc<Timer>>,
}

impl Timer {
    /// Of a device that has what is [`WANTED`].
    fn new(device: &wgpu::Device) -> Timer {
        let (ty, count) = (wgpu::QueryType::Timestamp, 2 * MOST as u32);
        let queries = device.create_query_set(&wgpu::QuerySetDescriptor { label: Some("clock"), ty, count });
        Timer { queries, asked: Mutex::default() }
    }

    fn asked(&self) -> MutexGuard<'_, Option<Vec<&'static str>>> {
        self.asked.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl KernelWatch for Timer {
    /// Runs a kernel, timed where somebody asks.
    fn around(&self, kernel: &'static str, pass: &mut wgpu::ComputePass<'_>, run: &dyn Fn(&mut wgpu::ComputePass<'_>)) {
        let place = self.asked().as_mut().map(|runs| {
            runs.push(kernel);
            2 * (runs.len() as u32 - 1)
        });
        let Some(place) = place.filter(|p| *p < 2 * MOST as u32) else { return run(pass) };
        pass.write_timestamp(&self.queries, place);
        run(pass);
        pass.write_timestamp(&self.queries, place + 1);
    }
}

impl TimedDevice {
    pub fn open(choice: AdapterChoice, checks: Checks) -> Result<TimedDevice> {
        let mut timer = None;
        let device = Device::open_watched(choice, checks, WANTED, |device| {
            timer = device.features().contains(WANTED).then(|| Arc::new(Timer::new(device)));
            timer.clone().map(|t| t as Arc<dyn KernelWatch>)
        })?;
        Ok(TimedDevice { device: Arc::new(device), timer })
    }

    /// The kernels that `work` runs, in the order of their first runs, and how long each takes. `None` where the device
    /// has no clock that it shows, was not opened for it, or more was run than it times together.
    pub fn timed(&self, work: impl FnOnce() -> Result<()>) -> Result<Option<Vec<KernelTime>>> {
        let Some(timer) = &self.timer else { return work().map(|()| None) };
        let device = &self.device;
        // Earlier work must not run beside what is timed.
        device.wait()?;
        *timer.asked() = Some(Vec::new());
        let done = work();
        // Taken before `done` is looked at, so that the timing ends even if the work failed.
        let runs = timer.asked().take().unwrap_or_default();
        done?;
        if runs.is_empty() || runs.len() > MOST {
            return Ok(None);
        }
        let bytes = 16 * runs.len() as u64;
        let times = device.buffer("times", bytes, Use::QUERY_RESOLVE | Use::COPY_SRC);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        encoder.resolve_query_set(&timer.queries, 0..2 * runs.len() as u32, &times, 0);
        device.queue.submit([encoder.finish()]);
        let bytes = device.read(&times, bytes)?;
        let ticks = |b: &[u8]| u64::from_le_bytes(std::array::from_fn(|k| b[k]));
        let second = 1e-9 * f64::from(device.queue.get_timestamp_period());
        let mut stages: Vec<KernelTime> = Vec::new();
        for (kernel, both) in runs.into_iter().zip(bytes.chunks_exact(16)) {
            let seconds = ticks(&both[8..]).saturating_sub(ticks(&both[..8])) as f64 * second;
            match stages.iter_mut().find(|s| s.kernel == kernel) {
                Some(s) => (s.runs, s.seconds) = (s.runs + 1, s.seconds + seconds),
                None => stages.push(KernelTime { kernel, runs: 1, seconds }),
            }
        }
        Ok(Some(stages))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_gpu::kernel::{BufferUse, Kernel};

    #[test]
    #[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
    fn kernels_are_timed_while_somebody_asks() {
        let timed = TimedDevice::open(AdapterChoice::Number(0), Checks::On).unwrap();
        let device = &timed.device;
        let words = device.buffer("words", 1 << 20, wgpu::BufferUsages::STORAGE);
        let kernel = Kernel::new(
            device,
            "additions",
            &[include_str!("experiments/gpu/additions_main.wgsl")],
            &[BufferUse::Write],
        );
        let bound = kernel.bind(device, &[&words]);
        let run = |times: usize| {
            let mut encoder = device.device.create_command_encoder(&Default::default());
            let mut pass = encoder.begin_compute_pass(&Default::default());
            (0..times).for_each(|_| kernel.run(&mut pass, &bound, [16, 1]));
            drop(pass);
            device.queue.submit([encoder.finish()]);
            Ok(())
        };
        run(2).unwrap();
        let Some(stages) = timed.timed(|| run(3)).unwrap() else {
            assert!(timed.timer.is_none());
            return;
        };
        assert_eq!((stages.len(), stages[0].kernel, stages[0].runs), (1, "additions", 3));
        assert!(stages[0].seconds > 0.0 && stages[0].seconds < 60.0, "{stages:?}");
        // More than are timed together; then as before.
        assert_eq!(timed.timed(|| run(super::MOST + 1)).unwrap(), None);
        assert_eq!(timed.timed(|| run(1)).unwrap().unwrap()[0].runs, 1);
        device.check().unwrap();
    }
}
