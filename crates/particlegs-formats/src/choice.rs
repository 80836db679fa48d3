//! The parts of a snapshot that a user chooses to read.

use crate::single_file::named;
use crate::topology::selection::AtomSelection;
use particlegs_files::input::SpoolFile;
use particlegs_particles::Selection;
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;
use std::path::PathBuf;
use std::sync::Arc;

/// Options of reading a snapshot.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
#[serde(default)]
pub struct Choice {
    /// Name of the format ([`Format::name`](crate::Format::name)) instead of what the content says.
    pub format: Option<String>,
    /// Frame of a file that holds several, from 0, or from the end where it is negative; the last, -1, by default.
    pub frame: Option<i64>,
    /// A file that names the atoms of one that has no names: GRO, PDB, PSF or LAMMPS data.
    pub topology: Option<PathBuf>,
    /// The atoms that are read; all by default.
    pub select: Option<AtomSelection>,
    /// Names, numbers or aliases of species; all by default. Each becomes a layer.
    pub species: Vec<String>,
    /// Field of positions with three components, or three scalar fields `x,y,z`; the species'
    /// own by default.
    pub positions: Option<String>,
    /// The source of weights.
    pub weights: Weights,
    /// Layers by mass within a species instead of one a species.
    pub by_mass: bool,
    /// Drop particles with invalid values instead of refusing them.
    pub skip_invalid: bool,
    /// Refuse files whose headers count other particles than there are, instead of saying so.
    pub strict: bool,
    /// Leave unwrapped positions of a trajectory as they are, without a periodic box, instead of wrapping them.
    pub keep_unwrapped: bool,
    /// Names of the blocks of a Gadget file of format 1, in order, behind its header; found by what they hold by default.
    pub blocks: Vec<String>,
    /// Periodic box lengths that the user states, over what the files say.
    pub box_lengths: Option<[f64; 3]>,
    /// Unit of length that the user states.
    pub length_unit: Option<String>,
    /// Unit of mass that the user states.
    pub mass_unit: Option<String>,
    /// Convert numbers to those units where the files state others, instead of taking the files to be wrong.
    pub convert_units: bool,
    /// The selection of particles among all that; all by default.
    pub selection: Option<Selection>,
    /// Fields as they are stored: in no cell, not moved, whole numbers of 64 bits as the bits of f64.
    #[serde(skip)]
    pub as_stored: bool,
    /// The content of the stream that is named, once it was read ([`Choice::spool`]).
    #[serde(skip)]
    pub spooled: Option<Arc<SpoolFile>>,
}

/// The source of weights.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Weights {
    /// The species' field of masses, where it has one.
    #[default]
    Auto,
    /// None: every particle counts alike.
    None,
    /// This scalar field.
    Field(String),
}

impl Choice {
    /// Whether atoms are told apart one by one, not by the species of their format.
    pub(crate) fn by_atoms(&self) -> bool {
        self.topology.is_some() || self.select.is_some()
    }

    /// As a model's recipe says it: which particles are read, and as what, by options of the command. Box, units and
    /// particles that are left out stand in its metadata.
    pub fn options(&self) -> BTreeMap<String, String> {
        let weights = match &self.weights {
            Weights::Auto => None,
            Weights::None => Some("none".to_string()),
            Weights::Field(name) => Some(name.clone()),
        };
        let settings = [
            ("format", self.format.clone()),
            ("particle-type", (!self.species.is_empty()).then(|| self.species.join(","))),
            ("positions", self.positions.clone()),
            ("weights", weights),
            ("frame", self.frame.map(|f| f.to_string())),
            ("topology", self.topology.as_deref().map(|path| named(path).name)),
            ("select", self.select.as_ref().map(ToString::to_string)),
            ("layers-by", self.by_mass.then(|| "mass".into())),
            ("unwrapped", self.keep_unwrapped.then(|| "keep".into())),
            ("gadget-blocks", (!self.blocks.is_empty()).then(|| self.blocks.join(","))),
        ];
        let stated_options = settings.into_iter().filter_map(|(name, value)| Some((name.to_string(), value?)));
        stated_options.chain(self.selection.iter().flat_map(Selection::options)).collect()
    }
}
