//! Particle snapshots as mixtures of Gaussians: files a hundred to a thousand times smaller that render the picture
//! ParaView would, and give densities, statistics and synthetic particles back.
//!
//! ```
//! use particlegs::prelude::*;
//!
//! # fn main() -> particlegs::Result<()> {
//! # let folder = tempfile::tempdir().unwrap();
//! # let (input, output, picture) = (sample(), folder.path().join("snap.pgs"), folder.path().join("snap.png"));
//! let snapshot = Snapshot::open(input)?; // a path; `.species("dm")` reads one species alone
//! let context = Context::default().with_memory(&available_memory); // also: progress, cancelling
//! let model = compress(&snapshot, &CompressOptions::ratio(300.0), &context)?;
//! model.save(&output)?;
//!
//! let model = Model::open(&output)?;
//! let size = Size { width: 1280, height: 720 };
//! let image = model.render(&model.orbit(30.0, 20.0, size), size, &context)?;
//! image.save_png(&picture)?;
//! let density = model.density_grid(64, &context)?;
//! let particles = model.recover(&RecoverOptions::default(), &context)?;
//! let correlation = model.certificate().map(|measured| measured.density.correlation); // with the source
//! # assert!(correlation > Some(0.9));
//! # assert_eq!((density.grid.cells, particles.len() as u64), ([64; 3], model.metadata().count));
//! # Ok(())
//! # }
//! # fn sample() -> std::path::PathBuf {
//! #     std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64")
//! # }
//! ```
//!
//! Everything that a user needs is here or in one of eight modules. The crates beneath (`particlegs-core`,
//! `particlegs-compress` and others) are its parts: their names may change from version to version, this crate's
//! do not without a new major version.

mod evaluate;
mod export;
pub mod input;
pub mod job;
mod model;
mod particle_files;
pub mod pictures;
mod run;
mod series;
mod snapshot;
mod training_log;
mod verification;

/// Names that most programs need.
///
/// ```
/// use particlegs::prelude::*;
///
/// let model = compress(&Snapshot::from_columns([0.5, 1.0, 2.5], [0.0; 3], [1.0; 3])?, &CompressOptions::gaussians(1), &Context::default())?;
/// assert_eq!(model.metadata().count, 3);
/// # Ok::<(), particlegs::Error>(())
/// ```
pub mod prelude {
    pub use crate::camera::{Camera, View};
    pub use crate::{
        CompressOptions, Context, Error, Model, Particles, RecoverOptions, Result, SavePng, Size, Snapshot, ToneStyle,
        available_memory, compress,
    };
}

/// Cameras, views and windows of maps.
///
/// ```
/// use particlegs::camera::{Camera, Projection, View, spherical_camera};
///
/// // 30 degrees about the z axis, 20 above the plane, 10 units of length from the origin.
/// let camera = spherical_camera([0.0; 3], 30.0, 20.0, 10.0);
/// assert!((camera.distance() - 10.0).abs() < 1e-12);
/// let view = View { name: "front".into(), camera, radius: 0.05, opacity: 0.1 };
/// assert_eq!(view.scaled(2.0).radius, 0.1);
/// ```
pub mod camera {
    pub use particlegs_core::camera::{
        Camera, DensityView, Images, Projection, View, ViewSet, Window, base_distance, spherical_camera,
    };
    pub use particlegs_files::ViewsFile;
}

/// Statistics of particles and models, and comparisons of two.
///
/// ```
/// use particlegs::stats::{Measure, StatsOptions, Subject, compare};
/// use particlegs::{Context, Particles};
///
/// let column = |k: u32| (0..4000u32).map(|i| (i * (k + 7) % 997) as f32).collect::<Vec<f32>>();
/// let particles = Particles::from_columns(column(1), column(2), column(3));
/// let subject = Subject::Particles(&particles);
/// let options = StatsOptions { measures: vec![Measure::Density], cells: Some(16), ..StatsOptions::default() };
/// let same = compare(subject, subject, &options, &Context::default())?;
/// assert!((same.density.unwrap().agreement.correlation - 1.0).abs() < 1e-9);
/// # Ok::<(), particlegs::Error>(())
/// ```
pub mod stats {
    pub use particlegs_core::codec::SeriesFile;
    pub use particlegs_figure::FileKind;
    pub use particlegs_files::output::Outputs;
    pub use particlegs_measure::stats::{
        Assignment, Convention, DensityComparison, DensityReport, FieldMean, FrameStatistics, Grid, GroupReport,
        HaloDispersions, HaloProfiles, JointHistogram, Measure, MultipoleShell, Multipoles, NearestDistances,
        PairCounts, SeriesStatistics, Spectra, Statistics, StatsOptions, StatsReport, StatsSide, Subject, WaveShell,
        compare,
    };
    pub use particlegs_particles::{Domain, LayerFields};
}

/// Haloes of particles or of a model: catalogues, mass functions, and the agreement of two catalogues.
///
/// ```
/// use particlegs::haloes::{HaloOptions, find_haloes};
/// use particlegs::stats::Subject;
/// use particlegs::{Context, Particles, Snapshot};
///
/// # let folder = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/nbody64");
/// let context = Context::default();
/// let particles = Snapshot::open(folder)?.particles(&context)?;
/// let catalogue = find_haloes(Subject::Particles(&particles), &HaloOptions::default(), &context)?;
/// let largest = catalogue.column("n200m").and_then(|numbers| numbers.first());
/// assert!(catalogue.len() > 100 && largest > Some(&1000.0));
/// # Ok::<(), particlegs::Error>(())
/// ```
pub mod haloes {
    pub use crate::particle_files::HaloFiles;
    pub use particlegs_measure::haloes::{
        HaloCatalogue, HaloColumn, HaloMatch, HaloOptions, HaloReport, MassFunctionBin, find_haloes,
    };
}

/// Quality of a model against its snapshot.
///
/// ```
/// use particlegs::evaluation::EvaluationViews;
/// use particlegs::prelude::*;
///
/// let (context, size) = (Context::default(), Size { width: 64, height: 64 });
/// let snapshot = Snapshot::from_columns([0.5, 1.0, 2.5], [0.0, 0.5, 2.0], [1.0, 0.0, 1.5])?;
/// let model = compress(&snapshot, &CompressOptions::gaussians(1), &context)?;
/// let views = EvaluationViews::Orbits { frames: 1, size, seed: 42 };
/// let report = model.evaluate(&[], &snapshot, views, None, &context)?;
/// assert!(report.source_matches && report.evaluation.views.len() == 3);
/// # Ok::<(), particlegs::Error>(())
/// ```
pub mod evaluation {
    pub use crate::evaluate::{EvaluationReport, EvaluationViews};
    pub use particlegs_measure::score::Evaluation;
}

/// Facts that a model file states: its metadata, its recipe and its certificate.
///
/// ```
/// # let bytes = include_bytes!("../../particlegs-compress/tests/fixtures/format-1.0.pgs");
/// use particlegs::Model;
///
/// let model = Model::from_bytes(bytes.to_vec(), "format-1.0.pgs")?;
/// println!("{} particles by {:?}", model.metadata().count, model.metadata().recipe.target);
/// assert!(model.certificate().is_some());
/// # Ok::<(), particlegs::Error>(())
/// ```
pub mod metadata {
    pub use particlegs_core::model::{
        Certificate, CertificateLevel, Effort, Goal, GoalKind, LawKind, Layer, Mass, Metadata, Mixture, Recipe, Target,
        Unit, Units,
    };
    pub use particlegs_core::space::{Bounds, Cell};
}

/// Training a model on pictures of its particles, beyond the fit.
///
/// ```
/// use particlegs::CompressOptions;
/// use particlegs::metadata::LawKind;
/// use particlegs::training::{Config, Preset};
///
/// let training = Config::preset(Preset::Fast, LawKind::OpticalDepth);
/// assert!(training.iterations() > 0);
/// let options = CompressOptions { training: Some(training), ..CompressOptions::ratio(300.0) };
/// ```
pub mod training {
    pub use particlegs_train::{Config, Limits, Preset};
}

pub use export::{ExportOptions, ExportResult, plan_export};
pub use model::{CompressOptions, Model, compress, merge, merge_files};
pub use particle_files::{ParticleFile, plan_recovery};
pub use particlegs_compress::verify::{SeriesVerification, StatedFigure, Verification};
pub use particlegs_core::context::{Context, Level, ProgressEvent, ProgressSink};
pub use particlegs_core::parallel::with_threads;
pub use particlegs_core::picture::{Gray8, Plane, Size};
pub use particlegs_core::splat::ToneStyle;
pub use particlegs_core::{Error, Hint, NamedValue, Result};
pub use particlegs_export::{Cells, Density};
pub use particlegs_files::memory::available_bytes as available_memory;
pub use particlegs_files::output::Outputs;
pub use particlegs_fit::recover::{Method as RecoverMethod, Options as RecoverOptions};
pub use particlegs_formats::{Choice, Description, Species, SpeciesField, SpeciesMass, Weights};
pub use particlegs_measure::score::{Assessment, Evaluation, Grade, UseCase};
pub use particlegs_particles::{Particles, RawForm, Selection, Storage};
pub use pictures::SavePng;
pub use run::{ModelOutput, RunOptions, compress_into};
pub use series::{
    FrameDescription, FrameRange, FrameResult, Series, SeriesDescription, SeriesOptions, SeriesResult, make_series,
};
pub use snapshot::Snapshot;
pub use verification::FileVerification;
