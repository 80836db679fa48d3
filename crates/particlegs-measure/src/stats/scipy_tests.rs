//! Statistics of 600 clustered points in a periodic slab against numpy 2 and scipy 1's values:
//! cKDTree (pairs, neighbours, links), csgraph (groups), fftn (P(k)), histogramdd (NGP).
//! scripts/stats_scipy.py made the file.

use super::density::compare_density;
use super::moments::axis_moments;
use super::neighbours::{NeighbourOptions, nearest_distances};
use super::pairs::{PairOptions, count_pairs};
use super::{Assignment, Grid, SpectrumOptions, Subject, deposit, find_groups, power_spectra};
use particlegs_core::context::Context;
use particlegs_core::space::Cell;
use particlegs_particles::Particles;
use serde_json::Value;

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
