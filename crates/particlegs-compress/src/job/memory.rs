//! Memory that the tasks of a job take, for engines that want to know before they start them.

use super::manifest::JobFolder;
use crate::{FieldPlan, MemoryLoad};
use particlegs_core::model::CertificateLevel;
use particlegs_particles::RUN;

/// Copies of a block's particles that a task holds: as gathered, and the fit's.
pub(super) const COPIES: u64 = 2;
/// Bytes of a particle in a chunk while it is bucketed: as read, sorted, and its order.
const BUCKETED: u64 = 40;

/// Fields of 256 x 256 x 256 cells, two and as f64, while the blocks' sums are added up.
const ADDED_UP: u64 = 500 << 20;

/// Bytes that a run takes while it is bucketed, with its fields.
pub(super) fn bucketed_run(fields: &FieldPlan) -> u64 {
    let widest = (0..fields.layers.len()).map(|l| fields.particle_bytes(l)).max().unwrap_or(0);
    (BUCKETED + widest) * RUN as u64
}

impl JobFolder {
    fn load(&self) -> MemoryLoad {
        let plan = &self.manifest.plan;
        MemoryLoad {
            count: plan.metadata.count,
            raw_bytes: plan.raw_bytes(),
            target: plan.recipe().target,
            effort: plan.recipe().effort,
            copies: COPIES,
            measuring: plan.certificate == CertificateLevel::Blocks,
            fields: self.manifest.fields.bytes(plan.layers.iter().map(|l| l.content)),
        }
    }

    /// Bytes of memory that a block or a chunk takes, whichever is larger: an estimate from above.
    pub fn task_bytes(&self) -> u64 {
        let m = &self.manifest;
        let chunk = if m.chunks > 0 { m.chunk_runs.saturating_mul(bucketed_run(&m.fields)) } else { 0 };
        self.load().task_bytes(u64::from(m.plan.recipe().blocks)).max(chunk)
    }

    /// Bytes of memory that the merge takes; where the model is measured, with all particles in memory.
    pub fn merge_bytes(&self) -> u64 {
        let plan = &self.manifest.plan;
        if plan.certificate == CertificateLevel::Blocks {
            return self.load().merge_bytes(false).saturating_add(ADDED_UP);
        }
        let measured = plan.certificate.measures();
        let particles = if measured { plan.column_bytes() } else { 0 };
        self.load().merge_bytes(measured).saturating_add(particles)
    }
}
