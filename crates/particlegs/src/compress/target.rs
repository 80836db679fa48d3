//! What a user may ask for: a ratio, a size, a number of Gaussians or a quality.

use crate::{Error, Result};

/// The default compression ratio.
pub const DEFAULT_RATIO: f64 = 300.0;

/// What the file is to meet.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Target {
    /// Ratio 300; where header and one Gaussian do not fit, the smallest file with a warning.
    Default,
    /// Raw bytes / file bytes.
    Ratio(f64),
    /// File bytes.
    Size(u64),
    /// Gaussians, at the nominal precision.
    Gaussians(u64),
    /// Masked PSNR in dB, `expected` look, mean over held-out views.
    Psnr(f64),
}

impl Target {
    /// The largest file that meets a ratio or size.
    pub fn bytes(self, raw_bytes: u64) -> Option<u64> {
        match self {
            Target::Default => Some((raw_bytes as f64 / DEFAULT_RATIO).floor() as u64),
            Target::Ratio(r) => Some((raw_bytes as f64 / r).floor() as u64),
            Target::Size(s) => Some(s),
            Target::Gaussians(_) | Target::Psnr(_) => None,
        }
    }

    /// Checks the number.
    ///
    /// # Errors
    /// [`Error::Argument`] for a ratio, size, count or quality that is not positive and finite.
    pub fn check(self) -> Result<Self> {
        let fine = match self {
            Target::Default => true,
            Target::Ratio(v) | Target::Psnr(v) => v > 0.0 && v.is_finite(),
            Target::Size(v) | Target::Gaussians(v) => v > 0,
        };
        if fine { Ok(self) } else { Err(Error::argument(format!("{} is not positive and finite", self.in_words()))) }
    }

    /// What is asked for, as people say it.
    fn in_words(self) -> String {
        match self {
            Target::Default => format!("a ratio of {DEFAULT_RATIO}"),
            Target::Ratio(v) => format!("a ratio of {v}"),
            Target::Size(v) => format!("a size of {v} bytes"),
            Target::Gaussians(v) => format!("a number of {v} Gaussians"),
            Target::Psnr(v) => format!("a quality of {v} dB"),
        }
    }

    /// Parses a size: `11MB`, `900 kB`, `1.5GiB`, `83886`.
    ///
    /// # Errors
    /// [`Error::Argument`] for anything else.
    pub fn parse_size(text: &str) -> Result<Self> {
        Target::Size(parse_bytes(text)?).check()
    }
}

/// Parses a number of bytes: `11MB`, `900 kB`, `1.5GiB`, `83886`.
///
/// # Errors
/// [`Error::Argument`] for anything else.
pub fn parse_bytes(text: &str) -> Result<u64> {
    let fail = || Error::argument(format!("size `{text}` is not a number with B, kB, MB, GB, KiB, MiB or GiB"));
    let split = text.find(|c: char| !(c.is_ascii_digit() || c == '.')).unwrap_or(text.len());
    let number: f64 = text[..split].parse().map_err(|_| fail())?;
    let unit = match text[split..].trim().to_ascii_lowercase().as_str() {
        "" | "b" => 1.0,
        "kb" | "k" => 1e3,
        "mb" | "m" => 1e6,
        "gb" | "g" => 1e9,
        "kib" => 1024.0,
        "mib" => 1024.0 * 1024.0,
        "gib" => 1024.0 * 1024.0 * 1024.0,
        _ => return Err(fail()),
    };
    Ok((number * unit).floor() as u64)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        assert_eq!(Target::parse_size("11MB").unwrap(), Target::Size(11_000_000));
        assert_eq!(Target::parse_size("1.5 KiB").unwrap(), Target::Size(1536));
        assert_eq!(Target::parse_size("83886").unwrap(), Target::Size(83_886));
        for bad in ["", "MB", "0", "-3MB", "1.2.3", "5 parsecs", "nan"] {
            assert!(Target::parse_size(bad).is_err(), "{bad}");
        }
    }
}
