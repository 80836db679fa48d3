//! Multipoles of the power spectrum in redshift space, and the power spectrum of the momentum.

use super::comparison_job::ComparisonJob;
use super::presentation::*;
use super::spectrum::{ShellSums, SpectrumOptions, last_while, limits, spectra_of_sums, transform_pair};
use super::velocities::{ParticleFields, displacement};
use super::{Convention, Domain, Grid, Spectra, Subject};
use particlegs_core::Result;
use particlegs_core::context::Context;

/// Degrees of the multipoles.
const DEGREES: [i32; 3] = [0, 2, 4];

/// One shell of wave numbers in redshift space.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MultipoleShell {
    /// Lowest and highest wave number.
    pub edges: [f64; 2],
    /// Mean wave number of its modes.
    pub k: f64,
    /// Modes, of which half are independent.
    pub modes: u64,
    /// P0 of truth and other, volume units, shot noise subtracted.
    pub monopole: [f64; 2],
    /// P2 of both.
    pub quadrupole: [f64; 2],
    /// P4 of both.
    pub hexadecapole: [f64; 2],
}

/// Multipoles of both sides, means over lines of sight along x, y and z.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct Multipoles {
    options: SpectrumOptions,
    /// Length, world units, by which a velocity of 1 km/s moves a particle.
    pub displacement: f64,
    /// Shot noise of each, volume units.
    pub shot_noise: [f64; 2],
    /// Shells of width 2 pi over the longest edge.
    pub shells: Vec<MultipoleShell>,
}

/// Legendre's polynomial of degree 0, 2 or 4.
fn legendre(degree: i32, mu: f64) -> f64 {
    let square = mu * mu;
    match degree {
        0 => 1.0,
        2 => 1.5 * square - 0.5,
        _ => (35.0 * square - 30.0) * square / 8.0 + 0.375,
    }
}

/// P0, P2 and P4 of a pair whose velocities in km/s move particles by `displacement` each.
pub fn multipoles(
    pair: [&ParticleFields; 2],
    displacement: f64,
    domain: &Domain,
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<Multipoles> {
    let grid = Grid::new(domain, o.cells);
    let mut sums: [Option<ShellSums>; 3] = Default::default();
    for axis in 0..3 {
        // Seen from far away any axis may be the line of sight; the mean of three scatters less.
        let [a, b] = pair.map(|v| v.in_redshift_space(axis, displacement));
        let (a, b) = (a?, b?);
        let subjects = [Subject::Particles(&a), Subject::Particles(&b)];
        let transforms = transform_pair(subjects, [None; 2], &grid, domain, o, context)?;
        for (sums, degree) in sums.iter_mut().zip(DEGREES) {
            let weight = |wave: [f64; 3], k: f64| legendre(degree, wave[axis] / k);
            let axis_sums = ShellSums::new(&transforms, domain, o.k_max, weight, context)?;
            // All lines of sight have the same modes: wave numbers and counts are those of the first.
            match sums {
                None => *sums = Some(axis_sums),
                Some(sums) => sums.add_power(&axis_sums),
            }
        }
    }
    let shot_noise = pair.map(|v| Subject::Particles(&v.particles).shot_noise(domain));
    // Over three lines of sight L0 sums to 3 and L2 to 0 in every mode, but L4's sum depends on the shell's modes: noise is
    // subtracted with their weights.
    let power = |degree: i32, [_, weight, xx, yy, _]: [f64; 5]| {
        let noise = shot_noise.map(|n| n * weight);
        let lines_of_sight = 3.0;
        // 2 l + 1 is what Legendre's polynomials are normalised by; sums over lines of sight become their mean.
        let factor = f64::from(2 * degree + 1) / lines_of_sight;
        [factor * (xx * domain.volume() - noise[0]), factor * (yy * domain.volume() - noise[1])]
    };
    let [p0, p2, p4] = sums.map(|s| s.unwrap_or_default());
    let shells = p0.means().zip(p2.means()).zip(p4.means()).map(|(((edges, modes, a), (_, _, b)), (_, _, c))| {
        let [monopole, quadrupole, hexadecapole] = [power(0, a), power(2, b), power(4, c)];
        MultipoleShell { edges, k: a[0], modes, monopole, quadrupole, hexadecapole }
    });
    Ok(Multipoles { options: *o, displacement, shot_noise, shells: shells.collect() })
}

/// The power of the momentum (1 + delta) v, the sum of its components': (unit of velocity)^2 times volume.
pub fn momentum_spectra(
    pair: [&ParticleFields; 2],
    domain: &Domain,
    o: &SpectrumOptions,
    context: &Context<'_>,
) -> Result<Spectra> {
    let grid = Grid::new(domain, o.cells);
    // Of a cell, in the units that momenta are deposited in.
    let cell = |v: &ParticleFields| {
        let p = &v.particles;
        p.total_mass() * p.meta.particle_mass.unwrap_or(1.0) / grid.len() as f64
    };
    // Momenta are over the mean mass, since their own mean may vanish.
    let means = pair.map(|v| Some(cell(v)));
    let mut sums: Option<ShellSums> = None;
    for axis in 0..3 {
        let [a, b] = pair.map(|v| v.with_momenta(axis));
        let (a, b) = (a?, b?);
        let subjects = [Subject::Particles(&a), Subject::Particles(&b)];
        let transforms = transform_pair(subjects, means, &grid, domain, o, context)?;
        let axis_sums = ShellSums::new(&transforms, domain, o.k_max, |_, _| 1.0, context)?;
        // Components have the same modes: wave numbers and counts are those of the first.
        match &mut sums {
            None => sums = Some(axis_sums),
            Some(sums) => sums.add_power(&axis_sums),
        }
    }
    let shot_noise = pair.map(|v| v.momentum_noise(domain));
    Ok(spectra_of_sums(&sums.unwrap_or_default(), shot_noise, &grid, domain, o))
}

impl ComparisonJob<'_> {
    /// `None`, and a note, where velocities cannot be turned into lengths, and in a box that is not periodic.
    pub fn multipoles(
        &self,
        pair: [&ParticleFields; 2],
        unit: Option<&str>,
        notes: &mut Vec<String>,
    ) -> Result<Option<Multipoles>> {
        let shift = match self.domain.periodic {
            [true, true, true] => displacement(self.pair, unit),
            _ => Err("the box is not periodic along all axes".into()),
        };
        match shift {
            Ok(shift) => multipoles(pair, shift, &self.domain, &self.spectrum_options(), self.context).map(Some),
            Err(why) => {
                notes.push(format!("no multipoles: {why}"));
                Ok(None)
            }
        }
    }
}

impl Multipoles {
    /// Shells in which P0 of the truth is more than its shot noise scatters.
    fn judged(&self) -> impl Iterator<Item = &MultipoleShell> {
        let scatter = |s: &MultipoleShell| self.shot_noise[0] / (0.5 * s.modes as f64).sqrt();
        self.shells.iter().filter(move |s| s.monopole[0] > scatter(s))
    }

    /// The last judged shell's k up to which every P0 is within `limit` of the truth's.
    pub fn monopole_within(&self, limit: f64) -> Option<f64> {
        last_while(self.judged().map(|s| (s.k, (s.monopole[1] / s.monopole[0] - 1.0).abs() <= limit)))
    }

    /// The largest difference of P2 in any judged shell, in units of the truth's P0.
    pub(super) fn largest_quadrupole_deviation(&self) -> Option<f64> {
        let deviation = |s: &MultipoleShell| ((s.quadrupole[1] - s.quadrupole[0]) / s.monopole[0]).abs();
        self.judged().map(deviation).reduce(f64::max)
    }
}

/// Shows them.
pub(super) fn show(
    multipoles: Option<&Multipoles>,
    momentum: Option<&Spectra>,
    (velocity_unit, convention): (Option<&str>, Convention),
    to: &mut Presentation,
) {
    if let Some(m) = multipoles {
        let row = |h: &MultipoleShell| {
            let ([a, b], [c, d], [e, f]) = (h.monopole, h.quadrupole, h.hexadecapole);
            row![h.edges[0], h.edges[1], h.k, h.modes, a, b, c, d, e, f]
        };
        let head = "k_low,k_high,k,modes,p0_truth,p0_other,p2_truth,p2_other,p4_truth,p4_other";
        to.table("multipoles.csv", head, m.shells.iter().map(row));
        // P0 and the size of P2; the ratio is that of P0.
        let points_of = |pick: fn(&MultipoleShell) -> f64| m.shells.iter().map(|h| (h.k, pick(h))).collect::<Points>();
        let series = vec![
            curve("P0, truth", TRUTH, false, points_of(|h| h.monopole[0])),
            curve("P0, other", OTHER, false, points_of(|h| h.monopole[1])),
            curve("|P2|, truth", TRUTH, true, points_of(|h| h.quadrupole[0].abs())),
            curve("|P2|, other", OTHER, true, points_of(|h| h.quadrupole[1].abs())),
        ];
        let axes = [log(format!("k{}", to.units.wave)), log(format!("P(k){}", to.units.volume))];
        let ratio = m.shells.iter().filter(|h| h.monopole[0] > 0.0).map(|h| (h.k, h.monopole[1] / h.monopole[0]));
        let title = "Multipoles in redshift space (shot noise subtracted); below, P0";
        to.plot(chart("multipoles", title, axes, series, ratio.collect()));
        to.line("P0(k): within 1, 5, 10 % up to k", limits(|limit| m.monopole_within(limit)) + &to.wave);
        let deviation = m.largest_quadrupole_deviation().map_or("-".into(), |d| format!("{d:.3}"));
        to.line("P2(k): largest difference / P0", deviation);
    }
    if let Some(m) = momentum {
        to.spectra_table("momentum.csv", m);
        let rows: Vec<_> = m.shells.iter().map(|h| (h.k, h.power)).collect();
        let unit = match (velocity_unit, to.units.volume.trim().trim_matches(['[', ']'])) {
            (Some(velocity), volume) if !volume.is_empty() => format!(" [({velocity})² {volume}]"),
            _ => String::new(),
        };
        let axes = [log(format!("k{}", to.units.wave)), log(format!("P(k) of (1 + delta) v{unit}"))];
        let title = format!("Power spectrum of the momentum ({})", convention.shot_noise());
        to.plot(compared("momentum", &title, axes, &rows, 0.0));
        to.line("momentum: within 1, 5, 10 % up to k", limits(|limit| m.power_within(limit)) + &to.wave);
    }
}

#[cfg(test)]
mod tests {
    use super::super::Assignment;
    use super::*;
    use particlegs_core::math::Random;
    use particlegs_particles::testing::{on_threads, poisson};
    use std::f64::consts::PI;

    const BOX: Domain = Domain::upright([0.0; 3], [4.0; 3], [true; 3]);

    fn options(cells: usize) -> SpectrumOptions {
        SpectrumOptions {
            cells,
            assignment: Assignment::Tsc,
            interlaced: true,
            deconvolved: true,
            shot_noise_subtracted: true,
            k_max: 0.9 * PI * cells as f64 / 4.0,
        }
    }

    /// A wave along x: x = q + A sin(k q), 2 pi over its length 2 in a box of 4, of random places or a lattice.
    fn wave(n: usize, amplitude: f64, velocity: impl Fn(usize, [f64; 3]) -> [f64; 3]) -> ParticleFields {
        let place = |i: usize| [i / (n * n), i / n % n, i % n].map(|v| 4.0 * (v as f64 + 0.5) / n as f64);
        let q = || (0..n * n * n).map(place);
        let moved_places = q().map(|[x, y, z]| [x + amplitude * (PI * x).sin(), y, z]);
        ParticleFields::of_parts(particlegs_particles::testing::from_points(moved_places), |i| velocity(i, place(i)))
    }

    #[test]
    fn particles_at_rest_have_no_quadrupole_and_the_power_of_real_space() {
        let p = particlegs_particles::testing::sample();
        let domain = Domain::from_particles(&p);
        let o = SpectrumOptions { k_max: 4.0, ..options(48) };
        let subject = Subject::Particles(&p);
        let real = super::super::power_spectra([subject; 2], &domain, &o, &Context::SILENT).unwrap();
        let still = ParticleFields::of_parts(p.clone(), |_| [0.0; 3]);
        let multipoles = multipoles([&still; 2], 0.01, &domain, &o, &Context::SILENT).unwrap();
        assert_eq!(multipoles.shells.len(), real.shells.len());
        for (s, r) in multipoles.shells.iter().zip(&real.shells) {
            assert!((s.monopole[0] / r.power[0] - 1.0).abs() < 1e-9 && s.modes == r.modes && s.k == r.k);
            // The mean over three lines of sight of each mode is zero.
            assert!((s.quadrupole[0] / s.monopole[0]).abs() < 1e-9, "{s:?}");
        }
        let momentum = momentum_spectra([&still; 2], &domain, &o, &Context::SILENT).unwrap();
        assert!(momentum.shells.iter().all(|s| s.power[0].abs() < 1e-20) && momentum.shot_noise == [0.0; 2]);
    }

    /// Kaiser's limit: a wave whose velocities along it add f to its displacement has 1 + f mu^2 of its amplitude; the
    /// means over three lines of sight of P (1 + f mu^2)^2 L for mu = 1, 0 and 0.
    #[test]
    fn a_growing_wave_has_its_multipoles() {
        let (amplitude, f, displacement) = (2e-3, 0.5, 0.01);
        let velocity = |_, [x, _, _]: [f64; 3]| [f * amplitude * (PI * x).sin() / displacement, 0.0, 0.0];
        let v = wave(24, amplitude, velocity);
        let o = SpectrumOptions { shot_noise_subtracted: true, ..options(24) };
        let multipoles = multipoles([&v; 2], displacement, &BOX, &o, &Context::SILENT).unwrap();
        let noise = multipoles.shot_noise[0];
        let shell = multipoles.shells.iter().find(|s| (s.edges[0]..s.edges[1]).contains(&PI)).unwrap();
        // All power is in two modes; the lattice has no shot noise.
        let all = |l: f64| (amplitude * PI).powi(2) / 4.0 * 64.0 * 2.0 * l / shell.modes as f64;
        let enhanced = (1.0 + f) * (1.0 + f);
        let expected = [all(enhanced + 2.0) / 3.0, 5.0 / 3.0 * all(enhanced - 1.0)];
        let parts = [shell.monopole[0] + noise, shell.quadrupole[0]];
        for (value, expected) in parts.iter().zip(expected) {
            assert!((value / expected - 1.0).abs() < 0.03, "{shell:?} {expected:?}");
        }
        // Momentum: f amplitude k / displacement along x.
        let momentum = momentum_spectra([&v; 2], &BOX, &o, &Context::SILENT).unwrap();
        let shell = momentum.shells.iter().find(|s| (s.edges[0]..s.edges[1]).contains(&PI)).unwrap();
        let expected = (f * amplitude / displacement).powi(2) / 4.0 * 64.0 * 2.0 / shell.modes as f64;
        let square = (f * amplitude / displacement).powi(2) / 2.0;
        assert!((momentum.shot_noise[0] / (square * 64.0 / 13_824.0) - 1.0).abs() < 0.01);
        assert!(((shell.power[0] + momentum.shot_noise[0]) / expected - 1.0).abs() < 0.03, "{shell:?} {expected}");
    }

    /// Random motions of dispersion s damp the power by exp(-(k mu s)^2) along the line of sight.
    #[test]
    fn a_gaussian_dispersion_damps_the_monopole() {
        let (amplitude, deviation) = (0.05, 0.2);
        let random = |i: usize, _: [f64; 3]| [0, 1, 2].map(|k| Random::new(5, k, i as u64).normal());
        let v = wave(40, amplitude, random);
        let o = options(32);
        let still = wave(40, amplitude, |_, _| [0.0; 3]);
        let power = |v: &ParticleFields, displacement| {
            let multipoles = multipoles([v; 2], displacement, &BOX, &o, &Context::SILENT).unwrap();
            *multipoles.shells.iter().find(|s| (s.edges[0]..s.edges[1]).contains(&PI)).unwrap()
        };
        let (hot, cold) = (power(&v, deviation), power(&still, 1.0));
        let damping = (-(PI * deviation).powi(2)).exp();
        // One line of sight of three is along the wave.
        let ratio = hot.monopole[0] / cold.monopole[0];
        assert!((ratio / ((2.0 + damping) / 3.0) - 1.0).abs() < 0.03, "{ratio} {damping}");
        let quadrupole = hot.quadrupole[0] / cold.monopole[0];
        assert!((quadrupole - 5.0 / 3.0 * (damping - 1.0)).abs() < 0.03, "{quadrupole} {damping}");
    }

    #[test]
    fn polynomials_are_orthogonal_and_one_along_the_line_of_sight() {
        let mean = |a, b| {
            (0..4000).map(|i| (f64::from(i) + 0.5) / 4000.0).map(|mu| legendre(a, mu) * legendre(b, mu)).sum::<f64>()
                / 4000.0
        };
        for a in DEGREES {
            assert_eq!(legendre(a, -1.0), 1.0);
            for b in DEGREES {
                let expected = if a == b { 1.0 / f64::from(2 * a + 1) } else { 0.0 };
                assert!((mean(a, b) - expected).abs() < 1e-5, "{a} {b}");
            }
        }
    }

    #[test]
    fn a_constant_velocity_of_a_gas_has_no_momentum_beyond_shot_noise() {
        let gas = ParticleFields::of_parts(poisson(20_000, [4.0; 3], 3), |_| [100.0, -50.0, 20.0]);
        let run = |threads| {
            on_threads(threads, || momentum_spectra([&gas; 2], &BOX, &options(24), &Context::SILENT).unwrap())
        };
        let spectra = run(1);
        assert!(spectra == run(3));
        let noise = 12_900.0 * 64.0 / 20_000.0;
        assert!((spectra.shot_noise[0] / noise - 1.0).abs() < 1e-6);
        for s in &spectra.shells {
            assert!(s.power[0].abs() < noise * (5.0 * (2.0 / s.modes as f64).sqrt() + 0.02), "{s:?} {noise}");
        }
    }
}
