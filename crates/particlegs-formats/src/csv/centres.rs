//! Centres of a list in the units and the box of a snapshot or model.

use super::catalogue::Catalogue;
use particlegs_core::context::Context;
use particlegs_core::model::UnitSystem;
use particlegs_core::space::{Cell, PeriodicCell};
use particlegs_core::{Error, Result};
use particlegs_files::input::name_of;
use std::path::Path;

impl Catalogue {
    /// Centres and radii of circles, in the units of a snapshot or model; one whose inner half reaches over a face of the
    /// periodic box is also at the other side.
    ///
    /// # Errors
    /// As [`Catalogue::read`] and [`Catalogue::placed`]; [`Error::Input`] where no centre has a radius.
    pub fn circles(
        path: &Path,
        place: (UnitSystem<'_>, Option<Cell>),
        context: &Context<'_>,
    ) -> Result<Vec<([f64; 3], f64)>> {
        let all = Catalogue::read(path, context)?.placed(path, place, context)?;
        let cell = place.1.and_then(PeriodicCell::new);
        // A halo that barely touches a face has next to nothing at the other.
        let images = |at: [f64; 3], radius: f64| cell.map_or(vec![at], |cell| cell.images_of_sphere(at, 0.5 * radius));
        let with_radius = all.into_iter().filter_map(|(at, radius)| Some((at, radius?)));
        let circles: Vec<([f64; 3], f64)> =
            with_radius.flat_map(|(at, radius)| images(at, radius).into_iter().map(move |at| (at, radius))).collect();
        if circles.is_empty() {
            let hint = "name a column `radius` or `r200m`";
            return Err(Error::input_with(name_of(path), "no centre has a radius", hint));
        }
        Ok(circles)
    }

    /// Centres and radii in the units of a snapshot or model, in whose box they lie; the list is that of a file, which errors
    /// and notes name.
    ///
    /// # Errors
    /// [`Error::Input`] where units cannot be converted, or centres lie far outside the periodic box.
    pub fn placed(
        self,
        path: &Path,
        (to, cell): (UnitSystem<'_>, Option<Cell>),
        context: &Context<'_>,
    ) -> Result<Vec<([f64; 3], Option<f64>)>> {
        let (centres, notes) = self
            .convert(&to, cell.and_then(|c| c.lengths()))
            .map_err(|message| Error::input(name_of(path), message))?;
        notes.iter().for_each(|note| context.message(&format!("note: {}: {note}", name_of(path))));
        let cell = cell.and_then(PeriodicCell::new);
        let is_far = |place: [f64; 3]| cell.is_some_and(|cell| cell.beyond(cell.offset(place)) > 1.0);
        let far = centres.iter().filter(|(place, _)| is_far(*place)).count();
        if far > 0 {
            let message =
                format!("{far} of {} centres lie more than a box length outside the periodic box", centres.len());
            return Err(Error::input_with(
                name_of(path),
                message,
                "check their unit of length and which columns they are in",
            ));
        }
        Ok(centres)
    }
}
