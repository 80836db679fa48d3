//! Names for the blocks of format 1: they have none, and codes write more of them than Gadget did.

use super::header::{GadgetHeader, GadgetRecord, Records, TYPES};
use crate::numbers::NumberType;
use particlegs_core::{Error, Hint, Result};
use std::path::Path;

/// Numbers of a block that are looked at.
const LOOKED_AT: u64 = 4096;

/// The name of a block that is passed over.
pub const NONE: &str = "-";

#[derive(Clone, Copy, PartialEq)]
enum Values {
    Zero,
    Whole,
    /// Reals of either sign.
    Signed,
    /// Reals that are not negative.
    Real,
}

struct BlockOrder<'a> {
    path: &'a Path,
    file: Records<'a>,
    records: &'a [GadgetRecord],
    all: u64,
    /// Particles of types whose mass is not in the header.
    massive: u64,
    gas: u64,
    names: Vec<String>,
    at: usize,
}

/// Names of `records`, those behind `header` in the file at `path`: POS, VEL, ID, whole numbers that some codes write behind ID,
/// MASS where a type needs it, then blocks of gas. [`NONE`] for what cannot be told.
pub fn names(path: &Path, header: &GadgetHeader, file: Records<'_>, records: &[GadgetRecord]) -> Result<Vec<String>> {
    let massive = (0..TYPES).filter(|&t| header.mass[t] == 0.0).map(|t| u64::from(header.count[t])).sum();
    let (all, gas) = (header.particles(), u64::from(header.count[0]));
    let mut order =
        BlockOrder { path, file, records, all, massive, gas, names: vec![NONE.into(); records.len()], at: 0 };
    if all > 0 {
        // What fits no positions is a second header; where nothing fits, the fault is that of the first block.
        order.at = records.iter().position(|r| fits(r, 3 * all)).unwrap_or(0);
        order.take("POS");
        if order.next().is_some_and(|r| fits(r, 3 * all)) {
            order.take("VEL");
        }
        order.identities_and_masses()?;
        let cooling = ["U", "RHO", "NE", "NH", "HSML"];
        // Cooling writes the electron and hydrogen fractions between density and smoothing length.
        for name in if header.cooling { &cooling[..] } else { &["U", "RHO", "HSML"] } {
            if order.next().is_some_and(|r| fits(r, gas)) {
                order.take(name);
            }
        }
    }
    Ok(order.names)
}

/// Whether a record has so many numbers of 4 or 8 bytes.
fn fits(record: &GadgetRecord, numbers: u64) -> bool {
    numbers > 0 && [4, 8].iter().any(|&size| numbers.checked_mul(size) == Some(record.length))
}

impl BlockOrder<'_> {
    fn next(&self) -> Option<&GadgetRecord> {
        self.records.get(self.at)
    }

    fn take(&mut self, name: &str) {
        if let Some(place) = self.names.get_mut(self.at) {
            *place = name.into();
            self.at += 1;
        }
    }

    /// Whether a record can hold masses, by its length and values.
    fn is_mass(&self, record: &GadgetRecord, values: Values) -> bool {
        [self.massive, self.all].iter().any(|&n| fits(record, n) && self.values(record, n) == values)
    }

    /// Identities, then whole numbers, one a particle, up to the first block that holds masses.
    fn identities_and_masses(&mut self) -> Result<()> {
        let (needed, start) = (self.massive > 0, self.at);
        let one_each = |r: &&GadgetRecord| fits(r, self.all) || needed && fits(r, self.massive);
        let run = self.records[start..].iter().take_while(one_each).count();
        let masses =
            |from: usize, values| (from..start + run).find(|&i| needed && self.is_mass(&self.records[i], values));
        // Identities of some sizes look like reals: the first block has them, unless it alone can be masses.
        let mass = masses(start + 1, Values::Real).or_else(|| masses(start, Values::Real));
        let mass = mass.or_else(|| masses(start + 1, Values::Zero));
        let end = mass.unwrap_or_else(|| {
            let whole = |i: &usize| match self.values(&self.records[*i], self.all) {
                Values::Whole => true,
                // Where all particles are gas, zeros may as well be the first field of gas.
                Values::Zero => self.gas != self.all,
                _ => *i == start,
            };
            start + (start..start + run).take_while(|i| fits(&self.records[*i], self.all) && whole(i)).count()
        });
        for number in 1..=end - start {
            self.take(&if number == 1 { "ID".to_string() } else { format!("ID{number}") });
        }
        if mass.is_none() && needed && run > 1 {
            let at = self.records[start].offset;
            let message = format!("none of the {run} blocks from byte {at} on looks like masses");
            let hint = Hint::default().option("gadget-blocks", "POS,VEL,ID,-,MASS");
            let hint = hint.words(" names the blocks after the header; - skips a block");
            return Err(Error::input_with(self.path, message, hint));
        }
        if needed {
            // Where its length is another, the fault is named when it is placed.
            self.take("MASS");
        }
        Ok(())
    }

    /// The kind of a record's numbers, `count` of them.
    fn values(&self, record: &GadgetRecord, count: u64) -> Values {
        let (whole, real, least) = match record.length / count.max(1) {
            8 => (NumberType::U64, NumberType::F64, 1e-100),
            // Whole numbers up to 600 million are smaller than that.
            _ => (NumberType::U32, NumberType::F32, 1e-15),
        };
        let mut values = Values::Zero;
        let step = count.div_ceil(LOOKED_AT).max(1);
        for i in (0..count).step_by(step as usize) {
            let from = (record.offset + i * real.bytes()) as usize;
            let bytes = &self.file.bytes[from..from + real.bytes() as usize];
            let [whole, real] = [whole, real].map(|kind| kind.get(bytes, self.file.big_endian));
            values = match values {
                _ if whole == 0.0 => values,
                _ if !(real == 0.0 || real.is_finite() && real.abs() >= least) => return Values::Whole,
                Values::Signed => Values::Signed,
                _ if real < 0.0 => Values::Signed,
                _ => Values::Real,
            };
        }
        values
    }
}
