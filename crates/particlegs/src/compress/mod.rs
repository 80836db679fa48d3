//! Floor 6: the whole job.
