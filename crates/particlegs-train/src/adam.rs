//! Adam (Kingma and Ba 2015), one instance a group of parameters.

use particlegs_core::parallel;

const RUN: usize = 1 << 14;

/// The decay of the averages, and what keeps the division finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Adam {
    /// Decay of the mean gradient.
    pub beta1: f32,
    /// Decay of the mean squared gradient.
    pub beta2: f32,
    /// Added to the root of the latter.
    pub epsilon: f32,
}

/// Running averages of the gradients of a group.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Averages {
    pub first: Vec<f32>,
    pub second: Vec<f32>,
    pub steps: u64,
}

impl Averages {
    /// For `len` parameters, before any step.
    pub fn zeros(len: usize) -> Self {
        Averages { first: vec![0.0; len], second: vec![0.0; len], steps: 0 }
    }

    /// The mean size of a gradient: over all parameters, of the root of its mean square.
    pub fn mean_size(&self, beta2: f64) -> f64 {
        if self.steps == 0 || self.second.is_empty() {
            return 0.0;
        }
        let sum = |run: &[f32]| run.iter().map(|s| f64::from(s.sqrt())).sum::<f64>();
        let sums = parallel::map(self.second.chunks(RUN), sum);
        // The average starts at 0, so early ones are too small by this factor (Kingma and Ba 2015, section 3).
        let correct = 1.0 - beta2.powi(self.steps.min(i32::MAX as u64) as i32);
        sums.iter().sum::<f64>() / self.second.len() as f64 / correct.sqrt()
    }
}

impl Adam {
    /// Moves `values` against `gradient`, `rate` at most about a step.
    pub fn step(&self, values: &mut [f32], gradient: &[f32], averages: &mut Averages, rate: f64) {
        assert!(values.len() == gradient.len() && values.len() == averages.first.len(), "columns of one length");
        averages.steps += 1;
        let t = averages.steps.min(i32::MAX as u64) as i32;
        let correct1 = 1.0 - f64::from(self.beta1).powi(t);
        let correct2 = 1.0 - f64::from(self.beta2).powi(t);
        // Both corrections are the step's alone: they leave the loop.
        let rate = (rate / correct1) as f32;
        let unroot = (1.0 / correct2) as f32;
        let (b1, b2, epsilon) = (self.beta1, self.beta2, self.epsilon);
        let averages = averages.first.chunks_mut(RUN).zip(averages.second.chunks_mut(RUN));
        let runs = values.chunks_mut(RUN).zip(gradient.chunks(RUN)).zip(averages);
        parallel::for_each(runs, |((values, gradient), (first, second))| {
            for (((v, g), m), s) in values.iter_mut().zip(gradient).zip(first).zip(second) {
                *m = b1 * *m + (1.0 - b1) * g;
                *s = b2 * *s + (1.0 - b2) * g * g;
                *v -= rate * *m / ((*s * unroot).sqrt() + epsilon);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ADAM: Adam = Adam { beta1: 0.9, beta2: 0.999, epsilon: 1e-8 };

    #[test]
    fn the_first_step_has_the_rate() {
        let (mut v, mut a) = (vec![1.0f32, 1.0, 1.0], Averages::zeros(3));
        ADAM.step(&mut v, &[5.0, -0.01, 0.0], &mut a, 0.1);
        assert!((v[0] - 0.9).abs() < 1e-5 && (v[1] - 1.1).abs() < 1e-4 && v[2] == 1.0, "{v:?}");
    }

    #[test]
    fn finds_a_minimum() {
        let (mut v, mut a) = (vec![3.0f32, -2.0], Averages::zeros(2));
        for k in 0..2000 {
            let g = [2.0 * (v[0] - 1.0), 20.0 * (v[1] - 4.0)];
            ADAM.step(&mut v, &g, &mut a, 0.05 * (1.0 - k as f64 / 2000.0));
        }
        assert!((v[0] - 1.0).abs() < 1e-3 && (v[1] - 4.0).abs() < 1e-3, "{v:?}");
    }
}
