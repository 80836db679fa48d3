//! Maps of a field of all particles: the mean of those that fall in a pixel, or whose kernels reach it.

use super::Reference;
use particlegs_core::camera::{DensityView, Projection};
use particlegs_core::context::Context;
use particlegs_core::math::{dot, each_axis, float32_scale};
use particlegs_core::picture::{Plane, Size};
use particlegs_core::render::{FieldMap, FieldQuery, FieldWeight, MapComponent};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::memory::require;
use particlegs_particles::{Column, Particles};

/// Values of a field of all particles, in their order: a column for each component; NaN where there is none.
pub struct FieldValues {
    /// One column of a scalar, three of a vector.
    pub columns: Vec<Vec<f64>>,
    /// Whether dispersions are those of decimal logarithms (dex), for scalars.
    pub logarithmic: bool,
    /// The weight of particles beside their masses, if another field weighs; NaN where there is none.
    pub by: Option<Vec<f64>>,
}

impl Reference<'_> {
    /// Mean or dispersion of a field at every pixel, weighted by the particles' masses (numbers without masses) as
    /// [`Reference::surface_density`] spreads them; NaN where there is no particle that has it. The dispersion of a
    /// logarithmic field is that of decimal logarithms.
    pub fn field_map(
        &self,
        values: &FieldValues,
        query: &FieldQuery,
        view: &DensityView,
        size: Size,
        context: &Context<'_>,
    ) -> Result<FieldMap> {
        let particles = self.particles();
        let n = particles.len();
        let wanted = if query.component == MapComponent::Scalar { 1 } else { 3 };
        if values.columns.len() != wanted || values.columns.iter().any(|c| c.len() != n) {
            return Err(Error::argument(format!("field `{}` has no such component", query.name)));
        }
        require("a map of a field", 24 * n as u64)?;
        let mut numbers = numbers(particles, values, query, view)?;
        if values.logarithmic && query.dispersion {
            numbers.iter_mut().for_each(|v| *v = libm::log10(*v));
        }
        // Planes are float32: values about their mean, and scaled, keep the digits of small differences in any unit.
        let is_number = |v: &&f64| v.is_finite();
        let count = numbers.iter().filter(is_number).count().max(1);
        let mean = numbers.iter().filter(is_number).sum::<f64>() / count as f64;
        let scale = float32_scale(numbers.iter().filter(is_number).map(|v| (v - mean).abs()).fold(0.0, f64::max));
        let heaviest = |by: &Vec<f64>| by.iter().filter(is_number).copied().fold(0.0, f64::max);
        let by_scale = values.by.as_ref().map_or(1.0, |by| float32_scale(heaviest(by)));
        // A sum counts each particle's value, whatever its mass.
        let alike = query.per_area || query.weight == FieldWeight::Count;
        let masses = particles.weights().filter(|_| !alike);
        let by = |i: usize| values.by.as_ref().map_or(1.0, |by| by[i] * by_scale);
        if values.by.as_ref().is_some_and(|by| by.len() != n || by.iter().any(|v| *v < 0.0)) {
            let message = "the field that weighs has negative values, or another number of values";
            return Err(Error::argument(message));
        }
        // The map is a quotient of densities, each drawn of particles that weigh as much as one of its sums wants.
        let weigh = |value_of: &(dyn Fn(f64) -> f64 + Sync), by: &(dyn Fn(usize) -> f64 + Sync)| {
            let weight = |i: usize| masses.as_ref().map_or(1.0, |w| f64::from(w[i])) * by(i);
            let weights = parallel::map_range(n, |i| {
                // Particles without a value add to no sum: quotients are of the others.
                let is_known = numbers[i].is_finite() && by(i).is_finite();
                if is_known { (weight(i) * value_of(scale * (numbers[i] - mean))) as f32 } else { 0.0 }
            });
            let mut weighted = particles.clone().with_weights(Column::owned(weights));
            // A mass that all particles have would multiply the counts.
            if alike {
                weighted.meta.particle_mass = None;
            }
            self.weighted(&weighted).surface_density(view, size, context)
        };
        let density = weigh(&|_| 1.0, &by)?;
        let first = weigh(&|v| v, &by)?;
        let second = if query.dispersion { Some(weigh(&|v| v * v, &by)?) } else { None };
        let mut map = Plane { size, data: vec![f64::NAN; density.data.len()] };
        for (i, w) in density.data.iter().map(|w| f64::from(*w)).enumerate().filter(|(_, w)| *w > 0.0) {
            let off = f64::from(first.data[i]) / w;
            let value = mean + off / scale;
            map.data[i] = match &second {
                // Rounding of the planes may leave a difference below zero.
                Some(second) => (f64::from(second.data[i]) / w - off * off).max(0.0).sqrt() / scale,
                None if query.per_area => w * value,
                None => value,
            };
        }
        // Beside the map stands the mass alone, without the field that weighs.
        let density = if values.by.is_some() { weigh(&|_| 1.0, &|_| 1.0)? } else { density };
        Ok(FieldMap { values: map, density })
    }
}

/// The number of each particle that a query asks for.
fn numbers(particles: &Particles, values: &FieldValues, query: &FieldQuery, view: &DensityView) -> Result<Vec<f64>> {
    let vector_of = |i: usize| -> [f64; 3] { each_axis(|k| values.columns[k][i] - query.bulk[k]) };
    let frame = view.camera.frame()?;
    let perspective = matches!(view.camera.projection, Projection::Perspective { .. });
    Ok(parallel::map_range(particles.len(), |i| match query.component {
        MapComponent::Scalar => values.columns[0][i],
        MapComponent::Axis(k) => vector_of(i)[k],
        MapComponent::LineOfSight if perspective => {
            let place = particles.position(i);
            let away: [f64; 3] = each_axis(|k| place[k] - frame.position[k]);
            dot(away, vector_of(i)) / dot(away, away).sqrt().max(f64::MIN_POSITIVE)
        }
        MapComponent::LineOfSight => -dot(frame.axes[2], vector_of(i)),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::camera::{DensityView, Window};

    #[test]
    fn a_pixel_has_the_weighted_mean_of_its_particles() {
        let x = vec![0.25f32, 0.3, 0.75, 0.8];
        let p = Particles::from_columns(x, vec![0.5; 4], vec![0.1, 0.9, 0.2, 0.6])
            .with_weights(Column::owned(vec![1.0f32, 3.0, 1.0, 1.0]));
        let values = FieldValues { columns: vec![vec![10.0, 20.0, f64::NAN, -7.0]], logarithmic: false, by: None };
        let query = FieldQuery {
            name: "heat".into(),
            component: MapComponent::Scalar,
            dispersion: false,
            bulk: [0.0; 3],
            per_area: false,
            weight: FieldWeight::Mass,
            by: None,
        };
        let window = Window { center: [0.5; 3], angles_deg: [0.0; 2], width: 1.0, depth: None };
        let size = Size { width: 4, height: 4 };
        let view = DensityView::orthographic("a", &window, size, &p.bounds(), None).unwrap();
        let lit = |values: &FieldValues, dispersion: bool| -> Vec<f64> {
            let query = FieldQuery { dispersion, ..query.clone() };
            let map = Reference::new(&p).field_map(values, &query, &view, size, &Context::SILENT).unwrap();
            map.values.data.into_iter().filter(|v| v.is_finite()).collect()
        };
        let (means, dispersions) = (lit(&values, false), lit(&values, true));
        // (10 + 3 20) / 4, and the root of 3/16 100.
        assert_eq!((means.len(), dispersions.len()), (2, 2));
        assert!((means[0] - 17.5).abs() < 1e-4 && (dispersions[0] - 18.75f64.sqrt()).abs() < 1e-3, "{means:?}");
        assert!((means[1] + 7.0).abs() < 1e-5 && dispersions[1] < 1e-2, "{dispersions:?}");
        // Another field that weighs: (3 10 + 3 20) / 6.
        let weighed = FieldValues { by: Some(vec![3.0, 1.0, 1.0, f64::NAN]), ..values };
        let lit = lit(&weighed, false);
        assert!(lit.len() == 1 && (lit[0] - 15.0).abs() < 1e-4, "{lit:?}");
        let negative = FieldValues { by: Some(vec![-1.0; 4]), ..weighed };
        assert!(Reference::new(&p).field_map(&negative, &query, &view, size, &Context::SILENT).is_err());
    }
}
