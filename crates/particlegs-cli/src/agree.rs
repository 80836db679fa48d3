//! Two certificates of one model side by side, and what a certificate cannot say whatever the model is.

use particlegs::model::{Certificate, Limit, MetricValue, PictureScores};
use serde::Serialize;

/// One figure of a certificate, stored and measured.
#[derive(Serialize)]
pub struct Figure {
    /// Which.
    pub name: String,
    /// As the file says it.
    pub stored: String,
    /// As it was measured now.
    pub measured: String,
    /// How far apart they may be.
    pub tolerance: String,
    /// Are they further apart?
    pub differs: bool,
}

/// Every figure that `stored` has, beside the one measured again: what it does not say is completed by what is measured.
pub fn side_by_side(stored: &Certificate, measured: &Certificate) -> Vec<Figure> {
    let mut all = Vec::new();
    for ((group, stored), (_, measured)) in stored.groups().into_iter().zip(measured.groups()) {
        let measured = measured.unwrap_or_default();
        for (place, entry) in stored.into_iter().flatten().enumerate().filter(|e| e.1.value != MetricValue::None) {
            let now = measured.get(place).map_or(MetricValue::None, |e| e.value);
            let metric = &entry.metric;
            let row = if entry.row.is_empty() { String::new() } else { format!(" {}", entry.row) };
            all.push(Figure {
                name: format!("{}{row}: {}", group.name, metric.name),
                stored: metric.in_words(entry.value, None),
                measured: metric.in_words(now, None),
                tolerance: metric.tolerance.in_words(),
                differs: metric.tolerance.is_passed(entry.value, now),
            });
        }
    }
    all
}

/// What no model's certificate can say, a line each: such a file was altered, or written by something
/// else. What is doubtful but possible is in [`doubts`].
pub fn contradictions(c: &Certificate) -> Vec<String> {
    let mut found = Vec::new();
    // One level in one of all pixels is the smallest error there is.
    let most = 20.0 * 255f64.log10() + 10.0 * (f64::from(c.views.width) * f64::from(c.views.height)).log10();
    let other = |s: &PictureScores| s.noise_free.is_some_and(|n| n.masked_psnr.is_some() || n.ssim < 1.0);
    for (name, orbit) in ["far", "mid", "near"].iter().zip(&c.views.orbits) {
        if other(&orbit.expected) {
            found.push(format!("{name}: a noise-free picture that is not itself"));
        }
        for s in [&orbit.paraview, &orbit.paraview_no_fxaa, &orbit.expected] {
            let all = [s.model, s.noise_free].into_iter().flatten().filter_map(|s| s.masked_psnr);
            if let Some(v) = all.into_iter().find(|v| *v > most + 0.01) {
                found.push(format!(
                    "{name}: {v:.2} dB, where pictures of this size reach {most:.2} dB unless identical"
                ));
            }
        }
    }
    if let Some(p) = &c.pictures
        && p.settings.iter().any(|s| other(&s.expected.mean) || other(&s.expected.worst))
    {
        found.push("at another radius or opacity: a noise-free picture that is not itself".into());
    }
    if let Some(s) = &c.science {
        // Whatever is within 1 % is within 5 %, and r of 0.99 is above 0.9.
        let beyond = |strict: Limit, loose: Limit| match (strict, loose) {
            (Limit::At(a), Limit::At(b)) => a > b,
            (Limit::At(_), Limit::Never) => true,
            _ => false,
        };
        if beyond(s.power_within_1_percent_to, s.power_within_5_percent_to) {
            found.push("P(k) within 1 % further than within 5 %".into());
        }
        if beyond(s.r_above_0_99_to, s.r_above_0_9_to) {
            found.push("r(k) of 0.99 further than of 0.9".into());
        }
    }
    found
}

/// What is hard to believe, a line each: scores clearly above the noise-free picture's. It knows every
/// particle; who is above it knows the noise of one shot.
pub fn doubts(c: &Certificate) -> Vec<String> {
    const ABOVE: f64 = 1.0;
    let mut found = Vec::new();
    for (name, orbit) in ["far", "mid", "near"].iter().zip(&c.views.orbits) {
        for (look, s) in [("paraview", &orbit.paraview), ("paraview-no-fxaa", &orbit.paraview_no_fxaa)] {
            if let [Some(model), Some(noise_free)] = [s.model, s.noise_free].map(|s| s.and_then(|s| s.masked_psnr))
                && model > noise_free + ABOVE
            {
                found.push(format!("{name} {look}: {model:.2} dB, above the noise-free picture's {noise_free:.2} dB"));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::model::{
        DensityMetrics, Goal, GoalKind, GoalResult, OrbitMetrics, PictureScore, ScienceMetrics, ViewMetrics,
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
        side_by_side(a, b).into_iter().filter(|f| f.differs).map(|f| f.name).collect()
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
    fn impossible_certificates_are_told_without_the_snapshot() {
        let c = certificate();
        assert!(contradictions(&c).is_empty() && doubts(&c).is_empty());
        let changed = |change: &dyn Fn(&mut Certificate)| {
            let mut c = c;
            change(&mut c);
            contradictions(&c).len()
        };
        assert_eq!(changed(&|c| c.views.orbits[0].paraview.model = model(Some(120.0))), 1);
        assert_eq!(changed(&|c| c.views.orbits[0].expected.noise_free = model(Some(40.0))), 1);
        assert_eq!(changed(&|c| c.science.as_mut().unwrap().power_within_5_percent_to = Limit::Never), 1);
        assert_eq!(changed(&|c| c.science.as_mut().unwrap().r_above_0_9_to = Limit::At(1.0)), 1);
        let mut forged = c;
        forged.views.orbits[0].paraview.model = model(Some(45.0));
        assert!(doubts(&forged)[0].contains("45.00 dB, above the noise-free picture's 42.00"));
    }
}
