//! Models to write, and files to damage. Not every test file needs all of it.
#![allow(dead_code)]

use particlegs_compress::Options;
use particlegs_compress::job::{JobFolder, Task};
use particlegs_core::codec::{Encoder, Precision};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3};
use particlegs_core::model::{
    Block, CellDensity, Certificate, Cosmology, DensityMetrics, DrawnDensity, Epoch, LawKind, Layer, Limit, Mass,
    Metadata, Mixture, Model, OrbitMetrics, PictureScore, PictureScores, Recipe, ScienceMetrics, ScienceSubject,
    Spacing, Subset, Units, ViewMetrics,
};
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Error, codec};
use particlegs_particles::{LayeredParticles, Particles};
use std::ops::Range;
use std::path::Path;

/// A mixture of `n` Gaussians in a box of `scale` at `origin`.
pub fn mixture(n: usize, seed: u64, origin: f64, scale: f64, weighted: bool) -> Mixture {
    let mut m = Mixture::new(weighted);
    for i in 0..n {
        let mut r = Random::new(seed, 1, i as u64);
        // Clustered places, sizes over three decades, all shapes.
        let cluster = Random::new(seed, 2, i as u64 / 7).uniform();
        let mean = std::array::from_fn(|_| origin + scale * (cluster + 0.05 * r.normal()));
        let size = scale * 1e-3 * (1.5 * r.normal()).exp();
        let v: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| size * r.normal()));
        let cov = Sym3::outer(v[0]).add(&Sym3::outer(v[1])).add(&Sym3::outer(v[2]));
        let count = (3.0 + r.normal()).exp();
        m.push(mean, cov, count, count * (0.3 * r.normal()).exp());
    }
    m
}

pub fn block(gaussians: Mixture) -> Block {
    let mut bounds = Bounds::empty();
    (0..gaussians.len()).for_each(|i| bounds.include(gaussians.mean_of(i)));
    let count = gaussians.count.iter().sum::<f64>().round().max(1.0);
    let mass = gaussians.masses().map_or(count, |m| m.iter().sum());
    Block { bounds, count: count as u64, mass, gaussians }
}

pub fn metadata(blocks: &[Block]) -> Metadata {
    let bounds = blocks.iter().fold(Bounds::empty(), |b, x| b.union(&x.bounds));
    let count = blocks.iter().map(|b| b.count).sum();
    Metadata {
        mass: blocks.iter().map(|b| b.mass).sum(),
        cell: Some(Cell::orthogonal([50.0; 3])),
        source: "nbody".into(),
        source_hash: [7; 32],
        units: Units::new(Some("Mpc/h"), None, Some(true)),
        cosmology: Cosmology { hubble: Some(0.68), ..Cosmology::default() },
        epoch: Epoch { scale_factor: Some(1.0), ..Epoch::default() },
        recipe: Recipe { seed: 42, ..Recipe::default() },
        ..Metadata::new(LawKind::OpticalDepth, count, bounds)
    }
}

/// Scores of a quick certificate; values that the file holds.
pub fn certificate() -> Certificate {
    let score = |masked_psnr, ssim| Some(PictureScore { masked_psnr, ssim });
    let look = PictureScores {
        model: score(Some(30.25), 24_575.0 / 32_767.0),
        noise_free: score(None, 1.0),
        all_black: score(Some(12.5), 0.0),
        uniform_box: score(Some(16.25), 1.0),
        ..PictureScores::default()
    };
    let expected = PictureScores { subset: score(Some(20.25), 0.0), ..look };
    let orbit = OrbitMetrics { paraview: look, paraview_no_fxaa: look, expected };
    let (correlation, mean_absolute_error) = (0.5, 0.25);
    let density =
        |(edge, particles)| CellDensity { edge, particles, correlation, mean_absolute_error, ..CellDensity::default() };
    Certificate {
        views: ViewMetrics { width: 1920, height: 1080, seed: 42, orbits: [orbit; 3] },
        density: DensityMetrics { cells: 50, correlation, mean_absolute_error, ..DensityMetrics::default() },
        densities: Some([(0.8, 0.015_625), (1.6, 0.125), (3.2, 1.0)].map(density)),
        science: Some(science()),
        spacing: Some(Spacing { median: 0.125, drawn_median: 0.25, ..Spacing::default() }),
        subset: Some(Subset { kept: 1, bytes: 100 }),
        ..Certificate::default()
    }
}

/// Limits in every state, values that f32 holds.
pub fn science() -> ScienceMetrics {
    ScienceMetrics {
        of: ScienceSubject::DrawnParticles,
        spectrum_grid: 256,
        k_max: 0.125,
        power_within_1_percent_to: Limit::Never,
        power_within_5_percent_to: Limit::At(0.125),
        groups_within_10_percent_from: Limit::At(57.0),
        ..ScienceMetrics::default()
    }
}

/// Each decoded Gaussian's original: the one whose mean is nearest.
pub fn partner(m: &Mixture, mean: [f64; 3]) -> usize {
    let distance = |i: usize| (0..3).map(|k| (m.mean[k][i] - mean[k]).powi(2)).sum::<f64>();
    (0..m.len()).min_by(|&a, &b| distance(a).total_cmp(&distance(b))).unwrap()
}

/// The bytes of a model file.
pub fn encoded(m: &Model) -> Vec<u8> {
    codec::encode(m, &Precision::BALANCED).unwrap()
}

/// The bytes of a block on its own.
pub fn coded(b: &Block) -> Vec<u8> {
    Encoder::new(b).unwrap().encode(&Precision::BALANCED)
}

/// Bit-exact: shortest decimals that come back.
pub fn table(columns: &[&Vec<f64>]) -> String {
    serde_json::to_string(columns).unwrap().replace("],", "],\n")
}

/// Every cut of a file is refused as corrupt.
pub fn check_cuts(bytes: &[u8]) {
    for n in 0..bytes.len() {
        assert!(matches!(codec::decode(&bytes[..n], "m"), Err(Error::Corrupt { .. })), "at {n}");
    }
}

/// Each byte changed to each of what `changes` makes of it is refused by the decoder and by the reader of heads.
pub fn check_bytes<const N: usize>(bytes: &[u8], changes: impl Fn(u8) -> [u8; N]) {
    for i in 0..bytes.len() {
        for v in changes(bytes[i]).into_iter().chain([0, 255]).filter(|&v| v != bytes[i]) {
            let mut bad = bytes.to_vec();
            bad[i] = v;
            assert!(codec::decode(&bad, "m").is_err() && codec::read_info(&bad, "m").is_err(), "byte {i} as {v}");
        }
    }
}

/// Files with one bit of `bits` changed, then `random` files with one to six bytes at random; their checksums are
/// right.
pub fn damaged(bytes: &[u8], seed: u64, bits: impl Iterator<Item = usize>, random: u64, mut check: impl FnMut(&[u8])) {
    let mut damage = |change: &dyn Fn(&mut [u8])| {
        let mut bad = bytes.to_vec();
        change(&mut bad);
        reseal(&mut bad);
        check(&bad);
    };
    bits.for_each(|bit| damage(&|bad| bad[bit / 8] ^= 1 << (bit % 8)));
    for i in 0..random {
        damage(&|bad| {
            let mut r = Random::new(seed, 4, i);
            for _ in 0..1 + r.bits() % 6 {
                let at = (r.bits() % bad.len() as u64) as usize;
                bad[at] = r.bits() as u8;
            }
        });
    }
}

/// A job that is planned in `folder`, and whose blocks cannot open the snapshot again; the seed is 3.
pub fn planned(particles: &Particles, folder: &Path, options: Options) -> JobFolder {
    let options = Options { seed: 3, ..options };
    let task = Task { options: &options, snapshot: "a sample".into(), place: "here", replace: false, reopened: false };
    JobFolder::plan(LayeredParticles::from_particles(particles), &task, folder, &Context::SILENT).unwrap()
}

/// A layer of some particles whose masses are not known.
pub fn layer(name: &str, particles: Range<usize>) -> Layer<Range<usize>> {
    Layer { name: name.into(), mass: Mass::Unknown, content: particles }
}

/// The result of `work` with so many threads.
pub fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    rayon_core::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(work)
}

/// The checksums of a file made right again, so that what is behind them meets the damage.
pub fn reseal(file: &mut [u8]) {
    let sum = crc32fast::hash(&file[..20]);
    file[20..24].copy_from_slice(&sum.to_le_bytes());
    let mut at = 24;
    while at + 16 <= file.len() {
        let length = u64::from_le_bytes(file[at + 4..at + 12].try_into().unwrap());
        let Some(end) = usize::try_from(length).ok().and_then(|l| l.checked_add(at + 16)).filter(|&e| e <= file.len())
        else {
            return;
        };
        let mut h = crc32fast::Hasher::new();
        h.update(&file[at..at + 12]);
        h.update(&file[at + 16..end]);
        let sum = h.finalize();
        file[at + 12..at + 16].copy_from_slice(&sum.to_le_bytes());
        at = end;
    }
}

/// Adds the group of a certificate that files of version 1.0 lack.
pub fn add_drawn_densities(m: &mut Model) {
    let drawn = DrawnDensity { correlation: 0.5, mean_absolute_error: 0.75 };
    m.certificate.iter_mut().for_each(|c| c.drawn_densities = Some([drawn; 3]));
}
