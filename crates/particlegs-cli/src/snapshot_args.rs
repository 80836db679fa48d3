//! Options of snapshots: their files, and the particles that are read.

use clap::{Args, ValueEnum};
use particlegs_core::context::Context;
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result};
use particlegs_formats::{AtomSelection, Choice, Weights};
use particlegs_particles::{Particles, Selection, Storage};
use std::path::PathBuf;

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Snapshot options")]
pub struct SnapshotArgs {
    /// Input format, if the content does not tell.
    #[arg(long, value_name = "NAME", hide_short_help = true, value_parser = clap::builder::PossibleValuesParser::new(names()))]
    pub format: Option<String>,
    /// Particle types, by number or name, such as 1 or dm [default: all].
    ///
    /// Several types become several layers of the model.
    #[arg(long, value_name = "TYPE,...", value_delimiter = ',')]
    pub particle_type: Vec<String>,
    /// Field of the positions: one with three components, or three scalar fields x,y,z.
    #[arg(long, value_name = "FIELD", hide_short_help = true)]
    pub positions: Option<String>,
    /// Field of the masses, or of another additive quantity [default: the masses, if they differ within a type].
    #[arg(long, alias = "weights", value_name = "FIELD|none", hide_short_help = true)]
    pub mass_field: Option<String>,
    /// Frame of a trajectory, counted from 0, or from the end: -1 is the last [default: the last].
    #[arg(long, value_name = "N", hide_short_help = true, allow_negative_numbers = true)]
    pub frame: Option<i64>,
    /// File that names the atoms of a trajectory without names: GRO, PDB, PSF or LAMMPS data.
    #[arg(long, value_name = "FILE", hide_short_help = true, value_hint = clap::ValueHint::FilePath)]
    pub topology: Option<PathBuf>,
    /// Atoms to read, such as "name OW", "protein and not name H*" or "resid 1:10".
    ///
    /// Words: name, resname, resid, element, type, index (each with one or more values), protein, water, all, not, and,
    /// or, parentheses. A * stands for any letters.
    #[arg(long, value_name = "TEXT", hide_short_help = true)]
    pub select: Option<String>,
    /// What each layer of the model contains.
    #[arg(long, alias = "layers", value_name = "WHAT", hide_short_help = true, value_enum, default_value_t = LayersBy::Species)]
    pub layers_by: LayersBy,
    /// Lengths of the periodic box, 0 for an axis that is not periodic; overrides the file.
    #[arg(long = "box", value_name = "Lx,Ly,Lz", value_delimiter = ',', num_args = 1)]
    pub box_lengths: Option<Vec<f64>>,
    /// Unit of length, such as Mpc/h; overrides the file.
    #[arg(long, value_name = "UNIT", hide_short_help = true)]
    pub length_unit: Option<String>,
    /// Unit of mass, such as Msun/h; overrides the file.
    #[arg(long, value_name = "UNIT", hide_short_help = true)]
    pub mass_unit: Option<String>,
    /// Leave out particles with NaN or infinite values instead of refusing the file.
    #[arg(long, hide_short_help = true)]
    pub skip_invalid: bool,
    /// Refuse files whose numbers of particles differ from their header.
    #[arg(long, hide_short_help = true)]
    pub strict: bool,
    /// What to do with unwrapped positions of a trajectory, such as xu, yu, zu.
    #[arg(long, value_name = "HOW", hide_short_help = true, value_enum, default_value_t = UnwrappedPositions::Wrap)]
    pub unwrapped: UnwrappedPositions,
    /// Names of the blocks after the header of a Gadget format 1 file, in order: POS,VEL,ID,MASS,...
    ///
    /// A block named - is skipped. By default blocks are identified by their lengths and values.
    #[arg(long, value_name = "NAME,...", hide_short_help = true, value_delimiter = ',')]
    pub gadget_blocks: Vec<String>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum UnwrappedPositions {
    /// Wrap them into the periodic box.
    #[default]
    Wrap,
    /// Keep them, without a periodic box.
    Keep,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub enum LayersBy {
    /// One particle type.
    Species,
    /// One particle mass of one type, for zoom simulations.
    Mass,
}

fn names() -> Vec<&'static str> {
    Choice::formats().collect()
}

#[derive(Args, Clone, Debug)]
#[command(next_help_heading = "Selection options (applied in the order region, every, sample)")]
pub struct SelectionArgs {
    /// Keep x0 <= x < x1, y0 <= y < y1, z0 <= z < z1 (world units).
    ///
    /// The result has no periodic box.
    #[arg(
        long,
        hide_short_help = true,
        alias = "crop",
        value_name = "x0,x1,y0,y1,z0,z1",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true
    )]
    pub region: Option<Vec<f64>>,
    /// Keep the first of every K particles.
    #[arg(long, value_name = "K", default_value_t = 1, hide_short_help = true)]
    pub every: u64,
    /// Keep N particles drawn at random, in the order of the file.
    #[arg(long, value_name = "N", hide_short_help = true)]
    pub sample: Option<u64>,
    /// Keep the particles that --sample leaves out, to score a model of the sample.
    #[arg(long, requires = "sample", hide_short_help = true)]
    pub left_out: bool,
}

#[derive(Args, Clone, Debug, Default)]
#[command(next_help_heading = "Selection options (applied in the order region, every, sample)")]
pub struct WindowArgs {
    /// Keep a window around this point, across the periodic boundary.
    #[arg(
        long,
        hide_short_help = true,
        value_name = "X,Y,Z",
        value_delimiter = ',',
        num_args = 1,
        allow_hyphen_values = true,
        requires = "width",
        conflicts_with = "region"
    )]
    pub center: Option<Vec<f64>>,
    /// Width of the window around --center, or its three widths.
    #[arg(
        long,
        hide_short_help = true,
        value_name = "W|Wx,Wy,Wz",
        value_delimiter = ',',
        num_args = 1,
        requires = "center"
    )]
    pub width: Option<Vec<f64>>,
}

/// The particles of a command: how a snapshot is read, and which are selected.
#[derive(Args, Clone, Debug)]
pub struct ParticleArgs {
    #[command(flatten)]
    pub opening: SnapshotArgs,
    #[command(flatten)]
    pub selection: SelectionArgs,
    #[command(flatten)]
    pub window: WindowArgs,
}

impl ParticleArgs {
    pub fn without_window(opening: &SnapshotArgs, selection: &SelectionArgs) -> Self {
        ParticleArgs { opening: opening.clone(), selection: selection.clone(), window: WindowArgs::default() }
    }

    /// The selection; `seed` draws the sample.
    pub fn choice(&self, seed: u64) -> Result<Choice> {
        let selection = self.selection.selection(&self.window, seed)?;
        Ok(Choice { selection: Some(selection), ..self.opening.choice()? })
    }

    /// Reads the particles; those that cannot be used in place go to `storage`.
    pub fn read(&self, paths: &[PathBuf], seed: u64, storage: &Storage, context: &Context<'_>) -> Result<Particles> {
        self.choice(seed)?.read(paths, storage, context)
    }
}

impl SnapshotArgs {
    /// The given options as text for a command line; `None` without any.
    #[cfg(feature = "lab")]
    pub fn describe(&self) -> Option<String> {
        let numbers = |list: &Vec<f64>| list.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
        let types = (!self.particle_type.is_empty()).then(|| self.particle_type.join(","));
        let by_mass = (self.layers_by == LayersBy::Mass).then(|| "mass".to_string());
        let all = [
            ("--format", self.format.clone()),
            ("--particle-type", types),
            ("--positions", self.positions.clone()),
            ("--mass-field", self.mass_field.clone()),
            ("--frame", self.frame.map(|n| n.to_string())),
            ("--topology", self.topology.as_ref().map(|path| path.display().to_string())),
            ("--select", self.select.as_ref().map(|text| format!("\"{text}\""))),
            ("--layers-by", by_mass),
            ("--box", self.box_lengths.as_ref().map(numbers)),
            ("--length-unit", self.length_unit.clone()),
            ("--mass-unit", self.mass_unit.clone()),
            ("--unwrapped", (self.unwrapped == UnwrappedPositions::Keep).then(|| "keep".into())),
            ("--gadget-blocks", (!self.gadget_blocks.is_empty()).then(|| self.gadget_blocks.join(","))),
        ];
        let options = all.into_iter().filter_map(|(name, value)| Some(format!("{name} {}", value?)));
        let switches = [("--skip-invalid", self.skip_invalid), ("--strict", self.strict)];
        let switches = switches.into_iter().filter(|s| s.1).map(|s| s.0.to_string());
        let words: Vec<String> = options.chain(switches).collect();
        (!words.is_empty()).then(|| words.join(" "))
    }

    pub fn choice(&self) -> Result<Choice> {
        let box_lengths = match self.box_lengths.as_deref() {
            None => None,
            Some([l]) => Some([*l; 3]),
            Some([x, y, z]) => Some([*x, *y, *z]),
            Some(_) => return Err(Error::argument("--box takes one length or three lengths Lx,Ly,Lz")),
        };
        let weights = match self.mass_field.as_deref() {
            None => Weights::Auto,
            Some("none") => Weights::None,
            Some(field) => Weights::Field(field.into()),
        };
        Ok(Choice {
            format: self.format.clone(),
            frame: self.frame,
            topology: self.topology.clone(),
            select: self.select.as_deref().map(AtomSelection::parse).transpose()?,
            species: self.particle_type.clone(),
            positions: self.positions.clone(),
            weights,
            by_mass: self.layers_by == LayersBy::Mass,
            skip_invalid: self.skip_invalid,
            strict: self.strict,
            keep_unwrapped: self.unwrapped == UnwrappedPositions::Keep,
            blocks: self.gadget_blocks.clone(),
            box_lengths,
            length_unit: self.length_unit.clone(),
            mass_unit: self.mass_unit.clone(),
            ..Choice::default()
        })
    }
}

impl SelectionArgs {
    pub fn selection(&self, window: &WindowArgs, seed: u64) -> Result<Selection> {
        let selection = match (self.region.as_deref(), window.center.as_deref(), window.width.as_deref()) {
            (None, None, _) => Selection::all(),
            (Some(&[x0, x1, y0, y1, z0, z1]), ..) => {
                Selection { crop: Some(Bounds { min: [x0, y0, z0], max: [x1, y1, z1] }), ..Selection::all() }
            }
            (None, Some(&[x, y, z]), Some(&[w])) => Selection::window([x, y, z], [w; 3]),
            (None, Some(&[x, y, z]), Some(&[wx, wy, wz])) => Selection::window([x, y, z], [wx, wy, wz]),
            (Some(_), ..) => return Err(Error::argument("--region takes six numbers x0,x1,y0,y1,z0,z1")),
            _ => return Err(Error::argument("a window needs --center X,Y,Z and --width W or Wx,Wy,Wz")),
        };
        let (every, sample, left_out) = (self.every, self.sample, self.left_out);
        Selection { every, sample, left_out, seed, ..selection }.check()
    }
}

#[cfg(all(test, feature = "lab"))]
mod tests {
    use super::*;
    use clap::Parser;

    #[derive(Parser)]
    struct TestCommandLine {
        #[command(flatten)]
        snapshot: SnapshotArgs,
    }

    /// The description of options gives them again.
    #[test]
    fn options_are_reported_as_given() {
        let describe = |words: &[&str]| TestCommandLine::parse_from(["x"].iter().chain(words)).snapshot.describe();
        assert_eq!(describe(&[]), None);
        let rest = "--particle-type 1,dm --mass-field none --frame 3 --layers-by mass --box 2,2.5,3 --length-unit kpc \
                    --unwrapped keep --gadget-blocks POS,ID --skip-invalid --strict";
        let all = format!("--format {} {rest}", names()[0]);
        assert_eq!(describe(&all.split(' ').collect::<Vec<_>>()).as_deref(), Some(&all[..]));
    }
}
