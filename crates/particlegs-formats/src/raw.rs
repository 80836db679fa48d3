//! Raw float32 columns: a folder with xx.f32, yy.f32, zz.f32, or those files. Their layers are species. Fields may be
//! float64.

use crate::numbers::{Bytes, NumberType, StridedColumn};
use crate::pieces::{ParticlePiece, PieceReader, RowBuffer};
use crate::{Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass, Weights};
use particlegs_core::model::Layer;
use particlegs_core::{Error, Result, model};
use particlegs_particles::{Particles, SnapshotMeta, SnapshotReader};
use std::ops::Range;
use std::path::{Path, PathBuf};

const POSITIONS: &str = "xx,yy,zz";
const WEIGHTS: &str = "ww";

struct RawSnapshot {
    description: Description,
    particles: Particles,
    /// The folder of the columns.
    folder: PathBuf,
    /// Names of those that are float64.
    double: Vec<String>,
}

/// Raw data have no head: a folder with columns, or columns that no format claims.
pub fn is_raw(paths: &[PathBuf]) -> bool {
    match paths {
        [folder] => folder.join("xx.f32").exists(),
        [x, ..] => (3..=4).contains(&paths.len()) && crate::open::detect(x).is_err(),
        [] => false,
    }
}

pub fn open(paths: &[PathBuf]) -> Result<Box<dyn Snapshot>> {
    let particles = Particles::open_raw(paths)?;
    let folder = match paths {
        [folder] => folder.clone(),
        files => files[0].parent().map_or_else(PathBuf::new, PathBuf::from),
    };
    let others = if paths.len() == 1 { other_columns(&folder, particles.len()) } else { Vec::new() };
    let double = |(_, kind): &&(String, NumberType)| *kind == NumberType::F64;
    let double = others.iter().filter(double).map(|(name, _)| name.clone()).collect();
    // Masses of layers weigh particles, too.
    let has_weights = paths.len() == 4 || folder.join("ww.f32").exists();
    let description = Description {
        species: particles.layers().iter().map(|l| species(l, has_weights, &others, &particles.meta)).collect(),
        ..Description::new("raw float32 columns, little-endian", paths, particles.meta.clone())
    };
    Ok(Box::new(RawSnapshot { description, particles, folder, double }))
}

/// Names and types of the folder's other columns, `.f32` and `.f64`, with a value for each particle, sorted.
fn other_columns(folder: &Path, count: usize) -> Vec<(String, NumberType)> {
    let Ok(entries) = std::fs::read_dir(folder) else { return Vec::new() };
    let name = |entry: std::fs::DirEntry| {
        // A link has the length of its file.
        let length = std::fs::metadata(entry.path()).ok()?.len();
        let file = entry.file_name().into_string().ok()?;
        let (name, kind) = match (file.strip_suffix(".f32"), file.strip_suffix(".f64")) {
            (Some(name), _) => (name, NumberType::F32),
            (_, name) => (name?, NumberType::F64),
        };
        let other = !POSITIONS.split(',').chain([WEIGHTS]).any(|standard| standard == name);
        (other && length == kind.bytes() * count as u64).then(|| (name.to_string(), kind))
    };
    let mut columns: Vec<(String, NumberType)> = entries.filter_map(|entry| name(entry.ok()?)).collect();
    // Of a name in both types the wider column comes first, and stays.
    columns.sort_by(|a, b| a.0.cmp(&b.0).then(b.1.bytes().cmp(&a.1.bytes())));
    columns.dedup_by(|b, a| a.0 == b.0);
    columns
}

fn species(
    layer: &Layer<Range<usize>>,
    weights: bool,
    others: &[(String, NumberType)],
    meta: &SnapshotMeta,
) -> Species {
    let of_kind = |(name, kind): (&str, NumberType)| {
        let unit = meta.field_units.get(name).cloned();
        SpeciesField { unit, ..SpeciesField::new(name, kind.name(), 1) }
    };
    let standard_columns = POSITIONS.split(',').chain(weights.then_some(WEIGHTS)).map(|name| (name, NumberType::F32));
    Species {
        name: layer.name.clone(),
        aliases: Vec::new(),
        count: layer.content.len() as u64,
        mass: match layer.mass {
            model::Mass::Weights(_) => SpeciesMass::Field(WEIGHTS.into()),
            model::Mass::Each(m) => SpeciesMass::Each(m),
            model::Mass::Unknown => SpeciesMass::Unknown,
        },
        positions: POSITIONS.into(),
        fields: standard_columns.chain(others.iter().map(|(name, kind)| (&name[..], *kind))).map(of_kind).collect(),
    }
}

/// Without weights and the masses of layers: all particles count alike.
fn counted(mut particles: Particles) -> Particles {
    let unknown = |l: &Layer<_>| Layer { mass: model::Mass::Unknown, ..l.clone() };
    let layers: Vec<_> = particles.layers().iter().map(unknown).collect();
    let one_kind = layers.len() == 1 && layers[0].name == Particles::ONE_LAYER;
    if !one_kind {
        particles.meta.particle_mass = None;
    }
    particles.without_weights().with_layers(if one_kind { Vec::new() } else { layers })
}

/// Columns of a folder's files.
struct RawColumns {
    rows: u64,
    columns: [(Bytes, StridedColumn); 3],
}

impl ParticlePiece for RawColumns {
    fn rows(&self) -> u64 {
        self.rows
    }

    fn is_wide(&self) -> bool {
        true
    }

    fn read(&self, rows: Range<u64>, out: &mut RowBuffer) -> Result<()> {
        for ((bytes, lane), column) in self.columns.iter().zip(&mut out.position) {
            lane.append(bytes, rows.clone(), column);
        }
        Ok(())
    }
}

impl RawSnapshot {
    fn is_double(&self, name: &str) -> bool {
        self.double.iter().any(|column| column == name)
    }

    /// A reader of three columns of a layer, of which some are float64; `None` of others.
    fn double_columns(&self, species: usize, choice: &Choice) -> Result<Option<PieceReader>> {
        let names: Vec<&str> = choice.positions.as_deref().unwrap_or(POSITIONS).split(',').map(str::trim).collect();
        let ([x, y, z], true) = (&names[..], names.iter().any(|name| self.is_double(name))) else { return Ok(None) };
        let layer = &self.particles.layers()[species].content;
        let column = |name: &str| {
            let kind = if self.is_double(name) { NumberType::F64 } else { NumberType::F32 };
            let path = self.folder.join(format!("{name}.{}", kind.name()));
            let (bytes, stride) = (Bytes::from_filled_file(&path)?, kind.bytes());
            let lane = StridedColumn { offset: stride * layer.start as u64, stride, kind, big_endian: false };
            match lane.fits(layer.len() as u64, bytes.len()) {
                true => Ok((bytes, lane)),
                false => Err(Error::input(&path, "it has fewer values than there are particles")),
            }
        };
        let columns = [column(x)?, column(y)?, column(z)?];
        let piece = RawColumns { rows: layer.len() as u64, columns };
        PieceReader::new(self.description.meta.clone(), vec![Box::new(piece)], false).map(Some)
    }

    /// The columns with the weights chosen, or none: there are no other fields to choose.
    fn with(&self, choice: &Choice) -> Result<Particles> {
        if let Some(names) = choice.positions.as_deref().filter(|names| *names != POSITIONS) {
            return self.columns(names);
        }
        let particles = self.particles.clone();
        match &choice.weights {
            Weights::Auto => Ok(particles),
            Weights::None => Ok(counted(particles)),
            Weights::Field(name) if name.strip_suffix(".f32").unwrap_or(name) == WEIGHTS => Ok(particles),
            Weights::Field(name) => {
                Err(Error::argument(format!("raw data have no field `{name}`: weights are in ww.f32")))
            }
        }
    }

    /// Three other columns in the places of positions.
    fn columns(&self, names: &str) -> Result<Particles> {
        let fields = &self.description.species[0].fields;
        let three: Vec<&str> = names.split(',').map(str::trim).collect();
        if let Some(name) = three.iter().find(|name| !fields.iter().any(|f| f.name == **name)) {
            return Err(Error::argument(format!("raw data have no field `{name}`: positions are in xx, yy and zz")));
        }
        if three.len() != 3 {
            return Err(Error::argument(format!("positions need three columns, not `{names}`")));
        }
        let paths: Vec<PathBuf> = three.iter().map(|name| self.folder.join(format!("{name}.f32"))).collect();
        Particles::open_raw(&paths)
    }
}

impl Snapshot for RawSnapshot {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        if let Some(reader) = self.double_columns(species, choice)? {
            return Ok(Box::new(reader));
        }
        let particles = self.with(choice)?;
        Ok(Box::new(particles.of_layer(&particles.layers()[species])))
    }

    fn in_place(&self, species: &[usize], choice: &Choice) -> Result<Option<Particles>> {
        let all = &self.description.species;
        if choice.positions.as_ref().is_some_and(|names| names.split(',').any(|name| self.is_double(name.trim()))) {
            return Ok(None);
        }
        let particles = self.with(choice)?;
        Ok(match species {
            _ if species.len() == all.len() => Some(particles),
            [one] => Some(particles.of_layer(&particles.layers()[*one])),
            _ => None,
        })
    }
}
