//! The Gaussians of the optical-depth law as parameters that are moved.
//!
//! A step is taken in each Gaussian's own frame: with the covariance L L^T its mean moves by L v,
//! its factor becomes L B (B lower triangular, exp of a number on the diagonal), its count is
//! multiplied by exp of a number. One rate then suits Gaussians of all sizes and shapes.

use super::adjoint::{OfGaussian, full};
use super::coded::{Budget, Coded};
use super::columns::{Change, Columns, Numbers};
use super::config::DepthConfig;
use super::curve::Curve;
use super::density::{Move, relocate};
use super::groups::Groups;
use super::raster::Tape;
use crate::adam::{Adam, Averages};
use crate::learner::{Densify, Learner, Moment, NotFinite, Shot, Stepped};
use crate::loss::Loss;
use crate::state::State;
use particlegs_core::Result;
use particlegs_core::model::{MASS, Mixture};
use particlegs_core::parallel;
use particlegs_core::picture::Plane;
use particlegs_core::render::Scratch;
use particlegs_core::space::Bounds;
use particlegs_core::splat::Look;

/// What the Gaussians are trained for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DepthGround {
    /// Bounds of the particles, world units.
    pub bounds: Bounds,
    /// Particles.
    pub particles: u64,
    /// Look of the targets.
    pub look: Look,
    /// Bytes that the coded Gaussians are to have; `None` = not known: they are not coded on the way.
    pub bytes: Option<u64>,
}

/// Parameters and what Adam remembers of them.
pub(crate) struct DepthLearner {
    config: DepthConfig,
    ground: DepthGround,
    columns: Columns,
    /// Their running average: what is scored and kept.
    averaged: Columns,
    /// The same as decoded, since they are coded on the way.
    coded: Option<Coded>,
    /// Does the precision stay as it is?
    settled: bool,
    /// Those whose counts sum to what they did.
    groups: Groups,
    /// ln count at the start.
    first_log_count: Vec<f64>,
    /// Mass a particle, where particles have weights; density control alone changes it.
    weight: Option<Vec<f64>>,
    /// Of place (3 a Gaussian), shape (6) and count (1).
    averages: [Averages; 3],
    /// Of its pictures.
    scratch: Scratch,
    #[cfg(test)]
    pub poison: Option<usize>,
}

/// Gradients in the Gaussians' own frames, by group.
struct Own {
    groups: [Vec<f32>; 3],
    not_finite: Option<NotFinite>,
}

impl DepthLearner {
    /// From a mixture.
    pub fn new(mixture: &Mixture, ground: DepthGround, config: DepthConfig) -> Self {
        let m = mixture.len();
        let columns = Columns::of(mixture, |i| i);
        DepthLearner {
            config,
            ground,
            first_log_count: columns.0.iter().map(|n| n[9]).collect(),
            groups: Groups::new(&columns.0, ground.particles, config.kept_among),
            averaged: columns.clone(),
            columns,
            coded: None,
            settled: false,
            weight: mixture.masses().map(|m| m.iter().zip(&mixture.count).map(|(m, c)| m / c.max(1e-3)).collect()),
            averages: WIDTHS.map(|k| Averages::zeros(k * m)),
            scratch: Scratch::default(),
            #[cfg(test)]
            poison: None,
        }
    }

    /// Loss of a shot, and its gradient with every Gaussian.
    fn backward(&mut self, mixture: &Mixture, shot: &Shot<'_>, loss: &Loss) -> Result<(f64, Vec<OfGaussian>)> {
        let simd = shot.progress.simd();
        let bounds = &self.ground.bounds;
        let tape = Tape::draw(mixture, bounds, shot.view, &shot.crop, &mut self.scratch, shot.progress)?;
        let curve = Curve::new(self.ground.look, shot.view.opacity, shot.view.radius_pixels(shot.crop.full));
        let size = tape.tau.size;
        let (mut drawn, mut slope) = (Plane::zeros(size), Plane::zeros(size));
        let pixels = drawn.data.chunks_mut(PIXELS).zip(slope.data.chunks_mut(PIXELS));
        parallel::for_each(pixels.zip(tape.tau.data.chunks(PIXELS)), |((drawn, slope), tau)| {
            curve.apply(simd, tau, drawn, slope);
        });
        let mut valued = loss.of(&drawn, shot.target, simd);
        valued.gradient.data.iter_mut().zip(&slope.data).for_each(|(g, s)| *g *= s);
        Ok((valued.value, tape.gradient(mixture, valued.gradient)))
    }

    /// The Gaussians that steps are taken from.
    fn seen(&self) -> &Columns {
        self.coded.as_ref().map_or(&self.columns, |c| &c.moved)
    }

    /// Gradients turned into the Gaussians' own frames; what is not finite counts as zero.
    fn own(&self, world: &[OfGaussian]) -> Own {
        let seen = &self.seen().0;
        let turned = parallel::map_range(world.len(), |i| turned(&seen[i], &world[i]));
        let mut own = Own { groups: WIDTHS.map(|k| Vec::with_capacity(k * world.len())), not_finite: None };
        for (i, (t, g)) in turned.iter().zip(world).enumerate() {
            let t = if g.is_finite() && t.iter().all(|v| v.is_finite()) {
                *t
            } else {
                let group = if g.mean.iter().any(|v| !v.is_finite()) {
                    "position"
                } else if g.cov.iter().any(|v| !v.is_finite()) {
                    "covariance"
                } else {
                    "count"
                };
                own.not_finite.get_or_insert(NotFinite { group, gaussian: i, count: 0 }).count += 1;
                [0.0; 10]
            };
            own.groups[0].extend(&t[..3]);
            own.groups[1].extend(&t[3..9]);
            own.groups[2].push(t[9]);
        }
        self.groups.share(&mut own.groups[2], &self.seen().0);
        own
    }

    /// The rate of a step.
    fn rate(&self, at: &Moment) -> f64 {
        let c = &self.config;
        let warm = ((at.iteration + 1) as f64 / (c.warm_up.max(1)) as f64).min(1.0);
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * at.done.min(1.0)).cos());
        c.rate * warm * (c.last_rate + (1.0 - c.last_rate) * cosine)
    }

    fn update(&mut self, own: &Own, rate: f64) {
        let m = self.len();
        let c = &self.config;
        let (beta1, beta2) = (c.beta1 as f32, c.beta2 as f32);
        let mut by = WIDTHS.map(|k| vec![0.0f32; k * m]);
        let rates = [c.rates.place, c.rates.shape, c.rates.count];
        for (k, rate_share) in rates.into_iter().enumerate() {
            let epsilon = (c.calm * self.averages[k].mean_size(c.beta2)) as f32;
            let adam = Adam { beta1, beta2, epsilon: epsilon.max(1e-15) };
            adam.step(&mut by[k], &own.groups[k], &mut self.averages[k], rate * rate_share);
        }
        let pull = (rate * c.count_pull) as f32;
        let mut changes: Vec<Change> = (0..m)
            .map(|i| {
                let [p, s] = [&by[0][3 * i..3 * i + 3], &by[1][6 * i..6 * i + 6]];
                let away = (self.columns.0[i][9] - self.first_log_count[i]) as f32;
                [p[0], p[1], p[2], s[0], s[1], s[2], s[3], s[4], s[5], by[2][i] - pull * away]
            })
            .collect();
        self.groups.keep(&self.columns.0, &mut changes);
        self.columns.change(&changes);
        if let Some(coded) = &mut self.coded {
            coded.moved.change(&changes);
        }
    }

    /// Codes the Gaussians where that is due.
    fn code(&mut self, at: &Moment) -> Result<()> {
        let (every, Some(budget)) = (self.config.code_every, self.budget()) else { return Ok(()) };
        if every == 0 || at.done < self.config.code_from || !at.iteration.is_multiple_of(every) {
            return Ok(());
        }
        self.settled = at.done >= self.config.settle_from;
        self.coded = Some(match &self.coded {
            Some(c) if self.settled && c.fits() => {
                self.columns.approach(&c.exact, self.config.settle);
                Coded::of(self.weighed(&self.columns), &budget, c.factor)?
            }
            Some(c) => Coded::of(self.weighed(&self.columns), &budget, c.better_factor(&budget))?,
            None => Coded::of(self.weighed(&self.columns), &budget, 1.0)?,
        });
        if let Some(c) = &self.coded {
            self.groups.aim(&c.exact.0);
        }
        Ok(())
    }

    /// What the file is to be, where that is known.
    fn budget(&self) -> Option<Budget> {
        let DepthGround { bounds, particles, bytes, .. } = self.ground;
        bytes.map(|bytes| Budget { bounds, count: particles, bytes })
    }

    /// As a mixture of all particles, with its masses.
    fn weighed(&self, columns: &Columns) -> Mixture {
        let mut mixture = columns.mixture();
        // A mean of logarithms is below that of the numbers.
        let scale = self.ground.particles as f64 / mixture.count.iter().sum::<f64>();
        mixture.count.iter_mut().for_each(|c| *c *= scale);
        let heavy = |w: &Vec<f64>| w.iter().zip(&mixture.count).map(|(w, c)| w * c).collect();
        if let Some(masses) = self.weight.as_ref().map(heavy) {
            mixture.columns.set(MASS, masses);
        }
        mixture
    }

    /// The Gaussians as they lie in a file that fits.
    fn ready(&self) -> Option<&Coded> {
        self.coded.as_ref().filter(|c| self.settled && c.fits())
    }
}

impl Learner for DepthLearner {
    fn step(&mut self, shot: &Shot<'_>, loss: &Loss, at: &Moment) -> Result<Stepped> {
        self.code(at)?;
        let mixture = self.seen().mixture();
        #[allow(unused_mut)]
        let (value, mut world) = self.backward(&mixture, shot, loss)?;
        #[cfg(test)]
        if let Some(g) = self.poison.and_then(|i| world.get_mut(i)) {
            g.cov[1] = f64::NAN;
        }
        let own = self.own(&world);
        self.update(&own, self.rate(at));
        let over = self.config.average.min(0.1 * (at.iteration + 1) as f64).max(1.0);
        self.averaged.approach(&self.columns, 1.0 / over);
        Ok(Stepped { loss: value, not_finite: own.not_finite })
    }

    fn control(&mut self, at: &Moment) {
        let step = at.iteration + 1;
        let Densify { every, until, .. } = at.densify;
        if every == 0 || step > until || !step.is_multiple_of(every) {
            return;
        }
        let [place, shape, _] = &self.averages;
        let squares = place.second.chunks_exact(3).zip(shape.second.chunks_exact(6));
        let gradients: Vec<f64> =
            squares.map(|(p, s)| p.iter().chain(s).map(|&v| f64::from(v)).sum::<f64>().sqrt()).collect();
        let heavy = |(w, n): (&f64, &Numbers)| w * n[9].exp();
        let mut mass: Option<Vec<f64>> =
            self.weight.as_ref().map(|w| w.iter().zip(&self.columns.0).map(heavy).collect());
        for Move { from, into, half_of } in relocate(&mut self.columns, &gradients, self.config.relocate) {
            for i in [from, into, half_of] {
                self.first_log_count[i] = self.columns.0[i][9];
                for (a, k) in self.averages.iter_mut().zip(WIDTHS) {
                    a.first[k * i..k * (i + 1)].fill(0.0);
                }
            }
            // Its half wants as much as it wanted; what was merged goes on as the larger did.
            for (a, k) in self.averages.iter_mut().zip(WIDTHS) {
                a.second.copy_within(k * half_of..k * (half_of + 1), k * from);
            }
            if let Some(mass) = &mut mass {
                mass[into] += mass[from];
                mass[half_of] *= 0.5;
                mass[from] = mass[half_of];
            }
        }
        self.weight = mass.map(|m| m.iter().zip(&self.columns.0).map(|(m, n)| m / n[9].exp()).collect());
        self.groups.count(&self.columns.0, self.ground.particles);
        // What was decoded and averaged is of other Gaussians now.
        self.coded = None;
        self.averaged = self.columns.clone();
    }

    fn len(&self) -> usize {
        self.columns.0.len()
    }

    fn mixture(&self) -> Mixture {
        self.weighed(self.ready().map_or(&self.averaged, |c| &c.exact))
    }

    fn shown(&self) -> Result<Mixture> {
        let Some(budget) = self.budget().filter(|_| self.ready().is_none()) else { return Ok(self.mixture()) };
        // Twice: the first says at which precision the bytes are met.
        let factor = self.coded.as_ref().map_or(1.0, |c| c.factor);
        let factor = Coded::of(self.weighed(&self.averaged), &budget, factor)?.better_factor(&budget);
        Ok(Coded::of(self.weighed(&self.averaged), &budget, factor)?.exact.mixture())
    }

    fn factor(&self) -> Option<f64> {
        self.ready().map(|c| c.factor)
    }

    fn state(&self) -> State {
        let mut state = State::default();
        let flat = |c: &Columns| c.0.iter().flatten().copied().collect::<Vec<f64>>();
        state.numbers.insert("gaussians".into(), flat(&self.columns));
        state.numbers.insert("averaged".into(), flat(&self.averaged));
        state.numbers.insert("group counts".into(), self.groups.counts.clone());
        state.numbers.insert("group aims".into(), self.groups.aims.clone());
        state.numbers.insert("first log count".into(), self.first_log_count.clone());
        if let Some(weight) = &self.weight {
            state.numbers.insert("weight".into(), weight.clone());
        }
        if let Some(coded) = &self.coded {
            state.numbers.insert("coded, moved".into(), flat(&coded.moved));
            state.numbers.insert("coded".into(), flat(&coded.exact));
            state.numbers.insert("coder".into(), vec![coded.factor, coded.filled, f64::from(u8::from(self.settled))]);
        }
        for (name, a) in GROUPS.iter().zip(&self.averages) {
            state.columns.insert(format!("{name} first"), a.first.clone());
            state.columns.insert(format!("{name} second"), a.second.clone());
            state.numbers.insert(format!("{name} steps"), vec![a.steps as f64]);
        }
        state
    }

    fn restore(&mut self, state: &State) -> std::result::Result<(), String> {
        let m = state.numbers.get("first log count").map_or(0, Vec::len);
        let columns = |name: &str| -> std::result::Result<Columns, String> {
            let flat = state.doubles(name, 10 * m)?;
            Ok(Columns(flat.chunks_exact(10).map(|n| std::array::from_fn(|k| n[k])).collect()))
        };
        if m != self.groups.of.len() {
            return Err(format!("{m} Gaussians, where the run begins with {}", self.groups.of.len()));
        }
        // Who is in which group follows from the start, as these Gaussians did.
        let [counts, aims] = ["group counts", "group aims"].map(|name| state.doubles(name, self.groups.counts.len()));
        let (counts, aims) = (counts?.to_vec(), aims?.to_vec());
        let (mut coded, mut settled) = (None, false);
        if state.numbers.contains_key("coder") {
            let coder = state.doubles("coder", 3)?;
            let (moved, exact) = (columns("coded, moved")?, columns("coded")?);
            coded = Some(Coded { moved, exact, factor: coder[0], filled: coder[1] });
            settled = coder[2] != 0.0;
        }
        let mut averages: [Averages; 3] = Default::default();
        for ((name, a), k) in GROUPS.iter().zip(&mut averages).zip(WIDTHS) {
            a.first = state.column(&format!("{name} first"), k * m)?.to_vec();
            a.second = state.column(&format!("{name} second"), k * m)?.to_vec();
            a.steps = state.doubles(&format!("{name} steps"), 1)?[0] as u64;
        }
        let (now, averaged) = (columns("gaussians")?, columns("averaged")?);
        let first_log_count = state.doubles("first log count", m)?.to_vec();
        let weight = self.weight.as_ref().map(|_| state.doubles("weight", m).map(<[f64]>::to_vec)).transpose()?;
        (self.columns, self.averaged, self.coded, self.settled) = (now, averaged, coded, settled);
        (self.averages, self.first_log_count, self.weight) = (averages, first_log_count, weight);
        (self.groups.counts, self.groups.aims) = (counts, aims);
        Ok(())
    }
}

/// Groups of parameters, and their numbers a Gaussian.
const GROUPS: [&str; 3] = ["place", "shape", "count"];
const WIDTHS: [usize; 3] = [3, 6, 1];
/// Pixels in one step of parallel work.
const PIXELS: usize = 1 << 14;

/// A gradient in the Gaussian's own frame (see [`Columns::change`]).
fn turned(n: &Numbers, g: &OfGaussian) -> [f32; 10] {
    let [_, _, _, a, b, c, d, e, f, log_count] = *n;
    let [x, y, z] = g.mean;
    let s = congruent(&[a, b, c, d, e, f], &full(&g.cov));
    let place = [a * x + b * y + d * z, c * y + e * z, f * z];
    let count = g.count * log_count.exp();
    let all =
        [place[0], place[1], place[2], 2.0 * s[0], 2.0 * s[1], 2.0 * s[2], 2.0 * s[3], 2.0 * s[4], 2.0 * s[5], count];
    all.map(|v| v as f32)
}

/// The lower triangle of L^T G L.
fn congruent(l: &[f64; 6], g: &[[f64; 3]; 3]) -> [f64; 6] {
    let [a, b, c, d, e, f] = *l;
    let columns = [[a, b, d], [0.0, c, e], [0.0, 0.0, f]];
    let at = |i: usize, j: usize| -> f64 {
        (0..3).map(|r| columns[i][r] * (0..3).map(|k| g[r][k] * columns[j][k]).sum::<f64>()).sum()
    };
    [at(0, 0), at(1, 0), at(1, 1), at(2, 0), at(2, 1), at(2, 2)]
}
