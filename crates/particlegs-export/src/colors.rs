//! Colours of splats.

use super::Notes;
use super::grid::density_unit;
use particlegs_core::math::Sym3;
use particlegs_core::model::{Layer, Mixture, Model};
use particlegs_core::picture::{Colormap, Rgb8};
use particlegs_core::{Error, Result};
use serde_json::{Map, json};

particlegs_core::named_values! {
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub enum ColorBy {
        /// Grey levels, as in pictures: white, or those that an alpha-blend model was trained to.
        #[default]
        Grey = "grey",
        Layer = "layer",
        /// Each Gaussian's own density at its centre, in logarithmic colours.
        Density = "density",
    }
}

/// Shares of the Gaussians whose densities have the first and the last colour.
const ENDS: [f64; 2] = [0.01, 0.99];

pub struct Coloring {
    /// Red, green and blue in 0 to 1 of each Gaussian, in the model's order; `None` = grey levels.
    pub colors: Option<Vec<[f32; 3]>>,
    /// Densities of the first and the last colour.
    pub range: Option<[f64; 2]>,
}

impl Coloring {
    pub fn new(model: &Model, by: ColorBy, map: Colormap, range: Option<[f64; 2]>) -> Result<Coloring> {
        if let Some([low, high]) = range
            && !(low > 0.0 && high > low && high.is_finite())
        {
            return Err(Error::argument("the density range must be LO,HI with 0 < LO < HI"));
        }
        match by {
            ColorBy::Grey => Ok(Coloring { colors: None, range: None }),
            ColorBy::Layer => {
                let layer_colors = |(i, layer): (usize, &Layer<Vec<_>>)| {
                    let color = Rgb8::layer_color(i).map(|v| f32::from(v) / 255.0);
                    greys(layer).map(move |grey| color.map(|v| v * grey)).collect::<Vec<_>>()
                };
                let colors = model.layers.iter().enumerate().flat_map(layer_colors).collect();
                Ok(Coloring { colors: Some(colors), range: None })
            }
            ColorBy::Density => {
                let densities: Vec<f64> = model.layers.iter().flat_map(densities).collect();
                let [low, high] = range.unwrap_or_else(|| ends(&densities));
                let span = (high / low).ln();
                // Equal densities all have the middle colour.
                let t = |density: f64| if span > 0.0 { (density / low).ln() / span } else { 0.5 };
                let color =
                    |(density, grey): (&f64, f32)| map.color(t(*density) as f32).map(|v| f32::from(v) / 255.0 * grey);
                let colors = densities.iter().zip(model.layers.iter().flat_map(greys)).map(color).collect();
                Ok(Coloring { colors: Some(colors), range: Some([low, high]) })
            }
        }
    }

    pub fn describe(&self, model: &Model, by: ColorBy, map: Colormap, notes: &mut Notes) {
        if by == ColorBy::Layer {
            let code = |i: usize| Rgb8::layer_color(i).iter().fold(String::from("#"), |s, v| s + &format!("{v:02x}"));
            let colors: Vec<(String, String)> =
                model.layers.iter().enumerate().map(|(i, l)| (l.name.clone(), code(i))).collect();
            let words: Vec<String> = colors.iter().map(|(name, code)| format!("{name} {code}")).collect();
            notes.say(format!("colours of layers: {}", words.join(", ")));
            notes.set("colors", colors.into_iter().map(|(name, code)| (name, code.into())).collect::<Map<_, _>>());
        }
        if let Some([low, high]) = self.range {
            let (map, unit) = (map.name(), density_unit(&model.metadata, model.has_masses(), 3));
            notes.say(format!("colours: {map}, logarithmic, from {low} to {high} {unit}, by Gaussian density"));
            notes.set(
                "colors",
                json!({ "colormap": map, "scale": "logarithmic", "density": [low, high], "unit": unit }),
            );
        }
    }
}

/// Grey levels of a layer's Gaussians, which colours are multiplied by; 1 of the optical-depth law.
fn greys(layer: &Layer<Vec<particlegs_core::model::Block>>) -> impl Iterator<Item = f32> {
    let grey = |g: &Mixture, i: usize| g.law.alpha_blend().map_or(1.0, |a| a.grey[i].clamp(0.0, 1.0) as f32);
    layer.content.iter().flat_map(move |b| (0..b.gaussians.len()).map(move |i| grey(&b.gaussians, i)))
}

/// Mass, or number, per volume at the centre of each of a layer's Gaussians.
fn densities(layer: &Layer<Vec<particlegs_core::model::Block>>) -> Vec<f64> {
    let unit = layer.mass.unit_or_one();
    let density_of = |g: &Mixture, i: usize| unit * g.mass_of(i) * peak(&g.cov_of(i));
    layer
        .content
        .iter()
        .flat_map(|b| (0..b.gaussians.len()).map(|i| density_of(&b.gaussians, i)).collect::<Vec<_>>())
        .collect()
}

fn peak(cov: &Sym3) -> f64 {
    let root = (2.0 * std::f64::consts::PI).sqrt();
    cov.deviations_and_turn().0.iter().fold(1.0, |p, d| p / (root * d))
}

/// The range that leaves the least and the densest out.
fn ends(densities: &[f64]) -> [f64; 2] {
    let mut sorted: Vec<f64> = densities.iter().copied().filter(|d| d.is_finite() && *d > 0.0).collect();
    sorted.sort_by(f64::total_cmp);
    let at = |share: f64| sorted.get(((sorted.len().max(1) - 1) as f64 * share).round() as usize).copied();
    ENDS.map(|share| at(share).unwrap_or(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_peak_is_the_normal_density() {
        let cov = Sym3([4.0, 0.0, 0.0, 1.0, 0.0, 0.25]);
        let want = (2.0 * std::f64::consts::PI).powf(-1.5);
        assert!((peak(&cov) / want - 1.0).abs() < 1e-12);
        assert_eq!(ends(&[3.0, f64::INFINITY, 1.0, 2.0, 0.0]), [1.0, 3.0]);
        assert_eq!(ends(&[]), [1.0, 1.0]);
    }
}
