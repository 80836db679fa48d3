//! Settings by which every block of a job is made, whichever block it is.

use super::plan::CompressionPlan;
use particlegs_core::context::Context;
use particlegs_train::Limits;

/// Settings by which the blocks of a job are made.
#[derive(Clone, Copy)]
pub(crate) struct BlockSetup<'a> {
    pub plan: &'a CompressionPlan,
    pub limits: &'a Limits,
    pub on_stop: StopPolicy,
    pub context: &'a Context<'a>,
}

/// The fate of a training run that the caller stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopPolicy {
    /// The best so far is coded.
    KeepBest,
    /// The work is given up, to be taken up again from its pieces.
    GiveUp,
}
