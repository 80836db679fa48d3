//! How large a model is to be. Commands add what they mean where nothing is said.

use clap::{Arg, Args};
use particlegs::compress::Target;
use particlegs::{Error, Result};

/// One target at most.
#[derive(Args, Clone, Debug)]
#[group(multiple = false)]
pub struct TargetArgs {
    /// Compression ratio to reach.
    ///
    /// The size of the particles as float32, 12 bytes each (16 with weights), divided by the file size.
    #[arg(long, value_name = "R")]
    ratio: Option<f64>,
    /// File size to reach, such as 11MB, 900kB or 1.5GiB.
    #[arg(long, value_name = "SIZE")]
    size: Option<String>,
    /// Number of Gaussians, stored at the nominal precision.
    #[arg(long, value_name = "K")]
    gaussians: Option<u64>,
}

/// --ratio with what holds where nothing is said.
pub fn with_default(ratio: Arg, default: &str) -> Arg {
    let noted = |help: Option<&clap::builder::StyledStr>| {
        help.map(|h| h.to_string().replace("to reach", &format!("to reach [default: {default}]")))
    };
    let (short, long) = (noted(ratio.get_help()), noted(ratio.get_long_help()));
    ratio.help(short.unwrap_or_default()).long_help(long.unwrap_or_default())
}

impl TargetArgs {
    /// The target, and how the file's command says it.
    ///
    /// # Errors
    /// [`particlegs::Error::Argument`] for what cannot be.
    pub fn target(&self) -> Result<(Target, String)> {
        Ok(match (self.ratio, &self.size, self.gaussians) {
            (Some(r), ..) => (Target::Ratio(r).check()?, format!(" --ratio {r}")),
            (_, Some(s), _) => (Target::Size(parse_bytes(s)?).check()?, format!(" --size {s}")),
            (.., Some(k)) => (Target::Gaussians(k).check()?, format!(" --gaussians {k}")),
            _ => (Target::Default, String::new()),
        })
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
        assert_eq!(parse_bytes("11MB").unwrap(), 11_000_000);
        assert_eq!(parse_bytes("1.5 KiB").unwrap(), 1536);
        assert_eq!(parse_bytes("83886").unwrap(), 83_886);
        for bad in ["", "MB", "0", "-3MB", "1.2.3", "5 parsecs", "nan"] {
            assert!(parse_bytes(bad).and_then(|b| Target::Size(b).check()).is_err(), "{bad}");
        }
    }
}
