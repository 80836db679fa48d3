//! Decoded chunks kept while neighbouring rows are read, so that each is decoded about once.

use particlegs_core::Result;
use std::collections::VecDeque;
use std::sync::{Arc, Mutex};

/// Bytes of decoded chunks kept by default.
pub const DEFAULT_BYTES: usize = 48 << 20;

type Slot = Arc<Mutex<Option<Arc<Vec<u8>>>>>;

/// Decoded chunks by number; the longest unused ones go first.
pub struct ChunkCache {
    limit: usize,
    /// Most recently used last.
    slots: Mutex<VecDeque<(u64, Slot)>>,
}

impl ChunkCache {
    /// Keeps chunks of about `limit` bytes in all; the one in use is always kept.
    pub fn new(limit: usize) -> Self {
        ChunkCache { limit, slots: Mutex::new(VecDeque::new()) }
    }

    /// Chunk `key`, decoded by `decode` where it is not at hand. Two threads that want the same
    /// chunk decode it once; `decode` itself must do no parallel work, which would run other work on a
    /// thread that others wait for.
    pub fn get(&self, key: u64, decode: impl FnOnce() -> Result<Vec<u8>>) -> Result<Arc<Vec<u8>>> {
        let slot = self.slot(key);
        let mut held = slot.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(bytes) = &*held {
            return Ok(bytes.clone());
        }
        let bytes = Arc::new(decode()?);
        *held = Some(bytes.clone());
        // `shrink` counts a locked slot as empty: this one must be free to be counted.
        drop(held);
        self.shrink();
        Ok(bytes)
    }

    fn slot(&self, key: u64) -> Slot {
        let mut slots = self.slots.lock().unwrap_or_else(|e| e.into_inner());
        let entry = match slots.iter().position(|s| s.0 == key).and_then(|i| slots.remove(i)) {
            Some(entry) => entry,
            None => (key, Slot::default()),
        };
        slots.push_back(entry.clone());
        entry.1
    }

    /// Drops the longest unused chunks until the rest fits. Slots being filled count as empty.
    fn shrink(&self) {
        let mut slots = self.slots.lock().unwrap_or_else(|e| e.into_inner());
        let size = |s: &Slot| s.try_lock().ok().and_then(|b| b.as_ref().map(|b| b.len())).unwrap_or(0);
        let mut total: usize = slots.iter().map(|s| size(&s.1)).sum();
        while total > self.limit && slots.len() > 1 {
            if let Some((_, slot)) = slots.pop_front() {
                total -= size(&slot);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn decodes_once_and_forgets_the_oldest() {
        let cache = ChunkCache::new(10);
        let mut decoded = 0;
        for key in [1, 1, 2, 1, 3, 1, 2] {
            let bytes = cache.get(key, || {
                decoded += 1;
                Ok(vec![key as u8; 4])
            });
            assert_eq!(*bytes.unwrap(), vec![key as u8; 4]);
        }
        // 2 went when 3 came, since 1 had been used again.
        assert_eq!(decoded, 4);
        assert!(cache.get(9, || Err(particlegs_core::Error::argument("no"))).is_err());
        assert_eq!(*cache.get(9, || Ok(vec![9])).unwrap(), vec![9]);
    }
}
