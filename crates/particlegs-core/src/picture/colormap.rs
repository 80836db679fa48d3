//! Colour maps: 256 colours each. A new one is 768 bytes more in the tables and a variant before `Grey`, which has none;
//! command, Python and page list them by themselves.

use super::{Plane, Rgb8};
use crate::{NamedValue, parallel};
use std::str::FromStr;

/// viridis, inferno and magma (CC0, Smith and van der Walt), cividis (Nuñez, Anderton and Renslow, CC0), ember and
/// arctic (CMasher, van der Velden 2020, BSD 3-clause), thermal and ice (cmocean, Thyng et al. 2016, MIT), one after
/// the other.
const TABLES: &[u8; 8 * 768] = include_bytes!("../../assets/colormaps.rgb");

crate::named_values! {
    /// Maps from numbers to colours.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum Colormap {
        /// Blue to yellow.
        Viridis = "viridis",
        /// Black over red to pale yellow.
        #[default]
        Inferno = "inferno",
        /// Black over purple to pale pink.
        Magma = "magma",
        /// Blue to yellow, for colour-blind eyes too.
        Cividis = "cividis",
        /// Black over red to orange.
        Ember = "ember",
        /// Black over blue to white.
        Arctic = "arctic",
        /// Dark blue over red to yellow.
        Thermal = "thermal",
        /// Nearly black over blue to white.
        Ice = "ice",
        /// Black to white.
        Grey = "grey",
    }
}

impl Colormap {
    /// The colour of `t` in [0, 1]; outside, that of the nearer end.
    pub fn color(self, t: f32) -> [u8; 3] {
        // NaN becomes 0 in the cast.
        let i = (t * 255.0).round().clamp(0.0, 255.0) as usize;
        match self {
            Colormap::Grey => [i as u8; 3],
            table => {
                let at = 768 * table as usize + 3 * i;
                [TABLES[at], TABLES[at + 1], TABLES[at + 2]]
            }
        }
    }
}

/// The colours of surface densities by their logarithm. The lowest density lies within a map, so that it is told apart
/// from empty pixels, which have the first colour; what lies below fades into that.
#[derive(Clone, Debug)]
pub struct DensityColors {
    colors: [[u8; 3]; 256],
    start: f32,
    length: f32,
}

impl DensityColors {
    /// The place of the lowest density among the colours, from 0 to 1.
    pub const LOWEST: f32 = 0.2;

    /// Colours over a range of densities: of `map` on black; on white paper, of its reverse, which grows out of white.
    pub fn new(map: Colormap, white: bool, [lo, hi]: [f64; 2]) -> DensityColors {
        let colors = std::array::from_fn(|i| {
            let share = i as f32 / 255.0;
            let ink = (share / Self::LOWEST).min(1.0);
            match white {
                true => map.color(1.0 - share).map(|v| (255.0 + (f32::from(v) - 255.0) * ink).round() as u8),
                false => map.color(share),
            }
        });
        DensityColors { colors, start: libm::log(lo) as f32, length: libm::log(hi / lo) as f32 }
    }

    /// All of them, from the first to the highest density's.
    pub fn all(&self) -> &[[u8; 3]; 256] {
        &self.colors
    }

    /// The colour of a density.
    pub fn of(&self, density: f32) -> [u8; 3] {
        match density > 0.0 {
            true => self.at((libm::logf(density) - self.start) / self.length),
            false => self.colors[0],
        }
    }

    /// The picture of a plane of densities.
    pub fn image(&self, plane: &Plane) -> Rgb8 {
        Rgb8 { size: plane.size, data: parallel::map_range(plane.data.len(), |i| self.of(plane.data[i])) }
    }

    /// The colour of a share of the range.
    pub fn at(&self, share: f32) -> [u8; 3] {
        // NaN becomes 0 in the cast.
        self.colors[(255.0 * (Self::LOWEST + (1.0 - Self::LOWEST) * share)).round().clamp(0.0, 255.0) as usize]
    }
}

impl FromStr for Colormap {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let known = Self::from_name(if name == "gray" { "grey" } else { name });
        known.map_err(|there| format!("unknown colour map `{name}`; {there}"))
    }
}

/// The colour of a signed number in [-1, 1]: blue below, black at zero, red above. Brightness grows
/// with the size, so that a picture of errors is dark where there are none.
pub fn diverging(t: f32) -> [u8; 3] {
    let mix = |from: [f32; 3], to: [f32; 3], s: f32| [0, 1, 2].map(|k| (from[k] + (to[k] - from[k]) * s).round() as u8);
    const BLACK: [f32; 3] = [0.0; 3];
    const BLUE: [f32; 3] = [64.0, 128.0, 255.0];
    const RED: [f32; 3] = [255.0, 96.0, 48.0];
    let size = t.abs().min(1.0);
    let pure = if t < 0.0 { BLUE } else { RED };
    if size < 0.7 { mix(BLACK, pure, size / 0.7) } else { mix(pure, [255.0; 3], (size - 0.7) / 0.3 * 0.8) }
}

/// The colour of a signed number in [-1, 1] on any background: blue below, light grey at zero, red above (Moreland 2009,
/// "Diverging color maps for scientific visualization", at five of its points).
pub fn cool_to_warm(t: f32) -> [u8; 3] {
    const POINTS: [[f32; 3]; 5] =
        [[59.0, 76.0, 192.0], [141.0, 176.0, 254.0], [221.0, 221.0, 221.0], [244.0, 152.0, 122.0], [180.0, 4.0, 38.0]];
    let at = 2.0 * (t.clamp(-1.0, 1.0) + 1.0);
    let first = (at as usize).min(3);
    let share = at - first as f32;
    [0, 1, 2].map(|k| (POINTS[first][k] + (POINTS[first + 1][k] - POINTS[first][k]) * share).round() as u8)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn maps_run_from_dark_to_light() {
        for map in Colormap::ALL {
            let light = |t| map.color(t).iter().map(|&v| u32::from(v)).sum::<u32>();
            assert!(light(0.0) < light(0.5) && light(0.5) < light(1.0), "{map:?}");
            assert_eq!(map.color(-3.0), map.color(0.0));
            assert_eq!(map.name().parse(), Ok(map));
        }
        assert_eq!(Colormap::Viridis.color(0.0), [68, 1, 84]);
        assert_eq!(diverging(0.0), [0, 0, 0]);
    }

    #[test]
    fn empty_pixels_differ_from_the_lowest_density_in_every_map() {
        let light = |[r, g, b]: [u8; 3]| 0.2126 * f32::from(r) + 0.7152 * f32::from(g) + 0.0722 * f32::from(b);
        for (map, white) in Colormap::ALL.into_iter().flat_map(|m| [(m, false), (m, true)]) {
            let colors = DensityColors::new(map, white, [2.0, 200.0]);
            let [empty, below, lowest, highest] = [0.0, 1e-9, 2.0, 200.0].map(|v| colors.of(v));
            assert_eq!((empty, lowest, highest), (below, colors.all()[51], colors.all()[255]));
            assert!((light(empty) - light(lowest)).abs() > 20.0, "{map:?} {white} {empty:?} {lowest:?}");
            assert_eq!(empty, if white { [255; 3] } else { map.color(0.0) });
            assert_eq!([f32::NAN, -1.0].map(|v| colors.of(v)), [empty; 2]);
        }
    }
}
