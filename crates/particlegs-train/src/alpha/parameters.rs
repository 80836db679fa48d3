//! Gaussians of the alpha-blend law in training: the numbers that steps move, f32 columns in the training frame, and
//! the scale of their snapshot.

use crate::adam::Averages;
use crate::learner::TrainingSample;
use particlegs_core::camera::Normalisation;
use particlegs_core::math::{Sym3, each_axis};
use particlegs_core::model::{Mixture, VIZMAPPER_PARAMETERS, VizMapper};
use particlegs_core::render::alpha::network::{Adaptation, Setting};
use particlegs_core::render::alpha::{Eye, Gaussian};
use particlegs_core::{Error, Result};

/// Properties of the snapshot that a learner needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TrainingScale {
    pub frame: Normalisation,
    /// Default radius, world units.
    pub radius: f64,
    /// Default opacity.
    pub opacity: f64,
    /// Particles that the Gaussians stand for.
    pub particles: u64,
    pub seed: u64,
}

/// Gaussians in training with their network, and what Adam and density control remember of them.
#[derive(Clone, Debug, PartialEq)]
pub struct Gaussians {
    pub scale: TrainingScale,
    pub parameters: AlphaParameters,
    /// Adam's, a group each.
    pub averages: [Averages; GROUPS],
    pub mapper: Option<VizMapper>,
    pub mapper_averages: Averages,
    /// Of each Gaussian since the last densification: sizes of the changes with its centre on the picture, and in
    /// how many pictures it was seen.
    pub screen: Vec<[f32; 2]>,
}

impl Gaussians {
    /// Before the first step.
    pub(super) fn new(parameters: AlphaParameters, mapper: Option<VizMapper>, scale: TrainingScale) -> Self {
        let n = parameters.len();
        Gaussians {
            scale,
            averages: ParameterGroup::ALL.map(|g| Averages::zeros(n * g.width())),
            mapper_averages: Averages::zeros(if mapper.is_some() { VIZMAPPER_PARAMETERS } else { 0 }),
            screen: vec![[0.0; 2]; n],
            parameters,
            mapper,
        }
    }

    /// The network's setting for a picture: radius and opacity over the defaults.
    pub fn setting(&self, sample: &TrainingSample<'_>) -> Setting {
        let TrainingScale { radius, opacity, .. } = self.scale;
        Setting { radius: sample.view.radius / radius, opacity: sample.view.opacity / opacity }
    }

    /// The camera of a sample in the training frame.
    pub fn eye(&self, sample: &TrainingSample<'_>) -> Result<Eye> {
        Ok(Eye::new(sample.view, sample.crop.full, &self.scale.frame)?.part(sample.crop.corner, sample.crop.size))
    }

    /// Those of a mixture of this law as they are, and its network where it has one, before the first step.
    pub fn from_mixture(mixture: &Mixture, scale: TrainingScale) -> Result<Self> {
        let mut parameters = AlphaParameters::default();
        parameters.push_mixture(mixture, &scale.frame)?;
        let network = mixture.law.alpha_blend().and_then(|law| law.vizmapper.as_deref().cloned());
        Ok(Gaussians::new(parameters, network, scale))
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ParameterGroup {
    Position,
    Scale,
    Rotation,
    Opacity,
    Feature,
}

pub const GROUPS: usize = 5;

impl ParameterGroup {
    pub const ALL: [ParameterGroup; GROUPS] = [
        ParameterGroup::Position,
        ParameterGroup::Scale,
        ParameterGroup::Rotation,
        ParameterGroup::Opacity,
        ParameterGroup::Feature,
    ];

    /// Its name in states and messages.
    pub fn name(self) -> &'static str {
        ["position", "scale", "rotation", "opacity", "feature"][self as usize]
    }

    pub fn width(self) -> usize {
        [3, 3, 4, 1, 1][self as usize]
    }
}

/// `1 / (2 sqrt pi)`: the spherical harmonic of degree 0 (3DGS, `SH2RGB`).
pub const SH0: f64 = 0.282_094_791_773_878_14;

/// Squared distances are taken as no smaller (3DGS).
pub(super) const LEAST_SQUARE: f64 = 1e-7;

pub(super) fn logit(opacity: f64) -> f64 {
    (opacity / (1.0 - opacity)).ln()
}

pub(super) fn feature(grey: f64) -> f64 {
    (grey - 0.5) / SH0
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct GaussianParameters {
    pub position: [f64; 3],
    /// Logarithms of its standard deviations along its axes.
    pub log_scale: [f64; 3],
    /// Quaternion w, x, y, z of any length: column k of its matrix is axis k.
    pub rotation: [f64; 4],
    /// Logit of its opacity.
    pub logit: f64,
    /// `(grey - 0.5) / SH0`.
    pub feature: f64,
}

/// The matrix of a quaternion of length 1.
pub(super) fn rotation_matrix([w, x, y, z]: [f64; 4]) -> [[f64; 3]; 3] {
    [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
}

/// The quaternion of length 1 of a rotation with these columns.
fn quaternion(columns: [[f64; 3]; 3]) -> [f64; 4] {
    let m = |r: usize, c: usize| columns[c][r];
    // The largest of the four squares is found first, so that nothing is divided by a small number.
    let squares = [
        1.0 + m(0, 0) + m(1, 1) + m(2, 2),
        1.0 + m(0, 0) - m(1, 1) - m(2, 2),
        1.0 - m(0, 0) + m(1, 1) - m(2, 2),
        1.0 - m(0, 0) - m(1, 1) + m(2, 2),
    ];
    let largest = (0..4).fold(0, |a, b| if squares[b] > squares[a] { b } else { a });
    let twice = 2.0 * squares[largest].max(0.0).sqrt();
    let (x, y, z) = (m(2, 1) - m(1, 2), m(0, 2) - m(2, 0), m(1, 0) - m(0, 1));
    let (xy, xz, yz) = (m(0, 1) + m(1, 0), m(0, 2) + m(2, 0), m(1, 2) + m(2, 1));
    let component = 0.25 * twice;
    match largest {
        0 => [component, x / twice, y / twice, z / twice],
        1 => [x / twice, component, xy / twice, xz / twice],
        2 => [y / twice, xy / twice, component, yz / twice],
        _ => [z / twice, xz / twice, yz / twice, component],
    }
}

impl GaussianParameters {
    pub fn from_world(frame: &Normalisation, mean: [f64; 3], cov: &Sym3, opacity: f64, grey: f64) -> Self {
        let e = cov.scale(frame.scale * frame.scale).eigen();
        let mut axes = e.vectors;
        let [a, b, c] = axes;
        let triple = a[0] * (b[1] * c[2] - b[2] * c[1])
            + a[1] * (b[2] * c[0] - b[0] * c[2])
            + a[2] * (b[0] * c[1] - b[1] * c[0]);
        // Eigenvectors can be left-handed, and no quaternion stands for a reflection.
        if triple < 0.0 {
            axes[2] = c.map(|v| -v);
        }
        GaussianParameters {
            position: each_axis(|k| (mean[k] - frame.center[k]) * frame.scale),
            // Not the maximum of the two: a value that is not a number must be seen.
            log_scale: e.values.map(|v| if v < LEAST_SQUARE { LEAST_SQUARE } else { v }.ln() * 0.5),
            rotation: quaternion(axes),
            // Opacities of 0 and 1 have no finite logit.
            logit: logit(opacity.clamp(1e-6, 1.0 - 1e-6)),
            feature: feature(grey),
        }
    }

    /// Columns are the axes times their standard deviations: the covariance is M M^T.
    pub fn root(&self) -> [[f64; 3]; 3] {
        let norm = self.rotation.iter().map(|v| v * v).sum::<f64>().sqrt();
        let r = rotation_matrix(self.rotation.map(|v| v / norm));
        let s = self.log_scale.map(f64::exp);
        each_axis(|i| each_axis(|k| r[i][k] * s[k]))
    }

    pub fn cov(&self) -> Sym3 {
        let m = self.root();
        let dot = |i: usize, j: usize| (0..3).map(|k| m[i][k] * m[j][k]).sum();
        Sym3([dot(0, 0), dot(0, 1), dot(0, 2), dot(1, 1), dot(1, 2), dot(2, 2)])
    }

    pub fn grey(&self) -> f64 {
        (0.5 + SH0 * self.feature).max(0.0)
    }

    /// Opacity before any adaptation.
    pub fn opacity(&self) -> f64 {
        Adaptation::STATIC.opacity(self.logit)
    }

    /// Mean of its log-scales: its size as the network sees it.
    pub fn mean_log_scale(&self) -> f64 {
        self.log_scale.iter().sum::<f64>() / 3.0
    }

    pub fn gaussian(&self, adapted: &Adaptation) -> Gaussian {
        Gaussian {
            mean: self.position,
            cov: self.cov().scale(adapted.scale * adapted.scale),
            opacity: adapted.opacity(self.logit),
            grey: self.grey(),
        }
    }

    fn numbers(&self) -> [&[f64]; GROUPS] {
        [
            &self.position,
            &self.log_scale,
            &self.rotation,
            std::slice::from_ref(&self.logit),
            std::slice::from_ref(&self.feature),
        ]
    }
}

/// All Gaussians, f32 in the training frame, a column a group: positions, logarithms of the standard deviations
/// along the axes and quaternions w, x, y, z of those, logits of opacities, grey levels as `(grey - 0.5) / SH0`; a
/// Gaussian's numbers stand together.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct AlphaParameters(pub [Vec<f32>; GROUPS]);

impl AlphaParameters {
    pub fn len(&self) -> usize {
        self.0[ParameterGroup::Opacity as usize].len()
    }

    pub(super) fn get(&self, i: usize) -> GaussianParameters {
        let [position, scale, rotation, opacity, feature] = &self.0;
        GaussianParameters {
            position: each_axis(|k| position[3 * i + k].into()),
            log_scale: each_axis(|k| scale[3 * i + k].into()),
            rotation: std::array::from_fn(|k| rotation[4 * i + k].into()),
            logit: opacity[i].into(),
            feature: feature[i].into(),
        }
    }

    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    pub(super) fn push(&mut self, one: &GaussianParameters) {
        for (column, numbers) in self.0.iter_mut().zip(one.numbers()) {
            column.extend(numbers.iter().map(|v| *v as f32));
        }
    }

    pub(super) fn push_mixture(&mut self, m: &Mixture, frame: &Normalisation) -> Result<()> {
        let law = m.law.alpha_blend().ok_or_else(|| Error::argument("the model is not of the alpha-blend law"))?;
        for i in 0..m.len() {
            self.push(&GaussianParameters::from_world(frame, m.mean_of(i), &m.cov_of(i), law.opacity[i], law.grey[i]));
        }
        Ok(())
    }

    pub fn zeros(n: usize) -> Self {
        AlphaParameters(ParameterGroup::ALL.map(|g| vec![0.0; n * g.width()]))
    }
}

/// Keeps the rows of a column that are wanted.
pub(super) fn keep_rows(column: &mut Vec<f32>, width: usize, keep: &[bool]) {
    let mut to = 0;
    for (i, keep) in keep.iter().enumerate() {
        if *keep {
            column.copy_within(i * width..(i + 1) * width, to);
            to += width;
        }
    }
    column.truncate(to);
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::math::Random;

    #[test]
    fn quaternions_and_matrices() {
        for i in 0..200 {
            let mut r = Random::new(1, 0, i);
            let mut q: [f64; 4] = [0; 4].map(|_| r.normal());
            if i < 4 {
                q = std::array::from_fn(|k| if k as u64 == i { 1.0 } else { 0.0 });
            }
            let n = q.iter().map(|v| v * v).sum::<f64>().sqrt();
            let q = q.map(|v| v / n);
            let m = rotation_matrix(q);
            let back = quaternion(each_axis(|c| each_axis(|r| m[r][c])));
            let same = (0..4).map(|k| q[k] * back[k]).sum::<f64>().abs();
            assert!((same - 1.0).abs() < 1e-12, "{q:?} {back:?}");
        }
    }
}
