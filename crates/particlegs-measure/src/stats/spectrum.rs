//! Power spectra: P(k) of each field, their cross power and its correlation coefficient r(k).
//!
//! A field is deposited twice, the second time half a cell moved, and the two transforms averaged
//! with the phase taken back: odd aliases cancel (interlacing; Sefusatti et al. 2016, eq. 21). The
//! assignment's window, a power of sinc on each axis, is divided out, and the shot noise
//! V sum w^2 / (sum w)^2 subtracted.

use super::comparison_job::ComparisonJob;
use super::density::mean_mass;
use super::deposit::{WIDENED, deposit_again, deposit_for_modes};
use super::presentation::*;
use super::transform::{Modes, XiByTransform, transform, transform_bytes, xi_of_modes};
use super::{Assignment, Convention, Domain, Field, Grid, Subject, deposit_bytes, deposit_steps};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::decimals;
use particlegs_core::{Result, parallel};
use particlegs_figure::Point;
use realfft::num_complex::Complex64;
use std::f64::consts::PI;

/// Options of power spectra.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct SpectrumOptions {
    /// Cells along the longest edge.
    pub cells: usize,
    /// Mass assignment of particles (a model's Gaussians are integrated over cells).
    pub assignment: Assignment,
    /// The spectra of a grid moved by half a cell are averaged in.
    pub interlaced: bool,
    /// The assignment's window is divided out.
    pub deconvolved: bool,
    /// The shot noise of particles is subtracted.
    pub shot_noise_subtracted: bool,
    /// Largest wave number; at most the grid's Nyquist frequency.
    pub k_max: f64,
}

/// One shell of wave numbers.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Shell {
    /// Lowest and highest wave number.
    pub edges: [f64; 2],
    /// Mean wave number of its modes.
    pub k: f64,
    /// Modes, of which half are independent.
    pub modes: u64,
    /// Power of each field, volume units, shot noise subtracted where the options say so.
    pub power: [f64; 2],
    /// Cross power, volume units.
    pub cross: f64,
    /// Power of the second over the first.
    pub ratio: Option<f64>,
    /// Standard error of the ratio from one box of this size to another; none of a momentum's, whose components are not
    /// independent.
    pub ratio_error: Option<f64>,
    /// Relative standard error of either power from box to box: sqrt(2 / modes) of a Gaussian field.
    pub sample_error: f64,
    /// Correlation coefficient of the fields as they are, noise included: at most 1.
    pub r: Option<f64>,
    /// The same with the shot noise subtracted from both powers.
    pub r_without_noise: Option<f64>,
}

/// Spectra of two fields.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Spectra {
    /// Options that they were taken with, which [`Statistics::options`](super::Statistics) come to.
    pub(super) options: SpectrumOptions,
    /// Cells along each axis.
    pub cells: [usize; 3],
    /// Shot noise of each, volume units; 0 for a mixture.
    pub shot_noise: [f64; 2],
    /// Shells of width 2 pi over the longest edge.
    pub shells: Vec<Shell>,
}

/// Interlaced, deconvolved modes of a subject's delta; in units of `mean`, a cell's mean, or of its own.
pub(super) fn modes_of(
    subject: Subject<'_>,
    mean: Option<f64>,
    grid: &Grid,
    most: [usize; 3],
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<Modes> {
    let scheme = scheme_of(subject.particles().is_some(), grid, o);
    let field = |moved: usize, spare: Option<Field>| match spare {
        Some(field) => deposit_again(subject, field, scheme, 0.5 * moved as f64, context),
        None => deposit_for_modes(subject, grid, scheme, 0.5 * moved as f64, context),
    };
    modes_of_fields(&field, (scheme, mean), most, o, context)
}

/// Cells along each axis from which on Gaussians are widened. Of fewer, sides differ by more than a thirtieth, and
/// widened Gaussians would fill the box.
pub(super) const WIDENED_FROM: usize = 16;

/// How mass is shared among cells for a spectrum. A mixture's Gaussians are widened (`None`), unless the window stays in
/// or the box is flat: then their integrals over cells are taken.
pub(crate) fn scheme_of(of_particles: bool, grid: &Grid, o: &SpectrumOptions) -> Option<Assignment> {
    let is_widened = o.deconvolved && grid.cells.iter().all(|n| *n >= WIDENED_FROM);
    match of_particles {
        true => Some(o.assignment),
        false => (!is_widened).then_some(Assignment::Ngp),
    }
}

/// The same of the fields that `field` gives: as it is (0) and moved by half a cell (1), which may take the first one's
/// memory.
pub(super) fn modes_of_fields(
    field: &dyn Fn(usize, Option<Field>) -> Result<Field>,
    (scheme, mean): (Option<Assignment>, Option<f64>),
    most: [usize; 3],
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<Modes> {
    let first = field(0, None)?;
    let grid = first.grid;
    let modes_of = |f: &Field| transform(f, mean.unwrap_or_else(|| mean_mass(f)), most, context);
    let mut modes = modes_of(&first)?;
    // The first field is transformed already: the moved one takes its memory.
    let is_interlaced = o.interlaced && (scheme.is_some() || o.k_max * grid.coarsest() > WITHOUT_IMAGES * PI);
    let second = if is_interlaced { Some(modes_of(&field(1, Some(first))?)?) } else { None };
    let (columns, depth) = modes.plane();
    let n = grid.cells.map(|n| n as f64);
    let window: [Vec<f64>; 3] = each_axis(|k| {
        let waves = (0..=most[k]).map(|m| PI * m as f64 / n[k]);
        match scheme {
            // The window of a scheme is a power of sinc on each axis; to the power 0 it leaves the modes as they are.
            Some(scheme) => {
                let power = if o.deconvolved { scheme.order() as i32 } else { 0 };
                waves.map(|x| sinc(x).powi(power)).collect()
            }
            None => {
                // A density at the centres of cells stands for their integrals, which are wider by 1/12.
                let deviation = WIDENED * grid.coarsest() / grid.side[k];
                waves.map(|x| libm::exp(-2.0 * x * x * (deviation * deviation + 1.0 / 12.0))).collect()
            }
        }
    });
    parallel::for_each_chunk(&mut modes.value, columns * depth, |i, plane| {
        let mx = i as i64 - most[0] as i64;
        for (at, value) in plane.iter_mut().enumerate() {
            let (my, mz) = ((at / depth) as i64 - most[1] as i64, at % depth);
            if let Some(second) = &second {
                // The phase of half a cell is taken back; odd aliases cancel (Sefusatti et al. 2016, equation 21).
                let phase = PI * (mx as f64 / n[0] + my as f64 / n[1] + mz as f64 / n[2]);
                let other = second.value[i * columns * depth + at] * Complex64::from_polar(1.0, phase);
                *value = 0.5 * (*value + other);
            }
            *value /= window[0][mx.unsigned_abs() as usize] * window[1][my.unsigned_abs() as usize] * window[2][mz];
        }
    });
    Ok(modes)
}

/// Share of the Nyquist frequency up to which a mixture's modes have no images to be cancelled ([`WIDENED`]).
const WITHOUT_IMAGES: f64 = 0.7;

fn sinc(x: f64) -> f64 {
    if x == 0.0 { 1.0 } else { libm::sin(x) / x }
}

/// The largest mode number of each axis up to `k_max`, below half the axis's cells: the mode at
/// exactly half is its own alias.
pub(super) fn mode_limits(grid: &Grid, domain: &Domain, k_max: f64) -> [usize; 3] {
    each_axis(|k| {
        // A mode whose wave number is k_max belongs to it, whatever the rounding.
        let limit = (k_max * domain.length[k] / (2.0 * PI) * (1.0 + 1e-12)).floor() as usize;
        limit.min((grid.cells[k] - 1) / 2)
    })
}

/// Place, wave vector, wave number and weight of every mode kept, plane by plane of x.
pub(super) fn visit_plane(
    modes: &Modes,
    domain: &Domain,
    i: usize,
    k_max: f64,
    context: &Context<'_>,
    mut visit: impl FnMut(usize, [f64; 3], f64, u64),
) -> Result<()> {
    let (columns, depth) = modes.plane();
    let base: [f64; 3] = domain.length.map(|l| 2.0 * PI / l);
    let kx = base[0] * (i as f64 - modes.most[0] as f64);
    for j in 0..columns {
        context.check()?;
        let ky = base[1] * (j as f64 - modes.most[1] as f64);
        for c in 0..depth {
            let kz = base[2] * c as f64;
            let [kx, ky, kz] = domain.tilt.as_ref().map_or([kx, ky, kz], |t| t.wave([kx, ky, kz]));
            let k = (kx * kx + ky * ky + kz * kz).sqrt();
            if k > 0.0 && k <= k_max {
                // The half with negative z is not stored.
                visit((i * columns + j) * depth + c, [kx, ky, kz], k, if c == 0 { 1 } else { 2 });
            }
        }
    }
    Ok(())
}

/// Transforms of both subjects, for spectra and xi(r).
pub(super) struct TransformPair {
    /// Modes of the first and the second.
    pub modes: [Modes; 2],
    /// Shot noise of each.
    pub shot_noise: [f64; 2],
    pub grid: Grid,
}

/// Transforms both, each in units of a cell's mean that is given, or of its own. `domain` gives the wave numbers of the
/// grid's modes.
pub(super) fn transform_pair(
    [a, b]: [Subject<'_>; 2],
    means: [Option<f64>; 2],
    grid: &Grid,
    domain: &Domain,
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<TransformPair> {
    let most = mode_limits(grid, domain, o.k_max);
    // Three sets of modes: those of both subjects, and those of a moved field until it is averaged in.
    particlegs_files::memory::require(
        "the power spectrum's grid",
        deposit_bytes(grid, [a, b].iter().filter_map(|s| s.particles()).map(|p| p.len() as u64).max().unwrap_or(0))
            + transform_bytes(grid.cells, most)
            + 3 * Modes::bytes(most),
    )?;
    let passes = if o.interlaced { 2 } else { 1 };
    let steps = [a, b].iter().map(|s| deposit_steps(*s, grid) + grid.len() as u64).sum::<u64>();
    context.begin("power spectra", passes * steps);
    let first = modes_of(a, means[0], grid, most, o, context)?;
    let second = modes_of(b, means[1], grid, most, o, context)?;
    context.end();
    Ok(TransformPair { modes: [first, second], shot_noise: [a.shot_noise(domain), b.shot_noise(domain)], grid: *grid })
}

/// Sums over the modes of each shell of width 2 pi / longest edge; shell s is centred at s + 1 widths.
#[derive(Clone, Debug, Default)]
pub(super) struct ShellSums {
    width: f64,
    count: Vec<u64>,
    /// Wave number, weight, and weighted powers of the first field, the second and both.
    terms: Vec<[f64; 5]>,
    /// Whether the powers are of one field each, not sums over components.
    is_scalar: bool,
}

impl ShellSums {
    /// Sums over the modes of a pair, whose powers count by the weights that their wave vectors and numbers have.
    pub fn new(
        pair: &TransformPair,
        domain: &Domain,
        k_max: f64,
        weight: impl Fn([f64; 3], f64) -> f64 + Sync,
        context: &Context<'_>,
    ) -> Result<Self> {
        let width = 2.0 * PI / domain.longest();
        let bins = ((k_max / width + 0.5).floor() as usize).max(1);
        let zero = ShellSums { width, count: vec![0; bins], terms: vec![[0.0; 5]; bins], is_scalar: true };
        let [a, b] = &pair.modes;
        let planes = parallel::try_map_range(2 * a.most[0] + 1, |i| {
            let mut sums = zero.clone();
            visit_plane(a, domain, i, k_max, context, |at, wave, k, times| {
                // Shells are centred at multiples of their width; longer waves belong to the first.
                let bin = (k / width - 0.5).max(0.0) as usize;
                if bin < bins {
                    let (x, y, n, w) = (a.value[at], b.value[at], times as f64, weight(wave, k));
                    // A mode whose conjugate is not stored stands for both.
                    sums.count[bin] += times;
                    let terms = [k, w, w * x.norm_sqr(), w * y.norm_sqr(), w * (x * y.conj()).re];
                    (0..5).for_each(|t| sums.terms[bin][t] += n * terms[t]);
                }
            })?;
            Ok(sums)
        })?;
        let mut total = zero;
        // Planes are added up in their order, so that sums do not depend on threads.
        planes.iter().for_each(|p| total.add(p));
        Ok(total)
    }

    fn add(&mut self, other: &ShellSums) {
        self.count.iter_mut().zip(&other.count).for_each(|(a, b)| *a += b);
        self.terms.iter_mut().zip(&other.terms).for_each(|(a, b)| (0..5).for_each(|t| a[t] += b[t]));
    }

    /// Adds weights and powers of other fields on the same modes.
    pub fn add_power(&mut self, other: &ShellSums) {
        self.terms.iter_mut().zip(&other.terms).for_each(|(a, b)| (1..5).for_each(|t| a[t] += b[t]));
        self.is_scalar = false;
    }

    /// Those shells that have modes: edges, number of modes, and means of the terms over them.
    pub fn means(&self) -> impl Iterator<Item = ([f64; 2], u64, [f64; 5])> {
        (0..self.count.len()).filter(|bin| self.count[*bin] > 0).map(|bin| {
            let low = if bin == 0 { 0.0 } else { (bin as f64 + 0.5) * self.width };
            let edges = [low, (bin as f64 + 1.5) * self.width];
            (edges, self.count[bin], self.terms[bin].map(|v| v / self.count[bin] as f64))
        })
    }
}

/// P(k), cross power and r(k) of a pair, in shells of width 2 pi / longest edge.
pub(super) fn spectra(
    pair: &TransformPair,
    domain: &Domain,
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<Spectra> {
    let sums = ShellSums::new(pair, domain, o.k_max, |_, _| 1.0, context)?;
    Ok(spectra_of_sums(&sums, pair.shot_noise, &pair.grid, domain, o))
}

/// Relative error of the ratio of two powers in that of one, of Gaussian fields that share modes: their noise is in the
/// `raw` powers and not in `power`. Without noise it is sqrt(2 (1 - r^2)).
fn paired_error(raw: [f64; 2], power: [f64; 2], cross: f64) -> f64 {
    let [a, b] = [0, 1].map(|s| raw[s] / power[s]);
    (a * a + b * b - 2.0 * cross * cross / (power[0] * power[1])).max(0.0).sqrt()
}

/// The same of sums over modes.
pub(super) fn spectra_of_sums(
    sums: &ShellSums,
    shot_noise: [f64; 2],
    grid: &Grid,
    domain: &Domain,
    o: &SpectrumOptions,
) -> Spectra {
    let noise = if o.shot_noise_subtracted { shot_noise } else { [0.0; 2] };
    let shells = sums
        .means()
        .map(|(edges, modes, [k, _, xx, yy, xy])| {
            let (raw, cross) = ([xx, yy].map(|v| v * domain.volume()), xy * domain.volume());
            // Coherence without noise is given whatever the options: these decide on the power alone.
            let clean: [f64; 2] = std::array::from_fn(|s| raw[s] - shot_noise[s]);
            let power: [f64; 2] = std::array::from_fn(|s| raw[s] - noise[s]);
            let ratio = (power[0] > 0.0).then(|| power[1] / power[0]);
            let sample_error = (2.0 / modes as f64).sqrt();
            let ratio_error = ratio.filter(|_| sums.is_scalar).and_then(|ratio| {
                let of_ratio = (power[1] > 0.0).then(|| paired_error(raw, power, cross))?;
                Some(ratio * sample_error * of_ratio)
            });
            let over = |p: [f64; 2]| (p[0] > 0.0 && p[1] > 0.0).then(|| cross / (p[0].sqrt() * p[1].sqrt()));
            Shell {
                edges,
                k,
                modes,
                power,
                cross,
                ratio,
                ratio_error,
                sample_error,
                r: over(raw),
                r_without_noise: over(clean),
            }
        })
        .collect();
    Spectra { options: *o, cells: grid.cells, shot_noise, shells }
}

/// Spectra of two subjects over a domain. Axes that do not repeat are taken as if they did.
pub fn power_spectra(
    subjects: [Subject<'_>; 2],
    domain: &Domain,
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<Spectra> {
    let grid = Grid::new(domain, o.cells);
    spectra(&transform_pair(subjects, [None; 2], &grid, domain, o, context)?, domain, o, context)
}

/// One subject's transform, kept to be compared with one other after the other.
pub(crate) struct CachedTransform {
    domain: Domain,
    grid: Grid,
    options: SpectrumOptions,
    modes: Modes,
    shot_noise: f64,
}

impl CachedTransform {
    /// Transforms a subject over a domain.
    pub fn new(subject: Subject<'_>, domain: &Domain, o: &SpectrumOptions, context: &Context<'_>) -> Result<Self> {
        let grid = Grid::new(domain, o.cells);
        let most = mode_limits(&grid, domain, o.k_max);
        let particles = subject.particles().map_or(0, |p| p.len() as u64);
        let bytes = deposit_bytes(&grid, particles) + transform_bytes(grid.cells, most) + 3 * Modes::bytes(most);
        particlegs_files::memory::require("the power spectrum's grid", bytes)?;
        let passes = if o.interlaced { 2 } else { 1 };
        context.begin("power spectrum", passes * (deposit_steps(subject, &grid) + grid.len() as u64));
        let modes = modes_of(subject, None, &grid, most, o, context)?;
        context.end();
        Ok(CachedTransform { domain: *domain, grid, options: *o, modes, shot_noise: subject.shot_noise(domain) })
    }

    /// The spectra of this and another, taken in the same way.
    pub fn against(&self, other: Subject<'_>, context: &Context<'_>) -> Result<Spectra> {
        let other = Self::new(other, &self.domain, &self.options, context)?;
        self.pair([other.modes, self.modes.clone()], other.shot_noise, context)
    }

    /// The spectra of this and itself.
    pub fn against_itself(&self, context: &Context<'_>) -> Result<Spectra> {
        self.pair([self.modes.clone(), self.modes.clone()], self.shot_noise, context)
    }

    fn pair(&self, [other_modes, own_modes]: [Modes; 2], shot_noise: f64, context: &Context<'_>) -> Result<Spectra> {
        let pair = TransformPair {
            modes: [own_modes, other_modes],
            shot_noise: [self.shot_noise, shot_noise],
            grid: self.grid,
        };
        spectra(&pair, &self.domain, &self.options, context)
    }
}

/// Spectra of a mixture and particles whose fields were added up: `field` gives that of the particles (0) or the
/// mixture (1), as it is (0) or moved by half a cell (1); `noise` is the particles' shot noise.
pub(crate) fn spectra_of(
    field: &dyn Fn(usize, usize) -> Result<Field>,
    noise: f64,
    domain: &Domain,
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<Spectra> {
    let grid = Grid::new(domain, o.cells);
    let most = mode_limits(&grid, domain, o.k_max);
    let modes = |side: usize| {
        modes_of_fields(&|moved, _| field(side, moved), (scheme_of(side == 0, &grid, o), None), most, o, context)
    };
    spectra(&TransformPair { modes: [modes(0)?, modes(1)?], shot_noise: [noise, 0.0], grid }, domain, o, context)
}

impl ComparisonJob<'_> {
    pub fn spectrum_options(&self) -> SpectrumOptions {
        let cells = self.o.spectrum_cells;
        let grid_limit = PI * cells as f64 / self.domain.longest();
        let k_max = self.o.k_max.unwrap_or(PI / self.spacing(0));
        SpectrumOptions {
            cells,
            assignment: if self.paper() { Assignment::Ngp } else { self.o.spectrum_assignment },
            interlaced: self.o.interlaced && !self.paper(),
            deconvolved: !self.paper(),
            shot_noise_subtracted: !self.paper(),
            k_max: if self.paper() { grid_limit } else { k_max.min(grid_limit) },
        }
    }

    /// Spectra, and xi(r) from the same modes.
    pub fn spectrum(&self) -> Result<(Option<Spectra>, Option<XiByTransform>)> {
        let domain = if self.paper() {
            // One length for all three axes: the grid's cells are taken for cubes.
            Domain { length: [self.domain.longest(); 3], ..self.domain }
        } else {
            self.domain
        };
        let (cells, options) = (self.o.spectrum_cells, self.spectrum_options());
        let grid =
            if self.paper() { Grid::stretched(&self.domain, [cells; 3]) } else { Grid::new(&self.domain, cells) };
        let pair = transform_pair(self.pair, [None; 2], &grid, &domain, &options, self.context)?;
        let spectra = spectra(&pair, &domain, &options, self.context)?;
        // Bins as wide as the shortest wave's half: narrower ones hold its ringing.
        let (width, last) = (PI / options.k_max, self.edges().last().copied().unwrap_or(0.0));
        let edges: Vec<f64> = (1..=1000).map(|i| width * f64::from(i)).take_while(|r| *r <= last).collect();
        let xi = if edges.len() > 1 && !self.paper() {
            let xi = xi_of_modes(&pair, &domain, &options, &edges, self.context)?;
            Some(XiByTransform { xi, edges })
        } else {
            None
        };
        Ok((Some(spectra), xi))
    }
}

/// |P_other / P_truth - 1| of a shell.
fn deviation(shell: &Shell) -> f64 {
    shell.ratio.map_or(f64::INFINITY, |r| (r - 1.0).abs())
}

impl Spectra {
    /// Shells in which the truth has power to be compared: more than its shot noise scatters. (A tiled
    /// box has none between the harmonics of its tiles.)
    fn judged(&self) -> impl Iterator<Item = &Shell> {
        let scatter = |s: &Shell| self.shot_noise[0] / (0.5 * s.modes as f64).sqrt();
        self.shells.iter().filter(move |s| s.power[0] > scatter(s))
    }

    /// The largest |P_other / P_truth - 1| of the judged shells.
    pub(crate) fn largest_power_deviation(&self) -> Option<f64> {
        self.judged().map(deviation).reduce(f64::max).filter(|d| d.is_finite())
    }

    /// The last shell's k up to which every shell's P(k) is within `limit` of the truth's (0.01 = 1 %),
    /// shells apart in which the truth has no power above the scatter of its shot noise; `None` = not
    /// even the first's.
    pub fn power_within(&self, limit: f64) -> Option<f64> {
        last_while(self.judged().map(|s| (s.k, deviation(s) <= limit)))
    }

    /// The same for r(k), noise included, of at least `limit`.
    pub fn r_above(&self, limit: f64) -> Option<f64> {
        last_while(self.judged().map(|s| (s.k, s.r.is_some_and(|r| r >= limit))))
    }
}

/// The last place up to which all is well.
pub(super) fn last_while(places: impl Iterator<Item = (f64, bool)>) -> Option<f64> {
    places.take_while(|(_, good)| *good).last().map(|(k, _)| k)
}

/// Shows them.
pub(super) fn show(p: &Spectra, convention: Convention, to: &mut Presentation) {
    to.spectra_table("power.csv", p);
    let power_of = |side: usize| p.shells.iter().map(|h| (h.k, h.power[side])).collect::<Vec<_>>();
    let points_of = |pick: fn(&Shell) -> Option<f64>| p.shells.iter().filter_map(|h| Some((h.k, pick(h)?))).collect();
    let k = log(format!("k{}", to.units.wave));
    let power = [k.clone(), log(format!("P(k){}", to.units.volume))];
    let title = format!("Power spectrum ({})", convention.shot_noise());
    let curves = vec![
        curve("with shot noise", OTHER, false, points_of(|h| h.r)),
        curve("without shot noise", THIRD, false, points_of(|h| h.r_without_noise.filter(|r| *r < 1.5))),
    ];
    let mut coherence = chart("coherence", "Cross-correlation coefficient", [k, even("r(k)")], curves, Vec::new());
    coherence[0].levels = [1.0, 0.99, 0.9].map(|level| (String::new(), level)).into();
    let mut power = chart("power", &title, power, pair([power_of(0), power_of(1)]), points_of(|h| h.ratio));
    if let [_, ratios] = &mut power[..] {
        add_errors(&mut ratios.series[0].points, &p.shells);
    }
    to.plot(power);
    to.plot(coherence);
    let ([x, y, z], wave) = (p.cells, to.wave.clone());
    let last = p.shells.last().map_or(0.0, |h| h.k);
    to.line("P(k): grid; up to k", format!("{x}x{y}x{z}; {}{wave}", decimals(last)));
    let deviation = p.largest_power_deviation().map_or("-".into(), |d| format!("{:.2} %", 100.0 * d));
    let at_end = p.shells.last().and_then(|h| h.r).map_or("-".into(), |r| format!("{r:.4}"));
    to.line("P(k): largest deviation; r at end", format!("{deviation}; {at_end}"));
    to.line("P(k): within 1, 5, 10 % up to k", format!("{}{wave}", limits(|limit| p.power_within(limit))));
    let [high, low] = [0.99, 0.9].map(|r| limit_text(p.r_above(r)));
    to.line("r(k): at least 0.99, 0.9 up to k", format!("{high}, {low}{wave}"));
}

/// Gives the ratios of shells their errors; a ratio that stands at the plot's edge has none.
fn add_errors(points: &mut [Point], shells: &[Shell]) {
    for point in points {
        let shell = shells.iter().find(|h| h.k == point.x && h.ratio == Some(point.y));
        point.range = shell.and_then(|h| h.ratio_error).map(|e| [point.y - e, point.y + e]);
    }
}

impl Presentation {
    pub fn spectra_table(&mut self, name: &'static str, spectra: &Spectra) {
        let row = |h: &Shell| {
            let ([low, high], [a, b], [ratio, error, r, without_noise]) =
                (h.edges, h.power, [h.ratio, h.ratio_error, h.r, h.r_without_noise].map(maybe));
            row![low, high, h.k, h.modes, a, b, h.cross, ratio, error, h.sample_error, r, without_noise]
        };
        let head =
            "k_low,k_high,k,modes,power_truth,power_other,cross,ratio,ratio_error,sample_error,r,r_without_noise";
        self.table(name, head, spectra.shells.iter().map(row));
    }
}

/// Up to where something is within 1, 5 and 10 %.
pub(super) fn limits(within: impl Fn(f64) -> Option<f64>) -> String {
    [0.01, 0.05, 0.1].map(|limit| limit_text(within(limit))).join(", ")
}

fn limit_text(limit: Option<f64>) -> String {
    limit.map_or("nowhere".into(), decimals)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    #[test]
    fn ratios_of_powers_scatter_by_their_stated_error() {
        const TRIALS: usize = 1000;
        const MODES: usize = 500;
        // A common field of power 1, the second also with a part of its own, and noise that is subtracted from the first.
        for [part, noise] in [[0.1f64, 0.0], [0.3, 0.2], [0.0, 1.0]] {
            let (mut ratios, mut stated) = (Vec::new(), 0.0);
            for trial in 0..TRIALS {
                let mut r = Random::new(5, 0, trial as u64);
                let mut sums = [0.0; 3];
                // Real and imaginary parts of the independent half.
                for _ in 0..MODES {
                    let shared = r.normal();
                    let (a, b) = (shared + noise.sqrt() * r.normal(), shared + part.sqrt() * r.normal());
                    [a * a, b * b, a * b].into_iter().zip(&mut sums).for_each(|(v, sum)| *sum += v / MODES as f64);
                }
                let [aa, bb, ab] = sums;
                let power = [aa - noise, bb];
                ratios.push(power[1] / power[0]);
                stated += power[1] / power[0] * (2.0 / MODES as f64).sqrt() * paired_error([aa, bb], power, ab);
            }
            let mean = ratios.iter().sum::<f64>() / TRIALS as f64;
            let scatter = (ratios.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / TRIALS as f64).sqrt();
            let error = stated / TRIALS as f64;
            assert!((error / scatter - 1.0).abs() < 0.12, "{part} {noise}: {error} for {scatter}");
        }
    }

    #[test]
    fn shells_without_power_are_not_judged() {
        let shell = |k: f64, truth: f64, other: f64| Shell {
            edges: [k - 0.5, k + 0.5],
            k,
            modes: 200,
            power: [truth, other],
            cross: 0.0,
            ratio: Some(other / truth),
            ratio_error: None,
            sample_error: 0.1,
            r: Some(if truth > 1.0 { 0.999 } else { 0.2 }),
            r_without_noise: None,
        };
        let options = SpectrumOptions {
            cells: 8,
            assignment: Assignment::Tsc,
            interlaced: true,
            deconvolved: true,
            shot_noise_subtracted: true,
            k_max: 4.0,
        };
        // The second holds the scatter of a noise of 1 in 100 independent modes, the third less than none.
        let shells = vec![shell(1.0, 50.0, 50.2), shell(2.0, 0.09, 0.3), shell(3.0, -0.2, 0.3), shell(4.0, 9.0, 9.3)];
        let spectra = Spectra { options, cells: [8; 3], shot_noise: [1.0, 1.0], shells };
        assert_eq!((spectra.power_within(0.01), spectra.power_within(0.05)), (Some(1.0), Some(4.0)));
        assert_eq!(spectra.r_above(0.99), Some(4.0));
    }
}
