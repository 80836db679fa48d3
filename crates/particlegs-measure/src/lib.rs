//! What particles and mixtures of Gaussians measure: statistics ([`stats`]), catalogues of haloes ([`haloes`]), and how
//! well a model stands for its particles ([`score`]).

pub mod haloes;
pub mod score;
pub mod stats;

#[cfg(test)]
mod law_tests;
