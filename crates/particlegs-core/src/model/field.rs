//! Fields of Gaussians: what their particles carry beside positions and masses.

/// Moments of a field over the particles of each Gaussian, in columns of one value a Gaussian. With mean position m, the
/// field at x is normal about `mean + slope (x - m)` with the covariance `spread`, whatever x.
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
}

impl FieldMoments {
    /// For a field of so many components, 1 or 3, without Gaussians.
    pub fn new(components: usize) -> Self {
        FieldMoments {
            mean: vec![Vec::new(); components],
            slope: vec![Default::default(); components],
            spread: vec![Vec::new(); if components == 1 { 1 } else { 6 }],
            range: vec![[f64::INFINITY, f64::NEG_INFINITY]; components],
        }
    }

    /// Number of components.
    pub fn components(&self) -> usize {
        self.mean.len()
    }

    /// Number of Gaussians.
    pub fn len(&self) -> usize {
        self.mean.first().map_or(0, Vec::len)
    }

    /// No Gaussians?
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Adds all of another's, of the same number of components.
    pub fn append(&mut self, other: &FieldMoments) {
        for (own, others) in self.columns_mut().zip(other.columns()) {
            own.extend_from_slice(others);
        }
        for (own, others) in self.range.iter_mut().zip(&other.range) {
            *own = [own[0].min(others[0]), own[1].max(others[1])];
        }
    }

    /// For the same particles, without Gaussians.
    pub fn emptied(&self) -> Self {
        FieldMoments { range: self.range.clone(), ..FieldMoments::new(self.components()) }
    }

    /// Adds Gaussian `i` of another's after its mean position changed by `moved`: the field follows its slope.
    pub fn push_moved(&mut self, other: &FieldMoments, i: usize, moved: [f64; 3]) {
        for (own, others) in self.columns_mut().zip(other.columns()) {
            own.push(others[i]);
        }
        for (c, own) in self.mean.iter_mut().enumerate() {
            own.last_mut().into_iter().for_each(|mean| *mean = other.mean_at(c, i, moved));
        }
    }

    /// All columns: means, slopes, spreads.
    pub fn columns(&self) -> impl Iterator<Item = &Vec<f64>> {
        self.mean.iter().chain(self.slope.iter().flatten()).chain(&self.spread)
    }

    fn columns_mut(&mut self) -> impl Iterator<Item = &mut Vec<f64>> {
        self.mean.iter_mut().chain(self.slope.iter_mut().flatten()).chain(&mut self.spread)
    }

    /// The mean of component `c` of Gaussian `i` at `from_mean` from the Gaussian's mean.
    pub fn mean_at(&self, c: usize, i: usize, from_mean: [f64; 3]) -> f64 {
        self.mean[c][i] + (0..3).map(|k| self.slope[c][k][i] * from_mean[k]).sum::<f64>()
    }
}
