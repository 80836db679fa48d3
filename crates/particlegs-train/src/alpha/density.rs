//! Density control as published: clone, split, prune, reset (Kerbl et al. 2023, section 5.2; the
//! numbers of its reference code and of docs/law/published.md, "Training").

use super::learner::AlphaLearner;
use super::parameters::{GaussianParameters, ParameterGroup, keep_rows, rotation_matrix};
use crate::adam::Averages;
use crate::learner::StepInfo;
use particlegs_core::math::{Purpose, Random, each_axis};

/// Pieces that a large Gaussian is split into.
const PIECES: u64 = 2;

/// Scales of the pieces are these of the Gaussian over this: 0.8 for each piece.
const SHRINK: f64 = 0.8 * PIECES as f64;

impl AlphaLearner {
    /// Whether densification and a reset of opacities are due after the step at `at`.
    fn dues(&self, at: &StepInfo) -> [bool; 2] {
        let (done, d, reset) = (at.iteration + 1, at.densify, self.config.reset_every);
        let goes_on = d.every > 0 && done < d.until;
        let densified = goes_on && done > self.config.densify_from && done % d.every == 0;
        [densified, goes_on && reset > 0 && done % reset == 0]
    }

    pub(super) fn due(&self, at: &StepInfo) -> bool {
        self.dues(at).contains(&true)
    }

    pub(super) fn densify(&mut self, at: &StepInfo) {
        let (done, d, [densified, reset]) = (at.iteration + 1, at.densify, self.dues(at));
        if densified {
            self.grow(d.threshold, done);
            self.prune();
            self.gaussians.screen = vec![[0.0; 2]; self.gaussians.parameters.len()];
        }
        if reset {
            self.reset();
        }
    }

    /// Clones small and splits large Gaussians with a large gradient on the picture.
    fn grow(&mut self, threshold: f64, iteration: u64) {
        let n = self.gaussians.parameters.len();
        // Mean size of the gradient with the centre on the picture.
        let mean = |s: &[f32; 2]| if s[1] > 0.0 { f64::from(s[0] / s[1]) } else { 0.0 };
        let gradient: Vec<f64> = self.gaussians.screen.iter().map(mean).collect();
        let mut chosen: Vec<usize> = (0..n).filter(|i| gradient[*i] >= threshold).collect();
        if let Some(most) = self.config.most_gaussians {
            // Each adds one.
            chosen.sort_by(|a, b| gradient[*b].total_cmp(&gradient[*a]).then(a.cmp(b)));
            chosen.truncate(usize::try_from(most).unwrap_or(usize::MAX).saturating_sub(n));
            // Gaussians are added in their own order, whether there is a limit or not.
            chosen.sort_unstable();
        }
        let largest = self.config.percent_dense * self.config.extent;
        let mut keep = vec![true; n];
        let mut added = Vec::new();
        for i in chosen {
            let one = self.gaussians.parameters.get(i);
            // Small ones lack neighbours, large ones cover too much (Kerbl et al. 2023, section 5.2).
            if one.log_scale.iter().fold(f64::MIN, |a, b| a.max(*b)).exp() <= largest {
                added.push(one);
            } else {
                keep[i] = false;
                // A stream for each iteration, Gaussian and piece: a run that goes on from a checkpoint draws the same.
                let first = (iteration << 32) + PIECES * i as u64;
                let draw = |k| Random::from_purpose(Purpose::AlphaSplit, self.gaussians.scale.seed, first + k);
                added.extend((0..PIECES).map(|k| piece(&one, draw(k))));
            }
        }
        self.keep(&keep);
        added.iter().for_each(|one| self.gaussians.parameters.push(one));
        let n = self.gaussians.parameters.len();
        for g in ParameterGroup::ALL {
            let Averages { first, second, .. } = &mut self.gaussians.averages[g as usize];
            // Adam knows nothing yet of those that were added, as in 3DGS.
            [first, second].into_iter().for_each(|column| column.resize(n * g.width(), 0.0));
        }
        self.gaussians.screen.resize(n, [0.0; 2]);
    }

    /// Drops Gaussians that are nearly transparent, unless all are.
    fn prune(&mut self) {
        let least = self.config.least_opacity;
        // Not the negation: those that are not numbers go too.
        let parameters = &self.gaussians.parameters;
        let keep: Vec<bool> = (0..parameters.len()).map(|i| parameters.get(i).opacity() >= least).collect();
        if keep.contains(&true) {
            self.keep(&keep);
        }
    }

    /// Makes all nearly transparent, so that those that are needed must show it.
    fn reset(&mut self) {
        let most = self.config.reset_opacity();
        let most = (most / (1.0 - most)).ln() as f32;
        self.gaussians.parameters.0[ParameterGroup::Opacity as usize].iter_mut().for_each(|v| *v = v.min(most));
        let Averages { first, second, .. } = &mut self.gaussians.averages[ParameterGroup::Opacity as usize];
        // As in 3DGS: gradients from before the reset say nothing about the new opacities.
        [first, second].into_iter().for_each(|column| column.fill(0.0));
    }

    fn keep(&mut self, keep: &[bool]) {
        for g in ParameterGroup::ALL {
            let averages = &mut self.gaussians.averages[g as usize];
            for column in [&mut self.gaussians.parameters.0[g as usize], &mut averages.first, &mut averages.second] {
                keep_rows(column, g.width(), keep);
            }
        }
        let mut flags = keep.iter();
        self.gaussians.screen.retain(|_| flags.next().copied().unwrap_or(false));
    }
}

/// One of the pieces of a Gaussian: a draw from it, smaller.
fn piece(gaussian: &GaussianParameters, mut draw: Random) -> GaussianParameters {
    let norm = gaussian.rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
    let r = rotation_matrix(gaussian.rotation.map(|v| v / norm));
    let offset: [f64; 3] = each_axis(|k| gaussian.log_scale[k].exp() * draw.normal());
    GaussianParameters {
        position: each_axis(|i| gaussian.position[i] + (0..3).map(|k| r[i][k] * offset[k]).sum::<f64>()),
        log_scale: gaussian.log_scale.map(|v| v - SHRINK.ln()),
        ..*gaussian
    }
}
