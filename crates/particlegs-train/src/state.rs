//! The state of a training run as named columns: what checkpoints hold.

use std::collections::BTreeMap;

/// Named columns of numbers, kept bit by bit.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct TrainingState {
    /// Single precision: parameters and moments.
    pub columns: BTreeMap<String, Vec<f32>>,
    /// Double precision: sums, counts, and whole numbers up to 2^53.
    pub numbers: BTreeMap<String, Vec<f64>>,
}

impl TrainingState {
    /// A column of `len` numbers.
    ///
    /// # Errors
    /// A text, where it is missing or of another length.
    pub fn column(&self, name: &str, len: usize) -> Result<&[f32], String> {
        column(&self.columns, name, len)
    }

    /// [`TrainingState::column`] of double precision.
    pub fn doubles(&self, name: &str, len: usize) -> Result<&[f64], String> {
        column(&self.numbers, name, len)
    }
}

fn column<'a, T>(all: &'a BTreeMap<String, Vec<T>>, name: &str, len: usize) -> Result<&'a [T], String> {
    let column = all.get(name).filter(|c| c.len() == len);
    column.map(|c| &c[..]).ok_or_else(|| format!("it has no column `{name}` of {len} numbers"))
}

/// The first bytes of a state.
const MAGIC: &[u8; 8] = b"PGSTATE1";

impl TrainingState {
    /// All columns as bytes, little-endian: magic; for single, then double precision u32 number of
    /// columns, and of each u32 length of its name, name, u64 numbers, numbers.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = MAGIC.to_vec();
        write_columns(&self.columns, f32::to_le_bytes, &mut out);
        write_columns(&self.numbers, f64::to_le_bytes, &mut out);
        out
    }

    /// The state of bytes; `None` where they are none.
    pub fn from_bytes(bytes: &[u8]) -> Option<TrainingState> {
        let mut rest = bytes.strip_prefix(MAGIC)?;
        let columns = read_columns(&mut rest, f32::from_le_bytes)?;
        let numbers = read_columns(&mut rest, f64::from_le_bytes)?;
        rest.is_empty().then_some(TrainingState { columns, numbers })
    }
}

fn write_columns<T: Copy, const N: usize>(
    columns: &BTreeMap<String, Vec<T>>,
    bytes: impl Fn(T) -> [u8; N],
    out: &mut Vec<u8>,
) {
    out.extend((columns.len() as u32).to_le_bytes());
    for (name, column) in columns {
        out.extend((name.len() as u32).to_le_bytes());
        out.extend(name.as_bytes());
        out.extend((column.len() as u64).to_le_bytes());
        column.iter().for_each(|v| out.extend(bytes(*v)));
    }
}

fn read_columns<T, const N: usize>(
    rest: &mut &[u8],
    number: impl Fn([u8; N]) -> T,
) -> Option<BTreeMap<String, Vec<T>>> {
    let mut take = |n: usize| -> Option<&[u8]> {
        let (head, tail) = rest.split_at_checked(n)?;
        *rest = tail;
        Some(head)
    };
    let mut columns = BTreeMap::new();
    for _ in 0..u32::from_le_bytes(take(4)?.try_into().ok()?) {
        let name = u32::from_le_bytes(take(4)?.try_into().ok()?);
        let name = String::from_utf8(take(name as usize)?.to_vec()).ok()?;
        let len = usize::try_from(u64::from_le_bytes(take(8)?.try_into().ok()?)).ok()?;
        // The bytes must be there before memory is reserved: a wrong length cannot ask for much.
        let bytes = take(len.checked_mul(N)?)?;
        columns.insert(name, bytes.chunks_exact(N).filter_map(|c| Some(number(c.try_into().ok()?))).collect());
    }
    Some(columns)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_come_back_bit_by_bit_and_broken_bytes_are_none() {
        let mut state = TrainingState::default();
        state.columns.insert("a".into(), vec![1.0, -0.0, f32::MIN_POSITIVE]);
        state.columns.insert("empty".into(), vec![]);
        state.numbers.insert("b".into(), vec![1.0 / 3.0, f64::INFINITY]);
        let bytes = state.to_bytes();
        assert_eq!(TrainingState::from_bytes(&bytes), Some(state));
        for cut in 0..bytes.len() {
            assert_eq!(TrainingState::from_bytes(&bytes[..cut]), None, "{cut}");
        }
        let mut long = bytes.clone();
        long[12..16].copy_from_slice(&u32::MAX.to_le_bytes());
        assert_eq!(TrainingState::from_bytes(&long), None);
    }
}
