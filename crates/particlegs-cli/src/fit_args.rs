//! Options of the fit: target, effort, certificate, fields. Shared by `compress`, `plan` and `series`.

use crate::common::named;
use crate::target_args::{GoalArgs, TargetArgs, with_default};
use crate::train_args::TrainArgs;
use clap::Args;
use particlegs_compress::Options;
use particlegs_core::Result;
use particlegs_core::model::CertificateLevel;
use particlegs_fit::Effort;
use particlegs_particles::StarFormingGas;

pub fn number_of_blocks(text: &str) -> std::result::Result<u32, String> {
    text.parse().map_err(|_| "not a number (--gadget-blocks names the blocks of a Gadget file)".to_string())
}

/// Position in the help: after the options of the fit.
pub const LATER: usize = 500;

#[derive(Args, Clone, Debug)]
#[command(mut_arg("ratio", |a| with_default(a, "300, less for small snapshots")))]
pub struct FitArgs {
    #[command(flatten)]
    target: TargetArgs,
    #[command(flatten)]
    goal: GoalArgs,
    /// Effort of the fit.
    ///
    /// docs/guide/choosing.md says when to use which.
    #[arg(long, value_name = "LEVEL", default_value = "default", value_parser = named::<Effort>())]
    effort: Effort,
    /// Particle radius to store as the default, world units [default: 0.0406 of the mean spacing].
    #[arg(long, value_name = "R", hide_short_help = true)]
    radius: Option<f64>,
    /// Particle opacity to store as the default, in (0, 1] [default: 0.05].
    #[arg(long, value_name = "A", hide_short_help = true)]
    opacity: Option<f64>,
    /// How much to measure on the decoded model and store in the file.
    #[arg(long, value_name = "LEVEL", default_value = "quick", value_parser = named::<CertificateLevel>())]
    certificate: CertificateLevel,
    /// Fields to store as well, such as velocity, or `all`.
    ///
    /// Names are those that `info` lists, case aside; `velocity` also finds Velocities, or vx, vy and vz. Velocities of
    /// cosmological snapshots are stored as peculiar velocities in km/s where the file says how. The target is met
    /// without the fields, and the report says what they add.
    #[arg(long, display_order = LATER, value_name = "NAME,...", value_delimiter = ',')]
    pub fields: Vec<String>,
    /// Temperature of star-forming gas, where it is computed from internal energy: keep, drop, or a value in K.
    ///
    /// Such gas follows an effective equation of state in many simulations, so its internal energy is not thermal.
    #[arg(long, display_order = LATER, value_name = "keep|drop|K", hide_short_help = true, requires = "fields", default_value = "keep", hide_default_value = true)]
    pub star_forming: StarFormingGas,
    #[command(flatten)]
    pub train: TrainArgs,
}

impl FitArgs {
    pub fn is_fast(&self) -> bool {
        self.effort == Effort::Fast
    }

    /// The library's options for one block in memory.
    pub fn options(&self, seed: u64) -> Result<Options> {
        let target = match self.goal.target()? {
            Some(goal) => goal,
            None => self.target.target()?,
        };
        let options = Options {
            target,
            effort: self.effort,
            radius: self.radius,
            opacity: self.opacity,
            training: self.train.config()?,
            seed,
            certificate: self.certificate,
            fields: self.fields.clone(),
            star_forming: self.star_forming,
            ..Options::default()
        };
        options.check().map(|()| options)
    }
}
