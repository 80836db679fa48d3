//! What tests of kernels share.

use crate::{AdapterChoice, Checks, Device};
use particlegs_core::camera::{Camera, Projection, View};
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
    View {
        name: "v".into(),
        camera: Camera {
            position,
            focal_point: [0.0; 3],
            view_up: [0.0, 1.0, 0.0],
            projection: Projection::Perspective { fov_deg: 30.0 },
            clipping_range: None,
        },
        radius,
        opacity,
    }
}
