//! All Gaussians that a picture shows, sorted by depth, in bins.

use super::bin::{Bin, TileRange, Tiles};
use super::eye::Eye;
use super::project::{GreyCameraGaussian, Splat, project};
use crate::context::Context;
use crate::{Error, Result, parallel};

/// Gaussians in one step of parallel work, at least.
const RUN: usize = 4096;

/// Runs of bins, at most: each holds a number for every tile.
const MOST_BINS: usize = 64;

/// Thresholds of the parts that are left out of a picture (3DGS, `renderCUDA`).
#[derive(Clone, Copy, Debug)]
pub struct CutOffs {
    /// Smaller alphas are not drawn.
    pub least_alpha: f32,
    /// Larger alphas become this.
    pub most_alpha: f32,
    /// A pixel is done where its transmittance would fall below.
    pub least_transmittance: f32,
}

impl CutOffs {
    /// As published.
    pub const PUBLISHED: CutOffs = CutOffs { least_alpha: 1.0 / 255.0, most_alpha: 0.99, least_transmittance: 1e-4 };
}

/// Gaussians on the picture, nearest first.
pub struct Plan {
    /// Their footprints.
    pub splats: Vec<Splat>,
    /// Their numbers among all.
    pub indices: Vec<u32>,
    /// Runs of footprints, in their order.
    pub bins: Vec<Bin>,
    /// Footprints in a run.
    pub run: usize,
    /// The picture's tiles.
    pub tiles: Tiles,
    /// Thresholds of the parts that are left out.
    pub cut: CutOffs,
}

impl Plan {
    /// Of Gaussians `0..n`. Those of equal depth are drawn in the order of their numbers.
    pub fn new(
        eye: &Eye,
        n: usize,
        gaussian: impl Fn(usize) -> Option<GreyCameraGaussian> + Sync,
        cut: CutOffs,
        context: &Context<'_>,
    ) -> Result<Plan> {
        let tiles = Tiles::new(eye.size);
        let see = |i: usize| {
            let p = project(eye, &gaussian(i)?, cut.least_alpha.into())?;
            let touched = tiles.touched(eye.size, &p)?;
            // Depths are positive: their bits stand in their order.
            let key = u64::from(p.depth.to_bits()) << 32 | i as u64;
            Some((key, p.splat, touched))
        };
        let runs = parallel::try_map_range(n.div_ceil(RUN), |c| {
            context.check()?;
            Ok((c * RUN..n.min((c + 1) * RUN)).filter_map(see).collect::<Vec<_>>())
        })?;
        let seen: Vec<(u64, Splat, TileRange)> = runs.into_iter().flatten().collect();
        let mut order: Vec<(u64, u32)> =
            seen.iter().enumerate().map(|(place, (key, ..))| (*key, place as u32)).collect();
        parallel::sort_keys(&mut order);
        let run = RUN.max(seen.len().div_ceil(MOST_BINS));
        let entries: u64 = seen.iter().map(|(.., touched)| touched.number()).sum();
        let places = (seen.len().div_ceil(run) * (tiles.number() + 1)) as u64;
        // Bins count with 32 bits.
        let most = u64::from(u32::MAX);
        if entries > most {
            return Err(Error::Memory { what: "a picture".into(), need_bytes: 4 * entries, have_bytes: 4 * most });
        }
        context.require_memory("a picture", 4 * (entries + 2 * places))?;
        let touched: Vec<TileRange> = order.iter().map(|(_, place)| seen[*place as usize].2).collect();
        let bins = parallel::map(touched.chunks(run).enumerate(), |(c, t)| Bin::new(&tiles, c * run, t));
        Ok(Plan {
            splats: order.iter().map(|(_, place)| seen[*place as usize].1).collect(),
            indices: order.iter().map(|(key, _)| *key as u32).collect(),
            bins,
            run,
            tiles,
            cut,
        })
    }

    /// Numbers of footprints that touch a tile, nearest first.
    pub fn in_tile(&self, tile: usize) -> impl Iterator<Item = u32> + '_ {
        self.bins.iter().flat_map(move |b| b.in_tile(tile).iter().copied())
    }
}
