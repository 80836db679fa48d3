//! A field's moments of a block's Gaussians as bytes (docs/format.md, section 14). Values are predicted from Gaussians
//! already decoded, in a change from the frame before (section 16), and coded in steps of a Gaussian's standard error.

use super::exact::{exp_twice, to_five};
use super::number_model::{
    ChangeModels, FieldNumberCoder, FieldPredictor, LARGEST_LOG as LARGEST_CHANGE, NumberContext, expected, in_steps,
};
use super::rans::{Coder, RansReader, RansWriter};
use super::shape::CholeskyFactor;
use super::sums::compensated;
use super::wire::WireReader;
use crate::math::{Sym3, each_axis, exp};
use crate::model::{FieldMoments, Mixture, Quantity, QuantityKind};

/// Shape numbers and logarithms at most.
const LARGEST_SHAPE: f64 = 16.0;
const LARGEST_LOG: f64 = 300.0;
/// An excess at most, and the shift of all.
const LARGEST_EXCESS: f64 = 100.0;
const LARGEST_SHIFT: f64 = 1e3;
/// The least variance that changes begin from, in the range of values, squared and times the count: 2^-42.
const NARROWEST_BEFORE: f64 = 1.0 / (1u64 << 42) as f64;
/// Times at most that shares are scaled until their sum is the particles'.
const SHARE_ROUNDS: usize = 64;

/// Steps that a field is coded with.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FieldPrecision {
    /// Steps of means, logarithms of spreads, shapes and slopes, in standard errors.
    pub steps: [f32; 4],
    /// The same of a logarithmic field, and of its excess.
    pub logarithmic: [f32; 5],
    /// Of shares: steps of means and slopes.
    pub shares: [f32; 2],
}

impl Default for FieldPrecision {
    fn default() -> Self {
        FieldPrecision { steps: [5.0, 2.0, 5.0, 6.0], logarithmic: [4.0, 3.0, 4.0, 12.0, 4.0], shares: [2.0, 4.0] }
    }
}

impl FieldPrecision {
    /// All steps times `q`.
    pub(crate) fn scaled(self, q: f32) -> FieldPrecision {
        FieldPrecision {
            steps: self.steps.map(|s| s * q),
            logarithmic: self.logarithmic.map(|s| s * q),
            shares: self.shares.map(|s| s * q),
        }
    }
}

/// A field of a block in the frame before, and which Gaussians of the frame stayed.
#[derive(Clone, Copy)]
pub struct PreviousField<'a> {
    pub(super) moments: &'a FieldMoments,
    /// Counts in the frame before.
    pub(super) counts: &'a [f64],
    /// For each Gaussian of the frame its number in the frame before; `None` of one that is new.
    pub(super) origin: &'a [Option<u32>],
    /// Steps that each took since.
    pub(super) unrest: &'a [u32],
}

impl PreviousField<'_> {
    /// The number of Gaussian `i` in the frame before, if it had a particle and, but of shares, a variance of at least
    /// `least` along an axis: of a smaller one changes do not lead far enough.
    fn of(&self, i: usize, least: Option<f64>) -> Option<usize> {
        let j = self.origin.get(i).copied().flatten()? as usize;
        let has_particles = *self.counts.get(j)? >= 1.0;
        let wide = |least: f64| trace(self.moments, j) >= self.moments.components() as f64 * least;
        (has_particles && least.is_none_or(wide)).then_some(j)
    }
}

/// The least logarithm of a spread that is coded, where the range of values, squared and times the count, is `square`.
fn least_log(square: f64) -> f64 {
    0.5 * libm::log(square) - 20.0 * std::f64::consts::LN_2
}

/// The sum of the variances of a spread.
fn trace(m: &FieldMoments, i: usize) -> f64 {
    match &m.spread[..] {
        [one] => one[i],
        six => (six[0][i] + six[3][i]) + six[5][i],
    }
}

/// Header of a section, before its stream.
#[derive(Clone, Debug, PartialEq)]
struct FieldHeader {
    field: u8,
    steps: [f32; 4],
    /// Variance of the mean's and of the log spread's change over a world unit.
    change: [f32; 2],
    /// Mean squares of shape numbers, and of slopes over a Gaussian in units of its spread.
    square: [f32; 2],
    /// Means and the logarithm of the spread where nothing is decoded yet. Infinite where means are beyond float32.
    start: [f32; 2],
    /// Exact sums of weight times value, one a component; least and largest value.
    sums: Vec<f64>,
    range: Vec<[f64; 2]>,
    /// Of a logarithmic field.
    excess: Option<ExcessHeader>,
}

/// The header's part on a logarithmic field's excess.
#[derive(Clone, Copy, Debug, PartialEq)]
struct ExcessHeader {
    step: f32,
    square: f32,
    shift: f64,
}

impl FieldHeader {
    /// The mean of component `k` where nothing is decoded yet.
    fn first_mean(&self, k: usize) -> f64 {
        let start = f64::from(self.start[0]);
        if start.is_finite() { start } else { start.clamp(self.range[k][0], self.range[k][1]) }
    }

    fn write(&self) -> Vec<u8> {
        let mut out = vec![self.field, self.sums.len() as u8];
        let floats = self.steps.iter().chain(&self.change).chain(&self.square).chain(&self.start);
        floats.for_each(|v| out.extend(v.to_le_bytes()));
        self.sums.iter().chain(self.range.iter().flatten()).for_each(|v| out.extend(v.to_le_bytes()));
        if let Some(ExcessHeader { step, square, shift }) = self.excess {
            [step, square].iter().for_each(|v| out.extend(v.to_le_bytes()));
            out.extend(shift.to_le_bytes());
        }
        out
    }

    fn read(r: &mut WireReader<'_>, logarithmic: bool) -> Result<Self, String> {
        let (field, components) = (r.u8()?, r.u8()?);
        if components != 1 && (components != 3 || logarithmic) {
            return Err(format!("a field has {components} components"));
        }
        let mut floats = [0f32; 10];
        for v in &mut floats {
            *v = r.f32()?;
        }
        let [a, b, c, d, change @ .., e, f, g, h] = floats;
        let positive = |v: &f32| *v > 0.0 && *v < 1e30;
        // An infinite mean stands for the least or largest value (section 14), so only NaN is refused.
        if !floats[..8].iter().all(positive) || g.is_nan() || !h.is_finite() {
            return Err("the steps of a field are out of range".into());
        }
        let mut reals = (0..3 * components).map(|_| r.f64()).collect::<Result<Vec<f64>, String>>()?;
        if reals.iter().any(|v| !v.is_finite()) {
            return Err("a sum or bound of a field is not finite".into());
        }
        let range = reals.split_off(usize::from(components));
        let range: Vec<[f64; 2]> = range.as_chunks().0.to_vec();
        if range.iter().any(|[least, largest]| least > largest) {
            return Err("the least value of a field is above the largest".into());
        }
        let mut excess = None;
        if logarithmic {
            let (step, square, shift) = (r.f32()?, r.f32()?, r.f64()?);
            if !positive(&step) || !positive(&square) || shift.is_nan() || shift.abs() > LARGEST_SHIFT {
                return Err("the excess of a field is out of range".into());
            }
            excess = Some(ExcessHeader { step, square, shift });
        }
        let (steps, square, start) = ([a, b, c, d], [e, f], [g, h]);
        Ok(FieldHeader { field, steps, change, square, start, sums: reals, range, excess })
    }
}

/// Encodes the moments of field `quantity`, number `field`, of a block's decoded Gaussians; `sums` are the particles'
/// weighted sums of each component. With what they had in the frame `before`: as a [`super::FIELD_CHANGE`].
pub fn encode_field(
    (field, quantity): (u8, &Quantity),
    moments: &FieldMoments,
    gaussians: &Mixture,
    sums: &[f64],
    precision: &FieldPrecision,
    before: Option<&PreviousField<'_>>,
) -> Vec<u8> {
    let of_shares = is_share(quantity);
    // The spread of a share is not coded: it follows from the mean, as in the decoder (docs/format.md, section 14).
    let shares = of_shares.then(|| shares_of(moments, gaussians));
    let moments = shares.as_ref().unwrap_or(moments);
    let mut header = FieldHeader {
        field,
        steps: precision.steps,
        sums: sums.to_vec(),
        range: moments.range.clone(),
        ..statistics(moments, gaussians)
    };
    if of_shares {
        let [mean, slope] = precision.shares;
        // Shares have no coded log spread and no shape, but steps of 0 would be corrupt.
        header.steps = [mean, 1.0, 1.0, slope];
    }
    if let Some(excess) = &mut header.excess {
        let [steps @ .., step] = precision.logarithmic;
        (header.steps, excess.step) = (steps, step);
    }
    let mut writer = RansWriter::default();
    let mut walk = FieldWalk::new(&header, gaussians, of_shares, before);
    // Every number is within the range that the walk accepts.
    let stream = walk.run(&mut writer, Some(moments)).map(|()| writer.finish()).unwrap_or_default();
    if header.excess.is_some() {
        // What makes the sum the particles'.
        // The shift is no part of the stream: it is measured on the moments that the decoder will have.
        let decoded = walk.finish(quantity.by_mass);
        let value =
            |i: usize| weight(gaussians, i, quantity.by_mass) * decoded.overall_value(0, i, &gaussians.cov_of(i));
        let sum = compensated(&(0..gaussians.len()).map(value).collect::<Vec<_>>());
        let shift = libm::log(sums[0] / sum);
        let shift = if shift.is_finite() { shift.clamp(-LARGEST_SHIFT, LARGEST_SHIFT) } else { 0.0 };
        header.excess = header.excess.map(|e| ExcessHeader { shift, ..e });
    }
    [header.write(), stream].concat()
}

/// Whether the values are shares of particles.
fn is_share(quantity: &Quantity) -> bool {
    quantity.kind == QuantityKind::Category
}

/// Moments of shares with the spreads that are coded.
fn shares_of(moments: &FieldMoments, gaussians: &Mixture) -> FieldMoments {
    let variance = |i: usize| {
        let s = share_deviation(moments.mean[0][i], gaussians.count[i].max(1.0));
        s * s
    };
    let spread = vec![(0..gaussians.len()).map(variance).collect()];
    FieldMoments { spread, range: vec![[0.0, 1.0]], ..moments.clone() }
}

/// The deviation that a share of `n` particles is taken to have.
fn share_deviation(share: f64, n: f64) -> f64 {
    let v = share.clamp(0.0, 1.0);
    (v * (1.0 - v)).max(1.0 / n).sqrt()
}

/// Weight of a Gaussian in a field's sums.
fn weight(g: &Mixture, i: usize, by_mass: bool) -> f64 {
    if by_mass { g.mass_of(i) } else { g.count[i] }
}

/// Decodes a section of `quantity`, which the caller found by the section's first byte; with the moments of the frame `before`, a [`super::FIELD_CHANGE`].
pub(crate) fn decode_field(
    bytes: &[u8],
    gaussians: &Mixture,
    quantity: &Quantity,
    before: Option<&PreviousField<'_>>,
) -> Result<FieldMoments, String> {
    let mut r = WireReader::new(bytes);
    let header = FieldHeader::read(&mut r, quantity.logarithmic)?;
    if before.is_some_and(|b| b.moments.components() != header.sums.len()) {
        return Err("a field has other components in the frame before".into());
    }
    if is_share(quantity) && (header.sums[0] < 0.0 || header.range != [[0.0, 1.0]]) {
        return Err("the shares of a class are out of range".into());
    }
    let stream = &bytes[r.position()..];
    let mut reader = RansReader::new(stream).ok_or("a field's stream has no start")?;
    let mut walk = FieldWalk::new(&header, gaussians, is_share(quantity), before);
    walk.run(&mut reader, None)?;
    if !reader.finished() || !reader.rest().is_empty() {
        return Err("a field's stream does not end where it should".into());
    }
    let moments = walk.finish(quantity.by_mass);
    let finite = moments.columns().flatten().all(|v| v.is_finite());
    if finite { Ok(moments) } else { Err("a number of a field is not finite".into()) }
}

/// Means, slopes and spreads as they are decoded, Gaussian by Gaussian.
struct FieldWalk<'a> {
    header: &'a FieldHeader,
    gaussians: &'a Mixture,
    of_shares: bool,
    before: Option<&'a PreviousField<'a>>,
    out: FieldMoments,
    /// Logarithm of the spread, of Gaussians without a guess from the frame before.
    logs: Vec<f64>,
    /// Deviations that stand for the spreads.
    sizes: Vec<f64>,
    done: FieldPredictor<'a>,
    models: [FieldNumberCoder; 5],
    changes: ChangeModels,
}

impl<'a> FieldWalk<'a> {
    fn new(
        header: &'a FieldHeader,
        gaussians: &'a Mixture,
        of_shares: bool,
        before: Option<&'a PreviousField<'a>>,
    ) -> Self {
        let (n, components) = (gaussians.len(), header.sums.len());
        let mut out = if header.excess.is_some() { FieldMoments::logarithmic() } else { FieldMoments::new(components) };
        out.mean.iter_mut().chain(&mut out.spread).chain(&mut out.excess).for_each(|c| c.resize(n, 0.0));
        out.slope.iter_mut().flatten().for_each(|c| c.resize(n, 0.0));
        FieldWalk {
            header,
            gaussians,
            of_shares,
            before,
            out,
            logs: vec![0.0; n],
            sizes: vec![0.0; n],
            done: FieldPredictor::new(gaussians),
            models: std::array::from_fn(|_| FieldNumberCoder::default()),
            changes: ChangeModels::new(),
        }
    }

    fn run(&mut self, c: &mut impl Coder, wanted: Option<&FieldMoments>) -> Result<(), String> {
        let components = self.out.components();
        let width = self.header.range.iter().map(|[least, largest]| largest - least).fold(0.0, f64::max);
        let [mean_steps, log_steps, shape_steps, slope_steps] = self.header.steps.map(f64::from);
        let [mean_change, log_change] = self.header.change.map(f64::from);
        let [shape_square, slope_square] = self.header.square.map(f64::from);
        for i in 0..self.gaussians.len() {
            let n = self.gaussians.count[i];
            // Gaussians without a particle keep zeros and are nobody's neighbours (docs/format.md, section 14).
            if n < 1.0 {
                continue;
            }
            // Beyond its end a stream reads as zeros, and of these no numbers may be made.
            if c.exhausted() {
                return Err("a field's stream ends too soon".into());
            }
            // A mean lies within 2^18 steps of any guess where the spread is no smaller.
            let square = (width * width * n).max(1e-200);
            let least = (!self.of_shares).then_some(square * NARROWEST_BEFORE);
            if let Some((before, j)) = self.before.and_then(|before| Some((before, before.of(i, least)?))) {
                self.change(c, before, [i, j], wanted.map(|w| (w, least_log(square))))?;
                self.done.push(i);
                continue;
            }
            let neighbours = self.done.near(i);
            let root = n.sqrt();
            let wanted_logs = wanted.map(|w| spread_logs(w, i));
            // The spread's logarithm.
            if !self.of_shares {
                // The logarithm of a deviation of C n normal values has this standard error.
                let error = 1.0 / (2.0 * components as f64 * n).sqrt();
                let weights =
                    self.done.weights(&neighbours, log_change, |_, count| 1.0 / (2.0 * components as f64 * count));
                let start = f64::from(self.header.start[1]);
                // Gaussians that follow the frame before have no `logs`: the guess is the header's (section 16).
                let (guess, variance) = match self.before {
                    None => expected(&neighbours, &weights, start, |j| self.logs[j]),
                    Some(_) => (start, 1.0),
                };
                let step = log_steps * error;
                let target = wanted_logs.map(|w| w.0.max(least_log(square)));
                self.logs[i] =
                    self.models[0].code(c, [guess, variance], [error, step], target)?.clamp(-LARGEST_LOG, LARGEST_LOG);
            }
            let mut spread = exp(self.logs[i]);
            // Means.
            let weights = self.done.weights(&neighbours, mean_change, |j, count| {
                let s = match self.of_shares {
                    true => share_deviation(self.out.mean[0][j], count),
                    false => self.sizes[j],
                };
                s * s / count
            });
            for k in 0..components {
                let start = self.header.first_mean(k);
                let (guess, variance) = expected(&neighbours, &weights, start, |j| self.out.mean[k][j]);
                // The share itself is not known yet, so the deviation is that of its guess.
                if self.of_shares {
                    spread = share_deviation(guess, n);
                }
                let error = spread / root;
                let step = mean_steps * error;
                let target = wanted.map(|w| w.mean[k][i]);
                self.out.mean[k][i] = self.models[1].code(c, [guess, variance], [error, step], target)?;
            }
            // Slopes come after the mean and may use the deviation of the share itself.
            if self.of_shares {
                spread = share_deviation(self.out.mean[0][i], n);
            }
            self.sizes[i] = spread;
            // The spread's shape.
            let error = 1.0 / root;
            let mut shape = [0.0; 5];
            if components == 3 {
                let step = shape_steps * error;
                for k in 0..5 {
                    let target = wanted_logs.map(|w| w.1[k]);
                    let value = self.models[2].code(c, [0.0, shape_square], [error, step], target)?;
                    shape[k] = value.clamp(-LARGEST_SHAPE, LARGEST_SHAPE);
                }
            }
            self.slopes(c, i, wanted, [spread, error, slope_steps * error, slope_square])?;
            self.excess(c, i, wanted)?;
            let size = spread * spread;
            match components {
                1 => self.out.spread[0][i] = size,
                _ => {
                    let unit = exp_twice(shape);
                    (0..6).for_each(|k| self.out.spread[k][i] = unit.0[k] * size);
                }
            }
            self.done.push(i);
        }
        Ok(())
    }

    /// Codes the slopes of Gaussian `i` over its own widths, in units of the spread.
    fn slopes(
        &mut self,
        c: &mut impl Coder,
        i: usize,
        wanted: Option<&FieldMoments>,
        [spread, error, step, square]: [f64; 4],
    ) -> Result<(), String> {
        let factor = CholeskyFactor::new(&self.gaussians.cov_of(i));
        for k in 0..self.out.components() {
            let target = wanted.map(|w| factor.over(each_axis(|d| w.slope[k][d][i])).map(|v| v / spread));
            let mut over = [0.0; 3];
            for d in 0..3 {
                over[d] = self.models[3].code(c, [0.0, square], [error, step], target.map(|t| t[d]))?;
            }
            let slope = factor.slope(over.map(|v| v * spread));
            (0..3).for_each(|d| self.out.slope[k][d][i] = slope[d]);
        }
        Ok(())
    }

    /// Codes Gaussian `i` from its moments as number `j` of the frame before. `wanted` moments come with the least
    /// logarithm of their spreads.
    fn change(
        &mut self,
        c: &mut impl Coder,
        before: &PreviousField<'_>,
        [i, j]: [usize; 2],
        wanted: Option<(&FieldMoments, f64)>,
    ) -> Result<(), String> {
        let PreviousField { moments: old_moments, unrest, .. } = *before;
        let components = self.out.components();
        let [mean_steps, log_steps, shape_steps, slope_steps] = self.header.steps.map(f64::from);
        let n = self.gaussians.count[i];
        let root = n.sqrt();
        let (changes, mut sum) = (&mut self.changes, 0u32);
        let mut number = |kind: usize, target: Option<f64>, step: f64, most: f64| {
            // Fields have no histories and no coarseness of their own: h = 0 and f = 1 (section 16).
            let context = NumberContext { unrest: unrest[i] + 2 * sum, history: 0, coarseness: 1.0 };
            let k = changes.code(c, kind, &context, target.map_or(0, |t| in_steps(t, step, most)))?;
            sum += k.unsigned_abs();
            let value = step * f64::from(k);
            if value.abs() > most { Err(String::from("a change of a field is out of range")) } else { Ok(value) }
        };
        // The spread, in the frame of that before.
        let before_spread = |k: usize| old_moments.spread[k][j];
        let factor = (components == 3).then(|| CholeskyFactor::new(&Sym3(std::array::from_fn(before_spread))));
        let wanted_logs = wanted.map(|(w, least)| {
            let (log, shape) = spread_logs(w, i);
            let square = libm::exp(2.0 * log.max(least));
            // A change without a finite logarithm is coded as none.
            match &factor {
                Some(factor) => factor.logarithm(&exp_twice(shape).scale(square)).unwrap_or_default(),
                None => [0.5 * libm::log(square / old_moments.spread[0][j]), 0.0, 0.0, 0.0, 0.0, 0.0],
            }
        });
        let wanted = wanted.map(|w| w.0);
        let (mut size, mut spread) = (0.0, 0.0);
        if !self.of_shares {
            let error = 1.0 / (2.0 * components as f64 * n).sqrt();
            size = number(0, wanted_logs.map(|w| w[0]), log_steps * error, LARGEST_CHANGE)?;
            spread = (trace(old_moments, j) / components as f64).sqrt() * exp(size);
        }
        for k in 0..components {
            let guess = old_moments.mean[k][j];
            if self.of_shares {
                spread = share_deviation(guess, n);
            }
            let step = mean_steps * (spread / root);
            self.out.mean[k][i] = guess + number(1, wanted.map(|w| w.mean[k][i] - guess), step, f64::INFINITY)?;
        }
        let error = 1.0 / root;
        match factor {
            Some(factor) => {
                let mut shape = [0.0; 5];
                for (k, value) in shape.iter_mut().enumerate() {
                    *value = number(2, wanted_logs.map(|w| w[1 + k]), shape_steps * error, LARGEST_CHANGE)?;
                }
                // In the frame of the old factor a step is a relative change, whatever the spread's size and direction.
                let cov = factor.congruent(&exp_twice(shape)).scale(exp(2.0 * size));
                (0..6).for_each(|k| self.out.spread[k][i] = cov.0[k]);
            }
            None if self.of_shares => {
                spread = share_deviation(self.out.mean[0][i], n);
                self.out.spread[0][i] = spread * spread;
            }
            None => self.out.spread[0][i] = old_moments.spread[0][j] * exp(2.0 * size),
        }
        self.sizes[i] = spread;
        // Old slopes, too, are taken over the widths that the Gaussian has in this frame (section 16).
        let factor = CholeskyFactor::new(&self.gaussians.cov_of(i));
        let slope_of = |m: &FieldMoments, k: usize, i: usize| factor.over(each_axis(|d| m.slope[k][d][i]));
        for k in 0..components {
            let in_spreads = |over: [f64; 3]| over.map(|v| v / spread);
            let (guess, target) =
                (in_spreads(slope_of(old_moments, k, j)), wanted.map(|w| in_spreads(slope_of(w, k, i))));
            let mut over = guess;
            for d in 0..3 {
                over[d] += number(3, target.map(|t| t[d] - guess[d]), slope_steps * error, f64::INFINITY)?;
            }
            let slope = factor.slope(over.map(|v| v * spread));
            (0..3).for_each(|d| self.out.slope[k][d][i] = slope[d]);
        }
        self.excess(c, i, wanted)
    }

    /// The excess of Gaussian `i` of a logarithmic field.
    fn excess(&mut self, c: &mut impl Coder, i: usize, wanted: Option<&FieldMoments>) -> Result<(), String> {
        let Some(excess) = self.header.excess else { return Ok(()) };
        let size = self.sizes[i] * self.sizes[i];
        let error = ((size * size * size / 6.0 * exp(size / 3.0)).min(0.25) + 1e-6) / self.gaussians.count[i];
        let (error, square) = (error.sqrt(), f64::from(excess.square));
        let step = f64::from(excess.step) * error;
        let target = wanted.and_then(|w| {
            let nominal = w.excess.as_ref()?[i];
            let cov = self.gaussians.cov_of(i);
            let log_normal = |mean: f64, slope: [f64; 3], spread: f64| mean + 0.5 * (spread + cov.quadratic(slope));
            let slope_of = |m: &FieldMoments| each_axis(|k| m.slope[0][k][i]);
            // Rounded moments, of wide spreads above all, would move the values' mean: the excess mends what is more than
            // the mean's own rounding.
            let off = log_normal(w.mean[0][i], slope_of(w), w.spread[0][i])
                - log_normal(self.out.mean[0][i], slope_of(&self.out), size);
            let rounding = 0.5 * f64::from(self.header.steps[0]) * (size.min(0.25) / self.gaussians.count[i]).sqrt();
            Some(if off.abs() > rounding { nominal + off } else { nominal })
        });
        let value = self.models[4].code(c, [0.0, square], [error, step], target)?;
        if let Some(column) = &mut self.out.excess {
            column[i] = value.clamp(-LARGEST_EXCESS, LARGEST_EXCESS);
        }
        Ok(())
    }

    /// Moments whose sums are the particles', with means within their range.
    fn finish(mut self, by_mass: bool) -> FieldMoments {
        let g = self.gaussians;
        let weight = |i: usize| weight(g, i, by_mass);
        let total = compensated(&(0..g.len()).map(weight).collect::<Vec<_>>());
        for (k, [least, largest]) in self.header.range.iter().enumerate() {
            let mean = &mut self.out.mean[k];
            // This changes the sum, so it comes before the sum is put right.
            mean.iter_mut().for_each(|v| *v = v.clamp(*least, *largest));
            // Of a logarithmic field the shift alone makes the sum the particles'.
            if let (Some(excess), Some(column)) = (self.header.excess, &mut self.out.excess) {
                column.iter_mut().for_each(|v| *v += excess.shift);
                continue;
            }
            let sum_of = |mean: &[f64]| compensated(&(0..g.len()).map(|i| weight(i) * mean[i]).collect::<Vec<_>>());
            if self.of_shares {
                scale_shares(mean, self.header.sums[k], total, sum_of);
                let spread = &mut self.out.spread[0];
                spread.iter_mut().zip(mean).for_each(|(v, share)| *v = *share * (1.0 - *share));
                continue;
            }
            let sum = sum_of(mean);
            let correction = (self.header.sums[k] - sum) / total;
            mean.iter_mut().for_each(|v| *v += correction);
        }
        self.out.range.clone_from(&self.header.range);
        self.out
    }
}

/// Scales shares until they sum to `wanted`, each at most 1; `total` is the sum of all particles.
fn scale_shares(mean: &mut [f64], wanted: f64, total: f64, sum_of: impl Fn(&[f64]) -> f64) {
    for _ in 0..SHARE_ROUNDS {
        let sum = sum_of(mean);
        if sum == wanted {
            break;
        }
        // What is cut off at 1 is lost to the sum, so it takes several rounds.
        match sum > 0.0 {
            true => mean.iter_mut().for_each(|v| *v = (*v * (wanted / sum)).min(1.0)),
            false => mean.fill(wanted / total),
        }
    }
}

/// The logarithm of a spread's size, and its shape numbers.
fn spread_logs(m: &FieldMoments, i: usize) -> (f64, [f64; 5]) {
    if m.components() == 1 {
        return (0.5 * libm::log(m.spread[0][i].max(1e-200)), [0.0; 5]);
    }
    let mut eigen = Sym3(std::array::from_fn(|k| m.spread[k][i])).eigen();
    // A flat spread has no logarithm across: there it counts as a thousandth of its longest width.
    let least = 1e-6 * eigen.values[0].max(1e-200);
    eigen.values = eigen.values.map(|v| 0.5 * libm::log(v.max(least)));
    let size = eigen.values.iter().sum::<f64>() / 3.0;
    eigen.values = eigen.values.map(|v| v - size);
    (size, to_five(&Sym3::from_eigen(&eigen)).map(|v| v.clamp(-LARGEST_SHAPE, LARGEST_SHAPE)))
}

/// The header's statistics of a block's moments: how they change with distance, and their squares.
fn statistics(m: &FieldMoments, g: &Mixture) -> FieldHeader {
    let components = m.components();
    let indices: Vec<usize> = (0..g.len()).filter(|&i| g.count[i] >= 1.0).collect();
    let logs: Vec<(f64, [f64; 5])> = indices.iter().map(|&i| spread_logs(m, i)).collect();
    let (mut mean, mut log, mut pairs) = (0.0, 0.0, 0.0f64);
    // Gaussians that follow each other in the order of the tree lie near each other.
    for (at, pair) in indices.windows(2).enumerate() {
        let [i, j] = [pair[0], pair[1]];
        let [x, y, z] = each_axis(|k| g.mean[k][i] - g.mean[k][j]);
        let d = (x * x + y * y + z * z).sqrt();
        let errors = 1.0 / g.count[i] + 1.0 / g.count[j];
        if d > 0.0 && g.count[i] > 4.0 && g.count[j] > 4.0 {
            let mean_difference = |k: usize| m.mean[k][i] - m.mean[k][j];
            let square =
                (0..components).map(|k| mean_difference(k) * mean_difference(k)).sum::<f64>() / components as f64;
            // Noise of both is taken away, because e and E of section 14 add it to what is expected.
            let noise = libm::exp(2.0 * logs[at].0) / g.count[i] + libm::exp(2.0 * logs[at + 1].0) / g.count[j];
            mean += (square - noise) / d;
            let log_difference = logs[at].0 - logs[at + 1].0;
            log += (log_difference * log_difference - errors / (2.0 * components as f64)) / d;
            pairs += 1.0;
        }
    }
    let (mut shape, mut slope, mut excess, mut numbers) = (0.0, 0.0, 0.0, 0.0f64);
    for (&i, (log, five)) in indices.iter().zip(&logs) {
        let spread = libm::exp(*log);
        let factor = CholeskyFactor::new(&g.cov_of(i));
        // Shapes and slopes of fewer particles are mostly noise, which a number's class adds itself (E of section 14).
        if g.count[i] >= 16.0 {
            shape += five.iter().map(|v| v * v).sum::<f64>() / 5.0;
            for k in 0..components {
                let over = factor.over(each_axis(|d| m.slope[k][d][i])).map(|v| v / spread);
                slope += over.iter().map(|v| v * v).sum::<f64>() / (3 * components) as f64;
            }
            excess += m.excess.as_ref().map_or(0.0, |e| e[i] * e[i]);
            numbers += 1.0;
        }
    }
    let total = logs.len().max(1) as f64;
    // Without its noise a mean square may come out negative, but a header's must be above 0 and below 1e30.
    let least = |v: f64, n: f64| (v / n.max(1.0)).clamp(1e-12, 1e25) as f32;
    // Beyond f32 the start becomes infinite, which stands for the least or largest value (section 14).
    let start = indices.iter().map(|&i| m.mean[0][i]).sum::<f64>() / total;
    FieldHeader {
        field: 0,
        steps: [0.0; 4],
        change: [least(mean, pairs), least(log, pairs)],
        square: [least(shape, numbers), least(slope, numbers)],
        start: [start as f32, (logs.iter().map(|l| l.0).sum::<f64>() / total) as f32],
        sums: Vec::new(),
        range: Vec::new(),
        excess: m.excess.is_some().then(|| ExcessHeader { step: 1.0, square: least(excess, numbers), shift: 0.0 }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;

    /// Gaussians along a line, with a flow that follows it.
    fn scene(n: u64, components: usize) -> (Mixture, FieldMoments) {
        let (mut m, mut f) = (Mixture::new(false), FieldMoments::new(components));
        f.range.fill([-1e3, 1e3]);
        for i in 0..n {
            let mut r = Random::new(7, 0, i);
            let mut v = || [r.normal(), r.normal(), r.normal()];
            let (a, b, c) = (v(), v(), v());
            let cov = Sym3::outer(a).add(&Sym3::outer(b)).add(&Sym3::scaled_identity(0.2)).scale(0.01);
            let place = i as f64 / n as f64;
            m.push([20.0 * place, c[0].abs() * 0.1, c[1] * 0.1], cov, (1.0 + c[2].abs() * 80.0).floor(), 0.0);
            for k in 0..components {
                f.mean[k].push(300.0 * (place * 9.0 + k as f64).sin() + 3.0 * a[k]);
                (0..3).for_each(|d| f.slope[k][d].push(5.0 * b[d]));
            }
            let spread = Sym3::outer(v()).add(&Sym3::scaled_identity(1.0)).scale(400.0);
            for (k, column) in f.spread.iter_mut().enumerate() {
                column.push(spread.0[k]);
            }
        }
        (m, f)
    }

    fn quantity(logarithmic: bool) -> Quantity {
        Quantity { logarithmic, ..Quantity::new("q", QuantityKind::Scalar) }
    }

    #[test]
    fn means_beyond_float32_and_narrow_ones_far_from_zero_come_back() {
        let (m, plain) = scene(300, 1);
        for (unit, middle) in [(1e42, 2e45), (1e42, -2e45), (1e-3, -1e8), (1e43, 0.0), (1e-38, 0.0)] {
            let mut f = plain.clone();
            f.mean[0].iter_mut().for_each(|v| *v = middle + unit * *v);
            f.spread[0].iter_mut().for_each(|v| *v *= unit * unit);
            f.slope[0].iter_mut().flatten().for_each(|v| *v *= unit);
            f.range = vec![[middle - 400.0 * unit, middle + 400.0 * unit]];
            let sums = sums(&m, &f);
            let bytes = encode_field((0, &quantity(false)), &f, &m, &sums, &FieldPrecision::default(), None);
            let decoded = decode_field(&bytes, &m, &quantity(false), None).unwrap();
            for i in (0..m.len()).filter(|&i| m.count[i] >= 1.0) {
                let error = (f.spread[0][i] / m.count[i]).sqrt();
                let difference = (decoded.mean[0][i] - f.mean[0][i]).abs();
                assert!(difference < 4.0 * error + 1e-12 * middle.abs(), "{unit} {middle}: {difference} {error}");
            }
        }
    }

    fn sums(m: &Mixture, f: &FieldMoments) -> Vec<f64> {
        f.mean.iter().map(|mean| mean.iter().zip(&m.count).map(|(v, n)| v * n).sum()).collect()
    }

    #[test]
    fn moments_come_back_within_their_errors_and_sums_exactly() {
        for components in [1, 3] {
            let (m, f) = scene(500, components);
            let precision = FieldPrecision::default();
            let bytes = encode_field((0, &quantity(false)), &f, &m, &sums(&m, &f), &precision, None);
            let decoded = decode_field(&bytes, &m, &quantity(false), None).unwrap();
            for (sum, original) in sums(&m, &decoded).iter().zip(sums(&m, &f)) {
                assert!((sum - original).abs() < 1e-9 * original.abs().max(1.0), "{sum} {original}");
            }
            for i in 0..m.len() {
                let (log, _) = spread_logs(&f, i);
                let (log_back, _) = spread_logs(&decoded, i);
                let error = 1.0 / m.count[i].sqrt();
                assert!((log - log_back).abs() < 0.51 * 4.0 * error + 1e-9, "{log} {log_back}");
                for k in 0..components {
                    let step = f64::from(precision.steps[0]) * libm::exp(log_back) * error;
                    assert!((f.mean[k][i] - decoded.mean[k][i]).abs() < 0.6 * step + 1e-9);
                }
            }
        }
    }

    /// Gaussians of a field that spans decades.
    fn logarithms() -> (Mixture, FieldMoments) {
        let (m, linear) = scene(300, 1);
        let mut f = FieldMoments { range: vec![[0.0, 40.0]], excess: Some(Vec::new()), ..linear };
        for i in 0..m.len() {
            f.mean[0][i] = 12.0 + 0.02 * f.mean[0][i];
            (0..3).for_each(|k| f.slope[0][k][i] *= 0.1);
            f.spread[0][i] /= 400.0;
            f.excess.as_mut().unwrap().push(0.1 * (i as f64).sin());
        }
        (m, f)
    }

    #[test]
    fn logarithmic_fields_come_back_with_the_sum_of_their_values() {
        let (m, f) = logarithms();
        let total =
            |f: &FieldMoments| -> f64 { (0..m.len()).map(|i| m.count[i] * f.overall_value(0, i, &m.cov_of(i))).sum() };
        let bytes = encode_field((0, &quantity(true)), &f, &m, &[total(&f)], &FieldPrecision::default(), None);
        let decoded = decode_field(&bytes, &m, &quantity(true), None).unwrap();
        assert!((total(&decoded) / total(&f) - 1.0).abs() < 1e-12);
        // All get one shift, which keeps the sum; without it values' means are off by no more than the rounding of means
        // and that of the excess.
        let value = |f: &FieldMoments, i: usize| f.overall_value(0, i, &m.cov_of(i)).ln();
        let off = |i: usize| value(&decoded, i) - value(&f, i);
        let error = |i: usize| {
            let s = decoded.spread[0][i];
            let excess = ((s * s * s / 6.0 * (s / 3.0).exp()).min(0.25) / m.count[i]).sqrt();
            2.0 * (s.min(0.25) / m.count[i]).sqrt() + 2.0 * excess
        };
        for i in 1..m.len() {
            let difference = off(i) - off(i - 1);
            assert!(
                difference.abs() < 1.02 * (error(i) + error(i - 1)) + 0.01,
                "{difference} {} {}",
                error(i),
                error(i - 1)
            );
        }
        assert!(decode_field(&bytes, &m, &quantity(false), None).is_err());
    }

    /// Gaussians with the shares of a species.
    fn shares() -> (Mixture, FieldMoments) {
        let (m, linear) = scene(400, 1);
        let mut f = FieldMoments { range: vec![[0.0, 1.0]], ..linear };
        for i in 0..m.len() {
            let share = (0.5 + f.mean[0][i] / 600.0).clamp(0.0, 1.0);
            f.mean[0][i] = (share * m.count[i]).round() / m.count[i];
            (0..3).for_each(|k| f.slope[0][k][i] *= 0.1 * share);
        }
        (m, f)
    }

    #[test]
    fn shares_come_back_within_their_errors_and_with_their_sum() {
        let (m, f) = shares();
        let class = Quantity::new("kind=a", QuantityKind::Category);
        let wanted = sums(&m, &f);
        let bytes = encode_field((0, &class), &f, &m, &wanted, &FieldPrecision::default(), None);
        assert!(bytes.len() < 66 + 2 * m.len(), "{} bytes", bytes.len());
        let decoded = decode_field(&bytes, &m, &class, None).unwrap();
        assert!((sums(&m, &decoded)[0] - wanted[0]).abs() < 1e-9 * wanted[0]);
        for i in 0..m.len() {
            let (was, is) = (f.mean[0][i], decoded.mean[0][i]);
            assert!((0.0..=1.0).contains(&is) && decoded.spread[0][i] == is * (1.0 - is));
            let error = share_deviation(was, m.count[i]).max(share_deviation(is, m.count[i])) / m.count[i].sqrt();
            assert!((was - is).abs() < 2.5 * error + 0.02, "{was} {is} of {}", m.count[i]);
        }
        let none = FieldMoments { mean: vec![vec![0.0; m.len()]], ..f.clone() };
        let bytes = encode_field((0, &class), &none, &m, &[0.0], &FieldPrecision::default(), None);
        assert!(decode_field(&bytes, &m, &class, None).unwrap().mean[0].iter().all(|v| *v == 0.0));
    }

    /// Sums of the values, also of logarithmic fields.
    fn totals(m: &Mixture, f: &FieldMoments) -> Vec<f64> {
        let value = |k: usize, i: usize| m.count[i] * f.overall_value(k, i, &m.cov_of(i));
        (0..f.components()).map(|k| (0..m.len()).map(|i| value(k, i)).sum()).collect()
    }

    /// Moments that Gaussians of [`scene`] had a frame ago, their counts and origins: all but every tenth stayed.
    fn scene_before(n: u64, components: usize, class: &Quantity) -> (FieldMoments, Vec<f64>, Vec<Option<u32>>) {
        let (m, f) = match (&class.kind, class.logarithmic) {
            (QuantityKind::Category, _) => shares(),
            (_, true) => logarithms(),
            _ => scene(n, components),
        };
        let total = totals(&m, &f);
        let bytes = encode_field((0, class), &f, &m, &total, &FieldPrecision::default(), None);
        let origin = (0..m.len() as u32).map(|i| (i % 10 != 3).then_some(i)).collect();
        (decode_field(&bytes, &m, class, None).unwrap(), m.count, origin)
    }

    #[test]
    fn changes_come_back_within_their_errors_and_take_fewer_bytes() {
        let class = Quantity::new("kind=a", QuantityKind::Category);
        for (quantity, components) in [(quantity(false), 1), (quantity(false), 3), (quantity(true), 1), (class, 1)] {
            let (was, counts, origin) = scene_before(500, components, &quantity);
            let (m, mut f) = match (&quantity.kind, quantity.logarithmic) {
                (QuantityKind::Category, _) => shares(),
                (_, true) => logarithms(),
                _ => scene(500, components),
            };
            let unrest = vec![0; m.len()];
            let before = PreviousField { moments: &was, counts: &counts, origin: &origin, unrest: &unrest };
            let moving = quantity.kind != QuantityKind::Category;
            for i in (0..m.len()).filter(|_| moving) {
                let error = (trace(&f, i) / components as f64 / m.count[i]).sqrt();
                (0..components).for_each(|k| f.mean[k][i] += 0.5 * error);
            }
            let total = totals(&m, &f);
            let precision = FieldPrecision::default();
            let whole = encode_field((0, &quantity), &f, &m, &total, &precision, None);
            let bytes = encode_field((0, &quantity), &f, &m, &total, &precision, Some(&before));
            let most = if moving && !quantity.logarithmic { whole.len() / 2 + 50 } else { whole.len() };
            assert!(bytes.len() <= most, "{} of {}", bytes.len(), whole.len());
            let decoded = decode_field(&bytes, &m, &quantity, Some(&before)).unwrap();
            for i in 0..m.len() {
                let deviation = match quantity.kind {
                    QuantityKind::Category => share_deviation(f.mean[0][i], m.count[i]).max(0.2),
                    _ => (trace(&f, i) / components as f64).sqrt(),
                };
                let error = deviation / m.count[i].sqrt();
                for k in 0..components {
                    let difference = (f.mean[k][i] - decoded.mean[k][i]).abs();
                    assert!(difference < 5.5 * error + 0.05, "{difference} of {error}, {i}");
                }
                let ratio = trace(&decoded, i) / trace(&f, i).max(1e-9);
                assert!(
                    quantity.kind == QuantityKind::Category || (ratio.ln() * m.count[i].sqrt()).abs() < 9.0,
                    "{ratio}"
                );
            }
            for at in (0..bytes.len()).step_by(11) {
                let mut damaged = bytes.clone();
                damaged[at] ^= 0x14;
                if let Ok(decoded) = decode_field(&damaged, &m, &quantity, Some(&before)) {
                    assert!(decoded.columns().flatten().all(|v| v.is_finite()), "byte {at}");
                }
            }
        }
    }

    #[test]
    fn gaussians_whose_values_were_all_the_same_follow_when_they_differ() {
        for components in [1, 3] {
            let (m, f) = scene(500, components);
            let is_still = |i: usize| i % 5 == 2 && m.count[i] >= 4.0;
            let mut still = f.clone();
            for i in (0..m.len()).filter(|i| is_still(*i)) {
                still.mean.iter_mut().for_each(|c| c[i] = 7.0);
                still.spread.iter_mut().for_each(|c| c[i] = 0.0);
                still.slope.iter_mut().flatten().for_each(|c| c[i] = 0.0);
            }
            let origin: Vec<Option<u32>> = (0..m.len() as u32).map(Some).collect();
            let (unrest, quantity, precision) = (vec![0; m.len()], quantity(false), FieldPrecision::default());
            let code = |f: &FieldMoments, was: Option<&FieldMoments>| {
                let previous =
                    was.map(|moments| PreviousField { moments, counts: &m.count, origin: &origin, unrest: &unrest });
                let bytes = encode_field((0, &quantity), f, &m, &sums(&m, f), &precision, previous.as_ref());
                decode_field(&bytes, &m, &quantity, previous.as_ref()).unwrap()
            };
            let mut was = code(&still, None);
            for _ in 0..3 {
                was = code(&still, Some(&was));
            }
            let (changed, whole) = (code(&f, Some(&was)), code(&f, None));
            let error = |back: &FieldMoments| {
                let off = |i: usize, k: usize| (back.mean[k][i] - f.mean[k][i]) * (back.mean[k][i] - f.mean[k][i]);
                let all: f64 = (0..m.len()).map(|i| (0..components).map(|k| off(i, k)).sum::<f64>()).sum();
                (all / m.len() as f64).sqrt()
            };
            assert!(error(&changed) < 1.3 * error(&whole), "{} {}", error(&changed), error(&whole));
        }
    }

    #[test]
    fn damaged_sections_are_refused_or_finite() {
        let class = Quantity::new("kind=a", QuantityKind::Category);
        let scenes = [(quantity(false), scene(60, 3)), (quantity(true), logarithms()), (class, shares())];
        for (quantity, (m, f)) in scenes {
            let bytes = encode_field((0, &quantity), &f, &m, &sums(&m, &f), &FieldPrecision::default(), None);
            for cut in 0..bytes.len() {
                assert!(decode_field(&bytes[..cut], &m, &quantity, None).is_err(), "cut at {cut}");
            }
            for at in 0..bytes.len() {
                let mut damaged = bytes.clone();
                damaged[at] ^= 0x14;
                if let Ok(back) = decode_field(&damaged, &m, &quantity, None) {
                    assert!(back.columns().flatten().all(|v| v.is_finite()), "byte {at}");
                }
            }
        }
    }
}
