//! Everything that a drawing needs.

use super::ViewRenderer;
use super::finish::Finisher;
use crate::common::CommandContext;
use particlegs_core::camera::ViewSet;

pub struct DrawingJob<'a> {
    pub painter: &'a ViewRenderer<'a>,
    pub finish: &'a Finisher<'a>,
    pub set: &'a ViewSet,
    /// The requested range.
    pub range: Option<[f64; 2]>,
    /// Print a hint for dark pictures?
    pub hints: bool,
    pub context: &'a CommandContext,
}
