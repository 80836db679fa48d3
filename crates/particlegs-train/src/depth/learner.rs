//! The Gaussians of the optical-depth law as parameters that are moved.
//!
//! A step is taken in each Gaussian's own frame: with the covariance L L^T its mean moves by L v,
//! its factor becomes L B (B lower triangular, exp of a number on the diagonal), its count is
//! multiplied by exp of a number. One rate then suits Gaussians of all sizes and shapes.

use super::config::DepthConfig;
use super::density::{Relocation, relocate};
use super::parameters::{DepthGaussians, Numbers, Parameters, WIDTHS};
use super::steps::{DepthStepper, StepSize};
use crate::adam::Averages;
use crate::learner::{Densify, Learner, StepInfo, StepReport, TrainingSample};
use crate::loss::Loss;
use crate::state::TrainingState;
use particlegs_core::Result;
use particlegs_core::codec::{Encoder, Precision, decode_block};
use particlegs_core::model::{Block, MASS, Mixture};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;

/// The task that the Gaussians are trained for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct DepthContext {
    /// Bounds of the particles, world units.
    pub bounds: Bounds,
    pub particles: u64,
    pub look: ToneStyle,
    /// Bytes that the coded Gaussians are to have; `None` = not known: they are not coded on the way.
    pub bytes: Option<u64>,
}

/// Parameters, and what becomes of them beside the steps.
pub(crate) struct DepthLearner {
    config: DepthConfig,
    context: DepthContext,
    parameters: Parameters,
    steps: Box<dyn DepthStepper>,
    coded: Option<DecodedGaussians>,
    /// Whether the precision stays as it is.
    settled: bool,
    /// Mass a particle, where particles have weights; density control alone changes it.
    weight: Option<Vec<f64>>,
}

impl DepthLearner {
    /// From a mixture, with what `steps` gives for its parameters.
    pub fn new(
        mixture: &Mixture,
        context: DepthContext,
        config: DepthConfig,
        steps: impl FnOnce(&Parameters) -> Result<Box<dyn DepthStepper>>,
    ) -> Result<Self> {
        let parameters = Parameters::new(mixture, context.particles, config.kept_among, context.bounds, context.look);
        Ok(DepthLearner {
            config,
            context,
            steps: steps(&parameters)?,
            parameters,
            coded: None,
            settled: false,
            // The same least count as in `DepthGaussians::from_mixture`.
            weight: mixture.masses().map(|m| m.iter().zip(&mixture.count).map(|(m, c)| m / c.max(1e-3)).collect()),
        })
    }

    /// The size of the step at `at`.
    fn size(&self, at: &StepInfo) -> StepSize {
        let c = &self.config;
        let warm = ((at.iteration + 1) as f64 / (c.warm_up.max(1)) as f64).min(1.0);
        // Of the share of steps or of time, whichever is more: rates reach their end when the time is up as well.
        let cosine = 0.5 * (1.0 + (std::f64::consts::PI * at.done.min(1.0)).cos());
        let rate = c.rate * warm * (c.last_rate + (1.0 - c.last_rate) * cosine);
        // A window longer than a tenth of the steps so far would keep the start in the average.
        let window = c.average.min(0.1 * (at.iteration + 1) as f64).max(1.0);
        StepSize {
            rates: [c.rates.place, c.rates.shape, c.rates.count].map(|r| rate * r),
            beta1: c.beta1,
            beta2: c.beta2,
            epsilon: c.calm,
            decay: rate * c.count_pull,
            average: 1.0 / window,
        }
    }

    /// Codes the Gaussians where that is due.
    fn code(&mut self, at: &StepInfo) -> Result<()> {
        let (every, Some(budget)) = (self.config.code_every, self.budget()) else { return Ok(()) };
        if every == 0 || at.done < self.config.code_from || !at.iteration.is_multiple_of(every) {
            return Ok(());
        }
        self.steps.fetch(&mut self.parameters)?;
        self.settled = at.done >= self.config.settle_from;
        // Once settled, a precision that meets the budget stays: any other is corrected at every coding.
        let factor = match &self.coded {
            Some(c) if self.settled && c.fits() => {
                self.parameters.now.approach(&c.exact, self.config.settle);
                c.factor
            }
            Some(c) => c.better_factor(&budget),
            None => 1.0,
        };
        let coded = DecodedGaussians::new(self.weighed(&self.parameters.now), &budget, factor)?;
        self.parameters.groups.aim(&coded.exact.0);
        self.parameters.decoded = Some(coded.exact.clone());
        self.coded = Some(coded);
        self.steps.changed();
        Ok(())
    }

    /// Bounds, count and bytes of the file, where the bytes are known.
    fn budget(&self) -> Option<Budget> {
        let DepthContext { bounds, particles, bytes, .. } = self.context;
        bytes.map(|bytes| Budget { bounds, count: particles, bytes })
    }

    /// As a mixture of all particles, with its masses.
    fn weighed(&self, columns: &DepthGaussians) -> Mixture {
        let mut mixture = columns.mixture();
        // A mean of logarithms is below that of the numbers.
        let scale = self.context.particles as f64 / mixture.count.iter().sum::<f64>();
        mixture.count.iter_mut().for_each(|c| *c *= scale);
        let masses_of = |w: &Vec<f64>| w.iter().zip(&mixture.count).map(|(w, c)| w * c).collect();
        if let Some(masses) = self.weight.as_ref().map(masses_of) {
            mixture.columns.set(MASS, masses);
        }
        mixture
    }

    /// The Gaussians as they lie in a file that fits.
    fn ready(&self) -> Option<&DecodedGaussians> {
        self.coded.as_ref().filter(|c| self.settled && c.fits())
    }
}

impl Learner for DepthLearner {
    fn step(&mut self, sample: &TrainingSample<'_>, loss: &Loss, at: &StepInfo) -> Result<StepReport> {
        self.code(at)?;
        let size = self.size(at);
        self.steps.step(&mut self.parameters, sample, loss, &size)
    }

    fn fetch(&mut self) -> Result<()> {
        self.steps.fetch(&mut self.parameters)
    }

    fn control(&mut self, at: &StepInfo) -> Result<()> {
        let step = at.iteration + 1;
        let Densify { every, until, .. } = at.densify;
        if every == 0 || step > until || !step.is_multiple_of(every) {
            return Ok(());
        }
        self.steps.fetch(&mut self.parameters)?;
        let p = &mut self.parameters;
        // By Adam's mean squares over the last steps, as a single step sees one picture only.
        let [place, shape, _] = &p.averages;
        let squares = place.second.chunks_exact(3).zip(shape.second.chunks_exact(6));
        let gradients: Vec<f64> =
            squares.map(|(p, s)| p.iter().chain(s).map(|&v| f64::from(v)).sum::<f64>().sqrt()).collect();
        let mass_of = |(w, n): (&f64, &Numbers)| w * n[9].exp();
        let mut mass: Option<Vec<f64>> = self.weight.as_ref().map(|w| w.iter().zip(&p.now.0).map(mass_of).collect());
        let mut replaced = Vec::new();
        for Relocation { from, into, half_of } in relocate(&mut p.now, &gradients, self.config.relocate) {
            for i in [from, into, half_of] {
                replaced.push(i);
                // The pull towards the first count would otherwise undo the move.
                p.first_log_count[i] = p.now.0[i][9];
                for (a, k) in p.averages.iter_mut().zip(WIDTHS) {
                    a.first[k * i..k * (i + 1)].fill(0.0);
                }
            }
            // Its half wants as much as it wanted; what was merged goes on as the larger did.
            for (a, k) in p.averages.iter_mut().zip(WIDTHS) {
                a.second.copy_within(k * half_of..k * (half_of + 1), k * from);
            }
            if let Some(mass) = &mut mass {
                mass[into] += mass[from];
                mass[half_of] *= 0.5;
                mass[from] = mass[half_of];
            }
        }
        self.weight = mass.map(|m| m.iter().zip(&p.now.0).map(|(m, n)| m / n[9].exp()).collect());
        p.groups.count(&p.now.0, self.context.particles);
        // What was decoded and averaged is of other Gaussians now.
        (self.coded, p.decoded) = (None, None);
        p.averaged = p.now.clone();
        replaced.sort_unstable();
        replaced.dedup();
        self.steps.replaced(p, &replaced)
    }

    fn len(&self) -> usize {
        self.parameters.len()
    }

    fn mixture(&self) -> Mixture {
        self.weighed(self.ready().map_or(&self.parameters.averaged, |c| &c.exact))
    }

    fn shown(&self) -> Result<Mixture> {
        let Some(budget) = self.budget().filter(|_| self.ready().is_none()) else { return Ok(self.mixture()) };
        // Twice: the first says at which precision the bytes are met.
        let averaged = &self.parameters.averaged;
        let factor = self.coded.as_ref().map_or(1.0, |c| c.factor);
        let factor = DecodedGaussians::new(self.weighed(averaged), &budget, factor)?.better_factor(&budget);
        Ok(DecodedGaussians::new(self.weighed(averaged), &budget, factor)?.exact.mixture())
    }

    fn factor(&self) -> Option<f64> {
        self.ready().map(|c| c.factor)
    }

    fn state(&self) -> TrainingState {
        let (mut state, p) = (TrainingState::default(), &self.parameters);
        let flat = |c: &DepthGaussians| c.0.iter().flatten().copied().collect::<Vec<f64>>();
        state.numbers.insert("gaussians".into(), flat(&p.now));
        state.numbers.insert("averaged".into(), flat(&p.averaged));
        state.numbers.insert("group counts".into(), p.groups.counts.clone());
        state.numbers.insert("group aims".into(), p.groups.aims.clone());
        state.numbers.insert("first log count".into(), p.first_log_count.clone());
        if let Some(weight) = &self.weight {
            state.numbers.insert("weight".into(), weight.clone());
        }
        if let Some((coded, moved)) = self.coded.as_ref().zip(p.decoded.as_ref()) {
            state.numbers.insert("coded, moved".into(), flat(moved));
            state.numbers.insert("coded".into(), flat(&coded.exact));
            state.numbers.insert("coder".into(), vec![coded.factor, coded.filled, f64::from(u8::from(self.settled))]);
        }
        for (name, a) in GROUPS.iter().zip(&p.averages) {
            state.columns.insert(format!("{name} first"), a.first.clone());
            state.columns.insert(format!("{name} second"), a.second.clone());
            state.numbers.insert(format!("{name} steps"), vec![a.steps as f64]);
        }
        state
    }

    fn restore(&mut self, state: &TrainingState) -> std::result::Result<(), String> {
        let m = state.numbers.get("first log count").map_or(0, Vec::len);
        let columns = |name: &str| -> std::result::Result<DepthGaussians, String> {
            let flat = state.doubles(name, 10 * m)?;
            Ok(DepthGaussians(flat.chunks_exact(10).map(|n| std::array::from_fn(|k| n[k])).collect()))
        };
        let groups = &self.parameters.groups;
        if m != groups.of.len() {
            return Err(format!("it has {m} Gaussians, but the run starts with {}", groups.of.len()));
        }
        // Who is in which group follows from the start, as these Gaussians did.
        let [counts, aims] = ["group counts", "group aims"].map(|name| state.doubles(name, groups.counts.len()));
        let (counts, aims) = (counts?.to_vec(), aims?.to_vec());
        let (mut coded, mut decoded, mut settled) = (None, None, false);
        if state.numbers.contains_key("coder") {
            let coder = state.doubles("coder", 3)?;
            decoded = Some(columns("coded, moved")?);
            coded = Some(DecodedGaussians { exact: columns("coded")?, factor: coder[0], filled: coder[1] });
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
        let p = &mut self.parameters;
        (p.now, p.averaged, p.decoded, p.averages, p.first_log_count) =
            (now, averaged, decoded, averages, first_log_count);
        (p.groups.counts, p.groups.aims) = (counts, aims);
        (self.coded, self.settled, self.weight) = (coded, settled, weight);
        self.steps.changed();
        Ok(())
    }
}

const GROUPS: [&str; 3] = ["place", "shape", "count"];

/// Shares of the budget that settled Gaussians may take, and the one that a new precision aims at.
const FILLED: std::ops::RangeInclusive<f64> = 0.98..=1.0;
const AIM: f64 = 0.999;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Budget {
    bounds: Bounds,
    count: u64,
    bytes: u64,
}

/// Decoded Gaussians and the precision that they were coded at: training that knows the coder's quantisation.
///
/// Every so many steps the Gaussians are coded and decoded. Steps are then taken from the decoded
/// ones, and move both alike: a gradient that goes straight through the rounding (Bengio et al. 2013,
/// straight-through estimator). So Gaussians learn to make up for each other's rounding.
///
/// That lasts only as long as the rounding does. The coder's trellis rounds anew whatever lies after
/// a number that changed, and another precision is another lattice. So towards the end the run
/// settles: the precision stays, and what is coded is drawn to what was decoded before, which codes
/// to the same bytes again. A number then changes where the pictures insist, and the file that comes
/// out is the one that was trained.
#[derive(Clone, Debug, PartialEq)]
struct DecodedGaussians {
    exact: DepthGaussians,
    /// Multiple of the nominal steps.
    factor: f64,
    /// Bytes over the budget.
    filled: f64,
}

impl DecodedGaussians {
    /// Codes and decodes `gaussians` at `factor` times the nominal steps.
    fn new(gaussians: Mixture, budget: &Budget, factor: f64) -> Result<DecodedGaussians> {
        let m = gaussians.len();
        let mass = gaussians.masses().map_or(budget.count as f64, |m| m.iter().sum());
        let encoder = Encoder::new(&Block { bounds: budget.bounds, count: budget.count, mass, gaussians })?;
        let bytes = encoder.encode(&Precision::BALANCED.scaled(factor));
        let decoded = decode_block(&bytes, "the Gaussians in training")?.gaussians;
        let mut rank = vec![0u32; m];
        // The coder sorts Gaussians, so each one is found again by its place in the file.
        for (k, &i) in encoder.order().iter().enumerate() {
            rank[i as usize] = k as u32;
        }
        let exact = DepthGaussians::from_mixture(&decoded, |i| rank[i] as usize);
        Ok(DecodedGaussians { exact, factor, filled: bytes.len() as f64 / budget.bytes as f64 })
    }

    /// Whether the file fits, and nearly fills its budget.
    fn fits(&self) -> bool {
        FILLED.contains(&self.filled)
    }

    /// The factor that leads to the budget, for Gaussians like these.
    fn better_factor(&self, budget: &Budget) -> f64 {
        let excess = (self.filled - AIM) * budget.bytes as f64;
        // The estimate counts one bit for each number, which is only good for small changes.
        let doublings = Precision::doublings(excess, self.exact.0.len()).clamp(-1.0, 1.0);
        let [finest, coarsest] = Precision::FACTORS;
        (self.factor * doublings.exp2()).clamp(finest, coarsest)
    }
}
