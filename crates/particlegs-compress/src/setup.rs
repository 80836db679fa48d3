//! What every block of a job is made by, whichever block it is.

use super::plan::CompressionPlan;
use particlegs_core::context::Context;
use particlegs_train::Limits;

/// What the blocks of a job are made by.
#[derive(Clone, Copy)]
pub(crate) struct BlockSetup<'a> {
    pub plan: &'a CompressionPlan,
    pub limits: &'a Limits,
    pub on_stop: StopPolicy,
    pub context: &'a Context<'a>,
}

/// What becomes of a training run that the caller stops.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StopPolicy {
    /// The best so far is coded.
    KeepBest,
    /// The work is given up, to be taken up again from its pieces.
    GiveUp,
}
