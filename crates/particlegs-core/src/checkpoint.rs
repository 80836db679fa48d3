//! Finished pieces of long work, kept so that interrupted work goes on where it stopped.

use crate::Result;

/// A store of finished pieces. The result of the work does not depend on which of them are there.
pub trait CheckpointStore {
    /// A piece that was kept before.
    fn get(&self, key: &str) -> Option<Vec<u8>>;
    /// Keeps a piece.
    fn keep(&mut self, key: &str, bytes: Vec<u8>) -> Result<()>;
    /// Keeps a piece, and sees to it that it outlives the process from now on.
    fn keep_now(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.keep(key, bytes)
    }
}

/// Keeps nothing.
pub struct NoCheckpoints;

impl CheckpointStore for NoCheckpoints {
    fn get(&self, _: &str) -> Option<Vec<u8>> {
        None
    }

    fn keep(&mut self, _: &str, _: Vec<u8>) -> Result<()> {
        Ok(())
    }
}

/// Pieces under a name of their own.
pub struct PrefixedCheckpoints<'a> {
    /// The store that holds them.
    pub pieces: &'a mut dyn CheckpointStore,
    /// The beginning of their keys.
    pub prefix: String,
}

impl CheckpointStore for PrefixedCheckpoints<'_> {
    fn get(&self, key: &str) -> Option<Vec<u8>> {
        self.pieces.get(&format!("{}/{key}", self.prefix))
    }

    fn keep(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.pieces.keep(&format!("{}/{key}", self.prefix), bytes)
    }

    fn keep_now(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.pieces.keep_now(&format!("{}/{key}", self.prefix), bytes)
    }
}
