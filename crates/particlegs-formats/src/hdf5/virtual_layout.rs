//! The layout of virtual data sets, which the library does not know: what it reads has each such layout rewritten as one
//! chunk without axes, which no other data set has; its address says where the list of sources lies.

use hdf5_reader::checksum::jenkins_lookup3;
use hdf5_reader::error::Result as Hdf5Result;
use hdf5_reader::messages::layout::DataLayout;
use hdf5_reader::{Storage, StorageBuffer};
use particlegs_files::input::MappedFile;
use std::sync::Arc;

/// A mapped file, with layouts of virtual data sets as the library can read them.
pub struct VirtualLayouts(pub Arc<MappedFile>);

impl Storage for VirtualLayouts {
    fn len(&self) -> u64 {
        self.0.len() as u64
    }

    fn read_range(&self, offset: u64, len: usize) -> Hdf5Result<StorageBuffer> {
        let start = usize::try_from(offset).unwrap_or(usize::MAX);
        let stored = StorageBuffer::from_shared_owner(self.0.clone(), start, len)?;
        Ok(rewritten(&stored).map_or(stored, StorageBuffer::from_vec))
    }
}

/// Part of an object's header with its layout rewritten; `None` where it has no layout of a virtual data set.
fn rewritten(bytes: &[u8]) -> Option<Vec<u8>> {
    let summed = bytes.starts_with(b"OHDR") || bytes.starts_with(b"OCHK");
    let at = (8..bytes.len().saturating_sub(13)).find(|&at| {
        let before = &bytes[at - 8..at];
        let layout = if summed {
            before[4..7] == [8, 14, 0] || before[2..5] == [8, 14, 0]
        } else {
            before[..4] == [8, 0, 16, 0] && before[5..] == [0; 3]
        };
        layout && matches!(bytes[at..at + 2], [4 | 5, 3])
    })?;
    let index = u32::from_le_bytes(bytes[at + 10..at + 14].try_into().ok()?);
    let address = u64::from_le_bytes(bytes[at + 2..at + 10].try_into().ok()?);
    let index = u16::try_from(index).ok().filter(|_| address < 1 << 48)?;
    let mut out = bytes.to_vec();
    out[at..at + 6].copy_from_slice(&[4, 2, 0, 0, 1, 1]);
    out[at + 6..at + 14].copy_from_slice(&(address << 16 | u64::from(index)).to_le_bytes());
    if summed {
        let end = bytes.len() - 4;
        if at + 14 > end || bytes[end..] != jenkins_lookup3(&bytes[..end]).to_le_bytes() {
            return None;
        }
        let sum = jenkins_lookup3(&out[..end]).to_le_bytes();
        out[end..].copy_from_slice(&sum);
    }
    Some(out)
}

/// Whether it is a virtual data set's layout as rewritten here.
pub fn is_virtual(layout: &DataLayout) -> bool {
    matches!(layout, DataLayout::Chunked { dims, .. } if dims.is_empty())
}
