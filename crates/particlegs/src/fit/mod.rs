//! Floor 3: particles to mixture, without gradients.
