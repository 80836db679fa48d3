//! What tests of kernels share.

use crate::{Checks, Choice, Device};
use std::sync::Arc;

/// The first adapter, with all checks on; says why where there is none.
pub fn device() -> Option<Arc<Device>> {
    match Device::open(Choice::Number(0), Checks::On) {
        Ok(device) => Some(Arc::new(device)),
        Err(e) => {
            assert!(std::env::var_os("PARTICLEGS_GPU_TESTS").is_none(), "{e}");
            eprintln!("skipped: {e}");
            None
        }
    }
}
