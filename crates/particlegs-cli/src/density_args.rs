//! Options of surface densities: colours, and values instead of pictures. Shared by `render` and `reference`.

use crate::common::named;
use clap::Args;
use clap::builder::TypedValueParser;
use particlegs_core::picture::Colormap;
use particlegs_core::{Error, Result};

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Options of --style density")]
pub struct DensityArgs {
    /// Colour map [default: inferno].
    #[arg(long, value_name = "NAME", hide_short_help = true, value_parser = colormaps())]
    pub colormap: Option<Colormap>,
    /// Values of the first and the last colour [default: 5th to 99.5th percentile of occupied pixels].
    #[arg(
        long,
        value_name = "LO,HI",
        value_delimiter = ',',
        num_args = 1,
        hide_short_help = true,
        allow_hyphen_values = true
    )]
    pub range: Option<Vec<f64>>,
    /// Write the values instead of a picture: NAME.f32 (rows from the top; NAME.f64 where float32 does not hold a field)
    /// and NAME.json.
    #[arg(long, hide_short_help = true)]
    pub raw: bool,
}

pub fn colormaps() -> impl TypedValueParser<Value = Colormap> {
    named()
}

pub fn range_of(numbers: Option<&[f64]>) -> Result<Option<[f64; 2]>> {
    match numbers {
        None => Ok(None),
        Some([lo, hi]) if *lo > 0.0 && hi > lo && hi.is_finite() => Ok(Some([*lo, *hi])),
        Some(_) => Err(Error::argument("--range takes LO,HI with 0 < LO < HI")),
    }
}

impl DensityArgs {
    /// The range of colours, whatever they show.
    pub fn range(&self) -> Result<Option<[f64; 2]>> {
        let two = |range: &[f64]| range.try_into().map_err(|_| Error::argument("--range takes two numbers LO,HI"));
        self.range.as_deref().map(two).transpose()
    }
}
