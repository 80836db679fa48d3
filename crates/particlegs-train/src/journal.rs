//! The report of a run: messages for the user, JSON lines for its log.

use super::learner::NonFiniteGradient;
use particlegs_core::context::Context;
use serde::Serialize;

/// Steps over which the loss that is logged is averaged.
const LOG_STEPS: u64 = 50;
/// Steps with gradients that are not finite of which each is named; then every tenth, hundredth, ...
const NAMED: u64 = 3;

#[derive(Clone, Debug, Default, Serialize)]
struct LogLine<'a> {
    #[serde(skip_serializing_if = "str::is_empty")]
    run: &'a str,
    iteration: u64,
    seconds: f64,
    loss: Option<f64>,
    held_out_masked_psnr: Option<f64>,
    gaussians: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    not_finite: Option<String>,
    #[serde(skip_serializing_if = "Option::is_none")]
    not_finite_steps: Option<u64>,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct RunStatus {
    pub iteration: u64,
    pub iterations: u64,
    /// Seconds of the command so far.
    pub seconds: f64,
    pub gaussians: usize,
}

pub(crate) struct Journal<'a> {
    context: &'a Context<'a>,
    /// Name of the run among several of a command; empty = the only one.
    run: &'a str,
    /// Sum of the losses since the last line of the log.
    pub loss_sum: f64,
    /// Steps with gradients that were not finite.
    pub faulty: u64,
}

impl<'a> Journal<'a> {
    pub fn new(context: &'a Context<'a>, run: &'a str) -> Self {
        Journal { context, run, loss_sum: 0.0, faulty: 0 }
    }

    pub fn step(&mut self, loss: f64, not_finite: Option<NonFiniteGradient>, at: &RunStatus) {
        self.loss_sum += loss;
        if let Some(n) = not_finite {
            self.fault(&n, at);
        }
        if at.iteration.is_multiple_of(LOG_STEPS) {
            let loss = std::mem::take(&mut self.loss_sum) / LOG_STEPS as f64;
            self.log(LogLine { loss: Some(loss), ..LogLine::default() }, at);
        }
    }

    pub fn evaluation(&self, score: Option<f64>, at: &RunStatus) {
        self.log(LogLine { held_out_masked_psnr: score, ..LogLine::default() }, at);
        if let Some(s) = score {
            let RunStatus { iteration, iterations, gaussians, .. } = at;
            self.say(&format!(
                "step {iteration} of {iterations}: {s:.3} dB masked PSNR on held-out views, {gaussians} Gaussians"
            ));
        }
    }

    /// Says that the time is up before the steps are done.
    pub fn late(&self, at: &RunStatus) {
        self.say(&format!("note: training reached its time limit after {} of {} steps", at.iteration, at.iterations));
    }

    pub fn end(&self) {
        if self.faulty > NAMED {
            self.say(&format!("warning: gradients that were not finite were ignored in {} steps", self.faulty));
        }
    }

    /// Names the first gradients that are not finite; then says how many there are, ever more rarely.
    fn fault(&mut self, n: &NonFiniteGradient, at: &RunStatus) {
        self.faulty += 1;
        if self.faulty > NAMED && !is_power_of_ten(self.faulty) {
            return;
        }
        let more = if n.count > 1 { format!(" and {} more", n.count - 1) } else { String::new() };
        let parameters = format!("{} of Gaussian {}{more}", n.group, n.gaussian);
        let steps = if self.faulty > NAMED { format!(" (in {} steps so far)", self.faulty) } else { String::new() };
        self.say(&format!(
            "warning: step {}: gradient of {parameters} is not finite and is ignored{steps}",
            at.iteration
        ));
        let line = LogLine { not_finite: Some(parameters), not_finite_steps: Some(self.faulty), ..LogLine::default() };
        self.log(line, at);
    }

    fn say(&self, text: &str) {
        match self.run {
            "" => self.context.message(text),
            run => self.context.message(&format!("{run}: {text}")),
        }
    }

    fn log(&self, line: LogLine<'_>, at: &RunStatus) {
        let RunStatus { iteration, seconds, gaussians, .. } = *at;
        if let Ok(text) = serde_json::to_string(&LogLine { run: self.run, iteration, seconds, gaussians, ..line }) {
            self.context.log(&text);
        }
    }
}

fn is_power_of_ten(n: u64) -> bool {
    n == 10u64.saturating_pow(n.max(1).ilog10())
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::{ProgressEvent, ProgressSink};
    use std::sync::Mutex;

    #[derive(Default)]
    struct MessageRecorder(Mutex<[Vec<String>; 2]>);

    impl ProgressSink for MessageRecorder {
        fn message(&self, text: &str) {
            self.0.lock().unwrap()[0].push(text.into());
        }
        fn event(&self, event: ProgressEvent<'_>) {
            if let ProgressEvent::Log(line) = event {
                self.0.lock().unwrap()[1].push(line.into());
            }
        }
    }

    #[test]
    fn ten_thousand_faulty_steps_are_a_few_lines() {
        let recorder = MessageRecorder::default();
        let context = Context::SILENT.with_sink(&recorder);
        let mut journal = Journal::new(&context, "block 1");
        let n = NonFiniteGradient { group: "position", gaussian: 7, count: 3 };
        for iteration in 1..=10_000 {
            let at = RunStatus { iteration, iterations: 10_000, seconds: 0.0, gaussians: 9 };
            journal.step(f64::NAN, Some(n), &at);
        }
        journal.end();
        let [messages, lines] = recorder.0.into_inner().unwrap();
        let expected =
            "block 1: warning: step 1: gradient of position of Gaussian 7 and 2 more is not finite and is ignored";
        assert_eq!(messages[0], expected);
        assert_eq!(messages.len(), 3 + 4 + 1, "{messages:?}");
        assert!(messages[7].contains("in 10000 steps"), "{messages:?}");
        let faults: Vec<&String> = lines.iter().filter(|l| l.contains("not_finite\"")).collect();
        assert_eq!((faults.len(), lines.len()), (7, 7 + 200));
        assert!(faults[6].contains("\"not_finite_steps\":10000") && faults[6].contains("\"run\":\"block 1\""));
    }
}
