//! Models as splats that are blended: those of the alpha-blend law as they are, those of the optical-depth
//! law approximated at one radius and opacity.
//!
//! A Gaussian of `n` particles and covariance `C` has at its centre the optical depth `n A1 r^2 / (2 pi
//! sqrt(det2))` of docs/law/depth.md, `A1 = 2 pi a e^2` and `det2` the determinant of `S = C + r^2 1` across
//! the line of sight `d`: `det2 = det(S) d^T S^-1 d`. Its mean over all directions is an elliptic integral,
//! that of a peak `1 / sqrt(d^T S^-1 d)` Carlson's `R_F` of the eigenvalues of `S^-1`.
//!
//! The splat has the opacity `1 - exp(-tau)` of the centre. The opacity of a Gaussian of depth, `1 - exp(-tau G)`, is
//! flatter than `G`: over the picture it sums to `Ein(tau) / tau` of the depth. So the splat's covariance is `S`
//! times `Ein(tau) / (1 - exp(-tau))`, which keeps that sum: 1 for what is faint, 1.26 at `tau = 1`.

use particlegs_core::context::Context;
use particlegs_core::math::Sym3;
use particlegs_core::model::{AlphaBlend, Law, LawKind, Mixture, Model};
use particlegs_core::splat::opacity_integral;
use particlegs_core::{Error, Result};

/// Opacities are kept this far from 0 and 1, where logits are infinite.
const EDGE: f64 = 1e-9;
/// Viewers draw in 8 bits, and leave out what is fainter.
const FAINTEST: f64 = 1.0 / 255.0;
/// Largest relative spread at which the series of `R_F` is taken: its error is the spread's sixth power.
const SPREAD: f64 = 1e-3;

/// The part of a model that 8-bit viewers leave out.
#[derive(Clone, Copy, Debug, Default, serde::Serialize)]
pub struct Faint {
    /// Share of the Gaussians whose opacity is below 1/255.
    pub gaussians: f64,
    /// Share of the particles that they stand for.
    pub particles: f64,
}

/// The model as one of the alpha-blend law, for particles of this radius and opacity, and what of it is
/// fainter than viewers draw. An alpha-blend model stays as it is at its own radius and opacity, and is bent by its
/// network for others.
pub fn as_splats(mut model: Model, radius: f64, opacity: f64, context: &Context<'_>) -> Result<(Model, Faint)> {
    if !(radius.is_finite() && radius > 0.0) {
        return Err(Error::argument(format!("radius {radius} must be positive")));
    }
    if !(opacity > 0.0 && opacity <= 1.0) {
        return Err(Error::argument(format!("opacity {opacity} is outside (0, 1]")));
    }
    if model.metadata.law == LawKind::OpticalDepth {
        for block in model.layers.iter_mut().flat_map(|l| &mut l.content) {
            context.check()?;
            blended(&mut block.gaussians, radius, opacity)?;
        }
        model.metadata.law = LawKind::AlphaBlend;
    } else if (radius, opacity) != (model.metadata.default_radius, model.metadata.default_opacity) {
        model = model.bent(radius, opacity, context)?;
    }
    let faint = faint(&model);
    Ok((model, faint))
}

fn blended(g: &mut Mixture, radius: f64, opacity: f64) -> Result<()> {
    let mut columns = AlphaBlend { grey: vec![1.0; g.len()], ..AlphaBlend::default() };
    columns.opacity.reserve_exact(g.len());
    let round = Sym3::scaled_identity(radius * radius);
    for i in 0..g.len() {
        let wide = g.cov_of(i).add(&round);
        let (deviations, _) = wide.deviations_and_turn();
        let tau = mean_peak(g.count[i], opacity, deviations.map(|d| d / radius));
        let finite = tau.is_finite() && wide.0.iter().chain(&g.mean_of(i)).all(|v| v.is_finite());
        if !finite {
            return Err(Error::argument(format!("Gaussian {i} of a block is too large or too small for splats")));
        }
        let splat = wide.scale(flatter(tau));
        (0..6).for_each(|k| g.cov[k][i] = splat.0[k]);
        // `exp_m1` keeps the digits of faint splats.
        columns.opacity.push((-(-tau).exp_m1()).clamp(EDGE, 1.0 - EDGE));
    }
    g.law = Law::AlphaBlend(columns);
    Ok(())
}

/// Optical depth at the centre of `count` particles of this opacity whose Gaussian, widened by their radius, has
/// deviations `q` in units of it: the mean over the directions of view.
fn mean_peak(count: f64, opacity: f64, q: [f64; 3]) -> f64 {
    let mean = carlson_rf(q.map(|q| 1.0 / (q * q)));
    count * opacity_integral(opacity) * mean / (2.0 * std::f64::consts::PI * q[0] * q[1] * q[2])
}

/// The factor on a splat's covariance, `Ein(tau) / (1 - exp(-tau))`: the entire exponential integral
/// `Ein(x) = sum of (-1)^(k+1) x^k / (k k!)`, which is `ln x` and Euler's constant where x is large
/// (NIST DLMF 6.2, 6.6).
fn flatter(tau: f64) -> f64 {
    /// From here on the rest of the logarithm is below 1e-10; before, the series keeps seven digits.
    const LARGE: f64 = 20.0;
    const EULER: f64 = 0.577_215_664_901_532_9;
    // The quotient would be 0 / 0; this is its limit.
    if tau < f64::EPSILON {
        return 1.0;
    }
    let ein = if tau >= LARGE {
        tau.ln() + EULER
    } else {
        let (mut sum, mut term, mut k) = (0.0, 1.0, 0.0);
        // Terms grow until k is beyond tau, so that a small one before says nothing.
        while k < 2.0 * LARGE || f64::abs(term) > 1e-17 {
            k += 1.0;
            term *= -tau / k;
            sum -= term / k;
        }
        sum
    };
    ein / -(-tau).exp_m1()
}

/// Carlson's symmetric elliptic integral of the first kind, for arguments above 0: the mean of
/// `1 / sqrt(x u^2 + y v^2 + z w^2)` over unit vectors (u, v, w). By duplication, until the series
/// converges (Carlson 1995; NIST DLMF 19.36).
fn carlson_rf([mut x, mut y, mut z]: [f64; 3]) -> f64 {
    loop {
        let mean = (x + y + z) / 3.0;
        let [a, b] = [1.0 - x / mean, 1.0 - y / mean];
        let c = -a - b;
        let spread = a.abs().max(b.abs()).max(c.abs());
        // Arguments that are not numbers end, too.
        if spread < SPREAD || spread.is_nan() {
            let (e2, e3) = (a * b - c * c, a * b * c);
            return (1.0 - e2 / 10.0 + e3 / 14.0 + e2 * e2 / 24.0 - 3.0 * e2 * e3 / 44.0) / mean.sqrt();
        }
        let [p, q, r] = [x.sqrt(), y.sqrt(), z.sqrt()];
        let shift = p * q + q * r + r * p;
        [x, y, z] = [x, y, z].map(|v| 0.25 * (v + shift));
    }
}

fn faint(model: &Model) -> Faint {
    let (mut out, mut all) = (Faint::default(), 0.0);
    for g in model.blocks().map(|b| &b.gaussians) {
        let opacities = g.law.alpha_blend().map_or(&[][..], |a| &a.opacity);
        for (opacity, count) in opacities.iter().zip(&g.count) {
            all += count;
            if *opacity < FAINTEST {
                out.gaussians += 1.0;
                out.particles += count;
            }
        }
    }
    let share = |part: f64, whole: f64| if whole > 0.0 { part / whole } else { 0.0 };
    Faint { gaussians: share(out.gaussians, model.gaussians() as f64), particles: share(out.particles, all) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    /// The mean over directions, summed.
    fn summed(arguments: [f64; 3]) -> f64 {
        const STEPS: usize = 400;
        let mut sum = 0.0;
        for i in 0..STEPS {
            let u = -1.0 + (2.0 * i as f64 + 1.0) / STEPS as f64;
            for j in 0..STEPS {
                let angle = std::f64::consts::PI * (2.0 * j as f64 + 1.0) / STEPS as f64;
                let (s, c) = angle.sin_cos();
                let across = (1.0 - u * u).sqrt();
                let d = [across * c, across * s, u];
                sum += (0..3).map(|k| arguments[k] * d[k] * d[k]).sum::<f64>().sqrt().recip();
            }
        }
        sum / (STEPS * STEPS) as f64
    }

    #[test]
    fn the_integral_is_the_mean_over_directions() {
        // NIST DLMF and Carlson's own table: R_F(1, 2, 4), and of equal arguments.
        assert!((carlson_rf([1.0, 2.0, 4.0]) - 0.685_085_816_632_6).abs() < 1e-9);
        assert!((carlson_rf([4.0; 3]) - 0.5).abs() < 1e-15);
        for arguments in [[1.0, 2.0, 4.0], [1.0, 0.1, 0.5], [0.02, 1.0, 1.0], [1.0, 1.0, 0.01]] {
            let (closed, sum) = (carlson_rf(arguments), summed(arguments));
            assert!((closed / sum - 1.0).abs() < 2e-3, "{arguments:?}: {closed} {sum}");
        }
        assert!(carlson_rf([f64::NAN, 1.0, 1.0]).is_nan());
        assert!(carlson_rf([1e-300, 1.0, 1e12]).is_finite());
    }

    /// A splat hides as much of the picture in sum as its depth does.
    #[test]
    fn splats_hide_as_much_as_the_depth() {
        for tau in [1e-20, 1e-3, 0.3, 1.0, 5.0, 19.9, 20.1, 300.0] {
            let steps = 200_000;
            // Over area in units of the Gaussian's, from 0 to where nothing is left.
            let end = 2.0 * (f64::max(tau, 1.0).ln() + 40.0);
            let hidden = |a: f64| -(-tau * (-0.5 * a).exp()).exp_m1();
            let sum: f64 =
                (0..steps).map(|i| hidden((i as f64 + 0.5) / steps as f64 * end)).sum::<f64>() * end / steps as f64;
            let splat = 2.0 * flatter(tau) * -(-tau).exp_m1();
            assert!((splat / sum - 1.0).abs() < 1e-5, "{tau}: {splat} {sum}");
        }
        assert!((flatter(1.0) - 1.260_2).abs() < 1e-4);
    }

    /// Whatever the shape, the mean over directions of the depth at the centre.
    #[test]
    fn peaks_are_those_of_the_law() {
        let (count, opacity, radius) = (40.0, 0.05, 0.3);
        for i in 0..20 {
            let mut r = Random::new(5, 1, i);
            let v: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| r.normal()));
            let cov = v.iter().fold(Sym3::default(), |s, v| s.add(&Sym3::outer(*v)));
            let wide = cov.add(&Sym3::scaled_identity(radius * radius));
            let inverse = wide.inverse().unwrap();
            let mut mean = 0.0;
            for _ in 0..20_000 {
                let d: [f64; 3] = std::array::from_fn(|_| r.normal());
                let across = wide.det() * inverse.quadratic(d) / d.iter().map(|x| x * x).sum::<f64>();
                mean += count * opacity_integral(opacity) * radius * radius
                    / (2.0 * std::f64::consts::PI * across.sqrt())
                    / 20_000.0;
            }
            let ours = mean_peak(count, opacity, wide.deviations_and_turn().0.map(|d| d / radius));
            assert!((ours / mean - 1.0).abs() < 0.02, "{ours} {mean}");
        }
    }

    /// The splats of the sample's model, blended, against the picture that they approximate: the law that this
    /// program draws alpha-blend models by, so that what viewers do otherwise is not in it.
    #[test]
    fn blended_splats_look_like_the_optical_depth() {
        use particlegs_compress::{Options, Target, compress};
        use particlegs_core::camera::{View, base_distance, spherical_camera};
        use particlegs_core::checkpoint::NoCheckpoints;
        use particlegs_core::context::Context;
        use particlegs_core::model::CertificateLevel;
        use particlegs_core::picture::{Size, masked_psnr};
        use particlegs_core::render::{Scene, draw};
        use particlegs_core::splat::ToneStyle;
        use particlegs_particles::Particles;

        let sample = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/nbody64");
        let particles = Particles::open_raw(&[sample.into()]).unwrap();
        let (certificate, effort) = (CertificateLevel::None, particlegs_core::model::Effort::Fast);
        let options = Options { target: Target::Gaussians(4000), certificate, effort, ..Options::default() };
        let model = compress(&particles, &options, &mut NoCheckpoints, &Context::SILENT).unwrap().model;
        let (m, size) = (&model.metadata, Size { width: 480, height: 270 });
        let camera = spherical_camera(m.bounds.center(), 30.0, 20.0, base_distance(&m.bounds, size));
        for (opacity, least) in [(0.05, 30.0), (0.5, 26.5)] {
            let view = View { name: "view".into(), camera, radius: m.default_radius, opacity };
            let wanted = draw(&Scene::new(&model), &view, size, ToneStyle::Expected, &Context::SILENT).unwrap();
            let (splats, faint) = as_splats(model.clone(), m.default_radius, opacity, &Context::SILENT).unwrap();
            let got = draw(&Scene::new(&splats), &view, size, ToneStyle::Expected, &Context::SILENT).unwrap();
            let score = masked_psnr(&wanted, &got).unwrap_or(f64::INFINITY);
            eprintln!("opacity {opacity}: {score:.2} dB, {faint:?}");
            assert!(score > least, "{opacity}: {score} dB");
        }
    }
}
