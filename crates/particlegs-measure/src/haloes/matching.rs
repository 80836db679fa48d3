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
}

/// Centres, masses and radii of haloes that are compared.
struct ComparedHaloes {
    centers: Vec<[f64; 3]>,
    mass: Vec<f64>,
    radius: Vec<f64>,
    count: Vec<f64>,
}

impl ComparedHaloes {
    fn new(catalogue: &HaloCatalogue, domain: &Domain) -> Option<Self> {
        let column = |name: &str| catalogue.column(name).map(<[f64]>::to_vec);
        let (mass, _) = catalogue.masses()?;
        let centers = catalogue.centers.iter().map(|c| domain.local(*c)).collect();
        Some(ComparedHaloes { centers, mass, radius: column("r200m")?, count: column("n200m")? })
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
        let (number, matches, ratios) = found_in(&truth, &other, domain)?;
        let (number_of_other, matches_of_other, _) = found_in(&other, &truth, domain)?;
        let share = |part: u64, all: u64| (all > 0).then(|| part as f64 / all as f64);
        let at = |p: f64| quantile(&ratios, p);
        Ok(Some(HaloMatch {
            truth: number,
            other: number_of_other,
            completeness: share(matches, number),
            purity: share(matches_of_other, number_of_other),
            mass_median: at(0.5),
            mass_scatter: at(0.16).zip(at(0.84)).map(|(low, high)| 0.5 * (high - low)),
        }))
    }
}

/// Large haloes of one, how many of them another has, and their ratios of mass, ascending. The heaviest choose first,
/// each the nearest.
fn found_in(haloes: &ComparedHaloes, other: &ComparedHaloes, domain: &Domain) -> Result<(u64, u64, Vec<f64>)> {
    let mut order: Vec<usize> = (0..haloes.mass.len()).filter(|i| haloes.is_large(*i, LEAST)).collect();
    order.sort_by(|a, b| haloes.mass[*b].total_cmp(&haloes.mass[*a]).then(a.cmp(b)));
    let ratio = |i: usize, j: usize| other.mass[j] / haloes.mass[order[i]];
    let alike =
        |i: usize, j: usize| (1.0 / FACTOR..=FACTOR).contains(&ratio(i, j)) && other.is_large(j, LEAST_COUNTERPART);
    let spheres = order.iter().map(|i| (haloes.centers[*i], haloes.radius[*i]));
    let counterparts = counterparts(spheres, &other.centers, domain, alike)?;
    let mut ratios: Vec<f64> = counterparts.iter().enumerate().filter_map(|(i, j)| Some(ratio(i, (*j)?))).collect();
    ratios.sort_by(f64::total_cmp);
    Ok((order.len() as u64, ratios.len() as u64, ratios))
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
        let itself = HaloMatch::new([&truth, &truth], &domain).unwrap().unwrap();
        assert_eq!((itself.completeness, itself.mass_median, itself.mass_scatter), (Some(1.0), Some(1.0), Some(0.0)));
        assert_eq!(HaloMatch::new([&truth, &HaloCatalogue::default()], &domain).unwrap(), None);
    }
}
