//! What experiments share: settings, snapshots, kept results, models and the pictures that they are scored by.

use crate::external::External;
use crate::store::Store;
use crate::{Baseline, Columns};
#[cfg(doc)]
use particlegs::Error;
use particlegs::Result;
use particlegs::codec;
use particlegs::compress::{Compressed, Options, Target, compress};
use particlegs::fit::Effort;
use particlegs::model::{CertificateLevel, Model};
use particlegs::particles::{Column, Particles, Positions, RawForm, Selection, Storage};
use particlegs::picture::Size;
use particlegs::pieces::NoPieces;
use particlegs::progress::Progress;
use particlegs::recover;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What is measured, and how finely.
#[derive(Clone, Debug)]
pub struct Settings {
    /// Small pictures, few ratios, one frame an orbit: to see that all of it runs.
    pub quick: bool,
    /// Also experiments that train models.
    pub training: bool,
    /// Pixels of the pictures that are scored.
    pub size: Size,
    /// Views an orbit.
    pub frames: usize,
    /// Raw bytes over bytes of a file, rising.
    pub ratios: Vec<f64>,
    /// The first seed.
    pub seed: u64,
    /// Seeds, where a draw or a start is random.
    pub seeds: usize,
    /// Share of the published recipe's pixels, steps and Gaussians that models are trained with; `None` = each
    /// experiment's own.
    pub scale: Option<f64>,
    /// Minutes after which a long training run ends for now, to be gone on from by the same command; `None` = the
    /// experiment's own.
    pub minutes: Option<f64>,
    /// A Python that has the packages of other compressors and renderers.
    pub python: Option<PathBuf>,
    /// This program, where whole commands are measured.
    pub program: PathBuf,
}

impl Settings {
    /// The settings of `--quick`, or the full ones.
    pub fn new(quick: bool, program: PathBuf) -> Settings {
        let (size, frames, seeds) = match quick {
            true => (Size { width: 640, height: 360 }, 1, 2),
            false => (Size { width: 1920, height: 1080 }, 2, 3),
        };
        let ratios = match quick {
            true => vec![50.0, 263.0, 1000.0],
            false => vec![20.0, 50.0, 100.0, 263.0, 500.0, 1000.0, 2000.0, 5000.0],
        };
        let (training, scale, minutes, python) = (false, None, None, None);
        Settings { quick, training, size, frames, ratios, seed: 42, seeds, scale, minutes, python, program }
    }

    /// The seeds.
    pub fn seeds(&self) -> impl Iterator<Item = u64> {
        let first = self.seed;
        (0..self.seeds as u64).map(move |i| first + i)
    }
}

/// A snapshot that is measured.
pub struct Snapshot {
    /// Its name in tables.
    pub name: String,
    /// Where it lies.
    pub path: PathBuf,
    /// Its particles.
    pub particles: Particles,
    /// The beginning of the hash that models of it carry, in hexadecimal digits; and where it was read by options of
    /// the command, such as another box, which that hash does not know, the beginning of theirs.
    pub hash: String,
}

impl Snapshot {
    /// Of particles from `path`.
    pub fn new(name: String, path: PathBuf, particles: Particles) -> Snapshot {
        let hash = blake3::Hash::from_bytes(particles.source_hash()).to_hex()[..24].to_string();
        Snapshot { name, path, particles, hash }
    }

    /// [`Snapshot::new`] of particles that were read by options, which results depend on as well.
    pub fn read_with(name: String, path: PathBuf, particles: Particles, options: Option<&str>) -> Snapshot {
        let mut all = Snapshot::new(name, path, particles);
        if let Some(options) = options {
            all.hash += &format!("-{}", &blake3::hash(options.as_bytes()).to_hex()[..8]);
        }
        all
    }

    /// Two random halves of the particles, the same for the same seed.
    ///
    /// # Errors
    /// [`Error::Memory`], [`Error::Cancelled`].
    pub fn halves(&self, seed: u64, progress: &dyn Progress) -> Result<[Particles; 2]> {
        let half = Selection { sample: Some(self.particles.len() as u64 / 2), seed, ..Selection::all() };
        let taken = |selection| self.particles.select(selection, &Storage::Memory, progress);
        Ok([taken(half)?, taken(Selection { left_out: true, ..half })?])
    }

    /// Mean spacing of the particles in their box, world units.
    pub fn spacing(&self) -> f64 {
        particlegs::stats::Domain::of_particles(&self.particles).spacing(self.particles.len())
    }
}

/// Positions in columns, as compressors take them: relative to the particles' origin, since float32 far from it has few
/// digits left.
pub fn columns_of(p: &Particles) -> Columns {
    [0, 1, 2].map(|k| (0..p.len()).map(|i| (p.position(i)[k] - p.origin[k]) as f32).collect())
}

/// Particles of such columns, about the origin and in the box of others.
pub fn particles_of(columns: Columns, like: &Particles) -> Particles {
    Particles::new(Positions::Columns(columns.map(Column::owned)), like.origin, like.meta.clone())
}

/// Where experiments are done.
pub struct Lab<'a> {
    /// How.
    pub settings: Settings,
    /// Kept results.
    pub store: Store,
    /// Other compressors: those that need nothing else, and those of the settings' Python.
    pub baselines: Vec<Box<dyn Baseline>>,
    /// Whom to tell.
    pub progress: &'a dyn Progress,
}

/// How a model is made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Recipe {
    /// What the file is to meet.
    pub target: Target,
    /// Time for quality.
    pub effort: Effort,
    /// Blocks that are fitted on their own.
    pub blocks: u32,
    /// Seed of the fit.
    pub seed: u64,
}

impl Recipe {
    /// A file of raw bytes over `ratio`, by the default fit.
    pub fn ratio(ratio: f64, seed: u64) -> Recipe {
        Recipe { target: Target::Ratio(ratio), effort: Effort::Default, blocks: 1, seed }
    }

    /// The same with its size in bytes: a ratio and the size that it comes to are one model, fitted once.
    fn in_bytes(&self, snapshot: &Snapshot) -> Recipe {
        let bytes = self.target.bytes(snapshot.particles.raw_bytes());
        Recipe { target: bytes.map_or(self.target, Target::Size), ..self.clone() }
    }

    /// The options of `compress`.
    pub fn options(&self) -> Options {
        Options {
            target: self.target,
            effort: self.effort,
            blocks: Some(self.blocks),
            seed: self.seed,
            certificate: CertificateLevel::None,
            ..Options::default()
        }
    }
}

/// A model file and what it decodes to.
pub struct Made {
    /// The file.
    pub bytes: Vec<u8>,
    /// What it decodes to.
    pub model: Model,
    /// Wall-clock seconds of the compression.
    pub seconds: f64,
}

impl<'a> Lab<'a> {
    /// Keeps results in `folder`, which is there.
    ///
    /// # Errors
    /// [`Error::Input`] for a Python that cannot be started or lacks packages.
    pub fn new(settings: Settings, folder: &Path, progress: &'a dyn Progress) -> Result<Self> {
        let external = settings.python.as_deref().map(External::start).transpose()?;
        let baselines = crate::baselines(external.as_ref());
        Ok(Lab { settings, store: Store::new(folder), baselines, progress })
    }

    /// What is not measured for want of a Python; nothing where there is one.
    pub fn left_out(&self) -> Option<String> {
        let words = "SZ3 and ZFP were not measured: they take a Python with their libraries (`--python`).";
        self.settings.python.is_none().then(|| words.into())
    }

    /// The model of a snapshot by a recipe: kept, or made now.
    ///
    /// # Errors
    /// Those of [`compress`]; [`Error::Io`].
    pub fn model(&self, snapshot: &Snapshot, recipe: &Recipe) -> Result<Made> {
        let recipe = recipe.in_bytes(snapshot);
        self.made(&(&snapshot.hash, &recipe), || {
            compress(&snapshot.particles, &recipe.options(), &mut NoPieces, self.progress)
        })
    }

    /// As many particles drawn from a model as it stands for.
    ///
    /// # Errors
    /// Those of the draw.
    pub fn drawn(&self, model: Model, method: recover::Method, seed: u64) -> Result<Particles> {
        let form = RawForm::Columns;
        let options = recover::Options { particles: None, method, scale: 1.0, seed, form, model_name: String::new() };
        options.draw(model, self.progress)
    }

    /// Keeps a model that a recipe gave in `seconds`, unless there is one.
    ///
    /// # Errors
    /// [`Error::Io`].
    pub fn keep(&self, snapshot: &Snapshot, recipe: &Recipe, done: Compressed, seconds: f64) -> Result<()> {
        let inputs = (&snapshot.hash, recipe.in_bytes(snapshot));
        self.store.bytes("model", &inputs, "pgs", || Ok(done.bytes))?;
        self.store.result("model-seconds", &inputs, || Ok(seconds))?;
        Ok(())
    }

    /// A model by whatever way, kept by what it was made from.
    ///
    /// # Errors
    /// Those of `make`; [`Error::Io`].
    pub fn made(&self, inputs: &impl Serialize, make: impl FnOnce() -> Result<Compressed>) -> Result<Made> {
        self.made_in(inputs, || timed(make))
    }

    /// [`Lab::made`] by work that says itself how many seconds it took, those of earlier pieces included.
    ///
    /// # Errors
    /// As [`Lab::made`].
    pub fn made_in(&self, inputs: &impl Serialize, make: impl FnOnce() -> Result<(Compressed, f64)>) -> Result<Made> {
        let seconds = std::cell::Cell::new(0.0);
        let bytes = self.store.bytes("model", inputs, "pgs", || {
            let (done, took) = make()?;
            seconds.set(took);
            Ok(done.bytes)
        })?;
        let seconds = self.store.result("model-seconds", inputs, || Ok(seconds.get()))?;
        let model = codec::decode_with(&bytes, "the model", self.progress)?;
        Ok(Made { bytes, model, seconds })
    }
}

/// What work gives, and its wall-clock seconds.
///
/// # Errors
/// Those of the work.
pub fn timed<T>(work: impl FnOnce() -> Result<T>) -> Result<(T, f64)> {
    let start = std::time::Instant::now();
    let done = work()?;
    Ok((done, start.elapsed().as_secs_f64()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Another box is another snapshot, though the positions are the same.
    #[test]
    fn options_of_reading_are_part_of_the_hash() {
        let particles = Particles::from_columns(vec![1.0; 3], vec![2.0; 3], vec![3.0; 3]);
        let of = |options| Snapshot::read_with("s".into(), "s".into(), particles.clone(), options).hash;
        let all = [of(None), of(Some("--box 1,1,1")), of(Some("--box 2,2,2"))];
        assert_eq!(all[0], Snapshot::new("s".into(), "s".into(), particles.clone()).hash);
        assert!(all[1].starts_with(&all[0]) && all[1] != all[2] && all[0] != all[1], "{all:?}");
    }

    /// What is asked for as a ratio is there for who asks for its bytes.
    #[test]
    fn a_ratio_and_its_size_are_one_model() {
        let column = |k: u32| (0..3000u32).map(|i| (i * (k + 7) % 997) as f32).collect::<Vec<f32>>();
        let particles = Particles::from_columns(column(1), column(2), column(3));
        let (of, folder) = (Snapshot::new("s".into(), "s".into(), particles), tempfile::tempdir().unwrap());
        let lab = Lab::new(Settings::new(true, "".into()), folder.path(), &particlegs::progress::Silent).unwrap();
        let asked = lab.model(&of, &Recipe::ratio(10.0, 1)).unwrap().bytes;
        let files = || std::fs::read_dir(folder.path()).unwrap().count();
        let kept = files();
        let size = Recipe { target: Target::Size(3600), ..Recipe::ratio(10.0, 1) };
        assert_eq!((lab.model(&of, &size).unwrap().bytes, files()), (asked, kept));
    }

    /// A snapshot far from zero comes back as it was: compressors are not given fewer digits than models.
    #[test]
    fn columns_keep_the_digits_of_places_far_away() {
        let near = [vec![0.125f32, 3.0], vec![1.0, 2.0], vec![0.0, 0.5]];
        let positions = Positions::Columns(near.clone().map(Column::owned));
        let far = Particles::new(positions, [1e9, 0.0, -1e9], Particles::from_columns(vec![], vec![], vec![]).meta);
        let columns = columns_of(&far);
        assert_eq!(columns, near);
        let back = particles_of(columns, &far);
        assert_eq!([0, 1].map(|i| back.position(i)), [0, 1].map(|i| far.position(i)));
        assert_eq!(back.position(0)[0], 1e9 + 0.125);
    }
}
