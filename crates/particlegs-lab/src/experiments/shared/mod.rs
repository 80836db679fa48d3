//! Measurements that several experiments share.

pub(crate) mod published_models;
pub(crate) mod rates;
