//! Records between two equal marks, as Fortran writes them, and the 256 bytes of the first one, with which every Gadget file
//! begins.

use crate::TextResult;
use crate::numbers::NumberType;
use crate::physical::{SAME_MOMENT, VelocityConvention, is_isolated};
use particlegs_core::model::{Cosmology, Epoch, Units};
use particlegs_core::space::Cell;
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotMeta;
use std::path::Path;

pub const HEADER: usize = 256;
pub const TYPES: usize = 6;

#[derive(Clone, Debug, PartialEq)]
pub struct GadgetHeader {
    /// Particles in this file, by type.
    pub count: [u32; TYPES],
    /// Mass of every particle of a type; 0 where each has its own.
    pub mass: [f64; TYPES],
    /// Scale factor in cosmological runs, else time.
    pub time: f64,
    /// Redshift in cosmological runs.
    pub redshift: f64,
    /// Particles in all files, low words.
    pub total: [u32; TYPES],
    /// Files of the snapshot; some codes leave 0 for 1.
    pub files: u32,
    /// Edge of the periodic box; 0 without one.
    pub box_size: f64,
    /// Matter's share of the critical density.
    pub omega0: f64,
    /// The cosmological constant's.
    pub omega_lambda: f64,
    /// Hubble constant in 100 km/s/Mpc.
    pub hubble: f64,
    /// Whether cooling was on, which adds two blocks of gas to format 1.
    pub cooling: bool,
}

impl GadgetHeader {
    pub fn parse(path: &Path, bytes: &[u8], big_endian: bool) -> Result<GadgetHeader> {
        let int = |at: usize| NumberType::U32.get(&bytes[at..], big_endian) as u32;
        let real = |at: usize| NumberType::F64.get(&bytes[at..], big_endian);
        let header = GadgetHeader {
            count: std::array::from_fn(|t| int(4 * t)),
            mass: std::array::from_fn(|t| real(24 + 8 * t)),
            time: real(72),
            redshift: real(80),
            total: std::array::from_fn(|t| int(96 + 4 * t)),
            cooling: int(120) != 0,
            files: int(124).max(1),
            box_size: real(128),
            omega0: real(136),
            omega_lambda: real(144),
            hubble: real(152),
        };
        header.check(path)?;
        Ok(header)
    }

    /// Refuses damage that would go unseen: numbers that are not finite, or so small that only
    /// flipped bits make them, and lengths and masses below 0.
    fn check(&self, path: &Path) -> Result<()> {
        let masses = self.mass.iter().map(|&m| ("mass", m, 0.0));
        let others = [
            ("Time", self.time, f64::MIN),
            ("Redshift", self.redshift, f64::MIN),
            ("BoxSize", self.box_size, 0.0),
            ("Omega0", self.omega0, f64::MIN),
            ("OmegaLambda", self.omega_lambda, f64::MIN),
            ("HubbleParam", self.hubble, 0.0),
        ];
        for (name, value, least) in masses.chain(others) {
            if !value.is_finite() || value.is_subnormal() || value < least {
                let message = format!("the Gadget header's {name} is {value:e}: the header is damaged");
                return Err(Error::input_with(path, message, "copy the file again from its source"));
            }
        }
        Ok(())
    }

    /// Whether the run has comoving coordinates, and its time is the scale factor. The header has no flag for it,
    /// but only then are Redshift and Time two names of one number.
    pub fn is_cosmological(&self) -> bool {
        let expected = 1.0 / self.time - 1.0;
        self.time > 0.0 && self.omega0 > 0.0 && (self.redshift - expected).abs() <= SAME_MOMENT * (1.0 + expected.abs())
    }

    /// The convention of velocities and energies.
    pub fn convention(&self) -> VelocityConvention {
        let [time, redshift, matter, box_size] = [self.time, self.redshift, self.omega0, self.box_size].map(Some);
        let isolated = is_isolated(time, redshift, matter, box_size).then_some(false);
        let cosmological = self.is_cosmological().then_some(true);
        // At a = 1 all conventions give the same velocities, whether the run is cosmological or not.
        let (powers, is_known) = (Some(VelocityConvention::GADGET), cosmological.is_some() || self.time == 1.0);
        let scale_factor = is_known.then_some(self.time);
        VelocityConvention { unit: None, powers, cosmological: cosmological.or(isolated), scale_factor }
    }

    pub fn meta(&self, named: SnapshotMeta) -> SnapshotMeta {
        let cosmological = self.is_cosmological();
        SnapshotMeta {
            cell: (self.box_size > 0.0).then(|| Cell::orthogonal([self.box_size; 3])),
            units: Units { comoving: cosmological.then_some(true), ..Units::default() },
            cosmology: Cosmology {
                hubble: (self.hubble > 0.0).then_some(self.hubble),
                omega_matter: cosmological.then_some(self.omega0),
                omega_lambda: cosmological.then_some(self.omega_lambda),
                omega_baryon: None,
            },
            epoch: Epoch {
                scale_factor: cosmological.then_some(self.time),
                time: (!cosmological).then_some(self.time),
                ..Epoch::default()
            },
            ..named
        }
    }

    pub fn particles(&self) -> u64 {
        self.count.iter().map(|&n| u64::from(n)).sum()
    }
}

/// A header's bytes, for tests of this format.
#[cfg(test)]
pub fn sample(count: [u32; TYPES], mass: [f64; TYPES], files: u32, total: [u32; TYPES]) -> Vec<u8> {
    let mut out = Vec::new();
    count.iter().for_each(|n| out.extend(n.to_le_bytes()));
    mass.iter().for_each(|m| out.extend(m.to_le_bytes()));
    [0.5f64, 1.0].iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.extend([0; 8]);
    total.iter().for_each(|n| out.extend(n.to_le_bytes()));
    [0, files].iter().for_each(|n| out.extend(n.to_le_bytes()));
    [25.0f64, 0.3, 0.7, 0.68].iter().for_each(|v| out.extend(v.to_le_bytes()));
    out.resize(HEADER, 0);
    out
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GadgetRecord {
    pub offset: u64,
    pub length: u64,
}

impl GadgetRecord {
    /// Byte behind the closing mark.
    pub fn end(&self) -> u64 {
        self.offset + self.length + 4
    }
}

#[derive(Clone, Copy)]
pub struct Records<'a> {
    pub bytes: &'a [u8],
    /// Of the marks.
    pub big_endian: bool,
}

impl Records<'_> {
    pub fn mark(&self, at: u64) -> Option<u32> {
        let at = usize::try_from(at).ok()?;
        let four: [u8; 4] = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.big_endian { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    /// The record whose opening mark is at byte `at`. Marks have 32 bits: blocks above 4 GiB are
    /// written with the length's low word, so that a length fits if its low word is the mark's and
    /// the closing mark stands behind it. The fault in words where none fits.
    pub fn at(&self, at: u64) -> TextResult<GadgetRecord> {
        let end = self.bytes.len() as u64;
        let mark = self.mark(at).ok_or_else(|| format!("the file ends at byte {end}, inside a record marker"))?;
        let fits = |length: u64| (at + 8).checked_add(length).is_some_and(|e| e <= end);
        let lengths = (0..=end >> 32).map(|k| u64::from(mark) + (k << 32)).take_while(|&l| fits(l));
        let mut first_close = None;
        for length in lengths {
            let close = self.mark(at + 4 + length);
            if close == Some(mark) {
                return Ok(GadgetRecord { offset: at + 4, length });
            }
            first_close.get_or_insert(close);
        }
        Err(match first_close.flatten() {
            Some(close) => {
                format!(
                    "the record at byte {at} begins with the length {mark} and ends with {close}: they must be equal"
                )
            }
            None => format!("the record at byte {at} should have {mark} bytes, but the file ends at byte {end}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn time_is_the_scale_factor_where_redshift_agrees() {
        let mut bytes = sample([0, 2, 0, 0, 0, 0], [0.0; 6], 1, [0, 2, 0, 0, 0, 0]);
        let parse = |bytes: &[u8]| GadgetHeader::parse(Path::new("f"), bytes, false);
        let meta = parse(&bytes).unwrap().meta(SnapshotMeta::default());
        assert_eq!((meta.epoch.scale_factor, meta.epoch.time, meta.units.comoving), (Some(0.5), None, Some(true)));
        bytes[80..88].copy_from_slice(&0.0f64.to_le_bytes());
        let meta = parse(&bytes).unwrap().meta(SnapshotMeta::default());
        assert_eq!((meta.epoch.scale_factor, meta.epoch.time, meta.units.comoving), (None, Some(0.5), None));
        bytes[128..136].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(parse(&bytes).unwrap_err().to_string().contains("BoxSize"));
        bytes[128..136].copy_from_slice(&3e-310f64.to_le_bytes());
        assert!(parse(&bytes).is_err());
    }

    #[test]
    fn marks_must_agree_and_lie_within_the_file() {
        let bytes = [2, 0, 0, 0, 7, 7, 2, 0, 0, 0, 9, 0, 0, 0];
        let records = Records { bytes: &bytes, big_endian: false };
        let first = records.at(0).unwrap();
        assert_eq!(first, GadgetRecord { offset: 4, length: 2 });
        assert!(records.at(first.end()).unwrap_err().contains("9 bytes"));
        assert!(records.at(13).unwrap_err().contains("inside"));
        assert!(records.at(u64::MAX).is_err());
        let bad = [1, 0, 0, 0, 7, 2, 0, 0, 0];
        assert!(Records { bytes: &bad, big_endian: false }.at(0).unwrap_err().contains("must be equal"));
    }
}
