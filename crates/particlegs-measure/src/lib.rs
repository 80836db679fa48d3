//! Measurements of particles and of mixtures of Gaussians: statistics ([`stats`]), catalogues of haloes ([`haloes`]),
//! and scores of a model against its particles ([`score`]).

#![cfg_attr(test, allow(clippy::disallowed_methods))]

pub mod haloes;
pub mod score;
pub mod stats;

#[cfg(test)]
mod law_tests;
