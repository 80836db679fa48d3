//! Arrays in memory, read as files are.

use crate::npy::header::scalar;
use crate::numbers::{Bytes, StridedColumn, StridedParticles};
use crate::pieces::PieceReader;
use particlegs_core::{Error, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader};
use std::sync::Arc;

/// Positions in memory, at equal distances: rows of an array of NumPy's, of any type, byte order and strides.
pub struct Array {
    /// The bytes from the first value to the last.
    pub bytes: Arc<dyn AsRef<[u8]> + Send + Sync>,
    /// Particles.
    pub rows: u64,
    /// Type of the values, in NumPy's words: `<f8`, `>i4`, `|u1`.
    pub dtype: String,
    /// Bytes before the first x, y and z.
    pub first: [u64; 3],
    /// Bytes from one row to the next.
    pub stride: u64,
}

impl Array {
    /// A reader that gives the same values as a .npy file with these bytes. Values with more digits than f32 are taken
    /// about an origin near the data where the data lie far from 0.
    pub fn reader(self, meta: SnapshotMeta) -> Result<Arc<dyn SnapshotReader>> {
        let Array { bytes, rows, dtype, first, stride } = self;
        let no_numbers = || Error::input(&meta.name, format!("values of type `{dtype}` are not numbers"));
        let scalar = scalar(&dtype).map_err(|_| no_numbers())?;
        let (kind, big_endian) = (scalar.kind.ok_or_else(no_numbers)?, scalar.big_endian);
        let axes = first.map(|offset| StridedColumn { offset, stride, kind, big_endian });
        let piece = StridedParticles::new(&meta.name, Bytes::Lent(bytes), rows, &axes)?;
        Ok(Arc::new(PieceReader::new(meta, vec![Box::new(piece)], false)?))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_particles::{LayeredParticles, Storage};

    #[test]
    fn strides_and_byte_orders_are_followed() {
        // Two rows of x, y, z and a value between, backwards; big-endian.
        let values = [7.0f64, 5.0, 3.0, -1.0, 8.0, 6.0, 4.0, -1.0];
        let array = |dtype: &str, bytes: Vec<u8>| Array {
            bytes: Arc::new(bytes),
            rows: 2,
            dtype: dtype.into(),
            first: [16, 8, 0],
            stride: 32,
        };
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_be_bytes()).collect();
        let reader = array(">f8", bytes.clone()).reader(SnapshotMeta::default()).unwrap();
        let particles = LayeredParticles::new(vec![("a".into(), reader)])
            .unwrap()
            .load(&Storage::Memory, &Context::SILENT)
            .unwrap();
        assert_eq!([0, 1].map(|i| particles.position(i)), [[3.0, 5.0, 7.0], [4.0, 6.0, 8.0]]);
        for bad in ["|O", "", "<c16", ">f3", "f"] {
            assert!(array(bad, bytes.clone()).reader(SnapshotMeta::default()).is_err(), "{bad}");
        }
        let short = Array { rows: 3, ..array(">f8", bytes) };
        assert!(short.reader(SnapshotMeta::default()).is_err());
    }
}
