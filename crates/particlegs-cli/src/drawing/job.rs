//! What a drawing is made of.

use super::ViewRenderer;
use super::finish::Finisher;
use crate::common::CommandContext;
use particlegs_pipeline::camera::ViewSet;

/// What is drawn, and how.
pub struct DrawingJob<'a> {
    /// What can be drawn.
    pub painter: &'a ViewRenderer<'a>,
    /// How it is finished.
    pub finish: &'a Finisher<'a>,
    /// The views.
    pub set: &'a ViewSet,
    /// The range that is asked for.
    pub range: Option<[f64; 2]>,
    /// Is it said what would show more than a dark picture?
    pub hints: bool,
    /// Where progress is told.
    pub context: &'a CommandContext,
}
