//! How large a model is to be. Commands add what they mean where nothing is said.

use clap::{Arg, Args};
use particlegs::Result;
use particlegs::compress::Target;

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
            (_, Some(s), _) => (Target::parse_size(s)?, format!(" --size {s}")),
            (.., Some(k)) => (Target::Gaussians(k).check()?, format!(" --gaussians {k}")),
            _ => (Target::Default, String::new()),
        })
    }
}
