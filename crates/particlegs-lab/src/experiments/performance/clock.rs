//! Wall-clock times, with the load of the machine; short ones are measured several times.

use crate::report::line_of;
use crate::results::{Spread, TableCell};
use particlegs_core::{Result, parallel};
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::time::Instant;

/// Conditions that times depend on besides the work: program, CPU, threads.
#[derive(Clone, Debug, Serialize)]
pub(super) struct Machine {
    commit: Option<&'static str>,
    processor: Option<String>,
    threads: usize,
}

impl Machine {
    pub fn here() -> Machine {
        Machine {
            commit: option_env!("PARTICLEGS_COMMIT"),
            processor: line_of("/proc/cpuinfo", "model name"),
            threads: parallel::threads(),
        }
    }

    pub fn describe(&self) -> String {
        format!("{} threads of {}", self.threads, self.processor.as_deref().unwrap_or("an unknown CPU"))
    }
}

/// Mean number of runnable processes during the last minute; `None` if the system does not tell.
pub(super) fn load() -> Option<f64> {
    std::fs::read_to_string(Path::new("/proc/loadavg")).ok()?.split(' ').next()?.parse().ok()
}

/// Times of the same work.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct Times {
    /// Seconds of each time.
    pub seconds: Vec<f64>,
    /// Load of the machine at the end.
    pub load: Option<f64>,
}

impl Times {
    /// Times `work` this many times.
    pub fn new<T>(times: usize, mut work: impl FnMut() -> Result<T>) -> Result<Times> {
        let mut seconds = Vec::with_capacity(times);
        for _ in 0..times {
            let start = Instant::now();
            let done = work()?;
            seconds.push(start.elapsed().as_secs_f64());
            drop(done);
        }
        Ok(Times { seconds, load: load() })
    }

    /// Median and range in seconds.
    pub fn cell(&self) -> TableCell {
        seconds(&self.seconds)
    }
}

/// Times of pictures, each drawn several times.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct FrameTimes {
    /// Seconds: one row per view, in order; the last views may be missing.
    pub views: Vec<Vec<f64>>,
    /// Load of the machine at the end.
    pub load: Option<f64>,
}

impl FrameTimes {
    /// Median and range over all frames, in milliseconds.
    pub fn cell(&self) -> TableCell {
        let all: Vec<f64> = self.views.iter().flatten().map(|s| 1000.0 * s).collect();
        TableCell::spread(&all, digits(Spread::new(&all).map_or(0.0, |s| s.median)))
    }

    /// Speed-up of these over others, for each view that both have.
    pub fn faster_than(&self, others: &FrameTimes) -> Vec<f64> {
        let median = |v: &Vec<f64>| Some(Spread::new(v)?.median);
        let ratio = |(times, other): (&Vec<f64>, &Vec<f64>)| Some(median(other)? / median(times)?);
        self.views.iter().zip(&others.views).filter_map(ratio).collect()
    }
}

/// Seconds with about three significant digits.
pub(super) fn seconds(values: &[f64]) -> TableCell {
    TableCell::spread(values, digits(Spread::new(values).map_or(0.0, |s| s.median)))
}

/// Digits after the point for about three significant ones.
pub(super) fn digits(value: f64) -> usize {
    (2 - value.abs().max(1e-4).log10().floor() as i32).clamp(0, 5) as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_repeated_and_compared_by_view() {
        let mut count = 0;
        let times = Times::new(5, || {
            count += 1;
            std::thread::sleep(std::time::Duration::from_millis(2));
            Ok(())
        });
        let seconds = times.unwrap().seconds;
        assert!(count == 5 && seconds.len() == 5 && seconds.iter().all(|s| *s >= 0.002), "{seconds:?}");
        let frames = |views: &[&[f64]]| FrameTimes { views: views.iter().map(|v| v.to_vec()).collect(), load: None };
        let (ours, others) = (frames(&[&[0.1, 0.3, 0.2], &[0.1], &[0.1]]), frames(&[&[2.0], &[3.0]]));
        // The third view was drawn by one alone.
        let faster = ours.faster_than(&others);
        assert_eq!(faster.len(), 2);
        assert!((faster[0] - 10.0).abs() < 1e-9 && (faster[1] - 30.0).abs() < 1e-9, "{faster:?}");
        assert_eq!(others.cell().describe(), "2500 (2000 to 3000)");
    }

    #[test]
    fn seconds_have_three_digits() {
        assert_eq!([0.0, 0.0123, 0.123, 1.23, 12.3, 123.0, 1234.0].map(digits), [5, 4, 3, 2, 1, 0, 0]);
    }
}
