//! What tests of kernels share.

use crate::{AdapterChoice, Checks, Device};
use particlegs_core::camera::{Camera, View};
use std::sync::Arc;

/// The first adapter, with all checks on; says why where there is none.
pub fn device() -> Option<Arc<Device>> {
    match Device::open(AdapterChoice::Number(0), Checks::On) {
        Ok(device) => Some(Arc::new(device)),
        Err(e) => {
            assert!(std::env::var_os("PARTICLEGS_GPU_TESTS").is_none(), "{e}");
            eprintln!("skipped: {e}");
            None
        }
    }
}

/// A view of the origin from a place.
pub fn view(position: [f64; 3], [radius, opacity]: [f64; 2]) -> View {
    View { name: "v".into(), camera: Camera::looking_at([0.0; 3], position), radius, opacity }
}
