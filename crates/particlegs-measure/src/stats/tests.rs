//! Statistics against what is known: spectra of noise, a wave and a Gaussian; of 600 clustered points in a periodic slab,
//! numpy 2 and scipy 1's values: cKDTree (pairs, neighbours, links), csgraph (groups), fftn (P(k)), histogramdd (NGP).
//! scripts/stats_scipy.py made their file.

use super::density::compare_density;
use super::moments::axis_moments;
use super::neighbours::{NeighbourOptions, nearest_distances};
use super::pairs::{PairOptions, count_pairs};
use super::spectrum::{SpectrumOptions, power_spectra, spectra, transform_pair};
use super::transform::xi_of_modes;
use super::{Assignment, Domain, Grid, Subject, deposit, find_groups};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3};
use particlegs_core::space::Cell;
use particlegs_particles::Particles;
use particlegs_particles::testing::{from_points, gas, model_of, poisson, tilted_cells};
use serde_json::Value;
use std::f64::consts::PI;

fn options(cells: usize, k_max: f64) -> SpectrumOptions {
    SpectrumOptions {
        cells,
        assignment: Assignment::Tsc,
        interlaced: true,
        deconvolved: true,
        shot_noise_subtracted: true,
        k_max,
    }
}

fn domain(length: [f64; 3]) -> Domain {
    Domain::upright([0.0; 3], length, [true; 3])
}

/// Poisson points have the power V / N at every k, on a slab too; two sets do not correlate.
#[test]
fn poisson_points_are_shot_noise_up_to_the_nyquist_frequency() {
    let length = [2.0, 8.0, 6.0];
    let (a, b) = (poisson(40_000, length, 1), poisson(30_000, length, 2));
    let k_max = PI * 32.0 / 8.0 * 0.98;
    let o = SpectrumOptions { shot_noise_subtracted: false, ..options(32, k_max) };
    let s =
        power_spectra([Subject::Particles(&a), Subject::Particles(&b)], &domain(length), &o, &Context::SILENT).unwrap();
    assert_eq!(s.cells, [8, 32, 24]);
    assert!((s.shot_noise[0] - 96.0 / 40_000.0).abs() < 1e-12);
    for shell in &s.shells {
        // Half of the modes are independent, each exponentially distributed.
        let sigma = (2.0 / shell.modes as f64).sqrt();
        for side in 0..2 {
            let off = shell.power[side] / s.shot_noise[side] - 1.0;
            assert!(off.abs() < 5.0 * sigma + 0.02, "{shell:?}");
        }
        assert!(shell.r.unwrap().abs() < 4.0 * sigma + 1e-3);
    }
    let total: u64 = s.shells.iter().map(|s| s.modes).sum();
    let whole = 4.0 / 3.0 * PI * k_max.powi(3) * 96.0 / (2.0 * PI).powi(3);
    assert!((total as f64 / whole - 1.0).abs() < 0.1, "{total} {whole}");
}

/// A mixture's power to two thirds of the Nyquist frequency is that of a finer grid; also in a flat box, whose few cells
/// across keep Gaussians from being widened.
#[test]
fn power_of_a_mixture_does_not_depend_on_the_grid() {
    for (length, most_off) in [([24.0; 3], 1e-3), ([24.0, 24.0, 1.5], 2e-2)] {
        let gaussian = |i: u64| {
            let mut r = Random::new(9, 0, i);
            let (place, size) = (length.map(|l| l * r.uniform()), 0.1 + 0.3 * r.uniform());
            (place, Sym3([size * size, 0.02 * size, 0.0, size * size, 0.0, 0.5 * size * size]), 1.0 + 9.0 * r.uniform())
        };
        let model = model_of(&(0..200).map(gaussian).collect::<Vec<_>>(), length);
        let k_max = 2.0 / 3.0 * PI * 48.0 / 24.0;
        let power = |cells| {
            let subject = Subject::Model(&model);
            power_spectra([subject, subject], &domain(length), &options(cells, k_max), &Context::SILENT).unwrap().shells
        };
        for (coarse, fine) in power(48).iter().zip(power(144)) {
            assert_eq!((coarse.modes, coarse.k), (fine.modes, fine.k));
            let off = coarse.power[0] / fine.power[0] - 1.0;
            assert!(off.abs() < most_off, "{length:?}, k = {}: {off}", coarse.k);
        }
    }
}

/// A displaced lattice: x = q + A sin(2 pi m q / L) has power A^2 k^2 / 4 x V in two modes.
#[test]
fn a_wave_has_its_power_and_its_place() {
    let (n, amplitude, m) = (32, 1e-3, 3.0);
    let length = [1.0, 1.0, 2.0];
    let wave = 2.0 * PI * m / length[2];
    let p = from_points((0..n * n * n).map(|i| {
        let q = [i / (n * n), i / n % n, i % n].map(|v| (v as f64 + 0.5) / n as f64);
        let z = q[2] * length[2];
        [q[0], q[1], z + amplitude * (wave * z).sin()]
    }));
    let o = SpectrumOptions { shot_noise_subtracted: false, ..options(32, 0.9 * PI * 16.0) };
    let subject = Subject::Particles(&p);
    let s = power_spectra([subject, subject], &domain(length), &o, &Context::SILENT).unwrap();
    let total: f64 = s.shells.iter().map(|h| h.modes as f64 * h.power[0]).sum();
    let expected = 2.0 * (amplitude * wave).powi(2) / 4.0 * 2.0;
    // A lattice of one point a cell along z leaves even aliases of about a hundredth.
    assert!((total / expected - 1.0).abs() < 0.02, "{total} {expected}");
    let top = s.shells.iter().max_by(|a, b| (a.power[0] * a.modes as f64).total_cmp(&(b.power[0] * b.modes as f64)));
    assert!((top.unwrap().k - wave).abs() < 0.5 * PI);
    assert!(s.shells.iter().filter_map(|h| h.r).all(|r| (r - 1.0).abs() < 1e-9));
}

/// One Gaussian of deviation s in a box has P(k) = V exp(-k^2 s^2), and its xi follows.
#[test]
fn one_gaussian_has_its_power_and_its_xi() {
    let (length, deviation) = ([4.0; 3], 0.25);
    let model = model_of(&[([1.3, 2.0, 3.9], Sym3::scaled_identity(deviation * deviation), 1000.0)], length);
    let o = options(64, 20.0);
    let subject = Subject::Model(&model);
    let pair =
        transform_pair([subject; 2], [None; 2], &Grid::new(&domain(length), 64), &domain(length), &o, &Context::SILENT)
            .unwrap();
    let s = spectra(&pair, &domain(length), &o, &Context::SILENT).unwrap();
    assert_eq!(s.shot_noise, [0.0, 0.0]);
    for h in s.shells.iter().filter(|h| h.k * deviation < 2.5) {
        // The shell's mean of exp(-k^2 s^2) is close to the value at its mean k for narrow shells.
        let expected = 64.0 * (-(h.k * deviation).powi(2)).exp();
        assert!((h.power[0] / expected - 1.0).abs() < 0.12, "{h:?} {expected}");
    }
    // xi(r) = V / (4 pi s^2)^(3/2) exp(-r^2 / 4 s^2) - 1.
    let edges = [0.4, 0.42, 0.6, 0.62, 0.9, 0.92];
    let [xi, _] = xi_of_modes(&pair, &domain(length), &o, &edges, &Context::SILENT).unwrap();
    for (i, r) in [(0, 0.41f64), (2, 0.61), (4, 0.91)] {
        let expected =
            64.0 / (4.0 * PI * deviation * deviation).powf(1.5) * (-r * r / (4.0 * deviation * deviation)).exp() - 1.0;
        assert!((xi[i] / expected - 1.0).abs() < 0.02, "{r}: {} {expected}", xi[i]);
    }
}

/// A gas is shot noise, and the mixture's P(k) is V exp(-k^2 s^2), on the modes of a tilted box.
#[test]
fn tilted_boxes_have_their_own_modes() {
    for cell in &tilted_cells()[..3] {
        let particles = gas(20_000, cell, 4);
        let domain = Domain::from_particles(&particles);
        let k_max = 0.9 * PI * 24.0 / domain.longest();
        let o = SpectrumOptions { shot_noise_subtracted: false, ..options(24, k_max) };
        let s = power_spectra([Subject::Particles(&particles); 2], &domain, &o, &Context::SILENT).unwrap();
        for shell in &s.shells {
            let off = shell.power[0] / s.shot_noise[0] - 1.0;
            assert!(off.abs() < 4.0 * (2.0 / shell.modes as f64).sqrt() + 0.02, "{cell:?}: {shell:?}");
        }
        let total: u64 = s.shells.iter().map(|s| s.modes).sum();
        let whole = 4.0 / 3.0 * PI * k_max.powi(3) * domain.volume() / (2.0 * PI).powi(3);
        assert!((total as f64 / whole - 1.0).abs() < 0.1, "{total} {whole}");
        // A turned Gaussian at a corner, so that it lies in all images.
        let (a, b) = (0.5f64, 0.3f64);
        let mut model = model_of(&[(cell.origin, Sym3([a * a, 0.0, 0.0, b * b, 0.0, a * a]), 1000.0)], [1.0; 3]);
        model.metadata.cell = Some(*cell);
        let s = power_spectra([Subject::Model(&model); 2], &domain, &options(48, 2.5), &Context::SILENT).unwrap();
        for shell in &s.shells {
            // The mean over directions of exp(-k^2 (a^2 + (b^2 - a^2) mu^2)).
            let n = 2000;
            let mu = |i: usize| (i as f64 + 0.5) / n as f64;
            let at = |i: usize| (-shell.k.powi(2) * (a * a + (b * b - a * a) * mu(i).powi(2))).exp();
            let expected = domain.volume() * (0..n).map(at).sum::<f64>() / n as f64;
            let few = 0.5 / (shell.modes as f64).sqrt();
            assert!((shell.power[0] / expected - 1.0).abs() < 0.15 + few, "{cell:?}: {shell:?} {expected}");
        }
    }
}

fn close(a: f64, b: f64, tolerance: f64) {
    assert!((a - b).abs() <= tolerance * b.abs().max(1e-3), "{a} against {b}");
}

fn floats(v: &Value) -> Vec<f64> {
    v.as_array().unwrap().iter().map(|x| x.as_f64().unwrap()).collect()
}

fn points() -> (Particles, Vec<[f64; 3]>, Value) {
    let expected: Value = serde_json::from_str(include_str!("../../tests/fixtures/stats_scipy.json")).unwrap();
    let all: Vec<f32> = floats(&expected["positions"]).iter().map(|v| *v as f32).collect();
    let column = |k: usize| all.iter().skip(k).step_by(3).copied().collect::<Vec<f32>>();
    let mut p = Particles::from_columns(column(0), column(1), column(2));
    let l = floats(&expected["length"]);
    p.meta.cell = Some(Cell::orthogonal([l[0], l[1], l[2]]));
    let positions = (0..p.len()).map(|i| p.position(i)).collect();
    (p, positions, expected)
}

#[test]
fn neighbours_pairs_and_groups_are_scipys() {
    let (p, x, e) = points();
    let domain = Subject::Particles(&p).domain();
    assert_eq!(domain.periodic, [true; 3]);
    let o = PairOptions { edges: floats(&e["pair_edges"]), band: 3.0, budget: u64::MAX, seed: 1 };
    let pairs = count_pairs(&x, &domain, &o, &Context::SILENT).unwrap().pairs;
    assert_eq!(pairs.iter().map(|p| *p as f64).collect::<Vec<_>>(), floats(&e["pairs"]));
    let o = NeighbourOptions { sample: 600, among_sample: false, seed: 1 };
    let d = nearest_distances(&p, &domain, &o, &Context::SILENT).unwrap();
    close(d.mean, e["nearest_mean"].as_f64().unwrap(), 1e-12);
    close(d.median, e["nearest_median"].as_f64().unwrap(), 1e-12);
    let length = e["linking"].as_f64().unwrap() * domain.spacing(600);
    let groups = find_groups(&x, &domain, length, 3, &Context::SILENT).unwrap();
    assert_eq!(groups.members.iter().map(|m| m.len() as f64).collect::<Vec<_>>(), floats(&e["groups"]));
}

#[test]
fn densities_spectra_and_moments_are_numpys() {
    let (p, _, e) = points();
    let subject = Subject::Particles(&p);
    let domain = subject.domain();
    let grid = Grid::new(&domain, 20);
    assert_eq!(grid.cells, [8, 20, 12]);
    let field_of = |scheme| deposit(subject, &grid, scheme, 0.0, &Context::SILENT).unwrap();
    let c = compare_density(&field_of(Assignment::Cic), &field_of(Assignment::Ngp));
    close(c.variance[0], e["cic_variance"].as_f64().unwrap(), 1e-5);
    close(c.variance[1], e["ngp_variance"].as_f64().unwrap(), 1e-6);
    close(c.correlation, e["cic_ngp_correlation"].as_f64().unwrap(), 1e-6);
    let o = SpectrumOptions {
        cells: 20,
        assignment: Assignment::Cic,
        interlaced: false,
        deconvolved: true,
        shot_noise_subtracted: false,
        k_max: e["k_max"].as_f64().unwrap(),
    };
    let s = power_spectra([subject, subject], &domain, &o, &Context::SILENT).unwrap();
    let expected: Vec<Vec<f64>> = e["power"].as_array().unwrap().iter().map(floats).collect();
    assert_eq!(s.shells.len(), expected.len());
    for (shell, numpy) in s.shells.iter().zip(&expected) {
        assert_eq!(shell.modes as f64, numpy[1]);
        close(shell.k, numpy[0], 1e-12);
        close(shell.power[0], numpy[2], 1e-5);
    }
    for (ours, numpy) in axis_moments(subject).iter().zip(e["moments"].as_array().unwrap().iter().map(floats)) {
        let ours = [ours.mean, ours.deviation, ours.skewness, ours.kurtosis];
        ours.iter().zip(&numpy).for_each(|(a, b)| close(*a, *b, 1e-9));
    }
}
