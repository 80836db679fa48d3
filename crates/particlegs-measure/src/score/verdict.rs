//! Uses that a model is good for, in plain words: one judgement of a certificate, the same everywhere. The thresholds
//! and their reasons: docs/guide/certificate.md.

use super::science::MOST_DRAWN;
use particlegs_core::model::{
    CELL_SIZES, CellDensity, Certificate, DrawnDensity, FieldAgreement, GROUP_CLASSES, GroupClass, Limit, Metadata,
    PictureScore, PictureScores, PictureSetting, Quantity, decimals, per_length,
};
use serde::Serialize;

/// Pictures are good where the worst view's masked PSNR against the noise-free picture is this far above the
/// better trivial picture, dB: half of its error, three quarters of its variance. The random subset of the same bytes
/// must score less: else the particles themselves show as much.
pub const PICTURES_GOOD: f64 = 6.0;
/// Pictures are fair from here on: seven tenths of its error.
pub const PICTURES_FAIR: f64 = 3.0;
/// Pictures at a large radius are good here: a quarter of the error. Theirs are mostly bright, where trivial pictures err
/// by a third of white: with half of that the filaments are wrong to the eye.
pub const LARGE_GOOD: f64 = 12.0;
/// A large radius is fair from here on.
pub const LARGE_FAIR: f64 = 6.0;
/// The density of the mixture, and of particles drawn from it, is good from this correlation on, with at most
/// [`DENSITY_ERROR_GOOD`] of the error of the better trivial density.
pub const DENSITY_GOOD: f64 = 0.99;
/// The density is fair from here on, with less error than the better trivial density.
pub const DENSITY_FAIR: f64 = 0.9;
/// The share of the better trivial density's error that [`DENSITY_GOOD`] allows.
pub const DENSITY_ERROR_GOOD: f64 = 0.5;
/// The power spectrum is good where it is within 1 % and r(k) at least 0.99 up to this share of the wave numbers measured,
/// and fair where they are within 5 % and at least 0.9.
pub const SPECTRUM_SHARE: f64 = 0.25;
/// Groups are good where their numbers are within 10 % from this size on, particles.
pub const GROUPS_GOOD: f64 = 100.0;
/// Groups are fair from this size on.
pub const GROUPS_FAIR: f64 = 1000.0;
/// Matched groups are good where this share of them, and of those drawn, has a counterpart.
pub const MATCHED_GOOD: f64 = 0.9;
/// Matched groups are fair where this share has one.
pub const MATCHED_FAIR: f64 = 0.8;
/// Numbers of matched groups are good within this share, with the scatter of a draw.
pub const NUMBERS_GOOD: f64 = 0.1;
/// Numbers of matched groups are fair within this share, with the scatter of a draw.
pub const NUMBERS_FAIR: f64 = 0.25;
/// Groups that are needed to judge them: of fewer, numbers scatter by more than [`NUMBERS_GOOD`].
pub const FEWEST_MATCHED: u64 = 100;
/// The spacing of drawn particles is good where the median distance to the nearest neighbour is within this share, and
/// the 5th percentile over the median as near.
pub const SPACING_GOOD: f64 = 0.1;
/// The spacing is fair within this share.
pub const SPACING_FAIR: f64 = 0.25;

/// A field is good where the model explains this share of the variance of its means in cells.
pub const FIELD_GOOD: f64 = 0.9;
/// A field is fair from here on.
pub const FIELD_FAIR: f64 = 0.7;

const NEEDS_FULL: &str = "needs a full certificate";
const ADDED_UP: &str = "the certificate is a sum over blocks";

particlegs_core::named_values! {
    /// A use of a model.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
    #[serde(rename_all = "snake_case")]
    pub enum UseCase {
        /// Pictures at the default radius and opacity.
        Pictures = "pictures",
        /// Pictures of large splats.
        LargeRadius = "large radius",
        /// Pictures from within the particles.
        CloseUp = "close up",
        /// The density, above a size of cells.
        Density = "density",
        /// P(k).
        PowerSpectrum = "power spectrum",
        /// Friends-of-friends groups.
        Groups = "groups",
        /// Distances of drawn particles to their neighbours.
        Spacing = "spacing",
        /// A field, such as the velocity; one finding for each.
        Field = "field",
    }
}

particlegs_core::named_values! {
    /// The grade of a model for a use.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
    pub enum Grade {
        /// Use it.
        #[serde(rename = "good")]
        Good = "good",
        /// For a first look.
        #[serde(rename = "fair")]
        Fair = "fair",
        /// Do not.
        #[serde(rename = "poor")]
        Poor = "poor",
        /// The figures are of too few objects, or scatter too much, to tell.
        #[serde(rename = "cannot tell")]
        CannotTell = "cannot tell",
        /// Nobody has measured again what a file says.
        #[serde(rename = "not verified")]
        NotVerified = "not verified",
        /// Nothing is known.
        #[serde(rename = "not measured")]
        NotMeasured = "not measured",
        /// There is no such thing of these particles.
        #[serde(rename = "not applicable")]
        NotApplicable = "not applicable",
    }
}

/// One use, its word, and the figures that decided it.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Assessment {
    /// The use.
    #[serde(rename = "use")]
    pub of: UseCase,
    /// The word.
    pub word: Grade,
    /// The reason, in one line: the figure that decided, and behind a semicolon further figures.
    pub why: String,
}

impl Assessment {
    /// The figure that decided.
    pub fn figure(&self) -> &str {
        self.why.split("; ").next().unwrap_or_default()
    }

    /// The verdict on a file whose figures nobody has measured again.
    pub fn unverified() -> Vec<Assessment> {
        let why = "verifying the file's figures needs the snapshot";
        let of_positions = UseCase::ALL.into_iter().filter(|use_case| *use_case != UseCase::Field);
        of_positions.map(|use_case| Assessment { of: use_case, word: Grade::NotVerified, why: why.into() }).collect()
    }

    /// Judges the certificate of a model of `metadata`: pictures (as they are, at a large radius, from close up),
    /// density, power spectrum, groups and spacing, in this order; then each field that was measured, or that none was.
    /// Without a certificate nothing is measured.
    pub fn verdict(certificate: Option<&Certificate>, metadata: &Metadata) -> Vec<Assessment> {
        let Some(c) = certificate else {
            let none = |use_case| Assessment {
                of: use_case,
                word: Grade::NotMeasured,
                why: "the file has no certificate".into(),
            };
            return UseCase::ALL.into_iter().filter(|use_case| *use_case != UseCase::Field).map(none).collect();
        };
        let unit = metadata.units.length_text();
        let density = c.densities.as_ref().map_or_else(|| density(c), |d| density_in_cells(c, d, unit));
        let groups = c.groups.as_ref().map_or_else(|| groups(c, metadata.count), matched_groups);
        let findings =
            [pictures(c), at_large_radius(c), close_up(c), density, spectrum(c, metadata), groups, spacing(c, unit)];
        let fields = metadata.fields.iter().zip(c.fields.iter().flat_map(|f| f.each));
        let fields = fields.filter_map(|(q, agreement)| Some((UseCase::Field, field(q, &agreement?, unit))));
        let unknown = c.fields.is_none() && !metadata.fields.is_empty();
        let none = (Grade::NotMeasured, "the fields were not compared with the particles".to_string());
        let unknown = unknown.then_some((UseCase::Field, none));
        let uses = UseCase::ALL.into_iter().zip(findings).chain(fields).chain(unknown);
        uses.map(|(use_case, (word, why))| Assessment { of: use_case, word, why }).collect()
    }
}

/// The grade of a use, and the reason.
type Finding = (Grade, String);

/// The smallest gain of the `expected` look, whose score has no sampling noise in it.
fn pictures(c: &Certificate) -> Finding {
    let gains: Vec<PictureGain> = c.views.orbits.iter().filter_map(|o| PictureGain::new(&o.expected)).collect();
    // One orbit in which the subset shows as much is enough.
    let beaten = gains.iter().any(|g| g.subset_is_better);
    let Some(worst) = gains.into_iter().min_by(|a, b| a.decibels.total_cmp(&b.decibels)) else {
        return (Grade::NotMeasured, "every pixel is black at the default radius and opacity".into());
    };
    (worst.word(beaten, [PICTURES_GOOD, PICTURES_FAIR]), worst.describe("worst orbit"))
}

/// At the largest radius and the default opacity.
fn at_large_radius(c: &Certificate) -> Finding {
    let limits = [LARGE_GOOD, LARGE_FAIR];
    at_setting(c, |s| !s.close && s.radius > 1.0, limits, |s| format!("{} default radii", s.radius))
}

/// From within, at the default radius and opacity.
fn close_up(c: &Certificate) -> Finding {
    at_setting(c, |s| s.close, [PICTURES_GOOD, PICTURES_FAIR], |_| "from inside".into())
}

/// The worst view of the first setting of a kind, which is at the default opacity.
fn at_setting(
    c: &Certificate,
    kind: impl Fn(&PictureSetting) -> bool,
    limits: [f64; 2],
    name: impl Fn(&PictureSetting) -> String,
) -> Finding {
    let Some(at) = c.pictures.as_ref().and_then(|p| p.settings.iter().find(|s| kind(s))) else {
        return (Grade::NotMeasured, NEEDS_FULL.into());
    };
    let Some(gain) = PictureGain::new(&at.expected.worst) else {
        return (Grade::NotMeasured, "every pixel is black or every pixel is white".into());
    };
    (gain.word(gain.subset_is_better, limits), gain.describe(&format!("worst view, {}", name(at))))
}

/// Decibels of a picture above the better of the trivial ones.
struct PictureGain {
    model: Option<f64>,
    trivial: f64,
    name: &'static str,
    decibels: f64,
    /// The model's SSIM is above that of both trivial pictures.
    more_similar: bool,
    subset: Option<f64>,
    /// The random subset of the same bytes scores as much.
    subset_is_better: bool,
}

impl PictureGain {
    /// `None` where a trivial picture is identical, nothing is lit, or nothing was drawn.
    fn new(scores: &PictureScores) -> Option<PictureGain> {
        let PictureScore { masked_psnr: model, ssim } = scores.model?;
        let (black, even) = (scores.all_black?, scores.uniform_box?);
        let more_similar = ssim > black.ssim.max(even.ssim) || model.is_none();
        let (black, even) = (black.masked_psnr?, even.masked_psnr?);
        let (trivial, name) = if black >= even { (black, "an empty picture") } else { (even, "a uniform box") };
        // Identical pictures have no decibels.
        let decibels = model.map_or(f64::INFINITY, |v| v - trivial);
        let subset = scores.subset.map(|s| s.masked_psnr.unwrap_or(f64::INFINITY));
        let subset_is_better = subset.is_some_and(|s| model.is_some_and(|v| s >= v));
        Some(PictureGain { model, trivial, name, decibels, more_similar, subset, subset_is_better })
    }

    /// By the decibels from which on it is good, and fair.
    fn word(&self, beaten: bool, [good, fair]: [f64; 2]) -> Grade {
        let is_good = self.decibels >= good && !beaten;
        graded(self.more_similar && is_good, self.more_similar && self.decibels >= fair)
    }

    fn describe(&self, view_name: &str) -> String {
        let Some(model) = self.model else { return "identical to the noise-free picture".into() };
        let less = if self.more_similar { "" } else { ", with no better SSIM" };
        let subset = match self.subset {
            Some(s) if s.is_finite() => format!("a random subset of the same size scores {s:.1}; "),
            Some(_) => "a random subset of the same size is identical; ".into(),
            None => String::new(),
        };
        format!(
            "{model:.1} dB, against {:.1} dB for {}{less}; {subset}masked PSNR, {view_name}",
            self.trivial, self.name
        )
    }
}

fn density(c: &Certificate) -> Finding {
    // An empty density has an error of 1.
    let d = &c.density;
    let trivial = d.uniform_mean_absolute_error.min(1.0);
    let word = graded(
        d.correlation >= DENSITY_GOOD && d.mean_absolute_error <= DENSITY_ERROR_GOOD * trivial,
        d.correlation >= DENSITY_FAIR && d.mean_absolute_error < trivial,
    );
    let why = format!(
        "correlation {:.4} on {} cells along the longest edge; mean error {:.2}, {trivial:.2} for a trivial density",
        d.correlation, d.cells, d.mean_absolute_error
    );
    (word, why)
}

/// The smallest of three sizes of cells from which on the density of the mixture, and of particles drawn from it, is good.
fn density_in_cells(c: &Certificate, densities: &[CellDensity; CELL_SIZES], unit: Option<&str>) -> Finding {
    let drawn: [Option<DrawnDensity>; CELL_SIZES] = std::array::from_fn(|i| Some(c.drawn_densities?[i]));
    // The worse of the two is what users get.
    let worse = |d: &CellDensity, drawn: Option<DrawnDensity>| CellDensity {
        correlation: drawn.map_or(d.correlation, |drawn| drawn.correlation.min(d.correlation)),
        mean_absolute_error: drawn.map_or(0.0, |drawn| drawn.mean_absolute_error).max(d.mean_absolute_error),
        ..*d
    };
    let densities: [CellDensity; CELL_SIZES] = std::array::from_fn(|i| worse(&densities[i], drawn[i]));
    let whose = if c.drawn_densities.is_some() { "mixture and drawn particles" } else { "mixture" };
    let trivial = |d: &CellDensity| d.uniform_mean_absolute_error.min(1.0);
    let is_good =
        |d: &CellDensity| d.correlation >= DENSITY_GOOD && d.mean_absolute_error <= DENSITY_ERROR_GOOD * trivial(d);
    let is_fair = |d: &CellDensity| d.correlation >= DENSITY_FAIR && d.mean_absolute_error < trivial(d);
    // Sizes ascend: from the largest down, the last good one is the smallest.
    let from = |good: &dyn Fn(&CellDensity) -> bool| densities.iter().rev().take_while(|d| good(d)).last();
    let unit = unit.map_or(String::new(), |u| format!(" {u}"));
    let finding = |d: &CellDensity, word| {
        let (even, more) = if word == Grade::Poor { ("even ", "") } else { ("", " or larger") };
        let (&CellDensity { edge, particles, correlation, mean_absolute_error, .. }, trivial) = (d, trivial(d));
        let why = format!(
            "correlation {correlation:.4} {even}in cells of {}{unit}{more}; {particles:.0} particles in each, mean \
             error {mean_absolute_error:.2}, against {trivial:.2} for a trivial density; {whose}",
            decimals(edge)
        );
        (word, why)
    };
    match (from(&is_good), from(&is_fair), densities.last()) {
        (Some(d), ..) => finding(d, Grade::Good),
        (None, Some(d), _) => finding(d, Grade::Fair),
        (None, None, Some(d)) => finding(d, Grade::Poor),
        _ => (Grade::NotMeasured, "there are too few particles".into()),
    }
}

/// Judged by the file's own power and phases: models of halves, which tell of the method, decide only where there is
/// nothing else. Power that was coded to be right is no evidence of the phases.
fn spectrum(c: &Certificate, metadata: &Metadata) -> Finding {
    if !metadata.cell.as_ref().is_some_and(|cell| cell.periodic.contains(&true)) {
        return (Grade::NotApplicable, "the particles have no periodic box".into());
    }
    let science = c.science.filter(|s| s.power_within_5_percent_to != Limit::NotMeasured);
    let of_file = science.map(|s| (s.k_max, [s.power_within_1_percent_to, s.power_within_5_percent_to]));
    let of_halves = c.held_out.map(|h| (h.k_max, [0.01, 0.05].map(|share| Limit::measured(h.within(share)))));
    let origin = if of_file.is_none() { ", with half the particles" } else { "" };
    let Some((k_max, [one, five])) = of_file.or(of_halves) else {
        return (Grade::NotMeasured, "there are too few particles".into());
    };
    let unit = metadata.units.length_text().map_or_else(|| "1/length".into(), per_length);
    let reaches = |limit: Limit| limit.place().is_some_and(|k| k >= SPECTRUM_SHARE * k_max);
    let within = |percent: u32, limit: Limit| match limit {
        Limit::At(k) => format!("within {percent} % up to k = {} {unit}", wavenumber(k.min(k_max))),
        Limit::Never => format!("not within {percent} % at any k"),
        Limit::NotMeasured => format!("within {percent} %: not measured"),
    };
    let phases = science.map(|s| [s.r_above_0_99_to, s.r_above_0_9_to]).filter(|r| r[1] != Limit::NotMeasured);
    let phases_reach = |i: usize| phases.is_none_or(|limits| reaches(limits[i]));
    let word = graded(reaches(one) && phases_reach(0), reaches(five) && phases_reach(1));
    let power = match word {
        Grade::Good => within(1, one),
        _ => format!("{}, {}", within(5, five), within(1, one)),
    };
    let phases = match phases {
        Some([Limit::At(k), _]) => format!(", r(k) above 0.99 up to {}", wavenumber(k)),
        Some([_, Limit::At(k)]) => format!(", r(k) above 0.9 up to {}, not above 0.99 at any k", wavenumber(k)),
        Some(_) => ", r(k) not above 0.9 at any k".into(),
        None => String::new(),
    };
    (word, format!("{power}{phases}; measured up to k = {}{origin}", wavenumber(k_max)))
}

/// In three digits that are not zeros, whatever the unit.
fn wavenumber(k: f64) -> String {
    if k >= 0.1 { format!("{k:.3}") } else { format!("{k:.2e}") }
}

/// By counterparts and numbers, whichever is worse.
fn matched_groups(classes: &[GroupClass; GROUP_CLASSES.len()]) -> Finding {
    let good = |c: &GroupClass, share: f64, number: f64| {
        // A class without groups has no value, and judges nothing.
        let matched = |v: Option<f64>| v.is_none_or(|v| v >= share);
        matched(c.completeness)
            && matched(c.purity)
            && c.number.is_none_or(|n| (n - 1.0).abs() + c.number_scatter <= number)
    };
    let largest = &classes[GROUP_CLASSES.len() - 1];
    let size = GROUP_CLASSES[GROUP_CLASSES.len() - 1];
    let (Some(completeness), Some(number)) = (largest.completeness, largest.number) else {
        return (Grade::NotMeasured, format!("there are no groups of {size} particles or more"));
    };
    let good_classes = classes.iter().rev().take_while(|c| good(c, MATCHED_GOOD, NUMBERS_GOOD)).count();
    let few = |groups: u64| format!("{groups} groups are too few to tell");
    if good_classes > 0 {
        let judged = &classes[GROUP_CLASSES.len() - good_classes..];
        let (from, groups) = (GROUP_CLASSES[GROUP_CLASSES.len() - good_classes], judged.iter().map(|c| c.groups).sum());
        let why = format!("positions and numbers match for groups of {from} particles or more");
        return match groups {
            0..FEWEST_MATCHED => (Grade::CannotTell, format!("{why}, but {}", few(groups))),
            _ => (Grade::Good, why),
        };
    }
    let why = format!(
        "{:.0} % of groups of {size} particles or more have a counterpart; {:.0} % of drawn groups do; number {:+.0} %",
        100.0 * completeness,
        100.0 * largest.purity.unwrap_or(0.0),
        100.0 * (number - 1.0)
    );
    if largest.groups < FEWEST_MATCHED {
        return (Grade::CannotTell, format!("{}; {why}", few(largest.groups)));
    }
    if largest.number_scatter > NUMBERS_FAIR {
        return (
            Grade::CannotTell,
            format!("numbers of draws scatter by {:.0} %; {why}", 100.0 * largest.number_scatter),
        );
    }
    (graded(false, good(largest, MATCHED_FAIR, NUMBERS_FAIR)), why)
}

/// A smooth model knows how dense it is at a place, and not how its particles keep apart.
fn spacing(c: &Certificate, unit: Option<&str>) -> Finding {
    let Some(s) = &c.spacing else {
        let why = if c.blocks.is_some() { ADDED_UP } else { "there are too few particles" };
        return (Grade::NotMeasured, why.into());
    };
    let within = |share: f64| {
        (s.drawn_median / s.median - 1.0).abs() <= share && (s.drawn_regularity - s.regularity).abs() <= share
    };
    let unit = unit.map_or(String::new(), |u| format!(" {u}"));
    let why = format!(
        "drawn particles are {}{unit} apart, {} in the snapshot; median distances to the nearest neighbour, whose \
         5th percentiles are {:.2} and {:.2} of these",
        decimals(s.drawn_median),
        decimals(s.median),
        s.drawn_regularity,
        s.regularity
    );
    (graded(within(SPACING_GOOD), within(SPACING_FAIR)), why)
}

fn groups(c: &Certificate, particles: u64) -> Finding {
    match c.science.map_or(Limit::NotMeasured, |s| s.groups_within_10_percent_from) {
        Limit::NotMeasured => {
            let why = match (c.blocks, c.pictures) {
                (Some(_), _) => ADDED_UP,
                (None, None) => NEEDS_FULL,
                (None, Some(_)) if particles > MOST_DRAWN => "there are too many particles",
                (None, Some(_)) => "there are too few groups",
            };
            (Grade::NotMeasured, why.into())
        }
        Limit::Never => (Grade::Poor, "group numbers are not within 10 % at any size".into()),
        Limit::At(n) => {
            let why = format!("numbers are within 10 % for groups of {n} particles or more");
            (graded(n <= GROUPS_GOOD, n <= GROUPS_FAIR), why)
        }
    }
}

fn field(q: &Quantity, f: &FieldAgreement, unit: Option<&str>) -> Finding {
    let name = &q.name;
    let Some(explained) = f.explained() else {
        return (
            Grade::NotMeasured,
            format!("{name}: means in cells do not stand out of the noise, or lie beyond float32"),
        );
    };
    let of_field = q.unit.as_ref().map_or(String::new(), |u| format!(" {}", u.text));
    let explains = match 100.0 * explained {
        v if v > 99.95 => "more than 99.9 %".into(),
        v if v > 0.0 => format!("{v:.1} %"),
        _ => "none".into(),
    };
    let why = format!(
        "{name}: explains {explains} of the variance of means in cells of {}{}; RMS error {}{of_field} of {}{of_field}, of particles that \
         the field was not gathered from",
        decimals(f.edge),
        unit.map_or(String::new(), |u| format!(" {u}")),
        decimals(f.error),
        decimals(f.signal),
    );
    (graded(explained >= FIELD_GOOD, explained >= FIELD_FAIR), why)
}

fn graded(is_good: bool, is_fair: bool) -> Grade {
    match (is_good, is_fair) {
        (true, _) => Grade::Good,
        (false, true) => Grade::Fair,
        (false, false) => Grade::Poor,
    }
}

#[cfg(test)]
mod tests {
    use super::super::tests::certificate;
    use super::*;
    use particlegs_core::model::{
        CrossValidation, DensityMetrics, FieldAgreements, LookSummary, Pictures, ScienceMetrics, Spacing, Transfer,
    };
    use particlegs_particles::testing::model_of;

    fn boxed() -> Metadata {
        model_of(&[], [50.0; 3]).metadata
    }

    fn finding(c: &Certificate, use_case: UseCase) -> Assessment {
        Assessment::verdict(Some(c), &boxed()).into_iter().find(|f| f.of == use_case).unwrap()
    }

    fn word(c: &Certificate, use_case: UseCase) -> Grade {
        finding(c, use_case).word
    }

    #[test]
    fn pictures_are_judged_against_the_better_trivial_one() {
        let c = certificate();
        assert_eq!(word(&c, UseCase::Pictures), Grade::Good);
        let with = |black: Option<f64>, even: Option<f64>| {
            let mut c = c;
            // One orbit that is worse than the others decides.
            let score = |masked_psnr| Some(PictureScore { masked_psnr, ssim: 0.25 });
            let look = &mut c.views.orbits[1].expected;
            (look.all_black, look.uniform_box) = (score(black), score(even));
            c
        };
        assert_eq!(word(&with(Some(26.0), Some(12.0)), UseCase::Pictures), Grade::Fair);
        assert_eq!(word(&with(Some(12.0), Some(29.4)), UseCase::Pictures), Grade::Poor);
        let why = finding(&with(Some(29.4), Some(12.0)), UseCase::Pictures).why;
        assert!(why.contains("30.5 dB, against 29.4 dB for an empty picture"), "{why}");
        // No better in structure is no better.
        let mut dim = c;
        dim.views.orbits[0].expected.uniform_box.as_mut().unwrap().ssim = 0.76;
        assert_eq!(word(&dim, UseCase::Pictures), Grade::Poor);
        let mut dark = c;
        for orbit in &mut dark.views.orbits {
            orbit.expected.all_black = Some(PictureScore { masked_psnr: None, ssim: 1.0 });
        }
        assert_eq!(word(&dark, UseCase::Pictures), Grade::NotMeasured);
        assert_eq!(word(&Certificate::default(), UseCase::Pictures), Grade::NotMeasured);
    }

    #[test]
    fn a_subset_that_shows_as_much_takes_a_word_away() {
        let c = certificate();
        let with = |psnr: f64| {
            let score = |v| PictureScore { masked_psnr: Some(v), ssim: 0.5 };
            let mut c = c;
            // One orbit is enough, and not the worst one.
            for (orbit, psnr) in c.views.orbits.iter_mut().zip([20.0, 20.0, psnr]) {
                orbit.expected.subset = Some(score(psnr));
            }
            c
        };
        assert_eq!(
            [word(&with(30.4), UseCase::Pictures), word(&with(30.5), UseCase::Pictures)],
            [Grade::Good, Grade::Fair]
        );
        assert!(finding(&with(25.0), UseCase::Pictures).why.contains("a random subset of the same size scores 20.0"));
    }

    #[test]
    fn other_radii_and_close_views_are_judged_by_their_worst() {
        let c = certificate();
        let score = |v| PictureScore { masked_psnr: Some(v), ssim: v / 100.0 };
        let scores = |model| PictureScores {
            model: Some(score(model)),
            all_black: Some(score(4.0)),
            uniform_box: Some(score(11.0)),
            subset: Some(score(19.5)),
            ..PictureScores::default()
        };
        let at = |radius, close, worst| {
            let look = LookSummary { worst_view: 1, mean: scores(40.0), worst: scores(worst) };
            PictureSetting { radius, opacity: 0.05, close, paraview: look, expected: look }
        };
        let words = |large, close| {
            let settings = [0.5, 0.5, 1.0, 1.0].map(|r| at(r, false, 12.0));
            let [a, b, c4, d] = settings;
            let settings = [a, b, c4, d, at(6.0, false, large), at(6.0, false, 12.0), at(1.0, true, close)];
            let pictures = Some(Pictures { width: 960, height: 540, settings });
            let c = Certificate { pictures, ..c };
            [word(&c, UseCase::LargeRadius), word(&c, UseCase::CloseUp)]
        };
        assert_eq!(words(24.0, 14.5), [Grade::Good, Grade::Fair]);
        // Above the trivial ones, and no better than the subset.
        assert_eq!(words(19.0, 13.0), [Grade::Fair, Grade::Poor]);
        assert_eq!([word(&c, UseCase::LargeRadius), word(&c, UseCase::CloseUp)], [Grade::NotMeasured; 2]);
    }

    #[test]
    fn densities_spectra_and_groups_have_their_words() {
        let c = certificate();
        let density = |correlation, mean_absolute_error| {
            let density = DensityMetrics { correlation, mean_absolute_error, ..c.density };
            word(&Certificate { density, ..c }, UseCase::Density)
        };
        assert_eq!(
            [density(0.997, 0.4), density(0.997, 0.7), density(0.95, 0.6)],
            [Grade::Good, Grade::Fair, Grade::Fair]
        );
        assert_eq!([density(0.95, 1.1), density(-0.0006, 0.9)], [Grade::Poor; 2]);
        // Against a uniform density that errs little, little error is needed.
        let even = DensityMetrics { uniform_mean_absolute_error: 0.3, ..c.density };
        assert_eq!(word(&Certificate { density: even, ..c }, UseCase::Density), Grade::Poor);
        let science = |one, five, groups| Certificate {
            science: Some(ScienceMetrics {
                power_within_1_percent_to: one,
                power_within_5_percent_to: five,
                groups_within_10_percent_from: groups,
                ..c.science.unwrap()
            }),
            ..c
        };
        let all = science(Limit::At(2.0), Limit::At(8.0), Limit::At(57.0));
        assert_eq!([word(&all, UseCase::PowerSpectrum), word(&all, UseCase::Groups)], [Grade::Good; 2]);
        let some = science(Limit::Never, Limit::At(8.0), Limit::At(160.0));
        assert_eq!([word(&some, UseCase::PowerSpectrum), word(&some, UseCase::Groups)], [Grade::Fair; 2]);
        let none = science(Limit::Never, Limit::At(1.0), Limit::Never);
        assert_eq!([word(&none, UseCase::PowerSpectrum), word(&none, UseCase::Groups)], [Grade::Poor; 2]);
        let early = Certificate { science: None, ..c };
        assert_eq!([word(&early, UseCase::PowerSpectrum), word(&early, UseCase::Groups)], [Grade::NotMeasured; 2]);
        assert!(Assessment::verdict(None, &boxed()).iter().all(|f| f.word == Grade::NotMeasured));
    }

    #[test]
    fn what_is_matched_held_out_and_in_cells_comes_first() {
        let c = certificate();
        let cell = |edge, correlation, error| CellDensity {
            edge,
            correlation,
            mean_absolute_error: error,
            uniform_mean_absolute_error: 1.2,
            ..CellDensity::default()
        };
        let densities = |v: [CellDensity; 3]| finding(&Certificate { densities: Some(v), ..c }, UseCase::Density);
        let some = densities([cell(1.0, 0.95, 0.6), cell(2.0, 0.995, 0.3), cell(4.0, 0.999, 0.2)]);
        assert!(some.word == Grade::Good && some.why.contains("cells of 2.0000"), "{}", some.why);
        assert_eq!(densities([cell(1.0, 0.1, 1.0), cell(2.0, 0.2, 1.0), cell(4.0, 0.95, 0.6)]).word, Grade::Fair);
        // Particles drawn decide where they are worse.
        let drawn = |correlation, mean_absolute_error| {
            let drawn = DrawnDensity { correlation, mean_absolute_error };
            let cells = [cell(1.0, 0.995, 0.3), cell(2.0, 0.998, 0.2), cell(4.0, 0.999, 0.1)];
            let perfect = DrawnDensity { correlation: 1.0, mean_absolute_error: 0.0 };
            let c = Certificate { densities: Some(cells), drawn_densities: Some([drawn, perfect, perfect]), ..c };
            finding(&c, UseCase::Density).why
        };
        assert!(drawn(0.992, 0.4).starts_with("correlation 0.9920 in cells of 1.0000"), "{}", drawn(0.992, 0.4));
        assert!(drawn(0.98, 0.4).contains("cells of 2.0000") && drawn(0.992, 0.7).contains("cells of 2.0000"));
        assert_eq!(densities([cell(1.0, 0.1, 1.0), cell(2.0, 0.2, 1.0), cell(4.0, 0.3, 0.9)]).word, Grade::Poor);
        let class = |share, number| GroupClass {
            groups: 120,
            number: Some(number),
            completeness: Some(share),
            purity: Some(share),
            ..GroupClass::default()
        };
        let groups = |v| word(&Certificate { groups: Some(v), ..c }, UseCase::Groups);
        assert_eq!(groups([class(0.5, 1.3), class(0.8, 1.0), class(0.95, 0.97)]), Grade::Good);
        assert_eq!(groups([class(0.95, 1.0), class(0.95, 1.0), class(0.85, 1.2)]), Grade::Fair);
        // Equal numbers are not equal groups.
        assert_eq!(groups([class(0.2, 1.0); 3]), Grade::Poor);
        // A draw's scatter counts, and tells nothing where it is large.
        let scattered = |number, number_scatter| [GroupClass { number_scatter, ..class(0.95, number) }; 3];
        assert_eq!(groups(scattered(1.05, 0.04)), Grade::Good);
        assert_eq!(groups(scattered(1.05, 0.06)), Grade::Fair);
        assert_eq!(groups(scattered(1.0, 0.3)), Grade::CannotTell);
        // Few groups tell nothing, unless those of smaller ones match too.
        let few = |share, number| GroupClass { groups: 44, ..class(share, number) };
        assert_eq!(groups([class(0.2, 1.0), class(0.2, 1.0), few(0.95, 1.0)]), Grade::CannotTell);
        assert_eq!(groups([few(0.2, 1.0), few(0.2, 1.0), few(0.5, 1.3)]), Grade::CannotTell);
        assert_eq!(groups([class(0.2, 1.0), class(0.95, 1.0), few(0.95, 1.0)]), Grade::Good);
        let spacing = |drawn_median, drawn_regularity| {
            let s = Spacing { median: 1.0, drawn_median, drawn_regularity, ..Spacing::default() };
            word(&Certificate { spacing: Some(s), ..c }, UseCase::Spacing)
        };
        assert_eq!(
            [spacing(1.05, 0.02), spacing(1.2, 0.0), spacing(0.6, 0.0)],
            [Grade::Good, Grade::Fair, Grade::Poor]
        );
        let mut transfer = [Transfer { deviation: Some(0.004), scatter: 0.001 }; 7];
        transfer[6].deviation = Some(-0.2);
        let held_out = CrossValidation { k_max: 8.0, transfer, ..CrossValidation::default() };
        let halves = Certificate { held_out: Some(held_out), ..c };
        let alone = finding(&Certificate { science: None, ..halves }, UseCase::PowerSpectrum);
        assert!(
            alone.why.contains("1 % up to k = 6.000 1/length; measured up to k = 8.000, with half"),
            "{}",
            alone.why
        );
        // More measurement gives no better word than the file's own figures.
        let words = |one, r| {
            let (five, r_above_0_9_to) = (Limit::At(8.0), Limit::At(8.0));
            let science = ScienceMetrics {
                k_max: 8.0,
                power_within_1_percent_to: one,
                power_within_5_percent_to: five,
                r_above_0_99_to: r,
                r_above_0_9_to,
                ..c.science.unwrap()
            };
            let science = Some(science);
            [Certificate { science, ..halves }, Certificate { science, held_out: None, ..c }]
                .map(|c| word(&c, UseCase::PowerSpectrum))
        };
        assert_eq!(words(Limit::At(7.0), Limit::At(7.0)), [Grade::Good; 2]);
        assert_eq!(words(Limit::At(1.0), Limit::At(7.0)), [Grade::Fair; 2]);
        // Nor does power that was coded to be right say anything of the phases.
        assert_eq!(words(Limit::At(7.0), Limit::At(1.0)), [Grade::Fair; 2]);
        let open = Metadata { cell: None, ..boxed() };
        let verdict = Assessment::verdict(Some(&c), &open);
        assert_eq!(verdict.iter().find(|f| f.of == UseCase::PowerSpectrum).unwrap().word, Grade::NotApplicable);
    }

    #[test]
    fn fields_have_a_line_each() {
        let quantity = |name: &str, unit: &str| Quantity {
            name: name.into(),
            kind: particlegs_core::model::QuantityKind::Vector,
            unit: Some(particlegs_core::model::Unit { text: unit.into(), si: None }),
            bytes: 12,
            by_mass: false,
            logarithmic: false,
            extensive: false,
        };
        let fields = ["velocity", "spin", "heat"].map(|name| quantity(name, "km/s")).into();
        let metadata = Metadata { fields, ..boxed() };
        let agreement = |error| Some(FieldAgreement { edge: 2.0, cells: 100, signal: 200.0, error });
        let mut each = [None; particlegs_core::model::CERTIFIED_FIELDS];
        each[..3].copy_from_slice(&[agreement(40.0), agreement(100.0), Some(FieldAgreement::default())]);
        let c = Certificate { fields: Some(FieldAgreements { each }), ..certificate() };
        let verdict = Assessment::verdict(Some(&c), &metadata);
        let fields: Vec<&Assessment> = verdict.iter().filter(|f| f.of == UseCase::Field).collect();
        assert_eq!(fields.iter().map(|f| f.word).collect::<Vec<_>>(), [Grade::Good, Grade::Fair, Grade::NotMeasured]);
        let unknown = Assessment::verdict(Some(&certificate()), &metadata);
        assert_eq!(unknown.last().unwrap().why, "the fields were not compared with the particles");
        assert_eq!(fields[0].figure(), "velocity: explains 96.0 % of the variance of means in cells of 2.0000");
        assert!(fields[0].why.contains("RMS error 40.0000 km/s of 200.0000 km/s"), "{}", fields[0].why);
        let without = Assessment::verdict(Some(&certificate()), &boxed());
        assert!(without.iter().all(|f| f.of != UseCase::Field));
    }

    #[test]
    fn json_says_use_word_and_why() {
        let json = serde_json::to_value(Assessment::verdict(None, &boxed())).unwrap();
        assert_eq!((&json[1]["use"], &json[4]["use"]), (&"large_radius".into(), &"power_spectrum".into()));
        assert_eq!(json[4]["word"], "not measured");
        assert!(json[4]["why"].as_str().is_some_and(|w| !w.is_empty()));
    }
}
