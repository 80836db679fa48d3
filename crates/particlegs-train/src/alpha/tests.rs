//! Gradients against differences of the plain twin: the law as a reader would write it, in f64, as a function of every
//! parameter.

use super::parameters::{AlphaParameters, GROUPS, GaussianParameters, ParameterGroup, SH0};
use super::pass::{ForwardPass, LoadedNetwork};
use particlegs_core::camera::{Normalisation, View};
use particlegs_core::context::Context;
use particlegs_core::math::{Random, Sym3, each_axis};
use particlegs_core::model::{VizMapper, VizRanges};
use particlegs_core::picture::{Plane, Size};
use particlegs_core::render::alpha::network::twin::{plain as network, stirred};
use particlegs_core::render::alpha::network::{Network, Setting};
use particlegs_core::render::alpha::plain::blend;
use particlegs_core::render::alpha::{CutOffs, Eye, Gaussian};
use particlegs_core::render::testing;

const SIZE: Size = Size { width: 37, height: 21 };
const FRAME: Normalisation = Normalisation { center: [0.0; 3], scale: 1.0 };

/// No threshold at which brightness jumps; the largest alpha, where it only bends, stays.
const SMOOTH: CutOffs = CutOffs { least_alpha: 1e-12, most_alpha: 0.99, least_transmittance: 0.0 };

fn view(position: [f64; 3]) -> View {
    testing::view(position, 0.01, 0.05)
}

/// Gaussians of all kinds: among them one without any width, one beyond the guard band that reaches
/// into the picture, one nearly opaque, one that is black.
fn some() -> AlphaParameters {
    let mut p = AlphaParameters::default();
    for i in 0..14 {
        let mut one = drawn(5, i);
        match i {
            0 => one.log_scale = [-12.0, -12.5, -13.0],
            1 => one = GaussianParameters { position: [0.9, -0.2, 0.3], log_scale: [-1.0, -0.6, -0.9], ..one },
            2 => one = GaussianParameters { logit: 9.0, log_scale: [-2.0, -1.5, -2.2], ..one },
            3 => one.feature = -4.0,
            _ => {}
        }
        p.push(&one);
    }
    p
}

fn check(position: [f64; 3], setting: Setting, mapper: Option<VizMapper>) {
    let eye = Eye::new(&view(position), SIZE, &FRAME).unwrap();
    let p = some();
    let mut draw = Random::new(8, 1, 2);
    let want: Vec<f32> = (0..SIZE.pixels()).map(|_| draw.normal() as f32).collect();
    let identity = 0.01;
    let used = mapper.as_ref().map(|m| LoadedNetwork { network: Network::new(m), ranges: m.ranges, identity });
    let pass = ForwardPass::new(&eye, &p, used.as_ref(), setting, SMOOTH, &Context::SILENT).unwrap();
    let gradient = pass.back(&Plane { size: SIZE, data: want.clone() });
    let parameters = mapper.as_ref().map(|m| &m.parameters[..]);
    let mut twin = DoubleParameters::new(&p, parameters, VizRanges::TRAINING, identity);
    let want: Vec<f64> = want.into_iter().map(f64::from).collect();
    let h = 1e-5;
    let difference = |twin: &mut DoubleParameters, at: &dyn Fn(&mut DoubleParameters) -> &mut f64| {
        let original = *at(twin);
        *at(twin) = original + h;
        let up = twin.value(&eye, setting, &SMOOTH, &want);
        *at(twin) = original - h;
        let down = twin.value(&eye, setting, &SMOOTH, &want);
        *at(twin) = original;
        (up - down) / (2.0 * h)
    };
    let close = |name: &str, slopes: &[f32], law: &[f64]| {
        let largest = law.iter().fold(0.0f64, |a, b| a.max(b.abs()));
        assert!(largest > 0.0, "{name}");
        for (i, (f, l)) in slopes.iter().zip(law).enumerate() {
            let error = (f64::from(*f) - l).abs();
            assert!(error < 1e-4 * largest + 1e-3 * l.abs(), "{name} {i}: {f} for {l}, largest {largest}");
        }
    };
    for g in ParameterGroup::ALL {
        let law: Vec<f64> = (0..p.0[g as usize].len())
            .map(|i| difference(&mut twin, &move |t: &mut DoubleParameters| &mut t.columns[g as usize][i]))
            .collect();
        close(g.name(), &gradient.parameters.0[g as usize], &law);
    }
    if let Some(network) = &gradient.network {
        let law: Vec<f64> = (0..network.len())
            .map(|i| difference(&mut twin, &move |t: &mut DoubleParameters| &mut t.network.as_mut().unwrap()[i]))
            .collect();
        close("network", network, &law);
    }
}

#[test]
fn gradients_are_differences_of_the_twin() {
    for position in [[0.3, 0.5, 3.0], [0.1, 0.2, 0.9]] {
        check(position, Setting { radius: 1.0, opacity: 1.0 }, None);
        check(position, Setting { radius: 1.3, opacity: 0.8 }, Some(stirred(2)));
    }
}

/// The floor on opacity holds for some: what is behind it moves nothing.
#[test]
fn gradients_at_the_floor_are_differences_too() {
    check([0.3, 0.5, 3.0], Setting { radius: 0.6, opacity: 0.4 }, Some(stirred(2)));
}

#[test]
fn what_is_not_seen_wants_nothing_and_order_does_not_matter() {
    let eye = Eye::new(&view([0.3, 0.5, 3.0]), SIZE, &FRAME).unwrap();
    let want = Plane { size: SIZE, data: vec![1.0; SIZE.pixels()] };
    let setting = Setting { radius: 1.0, opacity: 1.0 };
    let back = |p: &AlphaParameters| {
        ForwardPass::new(&eye, p, None, setting, CutOffs::PUBLISHED, &Context::SILENT).unwrap().back(&want)
    };
    let ones: Vec<GaussianParameters> = (0..40).map(|i| drawn(6, i)).collect();
    let mut forth = AlphaParameters::default();
    ones.iter().for_each(|o| forth.push(o));
    // Behind the camera, and not a number.
    forth.push(&GaussianParameters { position: [1.0, 2.0, 12.0], ..ones[0] });
    forth.push(&GaussianParameters { position: [f64::NAN, 0.0, 0.0], ..ones[0] });
    let mut turned = AlphaParameters::default();
    ones.iter().rev().for_each(|o| turned.push(o));
    let (a, b) = (back(&forth), back(&turned));
    for i in 0..40 {
        assert_eq!(a.parameters.get(i), b.parameters.get(39 - i));
    }
    for i in [40, 41] {
        assert_eq!(a.parameters.get(i), AlphaParameters::zeros(1).get(0));
    }
    let none = AlphaParameters::default();
    assert!(
        ForwardPass::new(&eye, &none, None, setting, CutOffs::PUBLISHED, &Context::SILENT)
            .unwrap()
            .drawn
            .data
            .iter()
            .all(|v| *v == 0.0)
    );
}

/// Three Gaussians that leave less than 1e-4: what is behind them wants nothing, and they want the
/// same with and without it.
#[test]
fn what_is_hidden_wants_nothing() {
    let eye = Eye::new(&view([0.0, 0.0, 3.0]), SIZE, &FRAME).unwrap();
    let mut draw = Random::new(8, 1, 3);
    let want = Plane { size: SIZE, data: (0..SIZE.pixels()).map(|_| draw.normal() as f32).collect() };
    let setting = Setting { radius: 1.0, opacity: 1.0 };
    let back = |p: &AlphaParameters| {
        ForwardPass::new(&eye, p, None, setting, CutOffs::PUBLISHED, &Context::SILENT).unwrap().back(&want)
    };
    let mut wall = AlphaParameters::default();
    for k in 0..3 {
        let rotation = [1.0, 0.0, 0.0, 0.0];
        let position = [0.0, 0.0, 1.0 - 0.1 * f64::from(k)];
        wall.push(&GaussianParameters { position, log_scale: [2.0, 2.0, -3.0], rotation, logit: 12.0, feature: 0.3 });
    }
    let mut both = wall.clone();
    (0..20).for_each(|i| both.push(&drawn(6, i)));
    let (alone, hidden) = (back(&wall), back(&both));
    for i in 0..23 {
        let law = if i < 3 { alone.parameters.get(i) } else { AlphaParameters::zeros(1).get(0) };
        assert_eq!(hidden.parameters.get(i), law, "{i}");
    }
}

#[derive(Clone)]
struct DoubleParameters {
    columns: [Vec<f64>; GROUPS],
    network: Option<Vec<f64>>,
    ranges: VizRanges,
    identity: f64,
}

impl DoubleParameters {
    fn new(p: &AlphaParameters, network: Option<&[f32]>, ranges: VizRanges, identity: f64) -> Self {
        let wide = |v: &[f32]| v.iter().map(|v| f64::from(*v)).collect::<Vec<f64>>();
        DoubleParameters { columns: p.0.each_ref().map(|c| wide(c)), network: network.map(wide), ranges, identity }
    }

    /// The sum over pixels of `want` times brightness, and what holds the network.
    fn value(&self, eye: &Eye, setting: Setting, cut: &CutOffs, want: &[f64]) -> f64 {
        let n = self.columns[ParameterGroup::Opacity as usize].len();
        let mut penalty = 0.0;
        let gaussians: Vec<Gaussian> = (0..n)
            .map(|i| {
                let at = |g: ParameterGroup, k: usize| self.columns[g as usize][i * g.width() + k];
                let q: [f64; 4] = std::array::from_fn(|k| at(ParameterGroup::Rotation, k));
                let norm = q.iter().map(|v| v * v).sum::<f64>().sqrt();
                let s: [f64; 3] = each_axis(|k| at(ParameterGroup::Scale, k));
                let logit = at(ParameterGroup::Opacity, 0);
                let (mut scale, mut odds) = (1.0, 1.0);
                if let Some(p) = &self.network {
                    let mean = (s[0] + s[1] + s[2]) / 3.0;
                    let x = [setting.radius - 1.0, setting.opacity - 1.0, (mean + 8.0) / 2.0, (logit + 3.0) / 4.0];
                    let [ds, d_o] = network(p, x);
                    scale = setting.radius * (1.0 + self.ranges.scale * ds);
                    odds = (setting.opacity * (1.0 + self.ranges.opacity * d_o)).max(self.ranges.floor);
                    penalty += (scale - setting.radius).powi(2) + (odds - setting.opacity).powi(2);
                }
                let mut cov = Sym3::default();
                for k in 0..3 {
                    let axis = turned(q.map(|v| v / norm), k);
                    cov = cov.add(&Sym3::outer(axis.map(|v| v * scale * s[k].exp())));
                }
                Gaussian {
                    mean: each_axis(|k| at(ParameterGroup::Position, k)),
                    cov,
                    opacity: 1.0 / (1.0 + (-logit - odds.ln()).exp()),
                    grey: (0.5 + SH0 * at(ParameterGroup::Feature, 0)).max(0.0),
                }
            })
            .collect();
        let picture = blend(eye, &gaussians, cut);
        picture.iter().zip(want).map(|(b, w)| b * w).sum::<f64>() + self.identity * penalty / n as f64
    }
}

/// The unit vector of axis `k` turned by a quaternion: q v q*.
fn turned(q: [f64; 4], k: usize) -> [f64; 3] {
    let mut v = [0.0; 4];
    v[k + 1] = 1.0;
    let times = |a: [f64; 4], b: [f64; 4]| {
        [
            a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
            a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
            a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
            a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
        ]
    };
    let r = times(times(q, v), [q[0], -q[1], -q[2], -q[3]]);
    [r[1], r[2], r[3]]
}

/// Parameters of one Gaussian, drawn.
fn drawn(seed: u64, i: u64) -> GaussianParameters {
    let mut r = particlegs_core::math::Random::new(seed, 3, i);
    GaussianParameters {
        position: [0; 3].map(|_| 1.2 * r.uniform() - 0.6),
        log_scale: [0; 3].map(|_| -3.0 + r.normal()),
        rotation: [0; 4].map(|_| r.normal()),
        logit: 2.0 * r.normal(),
        feature: r.normal() + 0.5,
    }
}
