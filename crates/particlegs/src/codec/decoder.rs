//! A block's bytes to Gaussians.

use super::exact::{exp, exp_twice};
use super::header::{BlockHeader, GAUSSIANS_A_BYTE, HEADER_BYTES};
use super::rans::Player;
use super::sums::{rescale, whole_counts};
use super::walk::{Nothing, OutOfRange, walk};
use crate::model::{Block, Mixture};
use rayon::prelude::*;

/// Whole numbers of a block, in columns.
#[derive(Default)]
struct Columns {
    radius: Vec<f64>,
    factor: Vec<f64>,
    m: Vec<i32>,
    w: Vec<i32>,
    shape: Vec<[i32; 5]>,
    mean: [Vec<f64>; 3],
}

/// Shape numbers beyond this are no Gaussian's.
const LARGEST_SHAPE: f64 = 32.0;
/// Gaussians that one task makes covariances of.
const CHUNK: usize = 4096;

/// Decodes a block; the text says what is wrong with it.
pub(crate) fn block(bytes: &[u8]) -> Result<Block, String> {
    let header = BlockHeader::read(bytes)?;
    let columns = numbers(&header, bytes)?;
    let cov = covariances(&header, &columns)?;
    let mut count: Vec<f64> = columns.m.par_iter().map(|&m| exp(header.log_count(m))).collect();
    whole_counts(&mut count, header.count);
    let mass = header.weighted.then(|| {
        let mut mass: Vec<f64> = count.iter().zip(&columns.w).map(|(c, &w)| c * exp(header.log_weight(w))).collect();
        rescale(&mut mass, header.mass);
        mass
    });
    let gaussians = Mixture { mean: columns.mean, cov, count, mass };
    Ok(Block { bounds: header.bounds, count: header.count, mass: header.mass, gaussians })
}

/// Reads the stream.
fn numbers(header: &BlockHeader, bytes: &[u8]) -> Result<Columns, String> {
    let n = header.gaussians as usize;
    let least = u64::from(header.gaussians).div_ceil(GAUSSIANS_A_BYTE) as usize;
    let stream = &bytes[HEADER_BYTES..];
    let mut player = Player::new(stream).ok_or("the stream has no start")?;
    let extent = header.bounds.extent();
    let mut out = Columns {
        radius: Vec::with_capacity(n),
        factor: Vec::with_capacity(n),
        m: Vec::with_capacity(n),
        w: Vec::with_capacity(if header.weighted { n } else { 0 }),
        shape: Vec::with_capacity(n),
        mean: std::array::from_fn(|_| Vec::with_capacity(n)),
    };
    let walked = walk(&mut player, header, &mut Nothing, |leaf| {
        out.radius.push(leaf.radius);
        out.factor.push(leaf.factor);
        out.m.push(leaf.m);
        if header.weighted {
            out.w.push(leaf.w);
        }
        out.shape.push(leaf.shape);
        for k in 0..3 {
            let f = leaf.place[k] as f64 * 0.25 / leaf.levels[k] as f64;
            out.mean[k].push(leaf.cell.point(&header.bounds, extent, k, f));
        }
        Ok(())
    });
    if let Err(OutOfRange) = walked {
        return Err("a number is out of range".into());
    }
    if player.exhausted() {
        return Err("the stream ends too soon".into());
    }
    let padding = player.rest();
    if !player.finished() || (!padding.is_empty() && (bytes.len() != least || padding.iter().any(|&b| b != 0))) {
        return Err("the stream goes on after its last Gaussian".into());
    }
    Ok(out)
}

/// radius^2 exp(2 S), in parallel over fixed chunks.
fn covariances(header: &BlockHeader, columns: &Columns) -> Result<[Vec<f64>; 6], String> {
    let n = columns.m.len();
    let mut cov: [Vec<f64>; 6] = std::array::from_fn(|_| vec![0.0; n]);
    let [a, b, c, d, e, f] = &mut cov;
    let chunks = a
        .par_chunks_mut(CHUNK)
        .zip(b.par_chunks_mut(CHUNK))
        .zip(c.par_chunks_mut(CHUNK))
        .zip(d.par_chunks_mut(CHUNK))
        .zip(e.par_chunks_mut(CHUNK))
        .zip(f.par_chunks_mut(CHUNK));
    let good = chunks
        .enumerate()
        .map(|(index, (((((a, b), c), d), e), f))| {
            let mut good = true;
            for i in 0..a.len() {
                let j = index * CHUNK + i;
                let step = 0.5 * f64::from(header.steps[3]) * columns.factor[j];
                let five = columns.shape[j].map(|s| f64::from(s) * step);
                let within = five.iter().all(|s| s.abs() <= LARGEST_SHAPE);
                let shape = exp_twice(if within { five } else { [0.0; 5] });
                let size = columns.radius[j] * columns.radius[j];
                let v = shape.0.map(|s| s * size);
                good &= within && v.iter().all(|s| s.is_finite());
                (a[i], b[i], c[i], d[i], e[i], f[i]) = (v[0], v[1], v[2], v[3], v[4], v[5]);
            }
            good
        })
        .reduce(|| true, |p, q| p && q);
    if good { Ok(cov) } else { Err("a covariance is out of range".into()) }
}
