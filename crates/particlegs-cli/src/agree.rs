//! Two certificates of one model side by side, and what a certificate cannot say whatever the model is.

use particlegs::model::{
    BANDS, Certificate, GROUP_CLASSES, GoalKind, Limit, LookBaselines, LookPictures, LookScore, MassPower, Measures,
    PictureScore, Pictures, PowerAgreement, Reached, Subset,
};
use serde::Serialize;

/// What is measured again agrees within these: the same program measures the same bits on every machine;
/// another version may round otherwise.
const DECIBELS: f64 = 0.05;
const SIMILARITY: f64 = 0.002;
const DENSITY: f64 = 0.001;
/// Of a wave number or a size.
const SHARE: f64 = 0.001;

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
    pub tolerance: &'static str,
    /// Are they further apart?
    pub differs: bool,
}

/// Every figure that `stored` has, beside the one measured again.
pub fn side_by_side(stored: &Certificate, measured: &Certificate) -> Vec<Figure> {
    let mut all = Figures::default();
    // Certificates that were added up of blocks do not have ParaView's own pictures.
    let drawn = stored.measures.blocks.is_none() && measured.measures.blocks.is_none();
    let size = |c: &Certificate| format!("{} x {}", c.width, c.height);
    all.push("picture size", [size(stored), size(measured)], "same", size(stored) != size(measured));
    let grid = [stored.grid, measured.grid];
    all.push("density grid", grid.map(|g| g.to_string()), "same", grid[0] != grid[1]);
    for (k, name) in ["far", "mid", "near"].iter().enumerate() {
        let (a, b) = (&stored.orbits[k], &measured.orbits[k]);
        if drawn {
            all.look(&format!("{name} paraview"), &a.paraview, &b.paraview);
            all.look(&format!("{name} paraview-no-fxaa"), &a.paraview_no_fxaa, &b.paraview_no_fxaa);
        }
        all.look(&format!("{name} expected"), &a.expected, &b.expected);
    }
    all.real("density correlation", [stored.density_correlation, measured.density_correlation], DENSITY, "0.001");
    all.real("density mean error", [stored.density_mae, measured.density_mae], DENSITY, "0.001");
    if let (Some(a), Some(b)) = (&stored.baselines, &measured.baselines) {
        for (k, name) in ["far", "mid", "near"].iter().enumerate() {
            let (a, b) = (&a.orbits[k], &b.orbits[k]);
            if drawn {
                all.baselines(&format!("{name} paraview"), &a.paraview, &b.paraview);
                all.baselines(&format!("{name} paraview-no-fxaa"), &a.paraview_no_fxaa, &b.paraview_no_fxaa);
            }
            all.baselines(&format!("{name} expected"), &a.expected, &b.expected);
        }
        all.real("uniform density mean error", [a.uniform_density_mae, b.uniform_density_mae], DENSITY, "0.001");
    }
    if let (Some(a), Some(b)) = (&stored.science, &measured.science) {
        all.real("largest wave number", [a.k_max, b.k_max], SHARE * b.k_max, "0.1 %");
        all.limit("P(k) within 1 % to", a.power_within_1_percent_to, b.power_within_1_percent_to);
        all.limit("P(k) within 5 % to", a.power_within_5_percent_to, b.power_within_5_percent_to);
        all.limit("r(k) of 0.99 to", a.r_above_0_99_to, b.r_above_0_99_to);
        all.limit("r(k) of 0.9 to", a.r_above_0_9_to, b.r_above_0_9_to);
        // Quick certificates have none, and are completed by what is measured.
        if a.groups_within_10_percent_from != Limit::NotMeasured {
            all.limit("groups from", a.groups_within_10_percent_from, b.groups_within_10_percent_from);
        }
    }
    all.measures(&stored.measures, &measured.measures);
    all.0
}

#[derive(Default)]
struct Figures(Vec<Figure>);

impl Figures {
    fn push(&mut self, name: &str, [stored, measured]: [String; 2], tolerance: &'static str, differs: bool) {
        self.0.push(Figure { name: name.into(), stored, measured, tolerance, differs });
    }

    fn real(&mut self, name: &str, [stored, measured]: [f64; 2], tolerance: f64, words: &'static str) {
        // Not a number is never within.
        let within = (stored - measured).abs() <= tolerance;
        self.push(name, [stored, measured].map(|v| format!("{v:.4}")), words, !within);
    }

    fn decibels(&mut self, name: &str, pair: [Option<f64>; 2]) {
        let within = match pair {
            [Some(a), Some(b)] => (a - b).abs() <= DECIBELS,
            [a, b] => a == b,
        };
        let words = pair.map(|v| v.map_or_else(|| "identical".into(), |v| format!("{v:.2} dB")));
        self.push(name, words, "0.05 dB", !within);
    }

    fn look(&mut self, name: &str, a: &LookScore, b: &LookScore) {
        self.decibels(name, [a.masked_psnr, b.masked_psnr]);
        self.real(&format!("{name} SSIM"), [a.ssim, b.ssim], SIMILARITY, "0.002");
        self.decibels(&format!("{name} noise-free"), [a.noise_free_masked_psnr, b.noise_free_masked_psnr]);
        self.real(&format!("{name} noise-free SSIM"), [a.noise_free_ssim, b.noise_free_ssim], SIMILARITY, "0.002");
    }

    fn baselines(&mut self, name: &str, a: &LookBaselines, b: &LookBaselines) {
        for (what, a, b) in [("all black", a.all_black, b.all_black), ("uniform box", a.uniform_box, b.uniform_box)] {
            self.decibels(&format!("{name} {what}"), [a.masked_psnr, b.masked_psnr]);
            self.real(&format!("{name} {what} SSIM"), [a.ssim, b.ssim], SIMILARITY, "0.002");
        }
    }

    /// What was asked for, and what is measured of it: nothing where it cannot be, and then no file was made for it.
    fn goal(&mut self, a: &Reached, b: Option<&Reached>) {
        let (at, value) = (a.goal.at, |r: &Reached| a.goal.value_in_words(r.reached));
        let (name, tolerance, words) = match a.goal.kind {
            GoalKind::Psnr => ("held-out masked PSNR".into(), DECIBELS, "0.05 dB"),
            GoalKind::PowerSpectrum => (format!("deviation of P(k) up to k = {at}"), DENSITY, "0.1 %"),
            GoalKind::Correlation => (format!("correlation in cells of {at}"), DENSITY, "0.001"),
            GoalKind::Groups => (format!("deviation of groups from {at} on"), DENSITY, "0.1 %"),
        };
        let within = b.is_some_and(|b| (a.reached - b.reached).abs() <= tolerance);
        self.push(&name, [value(a), b.map_or_else(|| "none".into(), value)], words, !within);
    }

    /// What either has and the other has too.
    fn measures(&mut self, a: &Measures, b: &Measures) {
        if let Some(stored) = &a.goal {
            self.goal(stored, b.goal.as_ref());
        }
        for (a, b) in a.densities.iter().flatten().zip(b.densities.iter().flatten()) {
            let name = |what: &str| format!("{what} in cells of {:.4}", b.edge);
            self.real(&name("density correlation"), [a.correlation, b.correlation], DENSITY, "0.001");
            self.real(&name("density error"), [a.mean_absolute_error, b.mean_absolute_error], DENSITY, "0.001");
            let uniform = [a.uniform_mean_absolute_error, b.uniform_mean_absolute_error];
            self.real(&name("uniform density error"), uniform, DENSITY, "0.001");
        }
        if let (Some(a), Some(b)) = (&a.spacing, &b.spacing) {
            self.real("nearest neighbour", [a.median, b.median], SHARE * b.median, "0.1 %");
            self.real("nearest neighbour, drawn", [a.drawn_median, b.drawn_median], SHARE * b.drawn_median, "0.1 %");
            self.real("its 5th percentile", [a.regularity, b.regularity], DENSITY, "0.001");
            self.real("its 5th percentile, drawn", [a.drawn_regularity, b.drawn_regularity], DENSITY, "0.001");
        }
        if let (Some(a), Some(b)) = (&a.held_out, &b.held_out) {
            self.real("held-out bits", [a.bits, b.bits], DENSITY, "0.001");
            self.real("their kernel estimate", [a.kernel_bits, b.kernel_bits], DENSITY, "0.001");
            for ((share, a), b) in BANDS.iter().zip(&a.transfer).zip(&b.transfer) {
                let deviation = [a, b].map(|t| t.deviation.unwrap_or(0.0));
                self.real(&format!("transfer function to {:.3} k_max", share), deviation, DENSITY, "0.001");
            }
        }
        if let (Some(a), Some(b)) = (&a.subset, &b.subset) {
            self.subset(a, b);
        }
        if let (Some(a), Some(b)) = (&a.pictures, &b.pictures) {
            self.pictures(a, b);
        }
        for ((from, a), b) in GROUP_CLASSES.iter().zip(a.groups.iter().flatten()).zip(b.groups.iter().flatten()) {
            let shares = [("number", a.number, b.number), ("completeness", a.completeness, b.completeness)];
            let more = [("purity", a.purity, b.purity), ("mass", a.mass, b.mass)];
            for (what, a, b) in shares.into_iter().chain(more) {
                let name = format!("groups from {from}: {what}");
                self.real(&name, [a, b].map(|v| v.unwrap_or(0.0)), DENSITY, "0.001");
            }
        }
        if let (Some(a), Some(b)) = (&a.sample, &b.sample) {
            self.push("sample", [a, b].map(|s| s.particles.to_string()), "same", a != b);
        }
        if let (Some(a), Some(b)) = (&a.mass_power, &b.mass_power) {
            self.mass_power(a, b);
        }
    }

    /// P(k) of mass, where both have it.
    fn mass_power(&mut self, a: &MassPower, b: &MassPower) {
        let mut pair = |name: &str, a: &PowerAgreement, b: &PowerAgreement| {
            // Where a model's P(k) is many times the particles', a share is what compares.
            let deviation = [a, b].map(|p| p.largest_deviation.unwrap_or(0.0));
            self.real(&format!("P(k) by mass{name}"), deviation, DENSITY * deviation[1].max(1.0), "0.001");
            let name = format!("P(k) by mass{name} within 1 % to");
            self.limit(&name, a.within_1_percent_to, b.within_1_percent_to);
        };
        pair("", &a.whole, &b.whole);
        for (number, (a, b)) in a.layers.iter().flatten().zip(b.layers.iter().flatten()).enumerate() {
            pair(&format!(", layer {}", number + 1), a, b);
        }
    }

    fn subset(&mut self, a: &Subset, b: &Subset) {
        self.same("subset's particles", [a.kept, b.kept]);
        self.same("subset's bytes", [a.bytes, b.bytes]);
        for (orbit, (a, b)) in ["far", "mid", "near"].iter().zip(a.orbits.iter().zip(&b.orbits)) {
            for (look, (a, b)) in ["paraview", "paraview-no-fxaa", "expected"].iter().zip(a.iter().zip(b)) {
                // A quick certificate has fewer.
                let (Some(a), Some(b)) = (a, b) else { continue };
                self.decibels(&format!("{orbit} {look} subset"), [a.masked_psnr, b.masked_psnr]);
                self.real(&format!("{orbit} {look} subset SSIM"), [a.ssim, b.ssim], SIMILARITY, "0.002");
            }
        }
    }

    fn same<T: ToString + PartialEq>(&mut self, name: &str, pair: [T; 2]) {
        let differs = pair[0] != pair[1];
        self.push(name, pair.map(|v| v.to_string()), "same", differs);
    }

    /// Mean and worst view's decibels and SSIM of a picture as one figure.
    fn pictures(&mut self, a: &Pictures, b: &Pictures) {
        self.same("size of pictures at settings", [a, b].map(|p| format!("{} x {}", p.width, p.height)));
        for (a, b) in a.settings.iter().zip(&b.settings) {
            let close = if b.close { " close" } else { "" };
            let setting = format!("radius {}, opacity {:.4}{close}", b.radius, b.opacity);
            let at = |p: &particlegs::model::PicturesAt| format!("{} {:.4} {}", p.radius, p.opacity, p.close);
            self.same(&format!("{setting}: setting"), [at(a), at(b)]);
            self.look_pictures(&format!("{setting}, paraview"), &a.paraview, &b.paraview);
            self.look_pictures(&format!("{setting}, expected"), &a.expected, &b.expected);
        }
    }

    fn look_pictures(&mut self, name: &str, a: &LookPictures, b: &LookPictures) {
        self.same(&format!("{name}: worst view"), [a.worst_view, b.worst_view]);
        let of = |l: &LookPictures| {
            let rest = [
                ("model", l.mean.model, l.worst.model),
                ("noise-free", l.mean.noise_free, l.worst.noise_free),
                ("all black", l.mean.all_black, l.worst.all_black),
                ("uniform box", l.mean.uniform_box, l.worst.uniform_box),
            ];
            let rest = rest.map(|(what, mean, worst)| (what, Some([mean, worst])));
            rest.into_iter().chain([("subset", l.mean.subset.zip(l.worst.subset).map(|(m, w)| [m, w]))])
        };
        for ((what, a), (_, b)) in of(a).zip(of(b)) {
            let differs = match (a, b) {
                (Some(a), Some(b)) => a.iter().zip(&b).any(|(a, b)| score_differs(a, b)),
                (a, b) => a.is_some() != b.is_some(),
            };
            self.push(&format!("{name}: {what}"), [a, b].map(pair_in_words), "0.05, 0.002", differs);
        }
    }

    fn limit(&mut self, name: &str, a: Limit, b: Limit) {
        let within = match (a, b) {
            (Limit::At(a), Limit::At(b)) => (a - b).abs() <= SHARE * b,
            (a, b) => a == b,
        };
        let words = |l: Limit| match l {
            Limit::At(v) => format!("{v:.4}"),
            Limit::Never => "nowhere".into(),
            Limit::NotMeasured => "not measured".into(),
        };
        self.push(name, [a, b].map(words), "0.1 %", !within);
    }
}

fn score_differs(a: &PictureScore, b: &PictureScore) -> bool {
    let apart = match (a.masked_psnr, b.masked_psnr) {
        (Some(a), Some(b)) => (a - b).abs() > DECIBELS,
        (a, b) => a.is_some() != b.is_some(),
    };
    // Not a number is never within.
    let alike = (a.ssim - b.ssim).abs() <= SIMILARITY;
    apart || !alike
}

/// Decibels of the mean and of the worst view, then SSIM.
fn pair_in_words(pair: Option<[PictureScore; 2]>) -> String {
    let Some([mean, worst]) = pair else { return "none".into() };
    let [a, b] = [mean, worst].map(|s| s.masked_psnr.map_or_else(|| "-".into(), |v| format!("{v:.2}")));
    format!("{a} {b} {:.3} {:.3}", mean.ssim, worst.ssim)
}

/// What no model's certificate can say, a line each: such a file was altered, or written by something
/// else. What is doubtful but possible is in [`doubts`].
pub fn contradictions(c: &Certificate) -> Vec<String> {
    let mut found = Vec::new();
    if !(-1.0..=1.0).contains(&c.density_correlation) {
        found.push(format!("a density correlation of {}", c.density_correlation));
    }
    if !(c.density_mae >= 0.0 && c.density_mae.is_finite()) {
        found.push(format!("a mean error of the density of {}", c.density_mae));
    }
    // One level in one of all pixels is the smallest error there is.
    let most = 20.0 * 255f64.log10() + 10.0 * (f64::from(c.width) * f64::from(c.height)).log10();
    for (name, orbit) in ["far", "mid", "near"].iter().zip(&c.orbits) {
        if orbit.expected.noise_free_masked_psnr.is_some() || orbit.expected.noise_free_ssim < 1.0 {
            found.push(format!("{name}: a noise-free picture that is not itself"));
        }
        for s in [&orbit.paraview, &orbit.paraview_no_fxaa, &orbit.expected] {
            if let Some(v) = [s.masked_psnr, s.noise_free_masked_psnr].into_iter().flatten().find(|v| *v > most + 0.01)
            {
                found.push(format!(
                    "{name}: {v:.2} dB, where pictures of this size reach {most:.2} dB unless identical"
                ));
            }
        }
    }
    if let Some(p) = &c.measures.pictures {
        let looks = p.settings.iter().flat_map(|s| [s.expected.mean, s.expected.worst]);
        if looks.clone().any(|s| s.noise_free.masked_psnr.is_some() || s.noise_free.ssim < 1.0) {
            found.push("at another radius or opacity: a noise-free picture that is not itself".into());
        }
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
    for (name, orbit) in ["far", "mid", "near"].iter().zip(&c.orbits) {
        for (look, s) in [("paraview", &orbit.paraview), ("paraview-no-fxaa", &orbit.paraview_no_fxaa)] {
            if let (Some(model), Some(noise_free)) = (s.masked_psnr, s.noise_free_masked_psnr)
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
    use particlegs::model::{Baselines, Goal, OrbitBaselines, OrbitScore, PictureScore, Science, ScienceOf};

    /// Pictures of 30.5 dB where black scores 12 and a uniform box 16; every number is one that the file holds.
    fn certificate() -> Certificate {
        let look = |noise_free, noise_free_ssim| LookScore {
            masked_psnr: Some(30.5),
            ssim: 0.75,
            noise_free_masked_psnr: noise_free,
            noise_free_ssim,
        };
        let orbit = OrbitScore {
            paraview: look(Some(42.0), 0.99),
            paraview_no_fxaa: look(Some(44.0), 0.99),
            expected: look(None, 1.0),
        };
        let score = |v| PictureScore { masked_psnr: Some(v), ssim: 0.25 };
        let trivial = LookBaselines { all_black: score(12.0), uniform_box: score(16.0) };
        let baselines = OrbitBaselines { paraview: trivial, paraview_no_fxaa: trivial, expected: trivial };
        Certificate {
            width: 1920,
            height: 1080,
            seed: 42,
            orbits: [orbit; 3],
            grid: 50,
            density_correlation: 0.9975,
            density_mae: 0.375,
            science: Some(Science {
                of: ScienceOf::DrawnParticles,
                spectrum_grid: 128,
                k_max: 8.0,
                power_within_1_percent_to: Limit::At(4.0),
                power_within_5_percent_to: Limit::At(8.0),
                r_above_0_99_to: Limit::At(2.5),
                r_above_0_9_to: Limit::At(8.0),
                groups_within_10_percent_from: Limit::At(57.0),
            }),
            baselines: Some(Baselines { orbits: [baselines; 3], uniform_density_mae: 1.25 }),
            measures: Measures::default(),
        }
    }

    fn differing(a: &Certificate, b: &Certificate) -> Vec<String> {
        side_by_side(a, b).into_iter().filter(|f| f.differs).map(|f| f.name).collect()
    }

    #[test]
    fn a_forged_score_differs_and_rounding_does_not() {
        let true_one = certificate();
        assert_eq!(differing(&true_one, &true_one), [""; 0]);
        let mut rounded = true_one;
        rounded.orbits[0].paraview.masked_psnr = Some(30.502);
        rounded.density_correlation += 1e-7;
        assert_eq!(differing(&rounded, &true_one), [""; 0]);
        let mut forged = true_one;
        forged.orbits[1].paraview.masked_psnr = Some(45.0);
        assert_eq!(differing(&forged, &true_one), ["mid paraview"]);
        let mut forged = true_one;
        forged.orbits[2].expected.masked_psnr = None;
        forged.science = Some(Science { groups_within_10_percent_from: Limit::At(20.0), ..true_one.science.unwrap() });
        assert_eq!(differing(&forged, &true_one), ["near expected", "groups from"]);
        // A goal that was not reached, or that no file of these particles is made for.
        let goal =
            |reached| Some(Reached { goal: Goal { kind: GoalKind::PowerSpectrum, asked: 0.01, at: 2.0 }, reached });
        let with = |goal| Certificate { measures: Measures { goal, ..Measures::default() }, ..true_one };
        assert_eq!(differing(&with(goal(0.0093)), &with(goal(0.0094))), [""; 0]);
        assert_eq!(differing(&with(goal(0.0093)), &with(goal(0.0193))), ["deviation of P(k) up to k = 2"]);
        assert_eq!(differing(&with(goal(0.0093)), &true_one), ["deviation of P(k) up to k = 2"]);
        // Early files are compared in what they say.
        let early = Certificate { science: None, baselines: None, ..true_one };
        assert_eq!(differing(&early, &true_one), [""; 0]);
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
        assert_eq!(changed(&|c| c.density_correlation = 1.5), 1);
        assert_eq!(changed(&|c| c.density_mae = f64::NAN), 1);
        assert_eq!(changed(&|c| c.orbits[0].paraview.masked_psnr = Some(120.0)), 1);
        assert_eq!(changed(&|c| c.orbits[0].expected.noise_free_masked_psnr = Some(40.0)), 1);
        assert_eq!(changed(&|c| c.science.as_mut().unwrap().power_within_5_percent_to = Limit::Never), 1);
        assert_eq!(changed(&|c| c.science.as_mut().unwrap().r_above_0_9_to = Limit::At(1.0)), 1);
        let mut forged = c;
        forged.orbits[0].paraview.masked_psnr = Some(45.0);
        assert!(doubts(&forged)[0].contains("45.00 dB, above the noise-free picture's 42.00"));
    }
}
