//! What else a certificate may hold, each where it was measured.

use super::{Limit, PictureScore, Reached};
use crate::space::Bounds;

/// Sizes of cells that densities are compared in.
pub const CELL_SIZES: usize = 3;
/// Bands of wave numbers of [`HeldOut::transfer`]; they end at these shares of its largest wave number.
pub const BANDS: [f64; 7] = [1.0 / 32.0, 1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 3.0 / 4.0, 1.0];
/// Classes of group sizes: they begin at so many particles.
pub const GROUP_CLASSES: [u64; 3] = [20, 50, 100];
/// Layers of [`MassPower`] at most: the first of the file.
pub const POWER_LAYERS: usize = 8;
/// Particles up to which a snapshot's distances and groups are those of all; of larger ones those of a region ([`Sample`]).
pub const SAMPLED_ABOVE: u64 = 3 << 20;

/// Radii that pictures are measured at, in default radii: half of it, itself, and the reference pictures' large one.
pub const PICTURE_RADII: [f64; 3] = [0.5, 1.0, 6.0];
/// Opacities that pictures are measured at, in default opacities; 1 at most.
pub const PICTURE_OPACITIES: [f64; 2] = [1.0, 10.0];
/// Every radius at every opacity, and views from close up.
pub const PICTURE_SETTINGS: usize = PICTURE_RADII.len() * PICTURE_OPACITIES.len() + 1;

/// Figures beside a certificate's first; since version 1.5 of files.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Measures {
    /// Densities in cells of three sizes, the smallest first.
    pub densities: Option<[CellDensity; CELL_SIZES]>,
    /// Distances to the nearest neighbour.
    pub spacing: Option<Spacing>,
    /// Of particles that the fit has not seen.
    pub held_out: Option<HeldOut>,
    /// Groups matched by position, by class of size.
    pub groups: Option<[GroupClass; GROUP_CLASSES.len()]>,
    /// Pictures at other radii and opacities, and from close up; since version 1.6.
    pub pictures: Option<Pictures>,
    /// The particles' own best rival to the model; since version 1.6.
    pub subset: Option<Subset>,
    /// P(k) of mass, where particles' masses are known and differ or there are several layers; since version 1.6.
    pub mass_power: Option<MassPower>,
    /// What distances, groups and halves are of where the snapshot is too large for all; since version 1.6.
    pub sample: Option<Sample>,
    /// Parts that the certificate was added up of, where no process had all particles: ParaView's pictures are then not
    /// measured. Since version 1.6.
    pub blocks: Option<u32>,
    /// What was asked for, and what the file reached; since version 1.6.
    pub goal: Option<Reached>,
}

/// A region that holds all the particles it has: groups and distances are found in it as in the whole.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Sample {
    /// Particles in it.
    pub particles: u64,
    /// Where it lies, world units.
    pub bounds: Bounds,
}

/// P(k) of mass: of the mixture itself against that of the particles, on the grid and up to the wave number of the
/// certificate's other spectra.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MassPower {
    /// All layers together.
    pub whole: PowerAgreement,
    /// Each layer on its own, in the file's order; none where there is but one.
    pub layers: [Option<PowerAgreement>; POWER_LAYERS],
}

/// How far one P(k) is another's.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PowerAgreement {
    /// Largest |P / P(particles) - 1| of any shell in which the particles have power above the scatter of their shot
    /// noise; `None` where there is no such shell.
    pub largest_deviation: Option<f64>,
    /// It is within 1 % in every such shell up to this wave number.
    pub within_1_percent_to: Limit,
}

/// Pictures at several radii and opacities.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Pictures {
    /// Their size.
    pub width: u16,
    /// Their size.
    pub height: u16,
    /// Radius by radius, opacity by opacity, from the three orbits; then from close up.
    pub settings: [PicturesAt; PICTURE_SETTINGS],
}

/// Pictures at one radius and opacity, of three views.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PicturesAt {
    /// Particle radius, in default radii.
    pub radius: f64,
    /// Opacity.
    pub opacity: f64,
    /// Where the views are from: the orbits, or within the particles.
    pub close: bool,
    /// Against `paraview`.
    pub paraview: LookPictures,
    /// Against `expected`.
    pub expected: LookPictures,
}

/// The scores of three views in one look.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct LookPictures {
    /// Which view has the lowest masked PSNR of the model: far, mid, near, or number 0, 1, 2 of those from close up.
    pub worst_view: u8,
    /// Means of the views' decibels and SSIM; views without a value are left out.
    pub mean: PictureScores,
    /// The worst view's.
    pub worst: PictureScores,
}

/// A model's picture and those that it is compared with.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct PictureScores {
    /// The model's.
    pub model: PictureScore,
    /// All particles', without sampling noise.
    pub noise_free: PictureScore,
    /// An empty one.
    pub all_black: PictureScore,
    /// As many particles spread evenly over the box.
    pub uniform_box: PictureScore,
    /// The subset of [`Subset`]; `None` where there is none.
    pub subset: Option<PictureScore>,
}

/// Particles chosen at random, coded to the bytes of the model's file and drawn larger: what the same bytes show
/// without any model.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Subset {
    /// Particles kept.
    pub kept: u64,
    /// Bytes that their places take.
    pub bytes: u64,
    /// Scores at the certificate's views, far, mid, near; each in `paraview`, `paraview-no-fxaa`, `expected`. A quick
    /// certificate has the last alone.
    pub orbits: [[Option<PictureScore>; 3]; 3],
}

/// A model's density against its particles' in cells of one size, and a uniform density's error.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct CellDensity {
    /// Edge of a cell, world units (the longest of the three).
    pub edge: f64,
    /// Particles in a cell, on average.
    pub particles: f64,
    /// Pearson's coefficient over the cells.
    pub correlation: f64,
    /// Mean absolute error of the density contrast.
    pub mean_absolute_error: f64,
    /// That of a uniform density.
    pub uniform_mean_absolute_error: f64,
}

/// Distances to the nearest neighbour, of the particles and of as many drawn from the model.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Spacing {
    /// Their median among the particles, world units.
    pub median: f64,
    /// Their 5th percentile over the median: 0.42 of particles at random, 1 of a lattice.
    pub regularity: f64,
    /// The median among those drawn.
    pub drawn_median: f64,
    /// And their 5th percentile over it.
    pub drawn_regularity: f64,
}

/// What models of halves of the particles, made by the same method with as many particles a Gaussian, say of the
/// other halves: of the method at these settings, and not of the file's own Gaussians.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct HeldOut {
    /// Mean log2(p / uniform) of particles, of both halves.
    pub bits: f64,
    /// Its standard error, by the sample's scatter and the halves' difference, whichever is larger.
    pub error: f64,
    /// Bits that an adaptive kernel estimate on all particles of a half gives those of the other (cubic spline to the 16th
    /// neighbour).
    pub kernel_bits: f64,
    /// Volume that bits are relative to, world units cubed.
    pub volume: f64,
    /// Largest wave number, one over the unit of length.
    pub k_max: f64,
    /// P(model of A, B) / P(A, B) in bands of k that end at shares [`BANDS`] of `k_max`.
    pub transfer: [Transfer; BANDS.len()],
}

/// A transfer function in one band of wave numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Transfer {
    /// Mean of both halves' minus 1; `None` where the band holds no modes, or no power above its noise.
    pub deviation: Option<f64>,
    /// Half of the halves' difference.
    pub scatter: f64,
}

/// Friends-of-friends groups of one class of sizes: those of the particles against those of several draws from the model,
/// matched by position. A share is `None` where there are no groups.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct GroupClass {
    /// Groups of the particles.
    pub groups: u64,
    /// Their number among drawn particles over that, mean of the draws.
    pub number: Option<f64>,
    /// Standard deviation of that over the draws.
    pub number_scatter: f64,
    /// Share of the groups that have a counterpart of any size.
    pub completeness: Option<f64>,
    /// Share of the drawn groups of this class that have one.
    pub purity: Option<f64>,
    /// Median of a counterpart's particles over the group's.
    pub mass: Option<f64>,
    /// Half the distance of the 16th and 84th percentile of that.
    pub mass_scatter: f64,
}

impl HeldOut {
    /// The wave number up to which every band's deviation, less its scatter, is within `share`.
    pub fn within(&self, share: f64) -> Option<f64> {
        let good = |t: &&Transfer| t.deviation.is_none_or(|d| d.abs() - t.scatter <= share);
        let bands = self.transfer.iter().take_while(good).count();
        let measured = self.transfer[..bands].iter().rposition(|t| t.deviation.is_some())?;
        Some(BANDS[measured] * self.k_max)
    }
}
