//! Unwrapped positions of trajectories: atoms that leave the periodic cell and go on beyond it.

use crate::{Choice, Description};
use particlegs_core::space::PeriodicCell;
use particlegs_core::{Error, Result};

/// First particles that are looked at for positions outside the cell.
pub const LOOKED_AT: usize = 1024;

/// Says whether positions are wrapped into the periodic cell: where they are `unwrapped`. With
/// [`Choice::keep_unwrapped`] drops the cell.
pub fn settle(
    description: &mut Description,
    choice: &Choice,
    unwrapped: impl FnOnce(&PeriodicCell) -> bool,
) -> Result<bool> {
    let periods = description.meta.cell.and_then(PeriodicCell::new);
    let (wraps, note) = match periods {
        None if choice.keep_unwrapped => {
            let place = description.files.first().map(|f| f.display().to_string()).unwrap_or_default();
            return Err(Error::input(place, "there is no periodic box: positions are not wrapped"));
        }
        Some(_) if choice.keep_unwrapped => {
            description.meta.cell = None;
            (false, "positions are used as stored; the periodic box is ignored")
        }
        Some(periods) if unwrapped(&periods) => (true, "unwrapped positions are wrapped into the periodic box"),
        _ => return Ok(false),
    };
    description.notes.push(note.into());
    Ok(wraps)
}

/// Whether a tenth of the first positions lie outside a periodic cell, and any by more than its length. A few that do
/// are damage.
pub fn leave(periods: &PeriodicCell, positions: impl Iterator<Item = [f64; 3]>) -> bool {
    let (mut all, mut outside, mut far) = (0, 0, 0);
    for position in positions.take(LOOKED_AT) {
        let beyond = periods.beyond(periods.offset(position));
        all += 1;
        outside += usize::from(beyond > 1e-5);
        far += usize::from(beyond > 1.0);
    }
    far > 0 && 10 * outside >= all
}

/// The cell that positions are wrapped into: the one that the user states, else the file's; none for fields as they are
/// stored.
pub fn cell(description: &Description, choice: &Choice) -> Result<Option<PeriodicCell>> {
    let mut meta = description.meta.clone();
    meta.state(choice.box_lengths, [None; 2])?;
    Ok(meta.cell.filter(|_| !choice.as_stored).and_then(PeriodicCell::new))
}
