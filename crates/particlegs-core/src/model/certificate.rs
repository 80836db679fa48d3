//! The certificate: measurements after decoding, when the file was made.

use super::metric::{MetricField, MetricVisitor, OptionalGroup, RequiredGroup, record};
use super::metrics::{CELL_NAMES, CLASS_NAMES};
use super::{
    CellDensity, CertificateLevel, CrossValidation, DensityMetrics, DrawnDensity, FieldAgreements, GoalResult,
    GroupClass, Layer, LayerRatio, LayerRatios, MassPower, Metric, MetricEntry, MetricGroup, MetricValue, Pictures,
    Sample, ScienceMetrics, Spacing, Subset, ViewMetrics, species_title,
};
use crate::model::{Coding::Whole, Tolerance};
use std::convert::Infallible;

/// Levels that have a group.
const ALL: &[CertificateLevel] = &[CertificateLevel::Quick, CertificateLevel::Full, CertificateLevel::Blocks];
const WHOLE: &[CertificateLevel] = &[CertificateLevel::Quick, CertificateLevel::Full];
const FULL: &[CertificateLevel] = &[CertificateLevel::Full];
const BLOCKS: &[CertificateLevel] = &[CertificateLevel::Blocks];
/// Of groups that certificates have where the snapshot or the user asks for them.
const SOME: &[CertificateLevel] = &[];

const fn group<F>(
    tag: u8,
    levels: &'static [CertificateLevel],
    name: &'static str,
    words: &'static str,
    form: F,
) -> OptionalGroup<F> {
    OptionalGroup(MetricGroup { tag, levels, name, words }, form)
}

record! {
    /// Measured at encoding, bound to the source by the metadata's hash.
    Certificate agrees by Self::groups_agree {
        /// Pictures at the default radius and opacity.
        #[serde(flatten)]
        views: ViewMetrics =
            RequiredGroup(group(1, ALL, "pictures", "pictures, one frame an orbit; masked PSNR in dB, SSIM", ""));
        density: DensityMetrics = RequiredGroup(group(MetricGroup::DENSITY, ALL, "density", "density on a grid", ""));
        /// Densities in cells of three sizes, the smallest first.
        densities: Option<[CellDensity; 3]> = group(3, ALL, "density", "density in cells", CELL_NAMES);
        science: Option<ScienceMetrics> =
            group(MetricGroup::SCIENCE, ALL, "statistics", "statistics against the source", "");
        /// P(k) of mass, where particles' masses are known and differ or there are several layers.
        mass_power: Option<MassPower> =
            group(5, SOME, "P(k) by mass", "power spectrum by mass, of the mixture itself", "");
        /// The region that distances, groups and halves are of where the snapshot is too large for all.
        sample: Option<Sample> = group(6, SOME, "region", "distances, groups and halves are of a region", "");
        spacing: Option<Spacing> = group(7, WHOLE, "nearest neighbour", "distance to the nearest neighbour", "");
        /// Groups matched by position, by class of size.
        groups: Option<[GroupClass; 3]> = group(8, FULL,
            "groups", "groups of particles drawn, over the source's, matched by position", CLASS_NAMES);
        /// Of particles that the fit has not seen.
        held_out: Option<CrossValidation> = group(9, FULL, "halves", "held-out particles, of models of halves", "");
        /// The particles' own best rival to the model.
        subset: Option<Subset> =
            group(10, WHOLE, "subset", "random subset of the same bytes, drawn with larger radii", "");
        /// Pictures at other radii and opacities, and from close up.
        pictures: Option<Pictures> = group(11, FULL,
            "settings", "pictures at other radii and opacities (r, a: the default ones) and from close up", "");
        /// Parts that the certificate was added up of, where no process had all particles: ParaView's pictures are then
        /// not measured.
        blocks: Option<u32> = group(12, BLOCKS, "blocks", "sum over blocks, each measured on its own",
            Metric::new("blocks", Whole(4)).tolerance(Tolerance::Any));
        /// The goal that was asked for, and what the file reached.
        goal: Option<GoalResult> = group(MetricGroup::GOAL, SOME, "goal", "asked for", "");
        /// Ratios of layers' masses, where there are several.
        layer_ratios: Option<LayerRatios> = group(14, SOME,
            "layers", "ratio of masses to the first layer's from cell to cell, dex", "");
        /// Agreement of fields with those of particles that they were not gathered from.
        fields: Option<FieldAgreements> =
            group(15, SOME, "fields", "means of fields in cells, gathered from half the particles, of the other half", "");
        /// The density of particles drawn, in the cells of `densities`.
        drawn_densities: Option<[DrawnDensity; 3]> = group(16, WHOLE, "drawn density",
            "density of as many particles drawn, in the same cells", CELL_NAMES);
    }
}

impl Certificate {
    /// Mean masked PSNR of the noise-free pictures over the orbits, dB.
    pub fn mean_psnr(&self) -> Option<f64> {
        let scores: Vec<f64> = self.views.orbits.iter().filter_map(|o| o.expected.model?.masked_psnr).collect();
        (!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64)
    }

    fn groups_agree(&self) -> Result<(), String> {
        let by_blocks = self.blocks.is_some();
        for orbit in &self.views.orbits {
            // ParaView's own pictures are not those of blocks one over the other.
            let drawn = [(&orbit.paraview, !by_blocks), (&orbit.paraview_no_fxaa, !by_blocks), (&orbit.expected, true)];
            for (s, drawn) in drawn {
                if [s.model, s.noise_free, s.all_black, s.uniform_box].iter().any(|s| s.is_some() != drawn) {
                    return Err("pictures and their scores do not match".into());
                }
            }
            if orbit.expected.subset.is_some() != self.subset.is_some() {
                return Err("the subset and its scores do not match".into());
            }
        }
        let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-5;
        if let Some(cells) = &self.densities
            && cells
                .windows(2)
                .any(|w| !near(w[1].edge, 2.0 * w[0].edge) || !near(w[1].particles, 8.0 * w[0].particles))
        {
            return Err("each cell size must be twice the one before".into());
        }
        if self.drawn_densities.is_some() && self.densities.is_none() {
            return Err("the density of drawn particles has no cells".into());
        }
        Ok(())
    }

    /// Notes to the user on layers whose ratio stands out of the noise ([`LayerRatio::stands_out`]), a line each;
    /// `unit` is that of length.
    pub fn differing_layers<T>(&self, layers: &[Layer<T>], unit: Option<&str>) -> Vec<String> {
        let ratios = self.layer_ratios.iter().flat_map(|r| r.to_first);
        let mut names = layers.iter().map(|l| species_title(&l.name));
        let first = names.next().unwrap_or_default();
        let named = ratios.zip(names).filter_map(|(ratio, name)| Some((ratio?, name)));
        let unit = unit.map_or(String::new(), |u| format!(" {u}"));
        let words = |(r, name): (LayerRatio, String)| {
            format!(
                "{first} and {name} differ where the particles do not: in cells of {:.3}{unit} their ratio is off by {:.3} \
                 dex, where sampling noise is {:.3}; a larger file helps",
                r.edge, r.error, r.noise
            )
        };
        named.filter(|(ratio, _)| ratio.stands_out()).map(words).collect()
    }

    /// Every group of figures in the order of the file; `None` where it was not measured.
    pub fn groups(&self) -> Vec<(MetricGroup, Option<Vec<MetricEntry>>)> {
        let mut list = FigureList::default();
        let mut certificate = *self;
        let Ok(()) = certificate.visit("", &mut list);
        list.groups
    }
}

#[derive(Default)]
struct FigureList {
    groups: Vec<(MetricGroup, Option<Vec<MetricEntry>>)>,
    row: Vec<&'static str>,
}

impl MetricVisitor for FigureList {
    type Error = Infallible;

    fn begin(&mut self, group: &MetricGroup, is_present: bool) -> Result<bool, Infallible> {
        self.groups.push((*group, is_present.then(Vec::new)));
        Ok(is_present)
    }

    fn metric(&mut self, metric: &Metric, value: MetricValue) -> Result<MetricValue, Infallible> {
        let names: Vec<&str> = self.row.iter().copied().filter(|name| !name.is_empty()).collect();
        if let Some((_, Some(entries))) = self.groups.last_mut() {
            entries.push(MetricEntry { row: names.join(" "), metric: *metric, value });
        }
        Ok(value)
    }

    fn enter(&mut self, name: &'static str) {
        self.row.push(name);
    }

    fn leave(&mut self) {
        self.row.pop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Mass;

    #[test]
    fn layers_that_differ_beyond_twice_the_noise_are_told() {
        let layers = ["PartType0", "PartType1", "PartType4"].map(|name| Layer {
            name: name.into(),
            mass: Mass::Unknown,
            content: (),
        });
        let mut ratios = LayerRatios::new(3).unwrap();
        let ratio = |error| LayerRatio { edge: 0.39, cells: 100, noise: 0.024, error, ..LayerRatio::default() };
        (ratios.to_first[0], ratios.to_first[1]) = (Some(ratio(0.064)), Some(ratio(0.047)));
        let c = Certificate { layer_ratios: Some(ratios), ..Certificate::default() };
        assert_eq!(
            c.differing_layers(&layers, Some("Mpc/h")),
            [
                "gas and dark matter differ where the particles do not: in cells of 0.390 Mpc/h their ratio is off by 0.064 \
              dex, where sampling noise is 0.024; a larger file helps"
            ]
        );
        assert_eq!(Certificate::default().differing_layers(&layers, None), [""; 0]);
        assert_eq!(LayerRatios::new(1), None);
        assert_eq!(LayerRatios::new(12).unwrap().to_first.iter().flatten().count(), 7);
    }
}
