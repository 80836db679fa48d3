//! Storage of large columns: memory, or files of a scratch folder that vanish by themselves.

use super::{Column, Particles, SnapshotMeta};
use memmap2::MmapMut;
use particlegs_core::context::Context;
use particlegs_core::model::Layer;
use particlegs_core::{Error, Result};
use particlegs_files::input::MappedFile;
use particlegs_files::memory::require;
use particlegs_files::output;
use std::ops::{Deref, DerefMut, Range};
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// The storage of large columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Storage {
    /// Memory of the process.
    #[default]
    Memory,
    /// Files without a name in this folder, mapped: the system writes them out as it needs memory,
    /// and they are gone when the process is, however it ends.
    Disk(PathBuf),
}

/// A column that is being filled, zeros at first.
pub enum ColumnBuffer {
    /// In memory.
    Memory(Vec<f32>),
    /// In a mapped scratch file.
    Disk(MmapMut),
}

impl Storage {
    /// Says what scratch space is about to be taken, if any.
    pub fn announce(&self, content: &str, bytes: u64, context: &Context<'_>) {
        if let Storage::Disk(folder) = self {
            context.message(&format!("the scratch file for {content} takes {bytes} bytes in {}", folder.display()));
        }
    }

    /// `count` columns of `len` zeros; `content` names them where they do not fit.
    pub fn columns(&self, content: &str, count: usize, len: usize) -> Result<Vec<ColumnBuffer>> {
        let bytes = len as u64 * 4;
        match self {
            Storage::Memory => {
                require(content, bytes.saturating_mul(count as u64))?;
                Ok((0..count).map(|_| ColumnBuffer::Memory(vec![0.0; len])).collect())
            }
            // A file of no bytes cannot be mapped.
            Storage::Disk(_) if len == 0 => Ok((0..count).map(|_| ColumnBuffer::Memory(Vec::new())).collect()),
            Storage::Disk(folder) => {
                let fail = |e| Error::io(folder, e);
                output::check_space(folder, bytes.saturating_mul(count as u64)).map_err(fail)?;
                (0..count).map(|_| map_scratch(folder, bytes).map(ColumnBuffer::Disk).map_err(fail)).collect()
            }
        }
    }
}

/// A new file of zeros without a name, mapped.
fn map_scratch(folder: &Path, bytes: u64) -> std::io::Result<MmapMut> {
    let file = output::scratch_file(folder, bytes)?;
    // SAFETY: nobody else can open a file without a name, and its blocks are reserved, so that no
    // write into the mapping finds the disk full.
    unsafe { MmapMut::map_mut(&file) }
}

impl ColumnBuffer {
    /// The column, filled.
    pub fn finish(self) -> Result<Column> {
        Ok(match self {
            ColumnBuffer::Memory(values) => Column::owned(values),
            ColumnBuffer::Disk(map) => {
                let len = map.len() / 4;
                let map = map.make_read_only().map_err(|e| Error::io("scratch file", e))?;
                Column::mapped(Arc::new(MappedFile::scratch(map)), 0, len)
            }
        })
    }
}

impl Particles {
    /// Particles of filled columns x, y, z and perhaps weights.
    pub fn from_buffers(
        columns: Vec<ColumnBuffer>,
        origin: [f64; 3],
        meta: SnapshotMeta,
        layers: Vec<Layer<Range<usize>>>,
    ) -> Result<Self> {
        let columns = columns.into_iter().map(ColumnBuffer::finish).collect::<Result<Vec<_>>>()?;
        Ok(Particles::from_column_list(columns, origin, meta, layers))
    }
}

impl Deref for ColumnBuffer {
    type Target = [f32];

    fn deref(&self) -> &[f32] {
        match self {
            ColumnBuffer::Memory(values) => values,
            ColumnBuffer::Disk(map) => bytemuck::cast_slice(map),
        }
    }
}

impl DerefMut for ColumnBuffer {
    fn deref_mut(&mut self) -> &mut [f32] {
        match self {
            ColumnBuffer::Memory(values) => values,
            ColumnBuffer::Disk(map) => bytemuck::cast_slice_mut(map),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_hold_what_is_written_and_leave_nothing() {
        let folder = tempfile::tempdir().unwrap();
        for storage in [Storage::Memory, Storage::Disk(folder.path().to_path_buf())] {
            let mut columns = storage.columns("a test", 2, 3).unwrap();
            assert_eq!(&columns[1][..], [0.0; 3]);
            columns[1][2] = 7.0;
            let last = columns.pop().unwrap().finish().unwrap();
            assert_eq!(&last[..], [0.0, 0.0, 7.0]);
            assert!(storage.columns("nothing", 1, 0).unwrap()[0].is_empty());
        }
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
        let full = Storage::Disk(folder.path().to_path_buf()).columns("a test", 4, 1 << 50);
        assert!(matches!(full, Err(Error::Io { .. })));
    }
}
