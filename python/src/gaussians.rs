//! The Gaussians of a model as arrays.

use crate::arrays::view;
use numpy::PyArrayDyn;
use particlegs_core::model::{Mixture, Model, Quantity};
use particlegs_export::{FieldNumbers, all_gaussians};
use pyo3::prelude::*;

/// Columns of all Gaussians, layer by layer and block by block.
#[pyclass(frozen, subclass, module = "particlegs._particlegs")]
pub struct Gaussians {
    means: Vec<f64>,
    covariances: Vec<f64>,
    counts: Vec<f64>,
    masses: Option<Vec<f64>>,
    /// Opacities and grey levels for the alpha-blend law.
    opacities: Option<[Vec<f64>; 2]>,
    layers: Vec<(String, usize, usize)>,
    fields: Vec<FieldArrays>,
}

/// Moments of a field of all Gaussians; NaN in layers without it.
struct FieldArrays {
    name: String,
    components: usize,
    means: Vec<f64>,
    slopes: Vec<f64>,
    covariances: Vec<f64>,
}

impl Gaussians {
    pub fn of(model: &Model) -> Self {
        let n = model.gaussians();
        let (mut means, mut covariances) = (Vec::with_capacity(3 * n), Vec::with_capacity(9 * n));
        let (mut counts, mut masses) = (Vec::with_capacity(n), Vec::with_capacity(n));
        let mut opacities = [Vec::new(), Vec::new()];
        let mut layers = Vec::new();
        for layer in &model.layers {
            let first = counts.len();
            for g in layer.content.iter().map(|b| &b.gaussians) {
                for i in 0..Mixture::len(g) {
                    means.extend(g.mean_of(i));
                    let [xx, xy, xz, yy, yz, zz] = g.cov_of(i).0;
                    covariances.extend([xx, xy, xz, xy, yy, yz, xz, yz, zz]);
                    masses.push(layer.mass.unit_or_one() * g.mass_of(i));
                }
                counts.extend(&g.count);
                if let Some(law) = g.law.alpha_blend() {
                    opacities[0].extend(&law.opacity);
                    opacities[1].extend(&law.grey);
                }
            }
            layers.push((layer.name.clone(), first, counts.len()));
        }
        Gaussians {
            means,
            covariances,
            masses: model.has_masses().then_some(masses),
            opacities: (opacities[0].len() == counts.len() && !counts.is_empty()).then_some(opacities),
            counts,
            layers,
            fields: model.metadata.fields.iter().map(|q| FieldArrays::new(model, q)).collect(),
        }
    }
}

impl FieldArrays {
    fn new(model: &Model, quantity: &Quantity) -> Self {
        let (name, components) = (quantity.name.clone(), quantity.component_names().len());
        let mut all = FieldArrays { name, components, means: Vec::new(), slopes: Vec::new(), covariances: Vec::new() };
        for g in all_gaussians(model) {
            let FieldNumbers { mean, slope, spread } = g.field(quantity);
            all.means.extend(mean);
            all.slopes.extend(slope);
            all.covariances.extend(spread);
        }
        all
    }
}

type MomentArray<'py> = Bound<'py, PyArrayDyn<f64>>;

#[pymethods]
impl Gaussians {
    fn __len__(&self) -> usize {
        self.counts.len()
    }

    #[getter]
    fn means<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        view(slf.as_any(), &slf.get().means, &[slf.get().counts.len(), 3])
    }

    #[getter]
    fn covariances<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        view(slf.as_any(), &slf.get().covariances, &[slf.get().counts.len(), 3, 3])
    }

    #[getter]
    fn counts<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
        column(slf, &slf.get().counts)
    }

    #[getter]
    fn masses<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f64>>>> {
        slf.get().masses.as_ref().map(|m| column(slf, m)).transpose()
    }

    #[getter]
    fn opacities<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f64>>>> {
        slf.get().opacities.as_ref().map(|[opacity, _]| column(slf, opacity)).transpose()
    }

    #[getter]
    fn grey_levels<'py>(slf: &Bound<'py, Self>) -> PyResult<Option<Bound<'py, PyArrayDyn<f64>>>> {
        slf.get().opacities.as_ref().map(|[_, grey]| column(slf, grey)).transpose()
    }

    /// Names, means, slopes and covariances (variances of a scalar) of fields.
    #[getter]
    fn fields<'py>(
        slf: &Bound<'py, Self>,
    ) -> PyResult<Vec<(String, MomentArray<'py>, MomentArray<'py>, MomentArray<'py>)>> {
        let n = slf.get().counts.len();
        let moment_arrays = |f: &FieldArrays| {
            let [means, slopes, covariances]: [&[usize]; 3] = match f.components {
                1 => [&[n], &[n, 3], &[n]],
                _ => [&[n, 3], &[n, 3, 3], &[n, 3, 3]],
            };
            Ok((
                f.name.clone(),
                view(slf.as_any(), &f.means, means)?,
                view(slf.as_any(), &f.slopes, slopes)?,
                view(slf.as_any(), &f.covariances, covariances)?,
            ))
        };
        slf.get().fields.iter().map(moment_arrays).collect()
    }

    #[getter]
    fn layer_ranges(&self) -> Vec<(String, usize, usize)> {
        self.layers.clone()
    }
}

fn column<'py>(owner: &Bound<'py, Gaussians>, values: &[f64]) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    view(owner.as_any(), values, &[values.len()])
}
