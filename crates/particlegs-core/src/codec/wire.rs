//! Reading little-endian fields from a slice that may end too soon.

pub(crate) struct WireReader<'a> {
    bytes: &'a [u8],
    at: usize,
}

type WireResult<T> = Result<T, String>;

/// Fault of a section that cannot be read.
pub(crate) enum SectionFault {
    /// It contradicts the format.
    Corrupt(String),
    /// It asks for something newer.
    Unknown(String),
}

impl From<String> for SectionFault {
    fn from(message: String) -> Self {
        SectionFault::Corrupt(message)
    }
}

/// Numbers by the names of their types.
macro_rules! numbers {
    ($($number:ident)*) => {
        impl WireReader<'_> {
            $(pub(crate) fn $number(&mut self) -> WireResult<$number> {
                let mut bytes = [0; size_of::<$number>()];
                bytes.copy_from_slice(self.take(size_of::<$number>())?);
                Ok($number::from_le_bytes(bytes))
            })*
        }
    };
}

numbers!(u8 u16 u32 u64 f32 f64);

impl<'a> WireReader<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        WireReader { bytes, at: 0 }
    }

    pub(crate) fn take(&mut self, n: usize) -> WireResult<&'a [u8]> {
        let end = self.at.checked_add(n).filter(|&e| e <= self.bytes.len());
        let Some(end) = end else {
            return Err(format!("{n} bytes are missing at byte {} of {}", self.at, self.bytes.len()));
        };
        let part = &self.bytes[self.at..end];
        self.at = end;
        Ok(part)
    }

    pub(crate) fn is_done(&self) -> bool {
        self.at == self.bytes.len()
    }

    pub(crate) fn position(&self) -> usize {
        self.at
    }
}
