//! A block's bytes to Gaussians.

use super::exact::exp;
use super::header::{BlockHeader, GAUSSIANS_A_BYTE};
use super::rans::Player;
use super::streams;
use super::sums::{opacity_of, rescale, whole_counts};
use super::tree::{Node, gaussians, pieces};
use super::walk::{Nothing, OutOfRange, trunk, walk};
use crate::memory::filled;
use crate::model::{AlphaBlend, Block, Law, MASS, Mixture};
use crate::progress::Progress;
use crate::{Error, parallel};

/// Where a segment's Gaussians go: mean, count and covariance.
struct Columns<'a> {
    mean: [&'a mut [f64]; 3],
    count: &'a mut [f64],
    cov: [&'a mut [f64]; 6],
    /// Mass a particle, relative, or grey level; empty without either.
    weight: &'a mut [f64],
}

/// Why a block cannot be decoded.
pub(crate) enum Fault {
    /// It contradicts the format.
    Corrupt(String),
    /// There is no memory for its Gaussians.
    Memory(Error),
}

impl From<String> for Fault {
    fn from(what: String) -> Self {
        Fault::Corrupt(what)
    }
}

impl From<&str> for Fault {
    fn from(what: &str) -> Self {
        Fault::Corrupt(what.into())
    }
}

impl From<Error> for Fault {
    fn from(error: Error) -> Self {
        Fault::Memory(error)
    }
}

impl Fault {
    /// As an error of the block that `corrupt` names.
    pub(crate) fn at(self, corrupt: impl FnOnce(String) -> Error) -> Error {
        match self {
            Fault::Corrupt(what) => corrupt(what),
            Fault::Memory(error) => error,
        }
    }
}

/// Bytes that the Gaussians of a block take: mean, covariance, count and, where they have them, mass or
/// opacity and grey level.
pub(crate) fn gaussian_bytes(header: &BlockHeader) -> u64 {
    let each = 80 + if header.shaded { 16 } else { 8 * u64::from(header.weighted) };
    u64::from(header.gaussians) * each
}

/// Bytes that decoding a block takes beside its Gaussians, at most: nodes of the segments at
/// work, and remainders of counts.
pub(crate) fn working_bytes(header: &BlockHeader) -> u64 {
    const A_GAUSSIAN: u64 = 32;
    const A_SEGMENT: u64 = 65_536 * 80;
    u64::from(header.gaussians) * A_GAUSSIAN + parallel::threads() as u64 * A_SEGMENT
}

/// What refuses memory for a block's columns is called.
const COLUMNS: &str = "decoding the model";

/// Decodes a block.
pub(crate) fn block(bytes: &[u8], progress: &dyn Progress) -> Result<Block, Fault> {
    let header = BlockHeader::read(bytes)?;
    let streams = streams::read(header.gaussians, &bytes[header.bytes()..])?;
    let nodes = match streams.trunk {
        None => vec![vec![Node::root(header.gaussians)]],
        Some(stream) => {
            let mut player = start(stream)?;
            let nodes = trunk(&mut player, &header, &mut Nothing).map_err(out_of_range)?;
            end(&player, true)?;
            nodes
        }
    };
    if nodes.len() != streams.segments.len() {
        return Err(format!("{} streams for {} segments", streams.segments.len(), nodes.len()).into());
    }
    let n = header.gaussians as usize;
    let column = |n: usize| filled(COLUMNS, 0.0f64, n, progress);
    let mut mean = [column(n)?, column(n)?, column(n)?];
    let mut cov = [column(n)?, column(n)?, column(n)?, column(n)?, column(n)?, column(n)?];
    let mut count = column(n)?;
    let mut weight = column(if header.has_w() { n } else { 0 })?;
    let columns = split(&nodes, &mut mean, &mut count, &mut cov, &mut weight);
    let work = nodes.iter().zip(&streams.segments).zip(columns);
    let whole = streams.trunk.is_some();
    let rests: Vec<Result<&[u8], String>> =
        parallel::map(work, |((nodes, stream), columns)| segment(&header, nodes, stream, whole, columns));
    let mut padding = streams.padding;
    for rest in rests {
        let rest = rest?;
        if !whole {
            padding = rest;
        }
    }
    let least = u64::from(header.gaussians).div_ceil(GAUSSIANS_A_BYTE) as usize;
    if !padding.is_empty() && (bytes.len() != least || padding.iter().any(|&b| b != 0)) {
        return Err("the block goes on after its last Gaussian".into());
    }
    // Opacities as coded; the counts in proportion to them are made whole.
    let law = if header.shaded {
        count.iter_mut().for_each(|c| *c = opacity_of(*c));
        let (opacity, grey) = (count.clone(), std::mem::take(&mut weight));
        Law::AlphaBlend(AlphaBlend { opacity, grey, vizmapper: None })
    } else {
        Law::OpticalDepth
    };
    whole_counts(&mut count, header.count);
    let mut named = crate::model::Columns::default();
    if header.weighted {
        let mut mass: Vec<f64> = count.iter().zip(&weight).map(|(c, w)| c * w).collect();
        rescale(&mut mass, header.mass);
        named.set(MASS, mass);
    }
    let gaussians = Mixture { mean, cov, count, columns: named, law };
    Ok(Block { bounds: header.bounds, count: header.count, mass: header.mass, gaussians })
}

fn start(stream: &[u8]) -> Result<Player<'_>, String> {
    Player::new(stream).ok_or_else(|| "a stream has no start".into())
}

/// Is a stream read to its end; `whole`: and nothing left of it?
fn end(player: &Player<'_>, whole: bool) -> Result<(), String> {
    if player.exhausted() {
        return Err("a stream ends too soon".into());
    }
    if !player.finished() || (whole && !player.rest().is_empty()) {
        return Err("a stream goes on after its last Gaussian".into());
    }
    Ok(())
}

fn out_of_range(_: OutOfRange) -> String {
    "a number is out of range".into()
}

/// The columns of each segment.
fn split<'a>(
    nodes: &[Vec<Node>],
    mean: &'a mut [Vec<f64>; 3],
    count: &'a mut [f64],
    cov: &'a mut [Vec<f64>; 6],
    weight: &'a mut [f64],
) -> Vec<Columns<'a>> {
    let part = |column: &'a mut [f64]| pieces(column, nodes.iter().map(|n| gaussians(n))).into_iter();
    let mut mean = mean.each_mut().map(|c| part(c));
    let mut cov = cov.each_mut().map(|c| part(c));
    let (mut count, mut weight) = (part(count), part(weight));
    let columns = |_: &Vec<Node>| Columns {
        mean: mean.each_mut().map(|c| c.next().unwrap_or_default()),
        count: count.next().unwrap_or_default(),
        cov: cov.each_mut().map(|c| c.next().unwrap_or_default()),
        weight: weight.next().unwrap_or_default(),
    };
    nodes.iter().map(columns).collect()
}

/// Reads a segment's stream; returns what is left of it.
fn segment<'a>(
    header: &BlockHeader,
    nodes: &[Node],
    stream: &'a [u8],
    whole: bool,
    out: Columns<'_>,
) -> Result<&'a [u8], String> {
    let mut player = start(stream)?;
    let extent = header.bounds.extent();
    let Columns { mean, count, cov, weight } = out;
    let [x, y, z] = mean;
    let mut finite = true;
    walk(&mut player, header, nodes, &mut Nothing, |i, leaf| {
        count[i] = leaf.count;
        for (k, mean) in [&mut *x, &mut *y, &mut *z].into_iter().enumerate() {
            let f = leaf.place[k] as f64 * 0.25 / leaf.levels[k] as f64;
            mean[i] = leaf.cell.point(&header.bounds, extent, k, f);
        }
        if header.has_w() {
            weight[i] = exp(header.log_weight(leaf.w));
        }
        let size = leaf.radius * leaf.radius;
        for k in 0..6 {
            cov[k][i] = leaf.unit.0[k] * size;
            finite &= cov[k][i].is_finite();
        }
    })
    .map_err(out_of_range)?;
    end(&player, whole)?;
    if finite { Ok(player.rest()) } else { Err("a covariance is out of range".into()) }
}
