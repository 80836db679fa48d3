//! Floor 2: the mixture and what is known about it: plain data. Knows no file, no camera, no thread.

mod certificate;
mod conversion;
mod field;
mod law;
mod layer;
mod metadata;
mod metric;
mod metrics;
mod mixture;
mod recipe;
mod science;
mod target;
mod unit;
mod weight_kind;

pub use crate::hash::hex;
pub use certificate::Certificate;
pub use conversion::{Conversion, UnitSystem};
pub use field::FieldMoments;
pub use law::{AlphaBlend, Law, LawKind, VIZMAPPER_PARAMETERS, VIZMAPPER_SHAPE, VizMapper, VizRanges};
pub use layer::{Layer, Mass, SharedSpecies, is_species, species_aliases, species_title};
pub use metadata::{Cosmology, Epoch, Metadata, Quantity, QuantityKind};
pub use metric::{
    CertificateLevel, Coding, Metric, MetricEntry, MetricGroup, MetricUnit, MetricValue, PictureScore, Tolerance,
    decimals,
};
pub(crate) use metric::{MetricField, MetricVisitor};
pub use metrics::{
    BANDS, CELL_SIZES, CERTIFIED_FIELDS, CellDensity, CrossValidation, DensityMetrics, DrawnDensity, FieldAgreement,
    FieldAgreements, GROUP_CLASSES, GroupClass, LayerRatio, LayerRatios, LookSummary, MassPower, OrbitMetrics,
    PICTURE_OPACITIES, PICTURE_RADII, PICTURE_SETTINGS, POWER_LAYERS, PictureScores, PictureSetting, Pictures,
    PowerAgreement, SAMPLED_ABOVE, Sample, Spacing, Subset, Transfer, ViewMetrics,
};
pub use mixture::{Block, Columns, MASS, Mixture, Model};
pub use recipe::{Effort, Recipe, RecipeStep, TrainingRecipe};
pub use science::{Limit, ScienceMetrics, ScienceSubject};
pub use target::{DEFAULT_RATIO, Goal, GoalKind, GoalResult, Target};
pub use unit::{Dimension, Si, Unit, Units, per_length};
pub use weight_kind::{WeightKind, check_densities, density_of};
