//! The frame that the published system trains in (docs/law/cameras.md, "The training frame").

use super::base_distance;
use crate::picture::Size;
use crate::space::Bounds;

/// From the world to the frame that a model is trained in: `x_n = (x - centre) * scale`.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct Normalisation {
    /// Centre of the particles' bounds, world units.
    pub center: [f64; 3],
    /// 4 over the base distance of the published cameras, one over world units.
    pub scale: f64,
}

impl Normalisation {
    /// The frame of particles with these bounds.
    pub fn new(bounds: &Bounds) -> Self {
        let wide = Size { width: 16, height: 9 };
        Normalisation { center: bounds.center(), scale: 4.0 / base_distance(bounds, wide) }
    }
}
