//! The state of a training run as named columns: what checkpoints hold.

use std::collections::BTreeMap;

/// Named columns of numbers, kept bit by bit.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct State {
    /// Single precision: parameters and moments.
    pub columns: BTreeMap<String, Vec<f32>>,
    /// Double precision: sums, counts, and whole numbers up to 2^53.
    pub numbers: BTreeMap<String, Vec<f64>>,
}

impl State {
    /// A column of `len` numbers.
    ///
    /// # Errors
    /// A text, where it is missing or of another length.
    pub fn column(&self, name: &str, len: usize) -> Result<&[f32], String> {
        self.columns
            .get(name)
            .filter(|c| c.len() == len)
            .map(|c| &c[..])
            .ok_or_else(|| format!("no column `{name}` of {len} numbers"))
    }

    /// A column of `len` numbers of double precision.
    ///
    /// # Errors
    /// As [`State::column`].
    pub fn doubles(&self, name: &str, len: usize) -> Result<&[f64], String> {
        self.numbers
            .get(name)
            .filter(|c| c.len() == len)
            .map(|c| &c[..])
            .ok_or_else(|| format!("no column `{name}` of {len} numbers"))
    }
}
