//! Particles in other units.

use super::scratch::ColumnBuffer;
use super::{CHUNK, Particles, Storage};
use particlegs_core::context::Context;
use particlegs_core::model::UnitSystem;
use particlegs_core::{Error, Result, parallel};

impl Particles {
    /// The particles in the units of another system, in columns of `storage` where lengths are converted; what the two
    /// do not state is taken from the other, and said.
    pub fn in_units(mut self, to: &UnitSystem<'_>, storage: &Storage, context: &Context<'_>) -> Result<Particles> {
        let (by, words) = self.meta.unit_system().conversion_of(&self.meta.name, to)?;
        words.iter().for_each(|words| context.message(&format!("note: {words}")));
        self.check_files()?;
        self.meta.units = self.meta.units.replaced(to.units);
        // Weights stay, and the mass of weight 1 is another.
        let weighted = self.weights().is_some() && by.mass != 1.0;
        self.meta.particle_mass = self.meta.particle_mass.or(weighted.then_some(1.0)).map(|m| m * by.mass);
        self.layers = self.layers.into_iter().map(|l| by.layer(l)).collect();
        if by.length == 1.0 {
            return Ok(self);
        }
        self.meta.cell = self.meta.cell.map(|c| c.scaled(by.length));
        let mut columns = storage.columns("the particles in other units", 3, self.len())?;
        let [x, y, z] = &mut columns[..] else { unreachable!("three columns") };
        let parts = x.chunks_mut(CHUNK).zip(y.chunks_mut(CHUNK)).zip(z.chunks_mut(CHUNK)).enumerate();
        let parts: Vec<_> = parts.map(|(i, ((x, y), z))| (i * CHUNK, [x, y, z])).collect();
        parallel::try_for_each(parts, |(start, parts)| {
            let positions = self.columns(start..start + parts[0].len());
            for (to, from) in parts.into_iter().zip(positions) {
                to.iter_mut().zip(from).for_each(|(to, v)| *to = (f64::from(v) * by.length) as f32);
            }
            Ok::<(), Error>(())
        })?;
        let columns = columns.into_iter().map(ColumnBuffer::finish).collect::<Result<Vec<_>>>()?;
        let origin = self.origin.map(|v| v * by.length);
        let weights = self.weights().cloned();
        let moved =
            Particles::from_column_list(columns.into_iter().chain(weights).collect(), origin, self.meta, self.layers);
        let bounds = moved.bounds();
        if bounds.min.iter().chain(&bounds.max).any(|v| !v.is_finite()) {
            return Err(Error::input(&moved.meta.name, "in that unit its positions are too large for float32"));
        }
        Ok(moved)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Column, SnapshotMeta};
    use particlegs_core::context::Context;
    use particlegs_core::model::{Mass, Units};
    use particlegs_core::space::Cell;

    #[test]
    fn positions_box_and_masses_are_converted() {
        let mut p = Particles::from_columns(vec![1.0, 2.0], vec![0.5, 4.0], vec![3.0, 8.0])
            .with_weights(Column::owned(vec![1.0, 2.0]));
        p.origin = [10.0, 0.0, 0.0];
        p.meta = SnapshotMeta {
            cell: Some(Cell::orthogonal([20.0; 3])),
            units: Units::new(Some("Mpc"), Some("1e10 Msun"), Some(true)),
            ..SnapshotMeta::default()
        };
        let to = Units::new(Some("kpc"), Some("Msun"), None);
        let to = UnitSystem { units: &to, scale_factor: None, hubble: None };
        let moved = p.clone().in_units(&to, &Storage::Memory, &Context::SILENT).unwrap();
        assert_eq!((moved.position(0), moved.position(1)), ([11e3, 500.0, 3e3], [12e3, 4e3, 8e3]));
        assert_eq!(moved.meta.cell, Some(Cell::orthogonal([20e3; 3])));
        assert_eq!(moved.meta.units, Units::new(Some("kpc"), Some("Msun"), Some(true)));
        assert_eq!((moved.layers()[0].mass, moved.meta.particle_mass), (Mass::Weights(Some(1e10)), Some(1e10)));
        let tiny = Units::new(Some("1e-40 m"), None, None);
        let tiny = UnitSystem { units: &tiny, ..to };
        assert!(p.in_units(&tiny, &Storage::Memory, &Context::SILENT).is_err());
    }
}
