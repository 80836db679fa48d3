//! Floor 3: pictures of all particles: ParaView's exactly, and the noise-free ones.
