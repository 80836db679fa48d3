//! NumPy arrays: N x 3, 3 x N, records with x, y, z, tables whose first columns are positions.
//! Mapped, not read; f32 in either order is used where it lies. An [`Array`] in memory is read as such a file is.

pub mod header;
pub mod layout;
mod literal;

use crate::affine::Affine;
use crate::columns::{ColumnarField, ColumnarSnapshot, one_species};
use crate::numbers::{Bytes, StridedColumn, StridedParticles};
use crate::pieces::PieceReader;
use crate::single_file::{named, only};
use crate::stored_bytes::StoredBytes;
use crate::{Choice, Description, Format, Snapshot};
use header::{MAGIC, NpyElement, NpyHeader, scalar};
use particlegs_core::{Error, Result};
use particlegs_particles::{SnapshotMeta, SnapshotReader};
use std::path::PathBuf;
use std::sync::Arc;

pub const FORMAT: Format = Format {
    name: "npy",
    title: "NumPy array",
    detect: |head| head.compression.is_none() && head.bytes.starts_with(MAGIC),
    open,
};

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let place = path.display().to_string();
    let bytes = Bytes::from_filled_file(path)?;
    let header = NpyHeader::read(&bytes[..]).map_err(|message| Error::input(path, message))?;
    let length = bytes.len() as u64;
    if header.end() != Some(length) {
        let message = format!(
            "the header says {} of {}, but the data have {length} bytes",
            header.shape_text(),
            header.kind_text()
        );
        return Err(Error::input_with(path, message, "the file is cut short or damaged: save it again"));
    }
    layout::check_numbers(&place, &header)?;
    let mut notes = Vec::new();
    let (count, fields, positions) = particles(&place, &header, &mut notes)?;
    if count == 0 {
        return Err(Error::input(path, "it holds no particles"));
    }
    let species = one_species(count, &fields, positions, layout::mass_named);
    let description = Description {
        species: vec![species],
        notes,
        ..Description::new(
            format!("NumPy array {} of {}", header.shape_text(), header.kind_text()),
            std::slice::from_ref(path),
            named(path),
        )
    };
    Ok(Box::new(ColumnarSnapshot {
        description,
        place,
        stored: vec![StoredBytes::plain_file(bytes)],
        fields,
        world: Affine::IDENTITY,
    }))
}

/// The rows, the fields, and which of them hold positions.
fn particles(place: &str, header: &NpyHeader, notes: &mut Vec<String>) -> Result<(u64, Vec<ColumnarField>, String)> {
    let is_record = matches!(header.element, NpyElement::Record { .. });
    if let Some(rows) = layout::rows_of_positions(header) {
        let fields = layout::fields("positions", 0, header, rows);
        let described: Vec<_> = fields.iter().map(ColumnarField::described).collect();
        let positions = layout::positions_named(&described).unwrap_or_default();
        let vectors = described.iter().any(|f| f.components == 3) || described.len() >= 3;
        if !positions.is_empty() || (is_record && vectors) {
            return Ok((rows, fields, positions));
        }
        let names: Vec<&str> = described.iter().map(|f| &f.name[..]).collect();
        let message = format!("the records have {}, but no x, y and z", names.join(", "));
        return Err(Error::input(place, message));
    }
    if let Some(rows) = layout::rows_of_table(header) {
        let fields = layout::table(0, header, rows);
        notes.push(format!(
            "a table of {} columns: 0, 1 and 2 are read as x, y and z; for others give the positions as, say, 3,4,5",
            fields.len()
        ));
        return Ok((rows, fields, "0,1,2".into()));
    }
    let message = format!("an array of shape {} of {} cannot hold positions", header.shape_text(), header.kind_text());
    Err(Error::input_with(place, message, "save an array of shape (N, 3) or (3, N), or records with x, y and z"))
}

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
pub(crate) mod tests {
    use super::*;
    use crate::Weights;
    use crate::testing::{open_bytes, rows};
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

    pub(crate) fn npy(descr: &str, fortran: bool, shape: &str, data: &[u8]) -> Vec<u8> {
        let fortran = if fortran { "True" } else { "False" };
        let mut header = format!("{{'descr': {descr}, 'fortran_order': {fortran}, 'shape': {shape}, }}");
        while (10 + header.len() + 1) % 64 != 0 {
            header.push(' ');
        }
        header.push('\n');
        let mut out = b"\x93NUMPY\x01\x00".to_vec();
        out.extend((header.len() as u16).to_le_bytes());
        out.extend(header.as_bytes());
        out.extend(data);
        out
    }

    fn le<T: bytemuck::NoUninit>(values: &[T]) -> Vec<u8> {
        bytemuck::cast_slice(values).to_vec()
    }

    const TWO: [[f64; 4]; 2] = [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]];

    #[test]
    fn every_layout() {
        let one_each = [1f32, 2., 3., 4., 5., 6.];
        let columns = [1f32, 4., 2., 5., 3., 6.];
        let big: Vec<u8> = [1f64, 4., 2., 5., 3., 6.].iter().flat_map(|v| v.to_be_bytes()).collect();
        let cases = [
            (npy("'<f4'", false, "(2, 3)", &le(&one_each)), true),
            (npy("'<f4'", true, "(2, 3)", &le(&columns)), true),
            (npy("'<f4'", false, "(3, 2)", &le(&columns)), true),
            (npy("'<f4'", true, "(3, 2)", &le(&one_each)), true),
            (npy("'<f4'", false, "(1, 2, 3)", &le(&one_each)), true),
            (npy("'>f8'", true, "(2, 3)", &big), false),
            (npy("'<i2'", false, "(2, 3)", &le(&[1i16, 2, 3, 4, 5, 6])), false),
            (npy("'<f2'", false, "(2, 3)", &le(&[0x3c00u16, 0x4000, 0x4200, 0x4400, 0x4500, 0x4600])), false),
        ];
        for (bytes, in_place) in cases {
            let snapshot = open_bytes("a.bin", &bytes).unwrap();
            assert_eq!(rows(&*snapshot, 0, &Choice::default()).unwrap(), TWO);
            assert_eq!(snapshot.reader(0, &Choice::default()).unwrap().in_place().is_some(), in_place);
        }
    }

    #[test]
    fn records_and_tables() {
        let data = le(&[1f32, 2., 3., 0.5, 4., 5., 6., 0.25]);
        let xyz = npy("[('x', '<f4'), ('y', '<f4'), ('z', '<f4'), ('Mass', '<f4')]", false, "(2,)", &data);
        let pos = npy("[('pos', '<f4', (3,)), ('mass', '<f4')]", false, "(2,)", &data);
        let weighted = vec![[1.0, 2.0, 3.0, 0.5], [4.0, 5.0, 6.0, 0.25]];
        for bytes in [xyz, pos] {
            let snapshot = open_bytes("a.npy", &bytes).unwrap();
            assert_eq!(rows(&*snapshot, 0, &Choice::default()).unwrap(), weighted);
            let none = Choice { weights: Weights::None, ..Choice::default() };
            assert_eq!(rows(&*snapshot, 0, &none).unwrap(), TWO);
        }
        let many: Vec<f32> = (0..70 * 4).map(|v| v as f32).collect();
        let snapshot = open_bytes("a.npy", &npy("'<f4'", false, "(70, 4)", &le(&many))).unwrap();
        assert_eq!(rows(&*snapshot, 0, &Choice::default()).unwrap()[1], [4.0, 5.0, 6.0, 0.0]);
        let chosen =
            Choice { positions: Some("1,2,3".into()), weights: Weights::Field("0".into()), ..Choice::default() };
        assert_eq!(rows(&*snapshot, 0, &chosen).unwrap()[1], [5.0, 6.0, 7.0, 4.0]);
        assert!(snapshot.description().notes[0].contains("4 columns"));
    }

    #[test]
    fn doubles_far_away_keep_their_precision() {
        let at = [1e12 + 0.25, 0.0, 0.0, 1e12 + 0.5, 1.0, 1.0];
        let snapshot = open_bytes("a.npy", &npy("'<f8'", false, "(2, 3)", &le(&at))).unwrap();
        let columns = rows(&*snapshot, 0, &Choice::default()).unwrap();
        assert_eq!(columns[1][0] - columns[0][0], 0.25);
    }

    #[test]
    fn what_holds_no_positions_is_refused_in_words() {
        let zeros = [0u8; 96];
        let cases = [
            (npy("'<c8'", false, "(4, 3)", &zeros), "complex64"),
            (npy("'|O'", false, "(4, 3)", &zeros), "pickle"),
            (npy("'<f4'", false, "(24,)", &zeros), "shape"),
            (npy("'<f4'", false, "(2, 3, 4)", &zeros), "shape"),
            (npy("'<f4'", false, "(0, 3)", &[]), "no particles"),
            (npy("'<f4'", false, "(9, 3)", &zeros), "but the data have"),
            (npy("'<f4'", false, "(7, 3)", &zeros), "but the data have"),
            (npy("[('a', '<f4'), ('b', '<f4')]", false, "(12,)", &zeros), "no x, y and z"),
        ];
        for (bytes, words) in cases {
            let error = open_bytes("a.npy", &bytes).err().unwrap().to_string();
            assert!(error.contains(words), "{error}");
        }
    }
}
