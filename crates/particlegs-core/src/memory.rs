//! Large buffers: what the system refuses is an error, not the end of the process.

use crate::context::Context;
use crate::{Error, Result};

/// `len` copies of a value.
pub fn filled<T: Clone>(what: &str, value: T, len: usize, context: &Context<'_>) -> Result<Vec<T>> {
    let mut out = reserved(what, len, context)?;
    out.resize(len, value);
    Ok(out)
}

/// Storage for `len` values.
pub fn reserved<T>(what: &str, len: usize, context: &Context<'_>) -> Result<Vec<T>> {
    let mut out = Vec::new();
    out.try_reserve_exact(len).map_err(|_| Error::Memory {
        what: what.to_string(),
        need_bytes: (len as u64).saturating_mul(size_of::<T>() as u64),
        have_bytes: context.available_memory().unwrap_or(0),
    })?;
    Ok(out)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Context;

    #[test]
    fn what_cannot_be_had_is_an_error() {
        let error = filled("a buffer", 0.0f64, usize::MAX / 16, &Context::SILENT).unwrap_err();
        assert!(matches!(error, crate::Error::Memory { .. }));
        assert_eq!(filled("a buffer", 1u8, 3, &Context::SILENT).unwrap(), [1; 3]);
    }
}
