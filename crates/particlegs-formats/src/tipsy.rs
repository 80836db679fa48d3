//! Tipsy snapshots (Gasoline, ChaNGa, PKDGRAV, Bonsai): a header with counts, then records of f32 for gas, dark matter and
//! stars, in either byte order; big-endian is the standard one.

use crate::atoms::{AtomSnapshot, AtomSpecies};
use crate::columns::ColumnarField;
use crate::compression::refuse;
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::{Choice, Description, Format, Snapshot};
use particlegs_core::model::{Epoch, species_aliases};
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::PathBuf;

pub const FORMAT: Format = Format {
    name: "tipsy",
    title: "Tipsy snapshot",
    detect: |head| TipsyHeader::read(&head.content, head.length).is_some(),
    open,
};

/// Fields of gas, dark matter and stars: names and components, all f32; and the number that Gadget has for the type.
const SPECIES: [(&str, usize, &[(&str, u32)]); 3] = [
    ("gas", 0, &[("mass", 1), ("pos", 3), ("vel", 3), ("rho", 1), ("temp", 1), ("eps", 1), ("metals", 1), ("phi", 1)]),
    ("dm", 1, &[("mass", 1), ("pos", 3), ("vel", 3), ("eps", 1), ("phi", 1)]),
    ("stars", 4, &[("mass", 1), ("pos", 3), ("vel", 3), ("metals", 1), ("tform", 1), ("eps", 1), ("phi", 1)]),
];

/// Bytes before the particles: a time, five counts, four that fill up.
const HEADER: u64 = 32;

fn record_bytes(fields: &[(&str, u32)]) -> u64 {
    fields.iter().map(|f| 4 * u64::from(f.1)).sum()
}

struct TipsyHeader {
    big_endian: bool,
    time: f64,
    counts: [u64; 3],
}

impl TipsyHeader {
    /// A time and counts that add up, to each other and to the file's length.
    fn read(bytes: &[u8], length: u64) -> Option<TipsyHeader> {
        let words = bytes.get(..HEADER as usize)?;
        [true, false].into_iter().find_map(|big_endian| {
            let count = |k: usize| NumberType::U32.get(&words[8 + 4 * k..], big_endian) as u64;
            let [all, axes, counts] = [[count(0); 3], [count(1); 3], [count(2), count(3), count(4)]];
            let bytes: u64 = SPECIES.iter().zip(counts).map(|(s, n)| n * record_bytes(s.2)).sum();
            let sound = length == HEADER + bytes
                && all[0] > 0
                && (1..=3).contains(&axes[0])
                && counts.iter().sum::<u64>() == all[0];
            let time = NumberType::F64.get(words, big_endian);
            sound.then_some(TipsyHeader { big_endian, time, counts })
        })
    }
}

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    refuse(path, FORMAT.title)?;
    let bytes = Bytes::from_filled_file(path)?;
    let header = TipsyHeader::read(&bytes, bytes.len() as u64).ok_or_else(|| {
        let message = "the numbers of particles in its header do not fit each other or the file's length";
        Error::input_with(path, message, "the file is damaged or cut short, or no Tipsy snapshot")
    })?;
    let order = if header.big_endian { "standard (big-endian)" } else { "little-endian" };
    let mut notes = vec!["the format states no units".to_string()];
    if header.time > 0.0 && header.time <= 1.0 {
        notes.push(format!(
            "the time {} is the scale factor if the run is cosmological; the file does not say",
            header.time
        ));
    }
    let mut start = HEADER;
    let mut species = Vec::new();
    for ((name, number, fields), count) in SPECIES.into_iter().zip(header.counts) {
        let stride = record_bytes(fields);
        if count > 0 {
            species.push(AtomSpecies {
                name: name.into(),
                aliases: species_aliases(number),
                ..AtomSpecies::all(self::fields(fields, start, stride, header.big_endian), count)
            });
        }
        start += count * stride;
    }
    let meta = SnapshotMeta {
        epoch: Epoch { time: Some(header.time).filter(|t| t.is_finite()), ..Epoch::default() },
        ..named(path)
    };
    let description = Description { notes, ..Description::new(format!("{}, {order}", FORMAT.title), paths, meta) };
    Ok(Box::new(AtomSnapshot::new(description, bytes, species)))
}

/// Fields of records of `stride` bytes from byte `start` on, the positions first.
fn fields(names: &[(&str, u32)], start: u64, stride: u64, big_endian: bool) -> Vec<crate::atoms::AtomField> {
    let mut offset = 0;
    let field = |&(name, components): &(&str, u32)| {
        let record_field = ColumnarField::in_records(name, NumberType::F32, components, [start, stride, offset]);
        offset += 4 * u64::from(components);
        (ColumnarField { big_endian, ..record_field }, None)
    };
    let mut fields: Vec<_> = names.iter().map(field).collect();
    // The first of a species' fields holds its positions; where they lie does not change.
    fields.swap(0, 1);
    fields
}

#[cfg(test)]
mod tests {
    use crate::SpeciesMass;
    use crate::testing::{fault, fixture, vectors};

    /// pynbody wrote it.
    #[test]
    fn three_kinds_with_their_fields() {
        let snapshot = fixture("fixtures/standard.tipsy", None);
        let d = snapshot.description();
        assert_eq!(d.format, "Tipsy snapshot, standard (big-endian)");
        let kinds: Vec<_> = d.species.iter().map(|s| (&s.name[..], s.count)).collect();
        assert_eq!(kinds, [("gas", 20), ("dm", 20), ("stars", 10)]);
        assert_eq!((d.meta.epoch.time, &d.species[1].mass), (Some(0.5), &SpeciesMass::Field("mass".into())));
        assert!(d.species[1].aliases.contains(&"dm".to_string()));
        assert_eq!(vectors(&*snapshot, 0, "temp,rho,mass")[19], [10_019.0, 19.0, 1.0]);
        assert_eq!(vectors(&*snapshot, 2, "tform,tform,mass")[9], [9.0, 9.0, 1.0]);
        assert_eq!(vectors(&*snapshot, 2, "vel")[9], [147.0, 148.0, 149.0].map(|v| v / 8.0 - 5.0));
    }

    #[test]
    fn counts_that_do_not_fit_are_refused() {
        let good = include_bytes!("../tests/fixtures/standard.tipsy");
        let cut = fault(&good[..good.len() - 4]);
        assert!(cut.contains("format is unknown"), "{cut}");
        let file = crate::testing::scratch(&good[..good.len() - 8]);
        let choice = crate::Choice { format: Some("tipsy".into()), ..crate::Choice::default() };
        let error = choice.open(&[file.path().to_path_buf()]).err().unwrap().to_string();
        assert!(error.contains("do not fit each other or the file's length"), "{error}");
    }
}
