//! Colour maps: 256 colours each.

use std::str::FromStr;

/// viridis, inferno and magma (CC0, Smith and van der Walt), cividis (Nuñez, Anderton and Renslow, CC0), ember and
/// arctic (CMasher, van der Velden 2020, BSD 3-clause), thermal and ice (cmocean, Thyng et al. 2016, MIT), one after
/// the other.
const TABLES: &[u8; 8 * 768] = include_bytes!("../../assets/colormaps.rgb");

crate::named_values! {
    /// How numbers become colours.
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

/// Share of a range over which colours on white grow out of the paper.
const FADE: f32 = 0.15;

impl Colormap {
    /// The colour of `t` in [0, 1] on white paper: the map is reversed and begins at white, so that nothing is paper
    /// and much is dark. Outside, that of the nearer end; what is no number has the first colour.
    pub fn on_white(self, t: f32) -> [u8; 3] {
        let t = if t.is_nan() { 0.0 } else { t.clamp(0.0, 1.0) };
        let share = (t / FADE).min(1.0);
        self.color(1.0 - t).map(|v| (255.0 + (f32::from(v) - 255.0) * share).round() as u8)
    }
}

impl FromStr for Colormap {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        Self::ALL.into_iter().find(|c| c.name() == name || (name == "gray" && *c == Colormap::Grey)).ok_or_else(|| {
            format!("`{name}` is not a colour map; there are {}", Self::ALL.map(Colormap::name).join(", "))
        })
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
}
