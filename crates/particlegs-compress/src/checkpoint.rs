//! A file of finished pieces, from which an interrupted job goes on.
//!
//! Little-endian: magic, the 32 bytes that say whose it is; pieces (u32 length of the key, key, u64
//! length, bytes); CRC-32 of all that.

use particlegs_core::checkpoint::CheckpointStore;
use particlegs_core::{Error, Result};
use particlegs_files::input::{Begins, Form, read_own};
use particlegs_files::output;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

const MAGIC: &[u8; 8] = b"PGSCKPT2";
/// As large as memory allows: the file, and its pieces taken apart.
const FORM: Form = Form { title: "a checkpoint", begins: Begins::With(MAGIC), most: u64::MAX, expansion: 2 };
/// A process that is killed outright loses at most about this much of a fit. Training says itself when
/// its state is to be written.
const INTERVAL: Duration = Duration::from_secs(60);

/// State of a file that was opened as a checkpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum CheckpointState {
    Nothing,
    /// A file that is half-written, changed, or no checkpoint.
    Broken,
    Other,
    Ours,
}

/// Pieces kept in memory, and in a file from time to time.
pub struct Checkpoint {
    path: PathBuf,
    head: Vec<u8>,
    pieces: BTreeMap<String, Vec<u8>>,
    saved: Instant,
    /// Pieces that the file does not hold.
    unsaved: usize,
    found: CheckpointState,
}

impl Checkpoint {
    /// A checkpoint as an output, of this version or another.
    pub const KIND: output::Kind =
        output::Kind { name: "a checkpoint", kept: false, is: |_, head| head.starts_with(&MAGIC[..7]) };

    /// The pieces of the work that `whose` names; none if the file is missing, broken or of
    /// other work: it only saves time.
    pub fn open(path: PathBuf, whose: &[u8; 32]) -> Result<Checkpoint> {
        let mut all = Checkpoint::fresh(path, whose);
        (all.found, all.pieces) = match read_own(&all.path, FORM) {
            Ok(Some(bytes)) => match pieces_of(&bytes, &all.head) {
                Some(pieces) => (CheckpointState::Ours, pieces),
                None if is_whole(&bytes) => (CheckpointState::Other, BTreeMap::new()),
                None => (CheckpointState::Broken, BTreeMap::new()),
            },
            Ok(None) => return Ok(all),
            // An empty file, or one with other first bytes, is as useless as a changed one.
            Err(Error::Input { .. }) => (CheckpointState::Broken, BTreeMap::new()),
            Err(e) => return Err(e),
        };
        Ok(all)
    }

    /// The reason why the file that was opened is of no use; `None` if it is of use, or there was none.
    pub fn fault(&self) -> Option<&'static str> {
        match self.found {
            CheckpointState::Ours | CheckpointState::Nothing => None,
            CheckpointState::Broken => Some("the checkpoint is truncated or has been changed"),
            CheckpointState::Other => Some("the checkpoint belongs to another command, snapshot or configuration"),
        }
    }

    /// A checkpoint of new work: the file is not looked at.
    pub fn fresh(path: PathBuf, whose: &[u8; 32]) -> Checkpoint {
        let head = [&MAGIC[..], whose].concat();
        Checkpoint {
            path,
            head,
            pieces: BTreeMap::new(),
            saved: Instant::now(),
            unsaved: 0,
            found: CheckpointState::Nothing,
        }
    }

    /// The file.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Number of pieces.
    pub fn len(&self) -> usize {
        self.pieces.len()
    }

    /// Whether it has no pieces.
    pub fn is_empty(&self) -> bool {
        self.pieces.is_empty()
    }

    /// Writes the pieces that the file does not hold yet.
    pub fn save(&mut self) -> Result<()> {
        if self.unsaved == 0 {
            return Ok(());
        }
        let mut bytes = self.head.clone();
        for (key, piece) in &self.pieces {
            bytes.extend((key.len() as u32).to_le_bytes());
            bytes.extend(key.as_bytes());
            bytes.extend((piece.len() as u64).to_le_bytes());
            bytes.extend(piece);
        }
        bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
        output::write_bytes(&self.path, &bytes)?;
        (self.saved, self.unsaved) = (Instant::now(), 0);
        Ok(())
    }

    /// Removes the file: the work is done.
    pub fn remove(self) -> Result<()> {
        match std::fs::remove_file(&self.path) {
            Err(e) if e.kind() != std::io::ErrorKind::NotFound => Err(Error::io(&self.path, e)),
            _ => Ok(()),
        }
    }
}

impl CheckpointStore for Checkpoint {
    fn get(&self, key: &str) -> Option<Vec<u8>> {
        self.pieces.get(key).cloned()
    }

    fn keep(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.pieces.insert(key.into(), bytes);
        self.unsaved += 1;
        if self.saved.elapsed() >= INTERVAL { self.save() } else { Ok(()) }
    }

    fn keep_now(&mut self, key: &str, bytes: Vec<u8>) -> Result<()> {
        self.pieces.insert(key.into(), bytes);
        self.unsaved += 1;
        self.save()
    }
}

fn is_whole(bytes: &[u8]) -> bool {
    let body = bytes.split_at_checked(bytes.len().saturating_sub(4));
    body.is_some_and(|(body, crc)| body.starts_with(MAGIC) && crc32fast::hash(body).to_le_bytes() == crc)
}

/// The pieces of a file; `None` where it is broken or has another head.
fn pieces_of(bytes: &[u8], head: &[u8]) -> Option<BTreeMap<String, Vec<u8>>> {
    let (body, crc) = bytes.split_at_checked(bytes.len().checked_sub(4)?)?;
    let mut rest = body.strip_prefix(head)?;
    if crc32fast::hash(body).to_le_bytes() != crc {
        return None;
    }
    let mut pieces = BTreeMap::new();
    while !rest.is_empty() {
        let key = take(&mut rest, 4).and_then(|n| take(&mut rest, u32::from_le_bytes(n.try_into().ok()?) as usize))?;
        let length = u64::from_le_bytes(take(&mut rest, 8)?.try_into().ok()?);
        let piece = take(&mut rest, usize::try_from(length).ok()?)?;
        pieces.insert(String::from_utf8(key.to_vec()).ok()?, piece.to_vec());
    }
    Some(pieces)
}

fn take<'a>(rest: &mut &'a [u8], n: usize) -> Option<&'a [u8]> {
    let (bytes, after) = rest.split_at_checked(n)?;
    *rest = after;
    Some(bytes)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pieces_come_back_and_broken_files_are_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        let head = b"head".to_vec();
        let fresh = |pieces| Checkpoint { pieces, head: head.clone(), ..Checkpoint::fresh(path.clone(), &[0; 32]) };
        let mut c = fresh(BTreeMap::new());
        c.save().unwrap();
        assert!(!path.exists(), "nothing to save");
        c.keep("a/1", vec![1, 2, 3]).unwrap();
        c.keep("b", vec![]).unwrap();
        c.save().unwrap();
        let bytes = std::fs::read(&path).unwrap();
        assert_eq!(pieces_of(&bytes, b"head").unwrap(), c.pieces);
        assert!(pieces_of(&bytes, b"other").is_none());
        for cut in 0..bytes.len() {
            assert!(pieces_of(&bytes[..cut], b"head").is_none(), "{cut}");
        }
        c.remove().unwrap();
        assert!(!path.exists());
        fresh(BTreeMap::new()).remove().unwrap();
    }

    #[test]
    fn a_checkpoint_says_what_it_found_in_its_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.checkpoint");
        let state_of = |whose: u8| Checkpoint::open(path.clone(), &[whose; 32]).unwrap().found;
        assert_eq!(state_of(1), CheckpointState::Nothing);
        let mut c = Checkpoint::fresh(path.clone(), &[1; 32]);
        c.keep("fit", vec![7]).unwrap();
        assert_eq!(state_of(1), CheckpointState::Nothing, "pieces of fits wait");
        c.keep_now("train", vec![1, 2, 3]).unwrap();
        assert_eq!((state_of(1), state_of(2)), (CheckpointState::Ours, CheckpointState::Other));
        let bytes = std::fs::read(&path).unwrap();
        for broken in [&bytes[..bytes.len() - 1], &bytes[1..], b"", b"abc"] {
            std::fs::write(&path, broken).unwrap();
            assert_eq!(state_of(1), CheckpointState::Broken);
        }
    }
}
