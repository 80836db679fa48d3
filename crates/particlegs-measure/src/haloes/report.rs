//! Haloes of one input, alone or against those of a truth, and their mass function.

use super::catalogue::HaloCatalogue;
use super::matching::HaloMatch;
use super::{HaloOptions, find_haloes};
use crate::stats::presentation::{OTHER, TRUTH, chart, curve};
use crate::stats::{StatsSide, Subject};
use particlegs_core::context::Context;
use particlegs_core::text::one_line;
use particlegs_core::{Error, Result};
use particlegs_figure::{FileKind, Plot, PlotAxis, PlotSeries, Point, plot_bytes};
use particlegs_files::output::{write_atomic, write_bytes};
use particlegs_particles::Domain;
use serde::Serialize;
use std::path::Path;

/// Bins a decade of mass.
const PER_DECADE: f64 = 5.0;
/// Parts of the box along each axis, left out one after the other for errors.
const PARTS: usize = 2;

/// Haloes of an input, and their agreement with those of a truth.
#[derive(Clone, Debug, Serialize)]
pub struct HaloReport {
    /// Name of the input.
    pub input: String,
    /// Number of haloes.
    pub haloes: usize,
    /// Haloes with masses: 100 particles and more.
    pub with_masses: usize,
    /// Largest mass, in `mass_unit`.
    pub largest_mass: Option<f64>,
    /// Unit of masses; `particles` where these have none.
    pub mass_unit: String,
    /// Agreement with the truth's haloes, where a truth is given and both have masses.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub agreement: Option<HaloMatch>,
    /// Mass function, from the least mass of both catalogues to the largest.
    pub mass_function: Vec<MassFunctionBin>,
    /// That of the truth, in the same bins.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub mass_function_of_truth: Vec<MassFunctionBin>,
    /// Notes for a user, a sentence each.
    pub notes: Vec<String>,
    /// The haloes.
    #[serde(skip)]
    pub catalogue: HaloCatalogue,
    /// Those of the truth.
    #[serde(skip)]
    pub truth: Option<HaloCatalogue>,
    #[serde(skip)]
    length_unit: Option<String>,
}

impl HaloReport {
    /// Finds haloes in the input called `name`, and in the truth, if one is given with its name, whose catalogue they
    /// are compared with. Notes also go to the context.
    ///
    /// # Errors
    /// Those of [`find_haloes`]; [`Error::Input`] for a truth in another box or unit; [`Error::Argument`] where there
    /// are no haloes.
    pub fn new<'a>(
        (input, name): (impl Into<StatsSide<'a>>, &str),
        truth: Option<(StatsSide<'_>, &str)>,
        options: &HaloOptions,
        context: &Context<'_>,
    ) -> Result<HaloReport> {
        let input = input.into();
        let catalogue = find_haloes(input, options, context)?;
        catalogue.notes.iter().for_each(|note| context.note(note));
        let truth = truth.map(|(truth, name)| {
            check_same_box(input.subject, truth.subject, name)?;
            find_haloes(truth, options, context)
        });
        let (truth, domain) = (truth.transpose()?, input.subject.domain());
        let ends = ends([Some(&catalogue), truth.as_ref()]);
        let bins = |c: &HaloCatalogue| ends.map_or(Vec::new(), |ends| mass_function(c, &domain, ends));
        let agreement = truth.as_ref().map(|truth| HaloMatch::new([truth, &catalogue], &domain)).transpose()?.flatten();
        context.check()?;
        if catalogue.is_empty() {
            let message = format!("there are no haloes of {} linked particles and more", options.smallest);
            return Err(Error::argument(message));
        }
        let (masses, unit) = catalogue.masses().unwrap_or_default();
        let masses: Vec<f64> = masses.into_iter().filter(|m| m.is_finite()).collect();
        Ok(HaloReport {
            input: name.into(),
            haloes: catalogue.len(),
            with_masses: masses.len(),
            largest_mass: masses.iter().copied().reduce(f64::max),
            mass_unit: unit.to_string(),
            agreement,
            mass_function: bins(&catalogue),
            mass_function_of_truth: truth.as_ref().map_or(Vec::new(), bins),
            notes: catalogue.notes.clone(),
            length_unit: input.subject.unit_system().units.length_text().map(String::from),
            catalogue,
            truth,
        })
    }

    /// Writes the mass function: a plot, where the file's ending is one of [`FileKind`], else a table as CSV. With a
    /// truth, both have that of the truth as well.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plot without a halo that has a mass; [`Error::Io`].
    pub fn write_mass_function(&self, path: &Path) -> Result<()> {
        match FileKind::from_path(path) {
            Some(kind) => {
                let bytes = plot_bytes(&self.mass_plots(), kind)?;
                let missing = || Error::argument("there is no halo with a mass to plot: 100 particles are needed");
                write_bytes(path, &bytes.ok_or_else(missing)?)
            }
            None => self.write_mass_table(path),
        }
    }

    fn write_mass_table(&self, path: &Path) -> Result<()> {
        let truth = |i: usize| self.mass_function_of_truth.get(i);
        write_atomic(path, |to| {
            let columns = "mass_low,mass_high,haloes,density,error";
            let of_truth = if truth(0).is_some() { ",haloes_truth,density_truth,error_truth" } else { "" };
            writeln!(to, "{columns}{of_truth}")?;
            let length = self.length_unit.as_deref().unwrap_or("unit of length");
            let words = format!("masses in {}; haloes per volume ({length}^3) and decade of mass", self.mass_unit);
            writeln!(to, "# {}", one_line(&words))?;
            for (i, b) in self.mass_function.iter().enumerate() {
                write!(to, "{:.6e},{:.6e},{},{:.6e},{:.6e}", b.masses[0], b.masses[1], b.haloes, b.density, b.error)?;
                if let Some(b) = truth(i) {
                    write!(to, ",{},{:.6e},{:.6e}", b.haloes, b.density, b.error)?;
                }
                writeln!(to)?;
            }
            Ok(())
        })
    }

    fn mass_plots(&self) -> Vec<Plot> {
        let (mass, length) = (&self.mass_unit[..], self.length_unit.as_deref());
        let series = |name: &str, style: usize, bins: &[MassFunctionBin]| {
            let point = |b: &MassFunctionBin| Point {
                x: (b.masses[0] * b.masses[1]).sqrt(),
                y: b.density,
                // A bar down to zero has no end on a logarithmic axis.
                range: Some([(b.density - b.error).max(0.1 * b.density), b.density + b.error]),
            };
            let points = bins.iter().filter(|b| b.haloes > 0).map(point).collect();
            PlotSeries { name: name.into(), style, dashed: false, points }
        };
        let volume = length.map_or("volume".into(), |l| format!("({l})³"));
        let mass_label = if mass == "particles" { "particles within R200m".into() } else { format!("M200m [{mass}]") };
        let truth = &self.mass_function_of_truth;
        let axes =
            [PlotAxis::logarithmic(&mass_label), PlotAxis::logarithmic(format!("haloes per decade and {volume}"))];
        let name = if truth.is_empty() { "haloes" } else { "input" };
        let of_truth = (!truth.is_empty()).then(|| series("truth", TRUTH, truth));
        let curves = of_truth.into_iter().chain([series(name, OTHER, &self.mass_function)]).collect();
        let mut plots = chart("mass_function", "Mass function of haloes", axes, curves, Vec::new());
        let both = self.mass_function.iter().zip(truth).filter(|(b, t)| b.haloes > 0 && t.haloes > 0);
        let ratio =
            |(b, t): (&MassFunctionBin, &MassFunctionBin)| ((b.masses[0] * b.masses[1]).sqrt(), b.density / t.density);
        let ratio = curve("", OTHER, false, both.map(ratio).collect());
        if !ratio.points.is_empty() {
            let axes = [PlotAxis::logarithmic(&mass_label), PlotAxis::ratios("input / truth", [0.5, 1.5])];
            plots.extend(chart("ratio", "", axes, vec![ratio], Vec::new()));
        }
        plots
    }

    /// The most important numbers, in words.
    pub fn text(&self) -> String {
        let unit = one_line(&self.mass_unit);
        let mut text = format!("{} haloes, {} of them with masses", self.haloes, self.with_masses);
        if let Some(mass) = self.largest_mass {
            text += &format!("; the heaviest has {mass:.4e} {unit}");
        }
        if let (Some(m), Some(truth)) = (&self.agreement, &self.truth) {
            let percent = |v: Option<f64>| v.map_or("-".into(), |v| format!("{:.1} %", 100.0 * v));
            let numbers = format!("{} in the truth, {} in the input", m.truth, m.other);
            text += &format!("\ntruth: {} haloes; with 300 particles and more: {numbers}", truth.len());
            text += &format!("\ncompleteness {}, purity {}", percent(m.completeness), percent(m.purity));
            let (median, scatter) = (m.mass_median.map_or("-".into(), |v| format!("{v:.4}")), percent(m.mass_scatter));
            text += &format!("\nM200m over the truth's: median {median}, scatter {scatter}");
            if let (Some(mean), Some(sd)) = (m.mass_pull_mean, m.mass_pull_sd) {
                let above = percent(m.mass_pulls_above_3);
                text += &format!("\nits difference over its error: mean {mean:.2}, sd {sd:.2}, beyond 3: {above}");
            }
        }
        text
    }
}

/// Refuses catalogues of other units or another box.
fn check_same_box(input: Subject<'_>, truth: Subject<'_>, name: &str) -> Result<()> {
    let [input_unit, truth_unit] =
        [input, truth].map(|s| s.unit_system().units.length_text().unwrap_or("none").to_string());
    if input_unit != truth_unit {
        let message = format!("its unit of length is {truth_unit}, that of the input {input_unit}");
        return Err(Error::input_with(name, message, "convert one of them first"));
    }
    let [input_box, truth_box] = [input, truth].map(|s| s.domain());
    let same = (0..3).all(|k| (input_box.length[k] / truth_box.length[k] - 1.0).abs() < 0.01);
    if input_box.periodic != truth_box.periodic || input_box.periodic.contains(&true) && !same {
        let message = format!("its box is {:?}, that of the input {:?}", truth_box.length, input_box.length);
        return Err(Error::input_with(name, message, "compare haloes of the same box"));
    }
    Ok(())
}

/// Masses from those of 100 particles to the heaviest.
fn ends(catalogues: [Option<&HaloCatalogue>; 2]) -> Option<[f64; 2]> {
    let masses = catalogues.into_iter().flatten().map(|c| Some(c.masses()?.0)).collect::<Option<Vec<_>>>()?.concat();
    let finite = || masses.iter().copied().filter(|m| m.is_finite());
    Some([finite().reduce(f64::min)?, finite().reduce(f64::max)?])
}

/// A bin of the mass function.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MassFunctionBin {
    /// Ends of the bin, in the unit of the masses.
    pub masses: [f64; 2],
    /// Haloes in it.
    pub haloes: u64,
    /// Haloes per volume and decade of mass.
    pub density: f64,
    /// Its standard error, by leaving out one octant of the box after the other.
    pub error: f64,
}

/// The mass function of a catalogue in a box from `least` on: bins of a fifth of a decade that begin there, up to the
/// heaviest halo. Satellites, which share the particles of others, are not counted. Masses are those of
/// [`HaloCatalogue::masses`]; volumes are in the box's own unit.
pub fn mass_function(catalogue: &HaloCatalogue, domain: &Domain, [least, most]: [f64; 2]) -> Vec<MassFunctionBin> {
    let Some((masses, _)) = catalogue.masses() else { return Vec::new() };
    if !(least > 0.0 && most >= least && most.is_finite()) {
        return Vec::new();
    }
    let bin = |m: f64| (libm::log10(m / least) * PER_DECADE).floor();
    let bins = bin(most) as usize + 1;
    let parts = PARTS.pow(3);
    let mut counts = vec![vec![0u64; parts]; bins];
    let satellite = catalogue.column("satellite");
    let counted =
        |(i, (_, m)): &(usize, (_, f64))| satellite.is_none_or(|s| s[*i] == 0.0) && (least..=most).contains(m);
    for (_, (center, m)) in catalogue.centers.iter().zip(masses).enumerate().filter(counted) {
        let local = domain.local(*center);
        let along =
            |k: usize| (domain.along(&local, k) / domain.length[k] * PARTS as f64).clamp(0.0, PARTS as f64 - 1.0);
        let part = (0..3).fold(0, |part, k| part * PARTS + along(k) as usize);
        if let Some(counts) = counts.get_mut(bin(m) as usize) {
            counts[part] += 1;
        }
    }
    let per = 1.0 / (domain.volume() / PER_DECADE);
    let n = parts as f64;
    let mass_bin = |(i, counts): (usize, &Vec<u64>)| {
        let total: u64 = counts.iter().sum();
        // What is left of the box without a part is scaled up to the whole.
        let without = |part_count: &u64| (total - part_count) as f64 * n / (n - 1.0);
        let mean = counts.iter().map(without).sum::<f64>() / n;
        let square =
            counts.iter().map(|part_count| (without(part_count) - mean) * (without(part_count) - mean)).sum::<f64>();
        let end = |i: usize| least * libm::pow(10f64, i as f64 / PER_DECADE);
        let error = ((n - 1.0) / n * square).sqrt() * per;
        MassFunctionBin { masses: [end(i), end(i + 1)], haloes: total, density: total as f64 * per, error }
    };
    counts.iter().enumerate().map(mass_bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haloes::HaloColumn;
    use particlegs_core::math::Random;

    #[test]
    fn bins_hold_all_haloes_and_errors_are_those_of_counts() {
        let domain = Domain::upright([0.0; 3], [10.0; 3], [true; 3]);
        let mut r = Random::new(3, 0, 0);
        let mut masses: Vec<f64> = (0..8000).map(|_| 100.0 / r.uniform().max(1e-3)).collect();
        let mut centers: Vec<_> =
            (0..8000).map(|_| [10.0 * r.uniform(), 10.0 * r.uniform(), 10.0 * r.uniform()]).collect();
        // A satellite, which is not counted.
        masses.push(150.0);
        centers.push([1.0; 3]);
        let column = |name: &str| HaloColumn { name: name.into(), values: masses.clone(), ..HaloColumn::default() };
        let values = [vec![0.0; 8000], vec![1.0]].concat();
        let satellite = HaloColumn { name: "satellite".into(), values, ..HaloColumn::default() };
        let columns = vec![column("m200m"), column("r200m"), satellite];
        let catalogue = HaloCatalogue { columns, centers, ..HaloCatalogue::default() };
        let bins = mass_function(&catalogue, &domain, [100.0, 1e5]);
        assert_eq!(bins.iter().map(|b| b.haloes).sum::<u64>(), 8000);
        assert!((bins[0].masses[1] / 100.0 - 10f64.powf(0.2)).abs() < 1e-12 && bins.len() == 16);
        for b in &bins[..6] {
            assert!((b.density - b.haloes as f64 / 1000.0 * 5.0).abs() < 1e-9);
            // Haloes without clustering have errors of roots of their numbers.
            let expected = (b.haloes as f64).sqrt() / 1000.0 * 5.0;
            assert!(b.error > 0.3 * expected && b.error < 2.0 * expected, "{b:?}");
        }
        assert_eq!(mass_function(&catalogue, &domain, [0.0, 1.0]), []);
    }
}
