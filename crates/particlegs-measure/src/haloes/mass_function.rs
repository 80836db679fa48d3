//! Haloes per volume and mass.

use super::table::HaloCatalogue;
use particlegs_particles::Domain;

/// Bins a decade of mass.
const PER_DECADE: f64 = 5.0;
/// Parts of the box along each axis, left out one after the other for errors.
const PARTS: usize = 2;

/// A bin of the mass function.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct MassFunctionBin {
    /// Ends of the bin, in the unit of the masses.
    pub masses: [f64; 2],
    /// Haloes in it.
    pub haloes: u64,
    /// Haloes per volume and decade of mass.
    pub density: f64,
    /// Its standard error, by leaving out one octant of the box after the other.
    pub error: f64,
}

/// The mass function of a catalogue in a box from `least` on: bins of a fifth of a decade that begin there, up to the
/// heaviest halo. Masses are those of [`HaloCatalogue::masses`]; volumes are in the box's own unit.
pub fn mass_function(catalogue: &HaloCatalogue, domain: &Domain, [least, most]: [f64; 2]) -> Vec<MassFunctionBin> {
    let Some((masses, _)) = catalogue.masses() else { return Vec::new() };
    if !(least > 0.0 && most >= least && most.is_finite()) {
        return Vec::new();
    }
    let bin = |m: f64| (libm::log10(m / least) * PER_DECADE).floor();
    let bins = bin(most) as usize + 1;
    let parts = PARTS.pow(3);
    let mut counts = vec![vec![0u64; parts]; bins];
    for (center, m) in catalogue.centers.iter().zip(masses).filter(|(_, m)| *m >= least && *m <= most) {
        let local = domain.local(*center);
        let along =
            |k: usize| (domain.along(&local, k) / domain.length[k] * PARTS as f64).clamp(0.0, PARTS as f64 - 1.0);
        let part = (0..3).fold(0, |part, k| part * PARTS + along(k) as usize);
        if let Some(counts) = counts.get_mut(bin(m) as usize) {
            counts[part] += 1;
        }
    }
    let per = 1.0 / (domain.volume() / PER_DECADE);
    let n = parts as f64;
    let mass_bin = |(i, counts): (usize, &Vec<u64>)| {
        let total: u64 = counts.iter().sum();
        // What is left of the box without a part is scaled up to the whole.
        let without = |part_count: &u64| (total - part_count) as f64 * n / (n - 1.0);
        let mean = counts.iter().map(without).sum::<f64>() / n;
        let square =
            counts.iter().map(|part_count| (without(part_count) - mean) * (without(part_count) - mean)).sum::<f64>();
        let end = |i: usize| least * libm::pow(10f64, i as f64 / PER_DECADE);
        let error = ((n - 1.0) / n * square).sqrt() * per;
        MassFunctionBin { masses: [end(i), end(i + 1)], haloes: total, density: total as f64 * per, error }
    };
    counts.iter().enumerate().map(mass_bin).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::haloes::HaloColumn;
    use particlegs_core::math::Random;

    #[test]
    fn bins_hold_all_haloes_and_errors_are_those_of_counts() {
        let domain = Domain::upright([0.0; 3], [10.0; 3], [true; 3]);
        let mut r = Random::new(3, 0, 0);
        let masses: Vec<f64> = (0..8000).map(|_| 100.0 / r.uniform().max(1e-3)).collect();
        let centers = (0..8000).map(|_| [10.0 * r.uniform(), 10.0 * r.uniform(), 10.0 * r.uniform()]).collect();
        let column = |name: &str| HaloColumn { name: name.into(), values: masses.clone(), ..HaloColumn::default() };
        let columns = vec![column("m200m"), column("r200m")];
        let catalogue = HaloCatalogue { columns, centers, ..HaloCatalogue::default() };
        let bins = mass_function(&catalogue, &domain, [100.0, 1e5]);
        assert_eq!(bins.iter().map(|b| b.haloes).sum::<u64>(), 8000);
        assert!((bins[0].masses[1] / 100.0 - 10f64.powf(0.2)).abs() < 1e-12 && bins.len() == 16);
        for b in &bins[..6] {
            assert!((b.density - b.haloes as f64 / 1000.0 * 5.0).abs() < 1e-9);
            // Haloes without clustering have errors of roots of their numbers.
            let expected = (b.haloes as f64).sqrt() / 1000.0 * 5.0;
            assert!(b.error > 0.3 * expected && b.error < 2.0 * expected, "{b:?}");
        }
        assert_eq!(mass_function(&catalogue, &domain, [0.0, 1.0]), []);
    }
}
