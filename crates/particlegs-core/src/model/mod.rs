//! Floor 2: the mixture and what is known about it: plain data. Knows no file, no camera, no thread.

mod certificate;
mod columns;
mod conversion;
mod goal;
mod law;
mod layer;
mod metadata;
mod metric;
mod metrics;
mod mixture;
mod network;
mod recipe;
mod science;
mod species;
mod sphere;
mod target;
mod unit;
pub mod vizmapper;
mod weighting;

pub use certificate::{Certificate, CertificateLevel};
pub use columns::{Columns, MASS};
pub use conversion::{Conversion, UnitSystem};
pub use goal::{Goal, GoalKind, GoalResult};
pub use law::{AlphaBlend, Law, LawKind};
pub use layer::{Layer, Mass};
pub use metadata::{Cosmology, Epoch, Metadata, Quantity, QuantityKind, hex};
pub use metric::{Coding, Metric, MetricEntry, MetricGroup, MetricUnit, MetricValue, Tolerance, decimals};
pub(crate) use metric::{MetricField, MetricVisitor};
pub use metrics::{
    BANDS, CELL_SIZES, CellDensity, CrossValidation, DensityMetrics, GROUP_CLASSES, GroupClass, LayerRatio,
    LayerRatios, LookSummary, MassPower, OrbitMetrics, PICTURE_OPACITIES, PICTURE_RADII, PICTURE_SETTINGS,
    POWER_LAYERS, PictureScore, PictureScores, PictureSetting, Pictures, PowerAgreement, SAMPLED_ABOVE, Sample,
    Spacing, Subset, Transfer, ViewMetrics,
};
pub use mixture::{Block, Mixture, Model};
pub use network::{VIZMAPPER_PARAMETERS, VIZMAPPER_SHAPE, VizMapper, VizRanges};
pub use recipe::{Effort, Recipe, RecipeStep, TrainingRecipe};
pub use science::{Limit, ScienceMetrics, ScienceSubject, per_length};
pub use species::{is_species, species_aliases, species_title};
pub use sphere::{GaussianInSphere, Rules};
pub use target::{DEFAULT_RATIO, Target};
pub use unit::{Dimension, Si, Unit, Units};
pub use weighting::WeightKind;
