//! Options of maps of a field: which one, its scale, and what is subtracted.

use crate::common::named;
use clap::Args;
use particlegs_core::picture::ValueScale;
use particlegs_pictures::FieldOptions;

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Field options")]
pub struct FieldArgs {
    /// Show a field: its mean along each line of sight, such as temperature or velocity.los.
    ///
    /// A vector needs a component: velocity.x, velocity.y, velocity.z, or velocity.los, positive away from the
    /// observer. dispersion.los is the dispersion of the velocity, dispersion.temperature that of the temperature. Means
    /// are weighted by mass, or by numbers of particles where no masses are known. `info` lists the fields.
    #[arg(long, value_name = "NAME", hide_short_help = true)]
    pub field: Option<String>,
    /// Scale of the field's colours [default: signed for vectors, log for positive values over a wide range].
    #[arg(long, value_name = "SCALE", hide_short_help = true, value_parser = named::<ValueScale>())]
    pub scale: Option<ValueScale>,
    /// Motion to subtract from a vector: `mean`, the mean of all particles, or X,Y,Z in its unit.
    #[arg(long, value_name = "mean|X,Y,Z", hide_short_help = true, allow_hyphen_values = true)]
    pub bulk: Option<String>,
    /// Weight of means along the line of sight [default: mass].
    ///
    /// mass, count (all particles alike), or the name of a positive scalar field: its value times mass. Both fields must be
    /// in the model.
    #[arg(long, value_name = "mass|count|NAME", hide_short_help = true)]
    pub field_weight: Option<String>,
    /// Shade the field's colours by surface density: bright where there is much mass.
    #[arg(long, hide_short_help = true)]
    pub shade: bool,
}

impl FieldArgs {
    pub fn options(&self) -> FieldOptions {
        let (name, weight) = (self.field.clone(), self.field_weight.clone());
        FieldOptions { name, scale: self.scale, bulk: self.bulk.clone(), weight, shade: self.shade }
    }
}
