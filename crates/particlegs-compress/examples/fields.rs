//! Cost and gain of a velocity field: bytes a Gaussian, and particles drawn from the model against the snapshot's.
//! `cargo run --release -p particlegs-compress --example fields -- FOLDER MODEL.pgs`: columns xx yy zz vx vy vz in
//! FOLDER.

use particlegs_core::codec;
use particlegs_core::math::Random;
use particlegs_core::model::{FieldMoments, Mixture};
use std::path::Path;

fn column(folder: &Path, name: &str) -> Vec<f32> {
    let bytes = std::fs::read(folder.join(name)).unwrap();
    bytes.chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]])).collect()
}

/// Positions and velocities.
type Phase = Vec<([f64; 3], [f64; 3])>;

fn drawn(m: &Mixture, f: &FieldMoments, seed: u64, spread: bool) -> Phase {
    let mut out = Phase::new();
    for i in 0..m.len() {
        let (e, s) =
            (m.cov_of(i).eigen(), particlegs_core::math::Sym3(std::array::from_fn(|k| f.spread[k][i])).eigen());
        for n in 0..m.count[i] as u64 {
            let mut r = Random::new(seed, i as u32, n);
            let mut turned = |e: &particlegs_core::math::Eigen| -> [f64; 3] {
                let z: [f64; 3] = std::array::from_fn(|a| e.values[a].max(0.0).sqrt() * r.normal());
                std::array::from_fn(|k| (0..3).map(|a| e.vectors[a][k] * z[a]).sum())
            };
            let (d, left) = (turned(&e), turned(&s));
            let mean = m.mean_of(i);
            let v = std::array::from_fn(|c| f.mean_at(c, i, d) + if spread { left[c] } else { 0.0 });
            out.push((std::array::from_fn(|k| mean[k] + d[k]), v));
        }
    }
    out
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let n = a.len() as f64;
    let (ma, mb) = (a.iter().sum::<f64>() / n, b.iter().sum::<f64>() / n);
    let dot = |x: &[f64], y: &[f64], mx: f64, my: f64| x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
    dot(a, b, ma, mb) / (dot(a, a, ma, ma) * dot(b, b, mb, mb)).sqrt()
}

/// Momentum of component `c` in cells of `edge`, in `dims` of three axes.
fn momentum(p: &Phase, corner: f64, length: f64, edge: f64, c: usize, flat: bool) -> Vec<f64> {
    let n = (length / edge).round() as usize;
    let mut grid = vec![0.0; if flat { n * n } else { n * n * n }];
    for (x, v) in p {
        let cell = |k: usize| ((x[k] - corner) / length).rem_euclid(1.0);
        let at = |k: usize| ((cell(k) * n as f64) as usize).min(n - 1);
        let (a, b) = ((c + 1) % 3, (c + 2) % 3);
        let place = if flat { at(a) * n + at(b) } else { (at(0) * n + at(1)) * n + at(2) };
        grid[place] += v[c];
    }
    grid
}

fn main() {
    let args: Vec<String> = std::env::args().collect();
    let folder = Path::new(&args[1]);
    let bytes = std::fs::read(&args[2]).unwrap();
    let info = codec::read_info(&bytes, "model").unwrap();
    let start = std::time::Instant::now();
    let model = codec::decode(&bytes, "model").unwrap();
    println!("decoded in {:.3} s", start.elapsed().as_secs_f64());
    for (field, bytes) in info.metadata.fields.iter().zip(info.fields.iter().map(|f| f.bytes)) {
        println!(
            "{}: {} bytes, {:.3} a Gaussian of {}",
            field.name,
            bytes,
            bytes as f64 / info.gaussians() as f64,
            info.gaussians()
        );
    }
    let [x, y, z, u, v, w] = ["xx.f32", "yy.f32", "zz.f32", "vx.f32", "vy.f32", "vz.f32"].map(|n| column(folder, n));
    let truth: Phase =
        (0..x.len()).map(|i| ([x[i], y[i], z[i]].map(f64::from), [u[i], v[i], w[i]].map(f64::from))).collect();
    let cell = info.metadata.cell.unwrap();
    let (corner, length) = (cell.origin[0], cell.vectors[0][0]);
    let mut ours = Phase::new();
    for b in model.blocks() {
        ours.extend(drawn(&b.gaussians, b.gaussians.fields.get("velocity").unwrap(), 3, false));
    }
    let rms = |p: &Phase| {
        (p.iter().map(|(_, v)| v.iter().map(|v| v * v).sum::<f64>()).sum::<f64>() / p.len() as f64 / 3.0).sqrt()
    };
    println!("rms velocity: particles {:.2}, means drawn {:.2}", rms(&truth), rms(&ours));
    for edge in [2.0, 1.0, 0.5] {
        let c: Vec<String> = (0..3)
            .map(|c| {
                format!(
                    "{:.4}",
                    correlation(
                        &momentum(&truth, corner, length, edge, c, false),
                        &momentum(&ours, corner, length, edge, c, false)
                    )
                )
            })
            .collect();
        println!("momentum in cells of {edge}: {}", c.join(" "));
    }
    let c: Vec<String> = (0..3)
        .map(|c| {
            format!(
                "{:.4}",
                correlation(
                    &momentum(&truth, corner, length, 0.25, c, true),
                    &momentum(&ours, corner, length, 0.25, c, true)
                )
            )
        })
        .collect();
    println!("line-of-sight momentum map at 0.25: {}", c.join(" "));
    let mut all = Phase::new();
    for b in model.blocks() {
        all.extend(drawn(&b.gaussians, b.gaussians.fields.get("velocity").unwrap(), 3, true));
    }
    println!("rms velocity with spread: {:.2}", rms(&all));
    let haloes = std::fs::read_to_string(folder.join("haloes.csv")).unwrap_or_default();
    println!("{}", haloes.lines().next().unwrap_or_default());
}
