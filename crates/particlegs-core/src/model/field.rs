//! Fields of Gaussians: what their particles carry beside positions and masses.

use super::Columns;
use crate::math::Sym3;

/// Moments of a field over the particles of each Gaussian, in columns of one value a Gaussian. With mean position m, the
/// field at x is normal about `mean + slope (x - m)` with the covariance `spread`, whatever x. Of a logarithmic field all of
/// this is said of the natural logarithm of its values, which need not be normal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FieldMoments {
    /// Means at the Gaussians' means, one column a component, in the field's unit.
    pub mean: Vec<Vec<f64>>,
    /// Change of each component along x, y and z: three columns a component, the field's unit over a world unit.
    pub slope: Vec<[Vec<f64>; 3]>,
    /// Covariance about that: one column (the variance) of a scalar; xx, xy, xz, yy, yz, zz of a vector.
    pub spread: Vec<Vec<f64>>,
    /// Least and largest value of each component over all particles.
    pub range: Vec<[f64; 2]>,
    /// Of a logarithmic field, one column: what the logarithm of the values' mean at any place is above that of log-normal
    /// values, `mean + slope (x - m) + spread / 2`.
    pub excess: Option<Vec<f64>>,
    /// Of a scalar: the correlation, of each Gaussian, of what its particles differ by from the mean at their place with the
    /// same of another scalar, by that one's name. One of two fields has it ([`super::Mixture::correlation`]).
    pub correlations: Columns<Vec<f64>>,
}

impl FieldMoments {
    /// For a field of so many components, 1 or 3, without Gaussians.
    pub fn new(components: usize) -> Self {
        FieldMoments {
            mean: vec![Vec::new(); components],
            slope: vec![Default::default(); components],
            spread: vec![Vec::new(); if components == 1 { 1 } else { 6 }],
            range: vec![[f64::INFINITY, f64::NEG_INFINITY]; components],
            excess: None,
            correlations: Columns::default(),
        }
    }

    /// For a field that describes logarithms, without Gaussians.
    pub fn logarithmic() -> Self {
        FieldMoments { excess: Some(Vec::new()), ..FieldMoments::new(1) }
    }

    /// Of the same kind, without Gaussians.
    pub fn same_kind(&self) -> Self {
        let moments =
            if self.excess.is_some() { FieldMoments::logarithmic() } else { FieldMoments::new(self.components()) };
        FieldMoments { correlations: self.correlations.map(|_| Vec::new()), ..moments }
    }

    /// Number of components.
    pub fn components(&self) -> usize {
        self.mean.len()
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.mean.first().map_or(0, Vec::len)
    }

    /// Whether it has no Gaussians.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds all of another's, of the same number of components. Correlations that either lacks are left out.
    pub fn append(&mut self, other: &FieldMoments) {
        self.correlations.retain(|name| other.correlations.get(name).is_some());
        for (name, column) in self.correlations.iter_mut() {
            other.correlations.get(name).into_iter().for_each(|others| column.extend_from_slice(others));
        }
        for (column, others) in self.columns_mut().zip(other.columns()) {
            column.extend_from_slice(others);
        }
        for (range, others) in self.range.iter_mut().zip(&other.range) {
            *range = [range[0].min(others[0]), range[1].max(others[1])];
        }
    }

    /// For the same particles, without Gaussians.
    pub fn emptied(&self) -> Self {
        FieldMoments { range: self.range.clone(), ..self.same_kind() }
    }

    /// Adds Gaussian `i` of another's after its mean position changed by `moved`: the field follows its slope.
    pub fn push_moved(&mut self, other: &FieldMoments, i: usize, moved: [f64; 3]) {
        for (column, others) in self.columns_mut().zip(other.columns()) {
            column.push(others[i]);
        }
        for (name, column) in self.correlations.iter_mut() {
            column.push(other.correlations.get(name).map_or(0.0, |others| others[i]));
        }
        for (c, means) in self.mean.iter_mut().enumerate() {
            means.last_mut().into_iter().for_each(|mean| *mean = other.mean_at(c, i, moved));
        }
    }

    /// Adds what lies at `share` (0 to 1) of the way from Gaussian `i` to Gaussian `j` of another's of the same kind.
    pub fn push_between(&mut self, [from, to]: [(&FieldMoments, usize); 2], share: f64) {
        let ((a, i), (b, j)) = (from, to);
        for (column, (a, b)) in self.columns_mut().zip(a.columns().zip(b.columns())) {
            column.push(a[i] + share * (b[j] - a[i]));
        }
        for (name, column) in self.correlations.iter_mut() {
            let correlation_of = |f: &FieldMoments, i: usize| f.correlations.get(name).map_or(0.0, |c| c[i]);
            column.push(correlation_of(a, i) + share * (correlation_of(b, j) - correlation_of(a, i)));
        }
    }

    /// Columns of moments: means, slopes, spreads, of a logarithmic field the excess.
    pub fn columns(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.mean.iter().chain(self.slope.iter().flatten()).chain(&self.spread).chain(&self.excess)
    }

    fn columns_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        self.mean.iter_mut().chain(self.slope.iter_mut().flatten()).chain(&mut self.spread).chain(&mut self.excess)
    }

    /// [`FieldMoments::columns`] and the correlations.
    pub(super) fn all_columns_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        let correlations = self.correlations.iter_mut().map(|(_, column)| column);
        let moments = self.mean.iter_mut().chain(self.slope.iter_mut().flatten());
        moments.chain(&mut self.spread).chain(&mut self.excess).chain(correlations)
    }

    /// The mean of component `c` of Gaussian `i` at `from_mean` from the Gaussian's mean.
    pub fn mean_at(&self, c: usize, i: usize, from_mean: [f64; 3]) -> f64 {
        self.mean[c][i] + (0..3).map(|k| self.slope[c][k][i] * from_mean[k]).sum::<f64>()
    }

    /// The mean of the values of component `c` of Gaussian `i` at `from_mean` from its mean, in the field's unit; that of a
    /// logarithmic field lies within its range.
    pub fn value_at(&self, c: usize, i: usize, from_mean: [f64; 3]) -> f64 {
        let mean = self.mean_at(c, i, from_mean);
        match &self.excess {
            Some(excess) => {
                let [least, largest] = self.range[c];
                libm::exp((mean + 0.5 * self.spread[0][i] + excess[i]).clamp(least, largest))
            }
            None => mean,
        }
    }

    /// The mean of the values of component `c` over all of Gaussian `i`, whose covariance is `cov`.
    pub fn overall_value(&self, c: usize, i: usize, cov: &Sym3) -> f64 {
        match &self.excess {
            Some(excess) => {
                let slope = [0, 1, 2].map(|k| self.slope[c][k][i]);
                libm::exp(self.mean[c][i] + 0.5 * (self.spread[0][i] + cov.quadratic(slope)) + excess[i])
            }
            None => self.mean[c][i],
        }
    }

    /// Variance of component `c` of Gaussian `i` about its mean, at any place.
    pub fn variance(&self, c: usize, i: usize) -> f64 {
        // The diagonal of xx, xy, xz, yy, yz, zz.
        self.spread[if self.components() == 1 { 0 } else { [0, 3, 5][c] }][i]
    }

    /// Least and largest value of component `c`, in the field's unit.
    pub fn value_range(&self, c: usize) -> [f64; 2] {
        if self.excess.is_some() { self.range[c].map(libm::exp) } else { self.range[c] }
    }
}
