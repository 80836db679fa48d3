//! One catalogue against another: haloes that are in both, and ratios of their masses.

use super::catalogue::HaloCatalogue;
use crate::stats::{counterparts, quantile};
use particlegs_core::{Error, Result};
use particlegs_particles::Domain;

/// Particles within R200m of a halo that must be found again, and of one that it may be found as.
const LEAST: f64 = 300.0;
const LEAST_COUNTERPART: f64 = 200.0;
/// Masses of the same halo differ by at most this factor.
const FACTOR: f64 = 2.0;

/// Agreement of two catalogues: haloes of each that are found in the other, and their masses.
#[derive(Clone, Debug, PartialEq, serde::Serialize)]
pub struct HaloMatch {
    /// Haloes of the truth with 300 particles and more within R200m.
    pub truth: u64,
    /// Those of the other.
    pub other: u64,
    /// Share of the truth's that the other has: within R200m, in mass within a factor of 2, with 200 particles and
    /// more.
    pub completeness: Option<f64>,
    /// Share of the other's that the truth has.
    pub purity: Option<f64>,
    /// Median of other / truth of M200m, of the truth's haloes that are found.
    pub mass_median: Option<f64>,
    /// Half the distance between its 16th and 84th percentiles.
    pub mass_scatter: Option<f64>,
    /// Mean of (other - truth) / error of M200m, of the same haloes, where the other has errors: 0 and, below, 1 and 0.003
    /// if these are normal and what they say.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_pull_mean: Option<f64>,
    /// Its standard deviation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_pull_sd: Option<f64>,
    /// Share of them beyond 3 on either side.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mass_pulls_above_3: Option<f64>,
}

/// Centres, masses and radii of haloes that are compared.
struct ComparedHaloes {
    centers: Vec<[f64; 3]>,
    mass: Vec<f64>,
    error: Option<Vec<f64>>,
    radius: Vec<f64>,
    count: Vec<f64>,
}

impl ComparedHaloes {
    fn new(catalogue: &HaloCatalogue, domain: &Domain) -> Option<Self> {
        let column = |name: &str| catalogue.column(name).map(<[f64]>::to_vec);
        let (mass, _) = catalogue.masses()?;
        let error = column("m200m_err").or_else(|| column("n200m_err"));
        let centers = catalogue.centers.iter().map(|c| domain.local(*c)).collect();
        Some(ComparedHaloes { centers, mass, error, radius: column("r200m")?, count: column("n200m")? })
    }

    fn is_large(&self, i: usize, least: f64) -> bool {
        self.count[i] >= least && self.mass[i] > 0.0 && self.radius[i] > 0.0
    }
}

impl HaloMatch {
    /// Compares catalogues in one box and the same unit of length; `None` where one has no masses.
    ///
    /// # Errors
    /// Masses in different units, or of one in particles.
    pub fn new([truth, other]: [&HaloCatalogue; 2], domain: &Domain) -> Result<Option<HaloMatch>> {
        let units = [truth, other].map(|c| c.masses().map(|(_, unit)| unit));
        if let [Some(truth_unit), Some(other_unit)] = units
            && truth_unit != other_unit
        {
            let message =
                format!("its masses are in {other_unit}, those of the truth in {truth_unit}: they cannot be compared");
            return Err(Error::input_with("the catalogue", message, "state masses and their unit for both"));
        }
        let both = [truth, other].map(|c| ComparedHaloes::new(c, domain));
        let [Some(truth), Some(other)] = both else { return Ok(None) };
        let (number, pairs) = found_in(&truth, &other, domain)?;
        let (number_of_other, pairs_of_other) = found_in(&other, &truth, domain)?;
        let share = |part: usize, all: usize| (all > 0).then(|| part as f64 / all as f64);
        let mut ratios: Vec<f64> = pairs.iter().map(|[i, j]| other.mass[*j] / truth.mass[*i]).collect();
        ratios.sort_by(f64::total_cmp);
        let at = |p: f64| quantile(&ratios, p);
        let pull = |error: &Vec<f64>, [i, j]: &[usize; 2]| (other.mass[*j] - truth.mass[*i]) / error[*j];
        let pulls: Vec<f64> = other.error.iter().flat_map(|e| pairs.iter().map(|pair| pull(e, pair))).collect();
        let mean_of = |value: &dyn Fn(f64) -> f64| {
            (!pulls.is_empty()).then(|| pulls.iter().map(|p| value(*p)).sum::<f64>() / pulls.len() as f64)
        };
        let mean = mean_of(&|p| p);
        Ok(Some(HaloMatch {
            truth: number as u64,
            other: number_of_other as u64,
            completeness: share(pairs.len(), number),
            purity: share(pairs_of_other.len(), number_of_other),
            mass_median: at(0.5),
            mass_scatter: at(0.16).zip(at(0.84)).map(|(low, high)| 0.5 * (high - low)),
            mass_pull_mean: mean,
            mass_pull_sd: mean.and_then(|mean| mean_of(&|p| (p - mean) * (p - mean))).map(f64::sqrt),
            mass_pulls_above_3: mean_of(&|p| f64::from(p.abs() > 3.0)),
        }))
    }
}

/// The number of large haloes of one, and those that another has, each with its counterpart. The heaviest choose first,
/// each the nearest.
fn found_in(haloes: &ComparedHaloes, other: &ComparedHaloes, domain: &Domain) -> Result<(usize, Vec<[usize; 2]>)> {
    let mut order: Vec<usize> = (0..haloes.mass.len()).filter(|i| haloes.is_large(*i, LEAST)).collect();
    order.sort_by(|a, b| haloes.mass[*b].total_cmp(&haloes.mass[*a]).then(a.cmp(b)));
    let alike = |i: usize, j: usize| {
        let ratio = other.mass[j] / haloes.mass[order[i]];
        (1.0 / FACTOR..=FACTOR).contains(&ratio) && other.is_large(j, LEAST_COUNTERPART)
    };
    let spheres = order.iter().map(|i| (haloes.centers[*i], haloes.radius[*i]));
    let counterparts = counterparts(spheres, &other.centers, domain, alike)?;
    let pairs = order.iter().zip(counterparts).filter_map(|(i, j)| Some([*i, j?])).collect();
    Ok((order.len(), pairs))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haloes::HaloColumn;

    fn catalogue(haloes: &[([f64; 3], f64, f64)]) -> HaloCatalogue {
        let column = |name: &str, value_of: &dyn Fn(usize) -> f64| HaloColumn {
            name: name.into(),
            values: (0..haloes.len()).map(value_of).collect(),
            ..HaloColumn::default()
        };
        HaloCatalogue {
            columns: vec![
                column("n200m", &|i| haloes[i].1),
                column("m200m", &|i| haloes[i].1),
                column("r200m", &|i| haloes[i].2),
            ],
            centers: haloes.iter().map(|h| h.0).collect(),
            ..HaloCatalogue::default()
        }
    }

    #[test]
    fn haloes_are_found_again_within_their_radius_and_a_factor_of_two() {
        let domain = Domain::upright([0.0; 3], [10.0; 3], [true; 3]);
        let truth = catalogue(&[
            ([9.9, 5.0, 5.0], 1000.0, 0.5),
            ([2.0; 3], 400.0, 0.4),
            ([4.0; 3], 500.0, 0.4),
            ([7.0; 3], 299.0, 0.4),
            ([8.0; 3], f64::NAN, f64::NAN),
        ]);
        let other = catalogue(&[
            ([0.1, 5.0, 5.0], 1100.0, 0.5),
            ([2.0, 2.0, 2.3], 250.0, 0.4),
            ([4.0, 4.5, 4.0], 500.0, 0.4),
            ([7.0; 3], 310.0, 0.4),
        ]);
        let halo_match = HaloMatch::new([&truth, &other], &domain).unwrap().unwrap();
        assert_eq!((halo_match.truth, halo_match.other), (3, 3));
        assert_eq!((halo_match.completeness, halo_match.purity), (Some(2.0 / 3.0), Some(2.0 / 3.0)));
        assert!((halo_match.mass_median.unwrap() - 0.5 * (1.1 + 0.625)).abs() < 1e-12);
        assert_eq!((halo_match.mass_pull_mean, halo_match.mass_pulls_above_3), (None, None));
        let mut with_errors = other.clone();
        let errors = vec![50.0, 30.0, 100.0, 100.0];
        with_errors.columns.push(HaloColumn { name: "m200m_err".into(), values: errors, ..HaloColumn::default() });
        let pulls = HaloMatch::new([&truth, &with_errors], &domain).unwrap().unwrap();
        // Of the two haloes that are found they are 2 and -5.
        assert_eq!((pulls.mass_pull_mean, pulls.mass_pull_sd), (Some(-1.5), Some(3.5)));
        assert_eq!(pulls.mass_pulls_above_3, Some(0.5));
        let itself = HaloMatch::new([&truth, &truth], &domain).unwrap().unwrap();
        assert_eq!((itself.completeness, itself.mass_median, itself.mass_scatter), (Some(1.0), Some(1.0), Some(0.0)));
        assert_eq!(HaloMatch::new([&truth, &HaloCatalogue::default()], &domain).unwrap(), None);
    }
}
