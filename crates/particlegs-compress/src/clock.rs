//! Time of a job by phase.

use std::time::Instant;

/// Wall-clock seconds by phase, in the order in which phases first came.
#[derive(Clone, Debug, Default)]
pub(crate) struct Clock {
    seconds: Vec<(&'static str, f64)>,
}

impl Clock {
    pub fn time<T>(&mut self, phase: &'static str, work: impl FnOnce() -> T) -> T {
        let start = Instant::now();
        let done = work();
        self.add(phase, start.elapsed().as_secs_f64());
        done
    }

    pub fn append(&mut self, other: Clock) {
        other.seconds.into_iter().for_each(|(phase, seconds)| self.add(phase, seconds));
    }

    fn add(&mut self, phase: &'static str, seconds: f64) {
        match self.seconds.iter_mut().find(|s| s.0 == phase) {
            Some(s) => s.1 += seconds,
            None => self.seconds.push((phase, seconds)),
        }
    }

    pub fn seconds(self) -> Vec<(&'static str, f64)> {
        self.seconds
    }
}
