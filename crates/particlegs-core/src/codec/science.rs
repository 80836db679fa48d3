//! The section `stat`: what statistics said, 27 bytes (docs/format.md, section 3).

use super::wire::Reader;
use crate::model::{Limit, Science, ScienceOf};

/// Bytes of the section.
pub(crate) const SCIENCE_BYTES: usize = 1 + 2 + 4 + 4 * 4 + 4;
/// A wave number that stands for "not measured".
const NOT_MEASURED: f32 = -1.0;
/// And for "nowhere".
const NEVER: f32 = 0.0;
/// A size that stands for "not measured".
const NO_SIZE: u32 = u32::MAX;

/// The section's bytes.
pub(crate) fn write(s: &Science) -> Vec<u8> {
    let mut out = Vec::with_capacity(SCIENCE_BYTES);
    out.push(match s.of {
        ScienceOf::DrawnParticles => 0,
        ScienceOf::Mixture => 1,
    });
    out.extend(s.spectrum_grid.to_le_bytes());
    let k_max = s.k_max as f32;
    out.extend(k_max.to_le_bytes());
    for limit in [s.power_within_1_percent_to, s.power_within_5_percent_to, s.r_above_0_99_to, s.r_above_0_9_to] {
        let value = match limit {
            Limit::NotMeasured => NOT_MEASURED,
            Limit::Never => NEVER,
            Limit::At(k) => (k as f32).clamp(f32::MIN_POSITIVE, k_max.max(f32::MIN_POSITIVE)),
        };
        out.extend(value.to_le_bytes());
    }
    let size = match s.groups_within_10_percent_from {
        Limit::NotMeasured => NO_SIZE,
        Limit::Never => 0,
        Limit::At(n) => (n as u32).clamp(1, NO_SIZE - 1),
    };
    out.extend(size.to_le_bytes());
    out
}

/// Reads the section.
pub(crate) fn read(bytes: &[u8]) -> Result<Science, String> {
    let mut r = Reader::new(bytes);
    let of = match r.u8()? {
        0 => ScienceOf::DrawnParticles,
        1 => ScienceOf::Mixture,
        v => return Err(format!("statistics of an unknown kind {v}")),
    };
    let (spectrum_grid, k_max) = (r.u16()?, r.f32()?);
    if !(k_max >= 0.0 && k_max.is_finite()) {
        return Err(format!("a largest wave number of {k_max}"));
    }
    let mut limits = [Limit::NotMeasured; 4];
    for limit in &mut limits {
        *limit = match r.f32()? {
            NOT_MEASURED => Limit::NotMeasured,
            NEVER => Limit::Never,
            k if k > 0.0 && k <= k_max => Limit::At(f64::from(k)),
            k => return Err(format!("a wave number of {k} of at most {k_max}")),
        };
    }
    let groups_within_10_percent_from = match r.u32()? {
        NO_SIZE => Limit::NotMeasured,
        0 => Limit::Never,
        n => Limit::At(f64::from(n)),
    };
    if !r.is_done() {
        return Err(format!("statistics of {} bytes", bytes.len()));
    }
    let [power_within_1_percent_to, power_within_5_percent_to, r_above_0_99_to, r_above_0_9_to] = limits;
    Ok(Science {
        of,
        spectrum_grid,
        k_max: f64::from(k_max),
        power_within_1_percent_to,
        power_within_5_percent_to,
        r_above_0_99_to,
        r_above_0_9_to,
        groups_within_10_percent_from,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn science() -> Science {
        Science {
            of: ScienceOf::DrawnParticles,
            spectrum_grid: 256,
            k_max: 8.0,
            power_within_1_percent_to: Limit::Never,
            power_within_5_percent_to: Limit::At(8.0),
            r_above_0_99_to: Limit::At(2.5),
            r_above_0_9_to: Limit::NotMeasured,
            groups_within_10_percent_from: Limit::At(57.0),
        }
    }

    #[test]
    fn comes_back() {
        for (of, groups) in [
            (ScienceOf::DrawnParticles, Limit::At(57.0)),
            (ScienceOf::Mixture, Limit::NotMeasured),
            (ScienceOf::Mixture, Limit::Never),
        ] {
            let s = Science { of, groups_within_10_percent_from: groups, ..science() };
            let bytes = write(&s);
            assert_eq!(bytes.len(), SCIENCE_BYTES);
            assert_eq!(read(&bytes).unwrap(), s);
            assert!(read(&bytes[1..]).is_err() && read(&[&bytes[..], &[0]].concat()).is_err());
        }
        // A limit that rounding to f32 takes beyond the grid's stays there.
        let k = f64::from(0.1f32).next_up();
        let s =
            Science { k_max: 0.1, power_within_5_percent_to: Limit::At(k), r_above_0_99_to: Limit::Never, ..science() };
        assert_eq!(read(&write(&s)).unwrap().power_within_5_percent_to, Limit::At(f64::from(0.1f32)));
    }

    #[test]
    fn contradictions_are_refused() {
        let with = |at: usize, value: &[u8]| {
            let mut bytes = write(&science());
            bytes[at..at + value.len()].copy_from_slice(value);
            read(&bytes)
        };
        assert!(with(0, &[2]).is_err());
        for k in [-0.5f32, f32::NAN, f32::INFINITY] {
            assert!(with(3, &k.to_le_bytes()).is_err(), "{k}");
        }
        for k in [-0.5f32, 8.5, f32::NAN] {
            assert!(with(11, &k.to_le_bytes()).is_err(), "{k}");
        }
    }
}
