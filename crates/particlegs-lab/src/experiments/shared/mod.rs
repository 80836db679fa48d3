//! What several experiments measure alike.

pub(crate) mod published_models;
pub(crate) mod rates;
