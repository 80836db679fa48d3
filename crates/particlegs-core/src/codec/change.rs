//! Changes of a block's Gaussians from one frame of a series to the next (docs/format.md, section 16).

use super::balance::{CountBalance, StepDescent};
use super::decoder;
use super::exact::exp_twice;
use super::field::PreviousField;
use super::number_model::{
    COUNT, ChangeModels, FIRST_PLACE, LARGEST_LOG, NumberContext, PLACE, SHAPE, SIZE, WEIGHT, in_steps,
};
use super::rans::{Coder, RansReader, RansWriter};
use super::shape::CholeskyFactor;
use super::sums::{rescale, whole_counts};
use super::wire::WireReader;
use super::{Encoder, Precision};
use crate::context::Context;
use crate::math::{each_axis, exp};
use crate::model::{Block, MASS, Mixture};
use crate::space::{Bounds, Cell, PeriodicCell};
use crate::{Error, Result};

/// Gaussians coded last among which the nearest are looked for, and how many of these guess a motion.
const WINDOW: usize = 256;
const NEIGHBOURS: usize = 4;
/// Steps of a Gaussian in the frame before that are remembered at most.
const MOST_UNREST: u32 = 255;
/// Numbers of a Gaussian: place, size and shape, count, mass.
const NUMBERS: usize = 3 + 6 + 1 + 1;
/// The header's bytes.
const HEADER_BYTES: usize = 6 * 8 + 8 + 8 + 4 + 5 * 4 + 8 + 2 * 4;

/// A block of a frame with what is known of its Gaussians' motion.
#[derive(Clone, Debug, PartialEq)]
pub struct TrackedBlock {
    /// The block, as decoded.
    pub block: Block,
    /// For each Gaussian its number in the frame before; `None` of one that is new.
    pub origin: Vec<Option<u32>>,
    /// Motion along each axis in a unit of the series' clock; NaN where that is not known yet.
    velocity: [Vec<f64>; 3],
    /// Steps that it took in the frame before.
    pub(super) unrest: Vec<u32>,
    /// Steps of each of its numbers: twice the last ones, and half of what there was before.
    history: Vec<[i32; NUMBERS]>,
    /// Models of numbers, as the frame left them.
    models: ChangeModels,
}

/// Steps that a change is coded with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ChangePrecision {
    /// Steps of place (in widths), size, shape, count and mass; a Gaussian's coarseness multiplies those of place and
    /// shape.
    pub steps: [f32; 5],
    /// Share of what a place is off its guess by that a velocity takes, at first and later.
    pub gains: [f32; 2],
}

impl Default for ChangePrecision {
    fn default() -> Self {
        ChangePrecision { steps: [0.32, 0.16, 0.32, 0.16, 0.16], gains: [0.7, 0.3] }
    }
}

/// The Gaussians of a block in the next frame, as an encoder has them.
pub struct ChangeTarget<'a> {
    /// As many as there were, in their order; those of less than half a particle go.
    pub gaussians: &'a Mixture,
    /// Flags of those that are new, in the places of others that go.
    pub born: &'a [bool],
    /// Bounds of the particles.
    pub bounds: Bounds,
    /// Particles.
    pub count: u64,
    /// Their mass.
    pub mass: f64,
}

/// The step from one frame to another.
#[derive(Clone, Copy, Debug)]
pub struct FrameStep {
    /// Cells of both.
    pub cells: [Option<Cell>; 2],
    /// Difference of the series' clock, above 0.
    pub elapsed: f64,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct ChangeHeader {
    bounds: Bounds,
    count: u64,
    mass: f64,
    /// Bytes of the block of new Gaussians.
    new: u32,
    steps: [f32; 5],
    /// Radius of a Gaussian over its count for which steps are those above.
    scale: f64,
    gains: [f32; 2],
}

impl ChangeHeader {
    fn write(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(HEADER_BYTES);
        let corners = self.bounds.min.iter().chain(&self.bounds.max);
        corners.for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(self.count.to_le_bytes());
        out.extend(self.mass.to_le_bytes());
        out.extend(self.new.to_le_bytes());
        self.steps.iter().for_each(|v| out.extend(v.to_le_bytes()));
        out.extend(self.scale.to_le_bytes());
        self.gains.iter().for_each(|v| out.extend(v.to_le_bytes()));
        out
    }

    fn read(r: &mut WireReader<'_>) -> std::result::Result<Self, String> {
        let mut corners = [0.0; 6];
        for v in &mut corners {
            *v = r.f64()?;
        }
        let [a, b, c, d, e, f] = corners;
        let bounds = Bounds { min: [a, b, c], max: [d, e, f] };
        let (count, mass, new) = (r.u64()?, r.f64()?, r.u32()?);
        let steps = [r.f32()?, r.f32()?, r.f32()?, r.f32()?, r.f32()?];
        let (scale, gains) = (r.f64()?, [r.f32()?, r.f32()?]);
        let ordered = (0..3).all(|k| bounds.min[k] <= bounds.max[k] && (bounds.max[k] - bounds.min[k]).is_finite());
        let sound = ordered && (1..=1 << 53).contains(&count) && mass > 0.0 && mass.is_finite();
        let sound = sound && scale > 0.0 && scale.is_finite();
        let positive = |v: &f32| *v > 0.0 && *v < 1e6;
        let gains_sound = gains.iter().all(|g| (0.0..=1.0).contains(g));
        if !(sound && gains_sound && steps.iter().all(positive)) {
            return Err("the header of a change is out of range".into());
        }
        Ok(ChangeHeader { bounds, count, mass, new, steps, scale, gains })
    }
}

/// The numbers of a Gaussian, one after the other.
struct ChangeNumbers<'a> {
    models: &'a mut ChangeModels,
    /// Steps of the Gaussian in the frame before and of the one coded before.
    unrest: u32,
    coarseness: f64,
    history: [i32; NUMBERS],
    /// Count of the numbers so far, and the sum of their steps.
    coded: usize,
    sum: u32,
}

impl ChangeNumbers<'_> {
    /// A number in whole steps, at most `most`; the encoder's is near its `target`.
    fn code(
        &mut self,
        c: &mut impl Coder,
        kind: usize,
        target: Option<f64>,
        [step, most]: [f64; 2],
    ) -> std::result::Result<f64, String> {
        let history = &mut self.history[self.coded];
        let unrest = self.unrest + 2 * self.sum;
        let context = NumberContext { unrest, history: *history, coarseness: self.coarseness };
        let k = self.models.code(c, kind, &context, target.map_or(0, |t| in_steps(t, step, most)))?;
        *history = 2 * k + *history / 2;
        self.coded += 1;
        self.sum += k.unsigned_abs();
        // An encoder's number is within `most` by `in_steps`; a file may hold any.
        let value = f64::from(k) * step;
        if value.abs() > most { Err("a number of a change is out of range".into()) } else { Ok(value) }
    }
}

impl TrackedBlock {
    /// The block of a model of its own, of whose motion nothing is known.
    pub fn new(block: Block) -> TrackedBlock {
        let n = block.gaussians.len();
        let unknown = || vec![f64::NAN; n];
        let velocity = [unknown(), unknown(), unknown()];
        let (unrest, history, models) = (vec![0; n], vec![[0; NUMBERS]; n], ChangeModels::new());
        TrackedBlock { block, origin: vec![None; n], velocity, unrest, history, models }
    }

    /// Motion of Gaussian `i` in a unit of the clock, if that is known.
    pub fn velocity(&self, i: usize) -> Option<[f64; 3]> {
        let v = each_axis(|k| self.velocity[k][i]);
        (!v[0].is_nan()).then_some(v)
    }

    /// A field as the Gaussians of the next frame had it, by their `origin` in this one and their `unrest` since.
    pub(super) fn field<'a>(
        &'a self,
        name: &str,
        origin: &'a [Option<u32>],
        unrest: &'a [u32],
    ) -> Option<PreviousField<'a>> {
        let moments = self.block.gaussians.fields.get(name)?;
        Some(PreviousField { moments, counts: &self.block.gaussians.count, origin, unrest })
    }

    /// The Gaussians at the places where the next frame is expected to have them.
    pub fn expected(&self, step: &FrameStep) -> Mixture {
        let mut gaussians = self.block.gaussians.clone();
        let [from, to] = step.cells;
        let frames = FrameMap::new(from, to);
        for i in 0..gaussians.len() {
            let moved = frames.carried(gaussians.mean_of(i));
            let moved = match self.velocity(i) {
                Some(v) => each_axis(|k| moved[k] + v[k] * step.elapsed),
                None => moved,
            };
            let moved = frames.image(moved);
            (0..3).for_each(|k| gaussians.mean[k][i] = moved[k]);
        }
        gaussians
    }

    /// Codes what becomes of the block.
    pub fn encode(&self, target: &ChangeTarget<'_>, step: &FrameStep, precision: &ChangePrecision) -> Result<Vec<u8>> {
        let g = target.gaussians;
        let has_particles = |i: usize| g.count[i] >= 0.5;
        let mut new = Mixture::new(g.masses().is_some());
        for i in (0..g.len()).filter(|&i| target.born[i] && has_particles(i)) {
            new.push(g.mean_of(i), g.cov_of(i), g.count[i], g.mass_of(i));
        }
        let stays = |i: usize| has_particles(i) && !target.born[i];
        let none_stays = !(0..g.len()).any(stays);
        let mut new_block = Vec::new();
        if !new.is_empty() {
            let sum: f64 = new.count.iter().sum();
            // What is left is of those that stay, where any do.
            let most = if none_stays { target.count } else { target.count - 1 };
            let count = if none_stays { most } else { (sum.round() as u64).clamp(1, most.max(1)) };
            let mass =
                if g.masses().is_some() { new.columns.get(MASS).into_iter().flatten().sum() } else { count as f64 };
            let block = Block { bounds: target.bounds, count, mass, gaussians: new };
            new_block = Encoder::new(&block)?.encode(&Precision::BALANCED);
        }
        let mixture = &self.block.gaussians;
        let mut scales: Vec<f64> = (0..mixture.len()).map(|i| extent_over_count(mixture, i)).collect();
        scales.sort_by(f64::total_cmp);
        // The median: steps hold as they are for a middling Gaussian (Y of docs/format.md, section 16).
        let header = ChangeHeader {
            bounds: target.bounds,
            count: target.count,
            mass: target.mass,
            new: new_block.len() as u32,
            steps: precision.steps,
            scale: scales.get(scales.len() / 2).copied().unwrap_or(1.0).clamp(1e-300, 1e300),
            gains: precision.gains,
        };
        let mut writer = RansWriter::default();
        self.walk(&mut writer, &header, step, Some((g, &stays))).map_err(Error::argument)?;
        let mut out = header.write();
        out.extend(new_block);
        out.extend(writer.finish());
        Ok(out)
    }

    /// Moves counts of `gaussians`, as which the next frame is coded, until sums over its Gaussians change as wanted, by
    /// those whole steps that fit the `counts` best which they should have. `next` was decoded last. Returns the factor by
    /// which each of its counts changes.
    pub fn balance_counts(
        &self,
        next: &TrackedBlock,
        (gaussians, counts): (&mut Mixture, &[f64]),
        precision: &ChangePrecision,
        balance: &CountBalance<'_>,
    ) -> Result<Vec<f64>> {
        let n = next.block.gaussians.len();
        balance.check(n)?;
        let step = f64::from(precision.steps[3]);
        let previous = &self.block.gaussians.count;
        // New ones stand behind the others: they stay as they are.
        let origins: Vec<usize> = next.origin.iter().map_while(|origin| origin.map(|i| i as usize)).collect();
        let lengths = [gaussians.len(), counts.len()];
        if lengths != [previous.len(); 2] || origins.iter().any(|i| *i >= previous.len()) {
            return Err(Error::argument("the Gaussians are those of another block"));
        }
        let log = |count: f64, i: usize| libm::log(count.max(0.5) / previous[i].max(0.5));
        let mut codes: Vec<i32> =
            origins.iter().map(|&i| in_steps(log(gaussians.count[i], i), step, LARGEST_LOG)).collect();
        let (last_codes, targets) =
            (codes.clone(), origins.iter().map(|&i| (counts[i], log(counts[i], i))).collect::<Vec<_>>());
        let most = (LARGEST_LOG / step) as i32;
        StepDescent { balance, targets: &targets, step, most, codes: &mut codes }.run();
        let mut factors = vec![1.0; n];
        for (at, (&i, (code, last))) in origins.iter().zip(codes.iter().zip(&last_codes)).enumerate() {
            if code != last {
                // With less than half a particle it would be left out.
                let moved = (previous[i].max(0.5) * exp(f64::from(*code) * step)).max(0.5);
                if let Some(masses) = gaussians.columns.get_mut(MASS) {
                    masses[i] *= moved / gaussians.count[i];
                }
                gaussians.count[i] = moved;
                factors[at] = exp(f64::from(code - last) * step);
            }
        }
        Ok(factors)
    }

    /// The block of the next frame.
    pub fn decode(&self, bytes: &[u8], step: &FrameStep) -> std::result::Result<TrackedBlock, String> {
        let mut r = WireReader::new(bytes);
        let header = ChangeHeader::read(&mut r)?;
        let new = r.take(header.new as usize)?;
        let mut reader = RansReader::new(&bytes[r.position()..]).ok_or("a stream has no start")?;
        let mut next = self.walk(&mut reader, &header, step, None)?;
        if !reader.finished() || !reader.rest().is_empty() {
            return Err("a stream does not end where it should".into());
        }
        let none = || Block { bounds: header.bounds, count: 0, mass: 0.0, gaussians: Mixture::default() };
        let new = match new {
            [] => none(),
            bytes => decoder::block(bytes, &Context::SILENT).map_err(|f| match f {
                decoder::BlockFault::Corrupt(message) => message,
                decoder::BlockFault::Memory(e) => e.to_string(),
            })?,
        };
        let weighted = self.block.gaussians.masses().is_some();
        if !new.gaussians.is_empty()
            && (new.gaussians.masses().is_some() != weighted || new.gaussians.law.alpha_blend().is_some())
        {
            return Err("new Gaussians are of another kind".into());
        }
        let g = &mut next.block.gaussians;
        // Those that stay share what the new block leaves: something where there are any, else nothing.
        let left = header.count.checked_sub(new.count).filter(|left| (*left > 0) != g.is_empty());
        let Some(left) = left else { return Err("a change has another number of particles".into()) };
        if !g.is_empty() {
            whole_counts(&mut g.count, left);
            let counts = &g.count;
            if let Some(masses) = g.columns.get_mut(MASS) {
                // The walk left masses of one particle, since counts are whole only now.
                masses.iter_mut().zip(counts).for_each(|(m, n)| *m *= n);
                let mass = header.mass - new.mass;
                if mass.is_nan() || mass <= 0.0 {
                    return Err("a change has another mass".into());
                }
                rescale(masses, mass);
            }
        }
        let n = new.gaussians.len();
        // New Gaussians come last, with no motion known yet (section 16).
        g.append(&new.gaussians);
        next.origin.extend(std::iter::repeat_n(None, n));
        next.velocity.iter_mut().for_each(|v| v.extend(std::iter::repeat_n(f64::NAN, n)));
        next.unrest.extend(std::iter::repeat_n(0, n));
        next.history.extend(std::iter::repeat_n([0; NUMBERS], n));
        Ok(next)
    }

    /// Codes the Gaussians one by one: those that stay, their counts as weights yet, masses as those of a particle.
    /// The encoder has `target`: Gaussians, and which of them stay.
    fn walk(
        &self,
        c: &mut impl Coder,
        header: &ChangeHeader,
        step: &FrameStep,
        target: Option<(&Mixture, &dyn Fn(usize) -> bool)>,
    ) -> std::result::Result<TrackedBlock, String> {
        let mixture = &self.block.gaussians;
        let weighted = mixture.masses().is_some();
        let [from, to] = step.cells;
        let frames = FrameMap::new(from, to);
        let n = mixture.len();
        let mut gaussians = Mixture::new(weighted);
        gaussians.reserve(n);
        let block = Block { bounds: header.bounds, count: header.count, mass: header.mass, gaussians };
        // Models go on from frame to frame, so the walk begins with those that the frame before left.
        let mut next = TrackedBlock {
            block,
            origin: Vec::with_capacity(n),
            velocity: [(); 3].map(|()| Vec::with_capacity(n)),
            unrest: Vec::with_capacity(n),
            history: Vec::with_capacity(n),
            models: self.models.clone(),
        };
        let [place_step, size_step, shape_step, count_step, mass_step] = header.steps.map(f64::from);
        let (mut previous_means, mut last_unrest) = (Vec::with_capacity(n), 0);
        for i in 0..n {
            let goes = target.is_some_and(|(_, stays)| !stays(i));
            if next.models.stays.code(c, usize::from(goes)) == 1 {
                continue;
            }
            // Counts may be 0, which has no logarithm: such a Gaussian counts as half a particle (section 16).
            let (mean, cov, count) = (mixture.mean_of(i), mixture.cov_of(i), mixture.count[i].max(0.5));
            let factor = CholeskyFactor::new(&cov);
            let coarseness = (extent_over_count(mixture, i) / header.scale).sqrt().clamp(0.125, 8.0);
            let velocity = self.velocity(i);
            let guess = velocity.unwrap_or_else(|| next.guess(&previous_means, mean));
            let carried = frames.carried(mean);
            let expected = each_axis(|k| carried[k] + guess[k] * step.elapsed);
            // The nearest image is meant, so that crossing a face of the cell costs nothing.
            let offset = target.map(|(t, _)| frames.nearest(each_axis(|k| t.mean[k][i] - expected[k])));
            let mut numbers = ChangeNumbers {
                models: &mut next.models,
                unrest: 2 * self.unrest[i] + last_unrest,
                coarseness,
                history: self.history[i],
                coded: 0,
                sum: 0,
            };
            let mut q = [0.0; 3];
            let (kind, size) = (if velocity.is_some() { PLACE } else { FIRST_PLACE }, place_step * coarseness);
            // Axis after axis, as each makes up for what the rounding of earlier ones has moved it by.
            for axis in 0..3 {
                let wanted = offset.map(|d| factor.solve(d, axis, q));
                q[axis] = numbers.code(c, kind, wanted, [size, f64::INFINITY])?;
            }
            let wanted = target.map(|(t, _)| factor.logarithm(&t.cov_of(i)).unwrap_or_default());
            let mut shape = [0.0; 6];
            for (j, value) in shape.iter_mut().enumerate() {
                let (kind, step) = if j == 0 { (SIZE, size_step) } else { (SHAPE, shape_step * coarseness) };
                *value = numbers.code(c, kind, wanted.map(|w| w[j]), [step, LARGEST_LOG])?;
            }
            let wanted = target.map(|(t, _)| libm::log(t.count[i].max(0.5) / count));
            let count = count * exp(numbers.code(c, COUNT, wanted, [count_step, LARGEST_LOG])?);
            let mut mass = 1.0;
            if weighted {
                let particle_mass = mixture.mass_of(i) / mixture.count[i].max(1.0);
                // A Gaussian without mass says nothing of its particles': they have the block's mean (section 16).
                let particle_mass =
                    if particle_mass > 0.0 { particle_mass } else { self.block.mass / self.block.count as f64 };
                let wanted =
                    target.map(|(t, _)| libm::log((t.mass_of(i) / t.count[i].max(0.5) / particle_mass).max(1e-30)));
                let wanted = wanted.map(|w| w.clamp(-8.0, 8.0));
                mass = particle_mass * exp(numbers.code(c, WEIGHT, wanted, [mass_step, LARGEST_LOG])?);
            }
            let history = numbers.history;
            // Limited once for both of its uses: as U of the next frame, and as U' of the next Gaussian (section 16).
            last_unrest = numbers.sum.min(MOST_UNREST);
            let shift = factor.apply(q);
            let place = each_axis(|k| expected[k] + shift[k]);
            let unit = exp_twice([shape[1], shape[2], shape[3], shape[4], shape[5]]);
            let growth = exp(2.0 * shape[0]);
            let cov = factor.congruent(&unit).scale(growth);
            let sound = cov.0.iter().chain(&place).all(|v| v.is_finite()) && [0, 3, 5].iter().all(|&k| cov.0[k] >= 0.0);
            if !sound || !count.is_finite() {
                return Err("a Gaussian of a change is out of range".into());
            }
            let gain = f64::from(header.gains[usize::from(velocity.is_some())]);
            (0..3).for_each(|k| next.velocity[k].push(guess[k] + gain * shift[k] / step.elapsed));
            next.block.gaussians.push(frames.image(place), cov, count, mass);
            next.origin.push(Some(i as u32));
            next.unrest.push(last_unrest);
            next.history.push(history);
            // Neighbours are found by their places in the frame before, where the next Gaussian still is.
            previous_means.push(mean);
        }
        Ok(next)
    }

    /// The mean velocity of the nearest of the Gaussians coded last, whose places were `from`.
    fn guess(&self, from: &[[f64; 3]], at: [f64; 3]) -> [f64; 3] {
        let mut neighbours: Vec<(f64, usize)> = Vec::with_capacity(NEIGHBOURS + 1);
        // Backwards: of equal distances the later one comes first (section 16).
        for j in (from.len().saturating_sub(WINDOW)..from.len()).rev() {
            let [x, y, z] = each_axis(|k| from[j][k] - at[k]);
            let d2 = x * x + y * y + z * z;
            if neighbours.len() < NEIGHBOURS || d2 < neighbours[NEIGHBOURS - 1].0 {
                let place = neighbours.partition_point(|n| n.0 <= d2);
                neighbours.insert(place, (d2, j));
                neighbours.truncate(NEIGHBOURS);
            }
        }
        let n = neighbours.len().max(1) as f64;
        each_axis(|k| neighbours.iter().fold(0.0, |sum, &(_, j)| sum + self.velocity[k][j]) / n)
    }
}

/// Radius of a Gaussian over its count: the larger and the fewer, the coarser its steps may be.
fn extent_over_count(g: &Mixture, i: usize) -> f64 {
    let trace = (g.cov[0][i] + g.cov[3][i]) + g.cov[5][i];
    (trace / 3.0).max(0.0).sqrt() / g.count[i].max(0.5)
}

/// Places of one frame in the other.
pub(super) struct FrameMap {
    /// Cells and the inverse of the first, where both repeat and differ.
    cells: Option<(PeriodicCell, Cell)>,
    to: Option<PeriodicCell>,
}

impl FrameMap {
    pub(super) fn new(from: Option<Cell>, to: Option<Cell>) -> FrameMap {
        // A cell without three vectors does not count here (section 16).
        let spanned = |c: &Cell| !c.vectors.contains(&[0.0; 3]);
        let [from, to] = [from, to].map(|c| c.filter(spanned).and_then(PeriodicCell::new));
        let cells = from.zip(to).filter(|(a, b)| a.cell != b.cell).map(|(a, b)| (a, b.cell));
        FrameMap { cells, to }
    }

    /// The place of the same fractions of the cell.
    pub(super) fn carried(&self, x: [f64; 3]) -> [f64; 3] {
        match &self.cells {
            None => x,
            Some((from, to)) => {
                let fractions = from.fractions(from.offset(x));
                each_axis(|k| {
                    let scaled: f64 = (0..3).map(|a| fractions[a] * to.vectors[a][k]).sum();
                    let along: f64 = (0..3).map(|a| fractions[a] * from.cell.vectors[a][k]).sum();
                    // What does not repeat stays where it is.
                    (x[k] - from.cell.origin[k]) - along + scaled + to.origin[k]
                })
            }
        }
    }

    pub(super) fn image(&self, x: [f64; 3]) -> [f64; 3] {
        self.to.as_ref().map_or(x, |to| to.image(x))
    }

    /// The shortest of the vectors that lead to an image.
    pub(super) fn nearest(&self, d: [f64; 3]) -> [f64; 3] {
        let Some(to) = &self.to else { return d };
        let whole = to.fractions(d).map(|f| (f + 0.5).floor());
        let shift = to.vector(whole);
        each_axis(|k| d[k] - shift[k])
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Random, Sym3};

    const STEP: FrameStep = FrameStep { cells: [None; 2], elapsed: 0.1 };

    /// Gaussians of some sizes and counts.
    fn block(number: usize, seed: u64, weighted: bool) -> Block {
        let mut g = Mixture::new(weighted);
        for i in 0..number {
            let mut r = Random::new(seed, 1, i as u64);
            let [a, b, c] = [r.normal(), r.normal(), r.normal()];
            let shape = Sym3::outer([0.1 * a, 0.1 * b, 0.1 * c]).add(&Sym3::scaled_identity(0.01));
            let count = (20.0 + 80.0 * r.uniform()).floor();
            g.push(
                [10.0 * r.uniform(), 10.0 * r.uniform(), 10.0 * r.uniform()],
                shape,
                count,
                count * (1.0 + r.uniform()),
            );
        }
        let count: f64 = g.count.iter().sum();
        let mass = if weighted { (0..number).map(|i| g.mass_of(i)).sum() } else { count };
        let bounds = Bounds { min: [-1.0; 3], max: [12.0; 3] };
        Block { bounds, count: count as u64, mass, gaussians: g }
    }

    fn target<'a>(block: &'a Block, born: &'a [bool]) -> ChangeTarget<'a> {
        ChangeTarget { gaussians: &block.gaussians, born, bounds: block.bounds, count: block.count, mass: block.mass }
    }

    fn largest_miss(a: &Mixture, b: &Mixture) -> f64 {
        let miss = |i: usize| {
            let width = (b.cov[0][i] + b.cov[3][i] + b.cov[5][i]).sqrt();
            (0..3).map(|k| (a.mean[k][i] - b.mean[k][i]).abs() / width).fold(0.0, f64::max)
        };
        (0..a.len()).map(miss).fold(0.0, f64::max)
    }

    #[test]
    fn gaussians_that_move_steadily_are_soon_expected_where_they_are() {
        let mut now = block(200, 7, true);
        let mut tracked = TrackedBlock::new(now.clone());
        let born = vec![false; 200];
        for _ in 0..6 {
            for k in 0..3 {
                now.gaussians.mean[k].iter_mut().for_each(|x| *x += 0.05 * (k + 1) as f64);
            }
            let bytes = tracked.encode(&target(&now, &born), &STEP, &ChangePrecision::default()).unwrap();
            tracked = tracked.decode(&bytes, &STEP).unwrap();
            assert_eq!(tracked.block.gaussians.count.iter().sum::<f64>() as u64, now.count);
            let mass: f64 = (0..200).map(|i| tracked.block.gaussians.mass_of(i)).sum();
            assert!((mass / now.mass - 1.0).abs() < 1e-12);
            assert!(largest_miss(&tracked.block.gaussians, &now.gaussians) < 2.0);
        }
        for k in 0..3 {
            now.gaussians.mean[k].iter_mut().for_each(|x| *x += 0.05 * (k + 1) as f64);
        }
        assert!(largest_miss(&tracked.expected(&STEP), &now.gaussians) < 0.5);
        assert!(tracked.origin.iter().enumerate().all(|(i, o)| *o == Some(i as u32)));
    }

    #[test]
    fn numbers_that_go_on_as_before_take_fewer_bytes() {
        let mut now = block(300, 11, false);
        let mut tracked = TrackedBlock::new(now.clone());
        let precision = ChangePrecision::default();
        for frame in 0..6 {
            // Each grows or shrinks at its own pace.
            let pace = |i: usize| 0.5 + Random::new(2, 3, i as u64).uniform();
            now.gaussians.cov.iter_mut().for_each(|c| (0..300).for_each(|i| c[i] *= pace(i)));
            let change = tracked.encode(&target(&now, &[false; 300]), &STEP, &precision).unwrap();
            if frame == 5 {
                let fresh =
                    TrackedBlock { velocity: tracked.velocity.clone(), ..TrackedBlock::new(tracked.block.clone()) };
                let without = fresh.encode(&target(&now, &[false; 300]), &STEP, &precision).unwrap();
                assert!((change.len() - HEADER_BYTES) * 4 < (without.len() - HEADER_BYTES) * 3, "{}", change.len());
            }
            tracked = tracked.decode(&change, &STEP).unwrap();
        }
    }

    #[test]
    fn counts_that_are_balanced_leave_no_gaussian_out() {
        for weighted in [false, true] {
            let (mut start, precision) = (block(100, 5, weighted), ChangePrecision::default());
            // Half of them are about to go.
            (0..50).for_each(|i| start.gaussians.count[i] = 1.0);
            start.count = start.gaussians.count.iter().sum::<f64>() as u64;
            let tracked = TrackedBlock::new(start.clone());
            let mut wanted = start.clone();
            (0..50).for_each(|i| wanted.gaussians.count[i] = 0.52);
            let next_of = |gaussians: &Mixture| {
                let block = Block { gaussians: gaussians.clone(), ..start.clone() };
                let bytes = tracked.encode(&target(&block, &[false; 100]), &STEP, &precision).unwrap();
                tracked.decode(&bytes, &STEP).unwrap()
            };
            let next = next_of(&wanted.gaussians);
            // All counts of the first half smaller, by as much as they may.
            let responses: Vec<f32> = (0..100).map(|i| if i < 50 { 1.0 } else { 0.0 }).collect();
            let balance = CountBalance { responses: &responses, wanted: &[-5.0], within: 1e-3 };
            let (mut gaussians, counts) = (wanted.gaussians.clone(), wanted.gaussians.count.clone());
            let factors = tracked.balance_counts(&next, (&mut gaussians, &counts), &precision, &balance).unwrap();
            assert!(factors[..50].iter().filter(|f| **f < 1.0).count() > 20 && factors[50..].iter().all(|f| *f == 1.0));
            assert_eq!(next_of(&gaussians).origin, next.origin);
            let short = CountBalance { responses: &responses[1..], ..balance };
            assert!(tracked.balance_counts(&next, (&mut gaussians, &counts), &precision, &short).is_err());
            let other = TrackedBlock::new(block(99, 5, weighted));
            assert!(other.balance_counts(&next, (&mut gaussians, &counts), &precision, &balance).is_err());
        }
    }

    #[test]
    fn gaussians_come_and_go() {
        let tracked = TrackedBlock::new(block(50, 1, false));
        let mut next = block(50, 1, false);
        let mut born = vec![false; 50];
        (born[3], born[40]) = (true, true);
        next.gaussians.mean[0][3] = 5.5;
        next.gaussians.count[10] = 0.0;
        next.count = next.gaussians.count.iter().sum::<f64>() as u64;
        next.mass = next.count as f64;
        let bytes = tracked.encode(&target(&next, &born), &STEP, &ChangePrecision::default()).unwrap();
        let decoded = tracked.decode(&bytes, &STEP).unwrap();
        let went = [3, 10, 40];
        let stay: Vec<Option<u32>> = (0..50).filter(|i| !went.contains(i)).map(Some).collect();
        assert_eq!(decoded.origin[..47], stay);
        assert_eq!(decoded.origin[47..], [None, None]);
        assert_eq!(decoded.block.count, next.count);
        assert!(decoded.velocity(0).is_some() && decoded.velocity(48).is_none());
    }

    #[test]
    fn all_gaussians_may_be_new() {
        let tracked = TrackedBlock::new(block(20, 1, false));
        let next = block(20, 2, false);
        let bytes = tracked.encode(&target(&next, &[true; 20]), &STEP, &ChangePrecision::default()).unwrap();
        let decoded = tracked.decode(&bytes, &STEP).unwrap();
        assert_eq!((decoded.block.count, decoded.block.gaussians.len()), (next.count, 20));
    }

    #[test]
    fn gaussians_that_become_points_or_giants_are_coded_as_far_as_steps_go() {
        let tracked = TrackedBlock::new(block(40, 9, false));
        let mut next = block(40, 9, false);
        for i in 0..40 {
            let by = if i % 2 == 0 { 1e-40 } else { 1e40 };
            (0..6).for_each(|k| next.gaussians.cov[k][i] *= if k == i % 6 { by } else { 1.0 });
        }
        let bytes = tracked.encode(&target(&next, &[false; 40]), &STEP, &ChangePrecision::default()).unwrap();
        assert!(tracked.decode(&bytes, &STEP).is_ok());
    }

    #[test]
    fn gaussians_cross_the_faces_of_a_cell() {
        let cell = Some(Cell::orthogonal([10.0; 3]));
        let step = FrameStep { cells: [cell; 2], elapsed: 0.1 };
        let tracked = TrackedBlock::new(block(100, 5, false));
        let mut next = block(100, 5, false);
        for x in &mut next.gaussians.mean[0] {
            *x = (*x + 0.3) % 10.0;
        }
        let bytes = tracked.encode(&target(&next, &[false; 100]), &step, &ChangePrecision::default()).unwrap();
        let decoded = tracked.decode(&bytes, &step).unwrap();
        assert!(decoded.block.gaussians.mean[0].iter().all(|x| (0.0..=10.0).contains(x)));
        // All moved alike, however they crossed.
        assert!((0..100).all(|i| (0.0..6.0).contains(&decoded.velocity(i).unwrap()[0])));
    }

    #[test]
    fn damaged_changes_are_refused_or_decode_to_sound_gaussians() {
        let tracked = TrackedBlock::new(block(30, 3, true));
        let next = block(30, 4, true);
        let mut born = [false; 30];
        born[5] = true;
        let bytes = tracked.encode(&target(&next, &born), &STEP, &ChangePrecision::default()).unwrap();
        for at in 0..bytes.len() {
            assert!(tracked.decode(&bytes[..at], &STEP).is_err());
            let mut other = bytes.clone();
            other[at] ^= 1 << (at % 8);
            if let Ok(decoded) = tracked.decode(&other, &STEP) {
                let g = &decoded.block.gaussians;
                assert!(g.mean.iter().chain(&g.cov).flatten().all(|v| v.is_finite()));
            }
        }
    }
}
