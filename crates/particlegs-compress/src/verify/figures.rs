//! Compares two certificates of one model, and finds contradictions in one certificate.

use particlegs_core::model::{
    Certificate, CertificateLevel, Metadata, MetricEntry, MetricGroup, MetricValue, Tolerance,
};
use serde::Serialize;

/// A number that a file states, and the measured one.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StatedFigure {
    /// Its name: `density: correlation`.
    pub name: String,
    /// In the file.
    pub stored: String,
    /// Now.
    pub measured: String,
    /// Largest difference of the two.
    pub tolerance: String,
    /// Whether they differ by more.
    pub differs: bool,
}

pub(super) fn level_of(c: &Certificate) -> CertificateLevel {
    let full =
        |(group, entries): &(MetricGroup, Option<_>)| group.levels == [CertificateLevel::Full] && entries.is_some();
    match (c.groups().iter().any(full), c.blocks) {
        (true, _) => CertificateLevel::Full,
        (false, Some(_)) => CertificateLevel::Blocks,
        (false, None) => CertificateLevel::Quick,
    }
}

/// Every number that is stored or measured, side by side. If the measurement `completes` the certificate with a higher
/// level, missing stored numbers do not count as different. With `exact`, for the same program, every digit counts.
pub(super) fn side_by_side(
    stored: &Certificate,
    measured: &Certificate,
    completes: bool,
    exact: bool,
) -> Vec<StatedFigure> {
    let mut all = Vec::new();
    for ((group, stored), (_, measured)) in stored.groups().into_iter().zip(measured.groups()) {
        let has_group = [&stored, &measured].map(Option::is_some);
        let groups = [stored, measured].map(Option::unwrap_or_default);
        for place in 0..groups[0].len().max(groups[1].len()) {
            let [stored, measured] = [0, 1].map(|side| groups[side].get(place));
            let [then, now] = [stored, measured].map(|e| e.map_or(MetricValue::None, |e| e.value));
            let Some(MetricEntry { row, metric, .. }) = stored.or(measured) else { continue };
            // Numbers that neither has are not listed, nor those that a fuller measurement adds.
            if then == MetricValue::None && (now == MetricValue::None && has_group[0] == has_group[1] || completes) {
                continue;
            }
            let row = if row.is_empty() { String::new() } else { format!(" {row}") };
            let tolerance =
                if exact && metric.tolerance != Tolerance::Any { Tolerance::Same } else { metric.tolerance };
            all.push(StatedFigure {
                name: format!("{}{row}: {}", group.name, metric.name),
                stored: metric.describe(then, None),
                measured: metric.describe(now, None),
                tolerance: tolerance.to_string(),
                differs: has_group[0] != has_group[1] || tolerance.is_passed(then, now),
            });
        }
    }
    all
}

/// Contradictions in a certificate, one line each: such a file was altered, or another program wrote it. Doubtful but
/// possible values are in [`doubts`].
pub(super) fn contradictions(c: &Certificate, m: &Metadata) -> Vec<String> {
    let mut lines = Vec::new();
    let recipe = &m.recipe;
    if let (Some(reached), true) = (&c.goal, recipe.steps.is_empty() && recipe.differing.is_empty())
        && recipe.target.goal() != Some(reached.goal)
    {
        lines.push("the target in its certificate is not the one in the recipe".into());
    }
    if let Some(blocks) = c.blocks.filter(|b| ![1, recipe.blocks].contains(b) && recipe.steps.is_empty()) {
        lines.push(format!("its certificate is the sum of {blocks} blocks, but the recipe has {}", recipe.blocks));
    }
    lines
}

/// Doubtful values, one line each: scores clearly above those of the noise-free picture, which knows everything but the
/// shot noise.
pub(super) fn doubts(c: &Certificate) -> Vec<String> {
    const ABOVE: f64 = 1.0;
    let mut lines = Vec::new();
    for (name, orbit) in ["far", "mid", "near"].iter().zip(&c.views.orbits) {
        for (look, s) in [("paraview", &orbit.paraview), ("paraview-no-fxaa", &orbit.paraview_no_fxaa)] {
            if let [Some(model), Some(noise_free)] = [s.model, s.noise_free].map(|s| s.and_then(|s| s.masked_psnr))
                && model > noise_free + ABOVE
            {
                lines.push(format!("{name} {look}: {model:.2} dB, above the noise-free picture's {noise_free:.2} dB"));
            }
        }
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::model::{
        DensityMetrics, Goal, GoalKind, GoalResult, Limit, OrbitMetrics, PictureScore, PictureScores, ScienceMetrics,
        ViewMetrics,
    };

    fn certificate() -> Certificate {
        let score = |masked_psnr, ssim| Some(PictureScore { masked_psnr, ssim });
        let look = |noise_free, ssim| PictureScores {
            model: score(Some(30.5), 0.75),
            noise_free: score(noise_free, ssim),
            all_black: score(Some(12.0), 0.25),
            uniform_box: score(Some(16.0), 0.25),
            ..PictureScores::default()
        };
        let orbit = OrbitMetrics {
            paraview: look(Some(42.0), 0.99),
            paraview_no_fxaa: look(Some(44.0), 0.99),
            expected: look(None, 1.0),
        };
        let (correlation, mean_absolute_error, uniform_mean_absolute_error) = (0.9975, 0.375, 1.25);
        Certificate {
            views: ViewMetrics { width: 1920, height: 1080, seed: 42, orbits: [orbit; 3] },
            density: DensityMetrics { cells: 50, correlation, mean_absolute_error, uniform_mean_absolute_error },
            science: Some(ScienceMetrics {
                k_max: 8.0,
                power_within_1_percent_to: Limit::At(4.0),
                power_within_5_percent_to: Limit::At(8.0),
                r_above_0_99_to: Limit::At(2.5),
                r_above_0_9_to: Limit::At(8.0),
                groups_within_10_percent_from: Limit::At(57.0),
                ..ScienceMetrics::default()
            }),
            ..Certificate::default()
        }
    }

    fn model(psnr: Option<f64>) -> Option<PictureScore> {
        Some(PictureScore { masked_psnr: psnr, ssim: 0.75 })
    }

    fn differing(a: &Certificate, b: &Certificate) -> Vec<String> {
        side_by_side(a, b, true, false).into_iter().filter(|f| f.differs).map(|f| f.name).collect()
    }

    #[test]
    fn a_forged_score_differs_and_rounding_does_not() {
        let true_one = certificate();
        assert_eq!(differing(&true_one, &true_one), [""; 0]);
        let mut rounded = true_one;
        rounded.views.orbits[0].paraview.model = model(Some(30.502));
        rounded.density.correlation += 1e-7;
        assert_eq!(differing(&rounded, &true_one), [""; 0]);
        let mut forged = true_one;
        forged.views.orbits[1].paraview.model = model(Some(45.0));
        assert_eq!(differing(&forged, &true_one), ["pictures mid paraview: model"]);
        let mut forged = true_one;
        forged.views.orbits[2].expected.model = model(None);
        forged.science.as_mut().unwrap().groups_within_10_percent_from = Limit::At(20.0);
        let groups = "statistics: number of groups within 10 %";
        assert_eq!(differing(&forged, &true_one), ["pictures near expected: model", groups]);
        // A goal that was not reached, or that no file of these particles is made for.
        let goal =
            |reached| Some(GoalResult { goal: Goal { kind: GoalKind::PowerSpectrum, asked: 0.01, at: 2.0 }, reached });
        let with = |goal| Certificate { goal, ..true_one };
        assert_eq!(differing(&with(goal(0.0093)), &with(goal(0.0094))), [""; 0]);
        assert_eq!(differing(&with(goal(0.0093)), &with(goal(0.0193))), ["goal: reached"]);
        assert_eq!(differing(&with(goal(0.0093)), &true_one).last().unwrap(), "goal: reached");
        // What was not measured at first is completed.
        let mut quick = Certificate { science: None, ..true_one };
        quick.views.orbits[0].paraview.subset = None;
        assert_eq!(differing(&quick, &true_one), [""; 0]);
        // Blocks that a job added up are one where it is measured again.
        let blocks = |blocks| Certificate { blocks, ..true_one };
        assert_eq!(differing(&blocks(Some(3)), &blocks(Some(1))), [""; 0]);
    }

    #[test]
    fn missing_and_extra_numbers_differ_unless_completed() {
        let full =
            Certificate { groups: Some(Default::default()), held_out: Some(Default::default()), ..certificate() };
        let differing = |a: &Certificate, b: &Certificate, completes| {
            side_by_side(a, b, completes, false).into_iter().filter(|f| f.differs).count()
        };
        let without = Certificate { held_out: None, ..full };
        assert_eq!((level_of(&full), level_of(&without)), (CertificateLevel::Full, CertificateLevel::Full));
        assert_eq!(level_of(&certificate()), CertificateLevel::Quick);
        // Left out, and added to what has none.
        assert!(differing(&without, &full, false) > 10 && differing(&full, &without, false) > 10);
        assert!(differing(&without, &full, true) == 0 && differing(&full, &without, true) > 10);
        let mut less = full;
        less.views.orbits[0].paraview.model = None;
        assert_eq!([differing(&less, &full, false), differing(&full, &less, false)], [1, 1]);
    }

    #[test]
    fn the_same_program_measures_the_same_to_the_last_digit() {
        let (a, mut b) = (certificate(), certificate());
        b.density.correlation += 1e-7;
        let differs = |exact| side_by_side(&a, &b, false, exact).iter().any(|f| f.differs);
        assert_eq!([differs(false), differs(true)], [false, true]);
    }

    #[test]
    fn certificates_agree_with_their_recipes() {
        let spectrum_goal = Goal { kind: GoalKind::PowerSpectrum, asked: 0.01, at: 2.0 };
        let certificate_for =
            |goal, blocks| Certificate { goal: Some(GoalResult { goal, reached: 0.009 }), blocks, ..certificate() };
        let bounds = particlegs_core::space::Bounds { min: [0.0; 3], max: [1.0; 3] };
        let mut m = Metadata::new(particlegs_core::model::LawKind::OpticalDepth, 1000, bounds);
        m.recipe.target = crate::Target::Goal(spectrum_goal);
        assert!(contradictions(&certificate_for(spectrum_goal, None), &m).is_empty());
        assert_eq!(contradictions(&certificate_for(Goal { asked: 0.001, ..spectrum_goal }, Some(7)), &m).len(), 2);
    }

    #[test]
    fn scores_above_the_noise_free_pictures_are_doubtful() {
        let c = certificate();
        assert!(doubts(&c).is_empty());
        let mut forged = c;
        forged.views.orbits[0].paraview.model = model(Some(45.0));
        assert!(doubts(&forged)[0].contains("45.00 dB, above the noise-free picture's 42.00"));
    }
}
