//! Evaluation and certificate of a tiny model of the sample; for other tests, the certificate of a good model.

use super::*;
use particlegs_core::context::{Context, ProgressEvent, ProgressSink};
use particlegs_core::math::Sym3;
use particlegs_core::model::{
    Block, Certificate, CertificateLevel, DensityMetrics, LawKind, Layer, Limit, Mass, Metadata, Mixture, Model,
    OrbitMetrics, PictureScore, PictureScores, ScienceMetrics, ViewMetrics,
};
use particlegs_core::picture::Size;
use particlegs_core::render::Scene;
use particlegs_particles::Particles;
use particlegs_particles::testing::{cancelled, sample};

const SIZE: Size = Size { width: 160, height: 90 };

/// The moments of the particles in each of `n` x `n` x `n` cells.
fn tiny(particles: &Particles, n: usize) -> Model {
    let bounds = particles.bounds();
    let (e, min) = (bounds.extent(), bounds.min);
    let mut sums = vec![[0.0f64; 10]; n * n * n];
    for i in 0..particles.len() {
        let p = particles.position(i);
        let c = [0, 1, 2].map(|k| (((p[k] - min[k]) / e[k] * n as f64) as usize).min(n - 1));
        let s = &mut sums[(c[0] * n + c[1]) * n + c[2]];
        let products = [p[0] * p[0], p[0] * p[1], p[0] * p[2], p[1] * p[1], p[1] * p[2], p[2] * p[2]];
        s.iter_mut().zip([1.0].into_iter().chain(p).chain(products)).for_each(|(s, v)| *s += v);
    }
    let mut gaussians = Mixture::default();
    for s in sums.iter().filter(|s| s[0] > 0.0) {
        let m = [s[1] / s[0], s[2] / s[0], s[3] / s[0]];
        let second = Sym3(std::array::from_fn(|k| s[4 + k] / s[0]));
        gaussians.push(m, second.add(&Sym3::outer(m).scale(-1.0)), s[0], s[0]);
    }
    let count = particles.len() as u64;
    let block = Block { bounds, count, mass: count as f64, gaussians };
    let metadata = Metadata { cell: particles.meta.cell, ..Metadata::new(LawKind::OpticalDepth, count, bounds) };
    let layers = vec![Layer { name: "all".into(), mass: Mass::Unknown, content: vec![block] }];
    Model { metadata, layers, certificate: None }
}

#[test]
fn a_finer_model_scores_higher_and_floors_stand_below() {
    let particles = sample();
    let (coarse, fine) = (tiny(&particles, 6), tiny(&particles, 24));
    let views = evaluation_views(&coarse.metadata, SIZE, 42, 1);
    let [coarse, fine] =
        [coarse, fine].map(|m| evaluate(&m, &particles, &views, SIZE, None, &Context::SILENT).unwrap());
    assert_eq!(fine.views.len(), 3);
    for (orbit, m) in &fine.by_orbit {
        let worse = coarse.by_orbit.iter().find(|o| o.0 == *orbit).unwrap().1;
        for (a, b) in [(m.paraview, worse.paraview), (m.expected, worse.expected)] {
            assert!(a.model.masked_psnr > b.model.masked_psnr && a.model.ssim > b.model.ssim, "{orbit}");
            assert!(b.model.masked_psnr > b.all_black.masked_psnr, "{orbit}");
        }
        assert_eq!(m.expected.noise_free.masked_psnr, None);
        let no_fxaa = m.paraview_no_fxaa;
        assert!(no_fxaa.noise_free.masked_psnr > no_fxaa.model.masked_psnr, "{orbit}");
        assert!(no_fxaa.gap.masked_psnr > Some(0.0) && no_fxaa.shot_noise.flatten().is_some());
    }
}

#[test]
fn held_out_views_rank_models() {
    let particles = sample();
    let (coarse, fine) = (tiny(&particles, 6), tiny(&particles, 24));
    let views = held_out_views(&coarse.metadata, SIZE, 42, 1);
    let held_out = HeldOutPictures::draw(&particles, &views, SIZE, &Context::SILENT).unwrap();
    let [a, b] =
        [&coarse, &fine].map(|m| held_out.expected_masked_psnr(&Scene::new(m), &Context::SILENT).unwrap().unwrap());
    assert!(b > a + 1.0, "{a} {b}");
    let scored = evaluate(&fine, &particles, &views, SIZE, None, &Context::SILENT).unwrap();
    assert_eq!(scored.mean.expected.model.masked_psnr, Some(b));
}

#[test]
#[ignore = "half a minute of pictures and groups: .ci/later runs it"]
fn certificates_repeat_and_know_the_density() {
    let particles = sample();
    let (coarse, fine) = (tiny(&particles, 6), tiny(&particles, 24));
    let steps = PhaseRecorder::default();
    let measure = CertificateInput {
        particles: &particles,
        seed: 42,
        level: CertificateLevel::Full,
        memory: None,
        reached: None,
    };
    let c = measure.certificate(&fine, 20_000, &Context::SILENT.with_sink(&steps)).unwrap();
    assert_eq!((c.views.width, c.views.height, c.density.cells), (1920, 1080, 50));
    let identical = Some(PictureScore { masked_psnr: None, ssim: 1.0 });
    assert!(c.views.orbits.iter().all(|o| o.expected.noise_free == identical));
    let bounds = &fine.metadata.bounds;
    let [coarse, uniform] = density_of(&coarse, &particles, bounds, 50, &Context::SILENT).unwrap();
    let d = &c.density;
    assert!(d.correlation > coarse.correlation && d.mean_absolute_error < coarse.mean_absolute_error);
    assert!(d.correlation > 0.8 && d.correlation < 1.0, "{}", d.correlation);
    // Trivial references: the model beats both pictures, a uniform density has the mean of |delta|.
    for orbit in &c.views.orbits {
        let e = &orbit.expected;
        let [model, black, even, subset] = [e.model, e.all_black, e.uniform_box, e.subset].map(Option::unwrap);
        assert!(model.masked_psnr > Some(20.0) && model.masked_psnr > even.masked_psnr, "{e:?}");
        assert!(even.masked_psnr > black.masked_psnr && model.masked_psnr > subset.masked_psnr, "{e:?}");
        assert!(model.ssim > black.ssim.max(even.ssim));
    }
    // So does the model the random subset of its bytes; larger splats lose less, and close views more.
    let subset = c.subset.unwrap();
    assert!(subset.bytes <= 20_000 && subset.bytes > 19_900 && subset.kept > 5000, "{subset:?}");
    for (at, s) in c.pictures.unwrap().settings.iter().enumerate() {
        assert_eq!(s.close, at == 6);
        for look in [s.paraview, s.expected] {
            let [worst, mean, even] =
                [look.worst.model, look.mean.model, look.mean.uniform_box].map(|s| s.unwrap().masked_psnr);
            assert!(worst <= mean && (mean > even || s.radius > 1.0), "{s:?}");
            assert!(look.mean.subset.is_some() && look.mean.noise_free.unwrap().ssim > 0.7, "{s:?}");
        }
    }
    assert!(uniform.correlation.abs() < 1e-9);
    assert_eq!(uniform.mean_absolute_error, d.uniform_mean_absolute_error);
    assert!(d.uniform_mean_absolute_error > 1.0);
    steps.check();
}

/// Phases with the steps that they were to have and had.
#[derive(Default)]
struct PhaseRecorder(std::sync::Mutex<Vec<(String, u64, u64)>>);

impl ProgressSink for PhaseRecorder {
    fn event(&self, event: ProgressEvent<'_>) {
        let mut phases = self.0.lock().unwrap();
        match event {
            ProgressEvent::Begin { phase, total } => phases.push((phase.into(), total, 0)),
            ProgressEvent::Advance(steps) => phases.last_mut().unwrap().2 += steps,
            _ => {}
        }
    }
}

impl PhaseRecorder {
    /// Every part of a measurement shows how far it is, and comes to its end.
    fn check(&self) {
        let phases = self.0.lock().unwrap();
        for wanted in [
            "ParaView's picture",
            "noise-free picture",
            "density",
            "drawing particles",
            "power spectra",
            "density in cells",
            "nearest neighbours",
            "friends of friends",
        ] {
            assert!(phases.iter().any(|p| p.0.ends_with(wanted)), "{wanted}: {phases:?}");
        }
        for (phase, total, done) in phases.iter().filter(|p| p.1 > 0) {
            let share = *done as f64 / *total as f64;
            assert!((0.95..=1.05).contains(&share), "{phase}: {done} of {total}");
        }
    }
}

#[test]
fn evaluations_stop_and_refuse_odd_views() {
    let particles = sample();
    let model = tiny(&particles, 4);
    let mut views = evaluation_views(&model.metadata, SIZE, 42, 1);
    let stopped = evaluate(&model, &particles, &views, SIZE, None, &cancelled());
    assert!(matches!(stopped, Err(particlegs_core::Error::Cancelled)));
    assert!(evaluate(&model, &particles, &[], SIZE, None, &Context::SILENT).is_err());
    views[1].opacity = 2.0;
    assert!(evaluate(&model, &particles, &views, SIZE, None, &Context::SILENT).is_err());
}

/// Two species of different masses: each has its own P(k), and a layer whose Gaussians are wrong is told.
#[test]
fn power_of_mass_is_told_by_layer() {
    let particles = sample();
    let (n, half) = (particles.len(), particles.len() / 2);
    let domain = particlegs_particles::Domain::from_particles(&particles);
    assert!(mass_power(&tiny(&particles, 8), &particles, &domain, &Context::SILENT).unwrap().is_none());
    // In the snapshot's order, which is not the file's.
    let layer = |name: &str, content, each| Layer { name: name.into(), mass: Mass::Each(each), content };
    let weights = (0..n).map(|i| if i < half { 4.0 } else { 1.0 }).collect();
    let particles = particles
        .with_weights(particlegs_particles::Column::owned(weights))
        .with_layers(vec![layer("stars", 0..half, 4.0), layer("dm", half..n, 1.0)]);
    let model_of = |cells: [usize; 2]| {
        let layer_of = |k: usize| {
            let alone = particles.of_layer(&particles.layers()[k]);
            let content = tiny(&alone, cells[k]).layers.remove(0).content;
            particles.layers()[k].with(content)
        };
        Model { layers: vec![layer_of(1), layer_of(0)], ..tiny(&particles, 1) }
    };
    let [good, bad] = [[24, 24], [2, 24]].map(|cells| {
        let power = mass_power(&model_of(cells), &particles, &domain, &Context::SILENT).unwrap().unwrap();
        assert_eq!(power.layers.iter().flatten().count(), 2);
        [power.whole, power.layers[0].unwrap(), power.layers[1].unwrap()].map(|p| p.within_1_percent_to.place())
    });
    assert!(good[1].is_some() && good[1] == bad[1], "{good:?} {bad:?}");
    assert!(good[2] > bad[2] && good[0] > bad[0], "{good:?} {bad:?}");
}

/// A region of a snapshot that is taken for too large has the particles that were asked for, and as many are drawn.
#[test]
fn large_snapshots_are_measured_in_a_region() {
    let particles = sample();
    let model = tiny(&particles, 24);
    let mut corners = Vec::new();
    for seed in [0, 5] {
        let scope = ParticlesWithModel::new(&model, &particles, seed, 20_000, &Context::SILENT).unwrap().unwrap();
        let (sample, n) = (scope.sample.unwrap(), scope.particles.len());
        assert!((8_000..=20_500).contains(&n) && sample.particles == n as u64, "{n}");
        let inside = |p: [f64; 3]| (0..3).all(|k| p[k] >= sample.bounds.min[k] && p[k] < sample.bounds.max[k]);
        let inside_count = (0..particles.len()).filter(|&i| inside(particles.position(i))).count();
        assert!(inside_count == n && (0..n).all(|i| inside(scope.particles.position(i))), "{inside_count} {n}");
        let drawn = scope.draw(7, &Context::SILENT).unwrap().unwrap();
        assert!((drawn.len() as f64 / n as f64 - 1.0).abs() < 0.1, "{} {n}", drawn.len());
        assert!((0..drawn.len()).all(|i| inside(drawn.position(i))) && scope.model.gaussians() < model.gaussians() / 4);
        corners.push(sample.bounds.min);
    }
    assert!(corners[0] != corners[1]);
    assert!(
        ParticlesWithModel::new(&model, &particles, 0, 1 << 20, &Context::SILENT).unwrap().unwrap().sample.is_none()
    );
}

/// Pictures of 30.5 dB where black scores 12 and a uniform box 16; every number is one that the file holds.
pub(super) fn certificate() -> Certificate {
    let score = |masked_psnr, ssim| Some(PictureScore { masked_psnr, ssim });
    let look = |noise_free, noise_free_ssim| PictureScores {
        model: score(Some(30.5), 0.75),
        noise_free: score(noise_free, noise_free_ssim),
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
