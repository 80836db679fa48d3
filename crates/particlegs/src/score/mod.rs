//! Floor 5: how good a model is: pictures over views, and the certificate.

mod compare;
mod mean;

pub use compare::{Compared, Comparison, MeanScores, compare_folders};
use mean::mean;
