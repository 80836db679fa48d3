//! Floor 2: the mixture and what is known about it: plain data. Knows no file, no camera, no thread.

mod certificate;
mod columns;
mod goal;
mod law;
mod layer;
mod measures;
mod metadata;
mod mixture;
mod network;
mod recipe;
mod science;
mod sphere;
mod target;
pub mod vizmapper;

pub use certificate::{
    Baselines, Certificate, CertificateLevel, LookBaselines, LookScore, OrbitBaselines, OrbitScore, PictureScore,
};
pub use columns::{Columns, MASS};
pub use goal::{Goal, GoalKind, Reached};
pub use law::{AlphaBlend, Law, LawKind};
pub use layer::{Layer, Mass};
pub use measures::{
    BANDS, CELL_SIZES, CellDensity, GROUP_CLASSES, GroupClass, HeldOut, LookPictures, MassPower, Measures,
    PICTURE_OPACITIES, PICTURE_RADII, PICTURE_SETTINGS, POWER_LAYERS, PictureScores, Pictures, PicturesAt,
    PowerAgreement, SAMPLED_ABOVE, Sample, Spacing, Subset, Transfer,
};
pub use metadata::{Metadata, hex};
pub use mixture::{Block, Mixture, Model};
pub use network::{VIZMAPPER_PARAMETERS, VIZMAPPER_SHAPE, VizMapper, VizRanges};
pub use recipe::{Effort, Recipe, RecipeStep, TrainingRecipe};
pub use science::{Limit, Science, ScienceOf, per_length};
pub use sphere::{Lump, Rules};
pub use target::{DEFAULT_RATIO, Target};
