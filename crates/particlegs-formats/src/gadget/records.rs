//! Records between two equal marks, as Fortran writes them.

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct GadgetRecord {
    pub offset: u64,
    pub length: u64,
}

impl GadgetRecord {
    /// Byte behind the closing mark.
    pub fn end(&self) -> u64 {
        self.offset + self.length + 4
    }
}

#[derive(Clone, Copy)]
pub struct Records<'a> {
    pub bytes: &'a [u8],
    /// Of the marks.
    pub big_endian: bool,
}

impl Records<'_> {
    pub fn mark(&self, at: u64) -> Option<u32> {
        let at = usize::try_from(at).ok()?;
        let four: [u8; 4] = self.bytes.get(at..at.checked_add(4)?)?.try_into().ok()?;
        Some(if self.big_endian { u32::from_be_bytes(four) } else { u32::from_le_bytes(four) })
    }

    /// The record whose opening mark is at byte `at`. Marks have 32 bits: blocks above 4 GiB are
    /// written with the length's low word, so that a length fits if its low word is the mark's and
    /// the closing mark stands behind it. The fault in words where none fits.
    pub fn at(&self, at: u64) -> Result<GadgetRecord, String> {
        let end = self.bytes.len() as u64;
        let mark = self.mark(at).ok_or_else(|| format!("the file ends at byte {end}, inside a record marker"))?;
        let fits = |length: u64| (at + 8).checked_add(length).is_some_and(|e| e <= end);
        let lengths = (0..=end >> 32).map(|k| u64::from(mark) + (k << 32)).take_while(|&l| fits(l));
        let mut first_close = None;
        for length in lengths {
            let close = self.mark(at + 4 + length);
            if close == Some(mark) {
                return Ok(GadgetRecord { offset: at + 4, length });
            }
            first_close.get_or_insert(close);
        }
        Err(match first_close.flatten() {
            Some(close) => {
                format!(
                    "the record at byte {at} begins with the length {mark} and ends with {close}: they must be equal"
                )
            }
            None => format!("the record at byte {at} should have {mark} bytes, but the file ends at byte {end}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_must_agree_and_lie_within_the_file() {
        let bytes = [2, 0, 0, 0, 7, 7, 2, 0, 0, 0, 9, 0, 0, 0];
        let records = Records { bytes: &bytes, big_endian: false };
        let first = records.at(0).unwrap();
        assert_eq!(first, GadgetRecord { offset: 4, length: 2 });
        assert!(records.at(first.end()).unwrap_err().contains("9 bytes"));
        assert!(records.at(13).unwrap_err().contains("inside"));
        assert!(records.at(u64::MAX).is_err());
        let bad = [1, 0, 0, 0, 7, 2, 0, 0, 0];
        assert!(Records { bytes: &bad, big_endian: false }.at(0).unwrap_err().contains("must be equal"));
    }
}
