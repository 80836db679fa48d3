//! The figures of a certificate, group by group. A figure is added here, in a line of its record; a group also in
//! [`Certificate`](super::Certificate).

use super::metric::{MetricField, MetricVisitor, record};
use super::{Limit, Metric, MetricUnit, MetricValue, PictureScore, Tolerance};
use crate::model::Coding::{F32, F64, Name, OptionalF32, Score, UpTo, Whole};
use crate::space::Bounds;

/// Sizes of cells that densities are compared in.
pub const CELL_SIZES: usize = 3;
pub(super) const CELL_NAMES: [&str; CELL_SIZES] = ["small cells", "twice as long", "four times"];
/// Bands of wave numbers of [`CrossValidation::transfer`]; they end at these shares of its largest wave number.
pub const BANDS: [f64; 7] = [1.0 / 32.0, 1.0 / 16.0, 1.0 / 8.0, 1.0 / 4.0, 1.0 / 2.0, 3.0 / 4.0, 1.0];
const BAND_NAMES: [&str; BANDS.len()] = [
    "P(k) to 1/32 k",
    "P(k) to 1/16 k",
    "P(k) to 1/8 k",
    "P(k) to 1/4 k",
    "P(k) to 1/2 k",
    "P(k) to 3/4 k",
    "P(k) to k",
];
/// Classes of group sizes: they begin at so many particles.
pub const GROUP_CLASSES: [u64; 3] = [20, 50, 100];
pub(super) const CLASS_NAMES: [&str; GROUP_CLASSES.len()] =
    ["20 to 49 particles", "50 to 99 particles", "100 and more"];
/// Layers of [`MassPower`] at most: the first of the file.
pub const POWER_LAYERS: usize = 8;
const LAYER_NAMES: [&str; POWER_LAYERS] =
    ["layer 1", "layer 2", "layer 3", "layer 4", "layer 5", "layer 6", "layer 7", "layer 8"];
/// Fields of [`FieldAgreements`] at most: the first of the file.
pub const CERTIFIED_FIELDS: usize = 8;
const FIELD_NAMES: [&str; CERTIFIED_FIELDS] =
    ["field 1", "field 2", "field 3", "field 4", "field 5", "field 6", "field 7", "field 8"];
const RATIO_NAMES: [&str; POWER_LAYERS - 1] = {
    let [_, a, b, c, d, e, f, g] = LAYER_NAMES;
    [a, b, c, d, e, f, g]
};
/// Particles up to which a snapshot's distances and groups are those of all; of larger ones those of a region
/// ([`Sample`]).
pub const SAMPLED_ABOVE: u64 = 3 << 20;

/// Radii that pictures are measured at, in default radii: half of it, itself, and the reference pictures' large one.
pub const PICTURE_RADII: [f64; 3] = [0.5, 1.0, 6.0];
/// Opacities that pictures are measured at, in default opacities; 1 at most.
pub const PICTURE_OPACITIES: [f64; 2] = [1.0, 10.0];
/// Every radius at every opacity, and views from close up.
pub const PICTURE_SETTINGS: usize = PICTURE_RADII.len() * PICTURE_OPACITIES.len() + 1;
const SETTING_NAMES: [&str; PICTURE_SETTINGS] = ["r/2 a", "r/2 10a", "r a", "r 10a", "6r a", "6r 10a", "close"];

const WIDTH: Metric = Metric::new("width", Whole(2)).range(1.0, f64::MAX);
const HEIGHT: Metric = Metric::new("height", Whole(2)).range(1.0, f64::MAX);
const CORRELATION: Metric = Metric::new("correlation", F32).range(-1.0, 1.0);
/// Densities of one mean differ by no more than both together.
const ERROR: Metric = Metric::new("mean error", F32).range(0.0, 2.01);
const UNIFORM_ERROR: Metric = Metric::new("error of a uniform one", F32).range(0.0, 2.01);
const K_MAX: Metric = Metric::new("largest wave number", F64).unit(MetricUnit::WaveNumber);

record! {
    /// A model's picture and those that it is compared with (docs/law/scores.md); `None` for those that were not drawn.
    PictureScores {
        #[serde(flatten)]
        model: Option<PictureScore> = Metric::new("model", Score);
        /// All particles', without sampling noise.
        noise_free: Option<PictureScore> = Metric::new("noise-free", Score);
        /// An empty one.
        all_black: Option<PictureScore> = Metric::new("all black", Score);
        /// As many particles spread evenly over the box.
        uniform_box: Option<PictureScore> = Metric::new("uniform box", Score);
        /// The subset of [`Subset`]; a quick certificate has it in `expected` alone.
        subset: Option<PictureScore> = Metric::new("subset", Score);
    }
}

record! {
    /// One frame of one orbit.
    OrbitMetrics {
        paraview: PictureScores = "paraview";
        paraview_no_fxaa: PictureScores = "paraview-no-fxaa";
        /// Against `expected` (whose noise-free picture is itself).
        expected: PictureScores = "expected";
    }
}

record! {
    /// Pictures at the default radius and opacity.
    ViewMetrics agrees by Self::pictures_are_of_their_size {
        width: u16 = WIDTH;
        height: u16 = HEIGHT;
        seed: u64 = Metric::new("seed", Whole(8));
        orbits: [OrbitMetrics; 3] = ["far", "mid", "near"];
    }
}

impl ViewMetrics {
    fn pictures_are_of_their_size(&self) -> Result<(), String> {
        // One level in one of all pixels is the smallest error there is.
        let pixels = f64::from(self.width) * f64::from(self.height);
        let most = 20.0 * libm::log10(255.0) + 10.0 * libm::log10(pixels) + 0.01;
        for orbit in &self.orbits {
            orbit.expected.are_of_the_noise_free()?;
            for s in [&orbit.paraview, &orbit.paraview_no_fxaa, &orbit.expected] {
                s.reach_at_most(most)?;
            }
        }
        Ok(())
    }
}

impl PictureScores {
    /// `expected` is the noise-free picture.
    fn are_of_the_noise_free(&self) -> Result<(), String> {
        match self.noise_free {
            Some(n) if n.masked_psnr.is_some() || n.ssim < 1.0 => {
                Err("a noise-free picture must match itself exactly".into())
            }
            _ => Ok(()),
        }
    }

    fn reach_at_most(&self, most: f64) -> Result<(), String> {
        let all = [self.model, self.noise_free, self.all_black, self.uniform_box, self.subset];
        match all.into_iter().flatten().filter_map(|s| s.masked_psnr).find(|v| *v > most) {
            Some(v) => Err(format!("{v:.2} dB is above {most:.2} dB, the limit for pictures that differ")),
            None => Ok(()),
        }
    }
}

record! {
    /// A model's density against its particles' on a grid. A uniform density has a correlation of 0; an empty one
    /// errs by 1.
    DensityMetrics {
        /// Cells along the longest extent.
        cells: u16 = Metric::new("cells", Whole(2)).range(1.0, f64::MAX);
        correlation: f64 = CORRELATION;
        /// Mean absolute error of the density contrast delta = rho / mean - 1.
        mean_absolute_error: f64 = ERROR;
        /// That of a uniform density: the mean of |delta|.
        uniform_mean_absolute_error: f64 = UNIFORM_ERROR;
    }
}

record! {
    /// A model's density against its particles' in cells of one size, and a uniform density's error.
    CellDensity {
        /// Edge of a cell, world units (the longest of the three).
        edge: f64 = Metric::new("edge", F64).range(f64::MIN_POSITIVE, f64::MAX).unit(MetricUnit::Length);
        particles: f64 = Metric::new("particles", F32).range(f32::MIN_POSITIVE as f64, f64::MAX);
        correlation: f64 = CORRELATION;
        mean_absolute_error: f64 = ERROR;
        uniform_mean_absolute_error: f64 = UNIFORM_ERROR;
    }
}

record! {
    /// The density of as many particles drawn from a model as the snapshot has, against the snapshot's, in cells of one size.
    DrawnDensity {
        correlation: f64 = CORRELATION;
        mean_absolute_error: f64 = ERROR;
    }
}

record! {
    /// P(k) of mass: of the mixture itself against that of the particles, on the grid and up to the wave number of the
    /// certificate's other spectra.
    MassPower {
        whole: PowerAgreement = "all layers";
        /// Each layer on its own, in the file's order; none where there is but one.
        layers: [Option<PowerAgreement>; POWER_LAYERS] = LAYER_NAMES;
    }
}

impl MassPower {
    /// Of so many layers; nothing is measured.
    pub fn new(layers: usize) -> MassPower {
        let layer_count = if layers > 1 { layers.min(POWER_LAYERS) } else { 0 };
        let mut power = MassPower::default();
        power.layers[..layer_count].fill(Some(PowerAgreement::default()));
        power
    }
}

record! {
    /// Agreement of one P(k) with another.
    PowerAgreement {
        /// Largest |P / P(particles) - 1| of any shell in which the particles have power above the scatter of their shot
        /// noise; `None` where there is no such shell.
        largest_deviation: Option<f64> = Metric::new("largest deviation", OptionalF32).unit(MetricUnit::Share);
        /// It is within 1 % in every such shell up to this wave number.
        within_1_percent_to: Limit = Metric::new("within 1 %", UpTo);
    }
}

record! {
    /// Ratios of layers' masses, from cell to cell: of species of one distribution they are the same everywhere.
    LayerRatios {
        /// Of the second layer and those after it, in the file's order, against the first.
        to_first: [Option<LayerRatio>; POWER_LAYERS - 1] = RATIO_NAMES;
    }
}

impl LayerRatios {
    /// Of so many layers, where there are several; nothing is measured.
    pub fn new(layers: usize) -> Option<LayerRatios> {
        let mut ratios = LayerRatios::default();
        let pairs = layers.checked_sub(1).filter(|n| *n > 0)?.min(ratios.to_first.len());
        ratios.to_first[..pairs].fill(Some(LayerRatio::default()));
        Some(ratios)
    }
}

record! {
    /// Agreement of fields that are gathered from a random half of the particles with the other half.
    FieldAgreements {
        /// In the file's order.
        each: [Option<FieldAgreement>; CERTIFIED_FIELDS] = FIELD_NAMES;
    }
}

record! {
    /// The means of a field in cells, of all components together; weighted by mass where the field is.
    FieldAgreement {
        /// Edge of a cell, world units (the longest of the three).
        edge: f64 = Metric::new("edge", F64).unit(MetricUnit::Length);
        /// Cells that hold particles of both halves; none where these are too few, or where means do not stand out of noise.
        cells: u32 = Metric::new("cells", Whole(4));
        /// Root mean square of the particles' means about that of all cells, without noise, in the field's unit.
        signal: f64 = Metric::new("signal", F32).tolerance(Tolerance::Relative(0.001));
        /// Root mean square of the difference of the model's means from them.
        error: f64 = Metric::new("error", F32).tolerance(Tolerance::Relative(0.001));
    }
}

impl FieldAgreement {
    /// The share of the means' variance that the model explains; `None` where it was not measured.
    pub fn explained(&self) -> Option<f64> {
        let missed = self.error / self.signal;
        (self.cells > 0 && self.signal > 0.0).then_some(1.0 - missed * missed)
    }
}

record! {
    /// The ratio of two layers' masses in cells that hold enough of both, as its logarithm to the base 10 (dex).
    LayerRatio {
        /// Edge of a cell, world units (the longest of the three): where the error stands out most.
        edge: f64 = Metric::new("edge", F64).unit(MetricUnit::Length);
        /// Such cells; none where the particles are too few.
        cells: u32 = Metric::new("cells", Whole(4));
        /// Standard deviation over the cells, of the model.
        scatter: f64 = Metric::new("scatter", F32);
        particles_scatter: f64 = Metric::new("the particles'", F32);
        /// Root mean square of the difference of the two.
        error: f64 = Metric::new("error", F32);
        /// The part that sampling adds to the particles'.
        noise: f64 = Metric::new("sampling noise", F32);
    }
}

impl LayerRatio {
    /// Whether the model differs by more than twice what sampling does.
    pub fn stands_out(&self) -> bool {
        self.error > 2.0 * self.noise
    }
}

record! {
    /// A region that holds all the particles it has: groups and distances are found in it as in the whole.
    Sample agrees by Self::corners_are_in_order {
        particles: u64 = Metric::new("particles", Whole(8)).range(1.0, f64::MAX);
        bounds: Bounds = ["from x", "from y", "from z", "to x", "to y", "to z"];
    }
}

impl Sample {
    fn corners_are_in_order(&self) -> Result<(), String> {
        let b = &self.bounds;
        if (0..3).all(|k| b.min[k] <= b.max[k]) { Ok(()) } else { Err("region corners are out of order".into()) }
    }
}

impl MetricField<[&'static str; 6]> for Bounds {
    fn visit<V: MetricVisitor>(&mut self, names: [&'static str; 6], v: &mut V) -> Result<(), V::Error> {
        self.min.iter_mut().chain(&mut self.max).zip(names).try_for_each(|(corner, name)| {
            corner.visit(Metric::new(name, F64).signed().unit(MetricUnit::Length).tolerance(Tolerance::Same), v)
        })
    }
}

record! {
    /// Distances to the nearest neighbour, of the particles and of as many drawn from the model.
    Spacing {
        /// Their median among the particles, world units.
        median: f64 = Metric::new("median", F64).unit(MetricUnit::Length);
        /// Their 5th percentile over the median: 0.42 of particles at random, 1 of a lattice.
        regularity: f64 = Metric::new("5th percentile over it", F32).range(0.0, 1.0);
        /// The median among those drawn.
        drawn_median: f64 = Metric::new("median of particles drawn", F64).unit(MetricUnit::Length);
        /// And their 5th percentile over it.
        drawn_regularity: f64 = Metric::new("5th percentile over that", F32).range(0.0, 1.0);
    }
}

record! {
    /// Friends-of-friends groups of one class of sizes: those of the particles against those of several draws from the
    /// model, matched by position. A share is `None` where there are no groups.
    GroupClass agrees by Self::shares_are_of_groups {
        groups: u64 = Metric::new("groups", Whole(4));
        /// Their number among drawn particles over that, mean of the draws.
        number: Option<f64> = Metric::new("number", OptionalF32).unit(MetricUnit::Share);
        /// Standard deviation of that over the draws.
        number_scatter: f64 = Metric::new("+- number", F32).unit(MetricUnit::Share);
        /// Share of the groups that have a counterpart of any size.
        completeness: Option<f64> = Metric::new("completeness", OptionalF32).range(0.0, 1.0).unit(MetricUnit::Share);
        /// Share of the drawn groups of this class that have one.
        purity: Option<f64> = Metric::new("purity", OptionalF32).range(0.0, 1.0).unit(MetricUnit::Share);
        /// Median of a counterpart's particles over the group's.
        mass: Option<f64> = Metric::new("median mass", OptionalF32).unit(MetricUnit::Share);
        /// Half the distance of the 16th and 84th percentile of that.
        mass_scatter: f64 = Metric::new("+- mass", F32).unit(MetricUnit::Share);
    }
}

impl GroupClass {
    fn shares_are_of_groups(&self) -> Result<(), String> {
        let some = self.groups > 0;
        // Of eight numbers the scatter is largest where all but one are 0.
        let scattered = self.number_scatter > 3.0 * self.number.unwrap_or(0.0);
        if [self.number, self.completeness].iter().any(|v| v.is_some() != some)
            || self.mass.is_some() != self.completeness.is_some_and(|c| c > 0.0)
            || scattered
            || self.mass.is_none() && self.mass_scatter > 0.0
        {
            return Err(format!("the shares of {} groups are impossible", self.groups));
        }
        Ok(())
    }
}

record! {
    /// Models of halves of the particles, made by the same method with as many particles a Gaussian, against the other
    /// halves: a test of the method at these settings, and not of the file's own Gaussians.
    CrossValidation {
        /// Mean log2(p / uniform) of particles, of both halves.
        bits: f64 = Metric::new("bits a particle above uniform", F32).signed();
        /// Its standard error, by the sample's scatter and the halves' difference, whichever is larger.
        error: f64 = Metric::new("standard error", F32);
        /// Bits that an adaptive kernel estimate on all particles of a half gives those of the other (cubic spline to the
        /// 16th neighbour).
        kernel_bits: f64 = Metric::new("bits of a kernel estimate on all particles", F32).signed();
        /// Volume that bits are relative to, world units cubed.
        volume: f64 = Metric::new("volume", F64).unit(MetricUnit::Volume);
        /// Largest wave number, one over the unit of length.
        k_max: f64 = K_MAX;
        /// P(model of A, B) / P(A, B) in bands of k that end at shares [`BANDS`] of `k_max`.
        transfer: [Transfer; BANDS.len()] = BAND_NAMES;
    }
}

record! {
    /// A transfer function in one band of wave numbers.
    Transfer agrees by Self::scatter_is_of_a_deviation {
        /// Mean of both halves' minus 1; `None` where the band holds no modes, or no power above its noise.
        deviation: Option<f64> = Metric::new("deviation", OptionalF32).signed().unit(MetricUnit::Share);
        /// Half of the halves' difference.
        scatter: f64 = Metric::new("scatter", F32).unit(MetricUnit::Share);
    }
}

impl Transfer {
    fn scatter_is_of_a_deviation(&self) -> Result<(), String> {
        match self.deviation {
            None if self.scatter > 0.0 => Err("there is a scatter but no deviation".into()),
            _ => Ok(()),
        }
    }
}

impl CrossValidation {
    /// The wave number up to which every band's deviation and its scatter together are within `share`.
    pub fn within(&self, share: f64) -> Option<f64> {
        let agrees = |t: &&Transfer| t.deviation.is_none_or(|d| d.abs() + t.scatter <= share);
        let bands = self.transfer.iter().take_while(agrees).count();
        let measured = self.transfer[..bands].iter().rposition(|t| t.deviation.is_some())?;
        Some(BANDS[measured] * self.k_max)
    }
}

record! {
    /// Particles chosen at random, coded to the bytes of the model's file and drawn larger: what the same bytes show
    /// without any model. Its scores stand beside the model's.
    Subset {
        kept: u64 = Metric::new("particles", Whole(8)).range(1.0, f64::MAX);
        bytes: u64 = Metric::new("bytes", Whole(8));
    }
}

record! {
    /// Pictures at several radii and opacities.
    Pictures {
        width: u16 = WIDTH;
        height: u16 = HEIGHT;
        /// Radius by radius, opacity by opacity, from the three orbits; then from close up.
        settings: [PictureSetting; PICTURE_SETTINGS] = SETTING_NAMES;
    }
}

record! {
    /// Pictures at one radius and opacity, of three views.
    PictureSetting agrees by Self::expected_is_noise_free {
        /// Particle radius, in default radii.
        radius: f64 = Metric::new("radius", F32).range(f32::MIN_POSITIVE as f64, f64::MAX);
        opacity: f64 = Metric::new("opacity", F32).range(f32::MIN_POSITIVE as f64, 1.0);
        /// Whether the views are from within the particles, and not from the orbits.
        close: bool = Metric::new("views", Name(&["orbits", "close up"]));
        paraview: LookSummary = "paraview";
        expected: LookSummary = "expected";
    }
}

impl PictureSetting {
    fn expected_is_noise_free(&self) -> Result<(), String> {
        [self.expected.mean, self.expected.worst].iter().try_for_each(PictureScores::are_of_the_noise_free)
    }
}

record! {
    /// The scores of three views in one look.
    LookSummary {
        /// The view with the lowest masked PSNR of the model: 0, 1, 2 for far, mid, near, or in order of those from
        /// close up.
        worst_view: u8 = Metric::new("worst view", Name(&["1 (far)", "2 (mid)", "3 (near)"]));
        /// Means of the views' decibels and SSIM; views without a value are left out.
        mean: PictureScores = "mean";
        worst: PictureScores = "worst";
    }
}

impl From<bool> for MetricValue {
    fn from(v: bool) -> Self {
        MetricValue::Count(u64::from(v))
    }
}

impl From<MetricValue> for bool {
    fn from(v: MetricValue) -> Self {
        v == MetricValue::Count(1)
    }
}
