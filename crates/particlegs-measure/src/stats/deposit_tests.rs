use super::*;
use particlegs_core::context::Context;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_particles::testing::{on_threads, poisson};
use particlegs_particles::{Column, Domain};

fn domain(length: [f64; 3], periodic: bool) -> Domain {
    Domain::upright([0.0; 3], length, [periodic; 3])
}

/// The plain twin: one particle after the other.
fn plain(p: &Particles, grid: &Grid, scheme: Assignment, shift: f64) -> Vec<f64> {
    let mut out = vec![0.0; grid.len()];
    for i in 0..p.len() {
        let x = p.position(i);
        let axes: [_; 3] = each_axis(|k| {
            let u = (x[k] - grid.min[k]) / grid.side[k] + shift;
            scheme.weights(u)
        });
        for a in 0..27 {
            let o = [a / 9, a / 3 % 3, a % 3];
            let w: f64 = (0..3).map(|k| axes[k].1[o[k]]).product();
            let at = each_axis(|k| grid.wrap(k, axes[k].0 + o[k] as i64));
            out[grid.index(at)] += w * p.weights().map_or(1.0, |c| f64::from(c[i]));
        }
    }
    out
}

#[test]
fn every_scheme_agrees_with_its_plain_twin() {
    let length = [3.0, 10.0, 7.0];
    let p = poisson(5000, length, 1).with_weights(Column::owned((0..5000).map(|i| 0.5 + (i % 7) as f32).collect()));
    for periodic in [true, false] {
        for longest in [1, 2, 5, 40] {
            let grid = Grid::new(&domain(length, periodic), longest);
            for scheme in [Assignment::Ngp, Assignment::Cic, Assignment::Tsc] {
                for shift in [0.0, 0.5] {
                    if shift > 0.0 && !periodic {
                        continue;
                    }
                    let fast = deposit(Subject::Particles(&p), &grid, scheme, shift, &Context::SILENT).unwrap();
                    let plain = plain(&p, &grid, scheme, shift);
                    let worst = fast
                        .mass
                        .iter()
                        .zip(&plain)
                        .map(|(a, b)| (f64::from(*a) - b).abs() / b.max(1.0))
                        .fold(0.0, f64::max);
                    assert!(worst < 1e-5, "{scheme:?} {longest} {periodic} {shift}: {worst}");
                }
            }
        }
    }
}

#[test]
fn threads_change_no_bit() {
    let p = poisson(300_000, [4.0, 4.0, 4.0], 1);
    let grid = Grid::new(&domain([4.0; 3], true), 24);
    let run = |threads| {
        on_threads(threads, || {
            deposit(Subject::Particles(&p), &grid, Assignment::Tsc, 0.5, &Context::SILENT).unwrap().mass
        })
    };
    assert_eq!(run(1), run(5));
}

#[test]
fn what_lies_beyond_an_open_edge_is_counted() {
    let p = Particles::from_columns(vec![-0.5, 0.5, 4.0, 4.1], vec![1.0; 4], vec![1.0; 4]);
    let grid = Grid::new(&domain([4.0; 3], false), 4);
    let f = deposit(Subject::Particles(&p), &grid, Assignment::Tsc, 0.0, &Context::SILENT).unwrap();
    assert_eq!(f.outside, 2.0);
    assert!((f.mass.iter().sum::<f32>() - 2.0).abs() < 1e-6);
}

#[test]
fn a_model_keeps_its_mass_and_its_place() {
    let mut m = Mixture::default();
    m.push([1.0, 9.5, 3.0], Sym3([0.3, 0.1, 0.0, 0.2, 0.0, 0.4]), 100.0, 100.0);
    m.push([2.9, 0.6, 6.6], Sym3::scaled_identity(1e-6), 50.0, 50.0);
    let grid = Grid::new(&domain([3.0, 10.0, 7.0], true), 40);
    let mut field = Field { grid, mass: vec![0.0; grid.len()], outside: 0.0 };
    add_mixtures(&mut field, &[&m], 2.0, 0.0, &Context::SILENT).unwrap();
    assert!((field.mass.iter().map(|v| f64::from(*v)).sum::<f64>() - 300.0).abs() < 1e-3);
    assert!((field.mass[grid.index([11, 2, 26])] - 100.0).abs() < 0.5);
    let mut whole = vec![0.0; grid.len()];
    let (mut splat, mut slab) = (DepositScratch::default(), Slab::whole(&grid, &mut whole));
    (0..2).for_each(|i| splat.add(&mut slab, m.mean_of(i), &m.cov_of(i), 2.0 * m.mass_of(i)));
    assert!(field.mass.iter().zip(&whole).all(|(a, b)| (f64::from(*a) - b).abs() < 1e-5));
}

#[test]
fn a_grid_beyond_memory_says_what_it_needs() {
    let grid = Grid::new(&domain([1.0; 3], true), 65_000);
    let p = poisson(10, [1.0; 3], 1);
    // Refused before anything is taken, where the system tells what it has.
    if particlegs_files::memory::available_bytes().is_some() {
        let error = deposit(Subject::Particles(&p), &grid, Assignment::Ngp, 0.0, &Context::SILENT).unwrap_err();
        assert!(matches!(error, particlegs_core::Error::Memory { .. }));
    }
}
