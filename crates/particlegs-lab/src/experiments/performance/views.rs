//! Views of the timed frames.

use crate::lab::Lab;
use crate::views::cache_key;
use particlegs_core::camera::View;
use particlegs_core::model::Metadata;
use particlegs_core::picture::Size;
use particlegs_measure::score::evaluation_views;

pub(super) struct TimingViews {
    pub size: Size,
    /// The first view, at the default radius and opacity.
    pub first: View,
    /// Cameras of the three orbits, at the default radius and opacity.
    pub cameras: Vec<View>,
    /// The first view's camera, with radii and opacities from the published ranges.
    pub settings: Vec<View>,
}

impl TimingViews {
    /// Views of a model: one camera per orbit (far, mid, near), and as many radii and opacities.
    pub fn new(lab: &Lab<'_>, m: &Metadata, size: Size) -> TimingViews {
        let views = evaluation_views(m, size, lab.settings.seed, 1);
        let plain = |v: &View| View { radius: m.default_radius, opacity: m.default_opacity, ..v.clone() };
        // A camera of the middle orbit from another seed, so that no timed frame repeats it.
        let other = evaluation_views(m, size, lab.settings.seed + 1, 1);
        let first = plain(other.get(1).unwrap_or(&views[0]));
        let settings = views.iter().map(|v| View { camera: first.camera, ..v.clone() }).collect();
        TimingViews { size, cameras: views.iter().map(plain).collect(), settings, first }
    }

    /// Cache key of times in these views.
    pub fn key(&self) -> String {
        let all = std::iter::once(&self.first).chain(&self.cameras).chain(&self.settings);
        let text: String = all.map(|v| cache_key(v, self.size)).collect();
        blake3::hash(text.as_bytes()).to_hex()[..16].to_string()
    }
}

/// Timed picture sizes: that of the settings, and twice its width and height.
pub(super) fn sizes(lab: &Lab<'_>) -> [Size; 2] {
    let s = lab.settings.size;
    [s, Size { width: 2 * s.width, height: 2 * s.height }]
}
