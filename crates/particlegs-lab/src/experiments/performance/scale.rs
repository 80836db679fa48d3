//! Size of models of parts of the box at one quality, by number of particles (paper, figure fig:scale).

use super::growth::proportional;
use crate::experiments::published::performance as paper;
use crate::experiments::rates::COMPARED;
use crate::lab::{Lab, ModelSettings};
use crate::results::{Plot, PlotAxis, PlotSeries, Point, ResultTable, TableCell};
use crate::snapshot::Snapshot;
use particlegs_compress::{Target, compress};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::picture::{Size, masked_psnr};
use particlegs_core::render::{Scene, draw};
use particlegs_core::space::Bounds;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use particlegs_fit::Effort;
use particlegs_measure::score::evaluation_views;
use particlegs_particles::{Selection, Storage};
use particlegs_reference::Reference;
use serde::{Deserialize, Serialize};

/// Number of halvings, smallest blocks first.
const HALVINGS: [u32; 5] = [4, 3, 2, 1, 0];
/// Size, and number per orbit, of the pictures that measure quality, as in the search of `compress`.
const SIZE: Size = Size { width: 1920, height: 1080 };
const FRAMES: usize = 2;
/// Distance of the target below the whole box's score, dB: means over six views of one model differ by about as much.
pub(super) const BELOW: f64 = 1.0;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct ScaleBlock {
    /// The block is 1/2^halvings of the box.
    pub halvings: u32,
    /// At the upper corner of the box instead of the lower.
    pub upper: bool,
    pub particles: u64,
    /// Bytes and Gaussians of its model, or why there is none.
    pub model: std::result::Result<[u64; 2], String>,
}

/// The blocks, and their common quality.
pub(super) struct ScaleBlocks {
    /// Masked PSNR in the style `expected`, dB.
    pub quality: f64,
    pub blocks: Vec<ScaleBlock>,
}

/// Blocks at the lower and upper corner of the box, smallest first; with quick settings only the lower, and three
/// sizes.
pub(super) fn measure(lab: &Lab<'_>, snapshot: &Snapshot) -> Result<ScaleBlocks> {
    let quality = quality(lab, snapshot)?;
    let (least, corners): (u32, &[bool]) = if lab.settings.quick { (2, &[false]) } else { (4, &[false, true]) };
    let mut blocks = Vec::new();
    for halvings in HALVINGS.into_iter().filter(|h| *h <= least) {
        // The whole box is the same from either corner.
        for upper in corners.iter().take(if halvings == 0 { 1 } else { 2 }) {
            blocks.push(block(lab, snapshot, halvings, *upper, quality)?);
        }
    }
    blocks.sort_by_key(|b| b.particles);
    Ok(ScaleBlocks { quality, blocks })
}

/// [`BELOW`] the whole box's score at the compared ratio, in tenths of a decibel.
fn quality(lab: &Lab<'_>, snapshot: &Snapshot) -> Result<f64> {
    let recipe = recipe(Target::Ratio(COMPARED), lab.settings.seed);
    let scored = lab.store.result("scale-quality", &(&snapshot.hash, &recipe, SIZE, FRAMES), || {
        let model = lab.model(snapshot, &recipe)?.model;
        let (scene, truth) = (Scene::new(&model), Reference::new(&snapshot.particles));
        let views = evaluation_views(&model.metadata, SIZE, recipe.seed, FRAMES);
        let of_view = |view| {
            let drawn = draw(&scene, view, SIZE, ToneStyle::Expected, lab.context)?;
            Ok(masked_psnr(&drawn, &truth.draw(view, SIZE, ToneStyle::Expected, lab.context)?))
        };
        let scores = views.iter().map(of_view).collect::<Result<Vec<Option<f64>>>>()?;
        let scores: Vec<f64> = scores.into_iter().flatten().collect();
        Ok((!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64))
    })?;
    let scored = scored.ok_or_else(|| Error::input(&snapshot.name, "its pictures are identical to the model's"))?;
    Ok((10.0 * (scored - BELOW)).floor() / 10.0)
}

fn recipe(target: Target, seed: u64) -> ModelSettings {
    ModelSettings { target, effort: Effort::Fast, blocks: 1, seed }
}

/// The lower or upper part of a box, halved along x, y, z, x.
fn corner(all: &Bounds, halvings: u32, upper: bool) -> Bounds {
    let mut b = *all;
    for k in 0..3 {
        // The halvings go round the axes, x first.
        let times = (halvings as usize + 2 - k) / 3;
        let width = (all.max[k] - all.min[k]) / f64::from(1 << times);
        // A region excludes its upper ends, but bounds include the last particle.
        let beyond = 1e-6 * width;
        match upper && times > 0 {
            true => (b.min[k], b.max[k]) = (all.max[k] - width, all.max[k] + beyond),
            false if times > 0 => b.max[k] = all.min[k] + width,
            false => b.max[k] = all.max[k] + beyond,
        }
    }
    b
}

fn block(lab: &Lab<'_>, snapshot: &Snapshot, halvings: u32, upper: bool, quality: f64) -> Result<ScaleBlock> {
    let recipe = recipe(Target::Psnr(quality), lab.settings.seed);
    let region = corner(&snapshot.particles.bounds(), halvings, upper);
    let key = (&snapshot.hash, halvings, format!("{region:?}"), &recipe);
    lab.store.result("scale-block", &key, || {
        let crop = (halvings > 0).then_some(region);
        let particles =
            snapshot.particles.select(Selection { crop, ..Selection::all() }, &Storage::Memory, lab.context)?;
        let model = match compress(&particles, &recipe.options(), &mut NoCheckpoints, lab.context) {
            Ok(done) => Ok([done.bytes.len() as u64, done.model.gaussians() as u64]),
            // A block without particles, or below the quality, records the reason.
            Err(e @ (Error::Unreachable { .. } | Error::Input { .. } | Error::Argument { .. })) => Err(e.to_string()),
            Err(e) => return Err(e),
        };
        Ok(ScaleBlock { halvings, upper, particles: particles.len() as u64, model })
    })
}

impl ScaleBlocks {
    /// Exponents of bytes and Gaussians over particles, by least squares in logarithms; `None` for fewer than two
    /// blocks.
    pub fn powers(&self) -> Option<[f64; 2]> {
        let power_of = |k: usize| {
            power(self.blocks.iter().filter_map(|b| Some([b.particles as f64, b.model.as_ref().ok()?[k] as f64])))
        };
        Some([power_of(0)?, power_of(1)?])
    }

    pub fn table(&self) -> ResultTable {
        let mut table = ResultTable::new(
            "performance-scale",
            format!("Blocks of the box at one quality: masked PSNR of {} dB", self.quality),
            &["block", "particles", "Gaussians", "bytes", "particles per Gaussian", "raw bytes / bytes"],
        );
        for b in &self.blocks {
            let n = b.particles as f64;
            let (bytes, gaussians) = match &b.model {
                Ok([bytes, gaussians]) => (Some(*bytes as f64), TableCell::count(*gaussians)),
                Err(why) => (None, TableCell::text(super::growth::not(why))),
            };
            let each = b.model.as_ref().ok().map(|m| n / m[1] as f64);
            table.row([
                TableCell::text(match (b.halvings, b.upper) {
                    (0, _) => "the whole".into(),
                    (h, false) => format!("1/{}, lower corner", 1 << h),
                    (h, true) => format!("1/{}, upper corner", 1 << h),
                }),
                TableCell::count(b.particles),
                gaussians,
                TableCell::number(bytes, 0),
                TableCell::number(each, 1),
                TableCell::number(bytes.map(|v| 12.0 * n / v), 1),
            ]);
        }
        for [particles, gaussians] in paper::SCALE {
            let name = TableCell::text(format!("paper, 1/{:.0}", paper::PARTICLES / particles));
            let cells = [TableCell::number(particles, 0), TableCell::number(gaussians, 0)];
            let each = TableCell::number(particles / gaussians, 1);
            let [particles, gaussians] = cells;
            table.row([name, particles, gaussians, TableCell::Empty, each, TableCell::Empty]);
        }
        table
    }

    pub fn plot(&self) -> Plot {
        let point = |b: &ScaleBlock| Some(Point::new(b.particles as f64, b.model.as_ref().ok()?[0] as f64));
        let corner_series = |name: &str, style, upper| {
            // The whole box is the last point of both.
            let blocks = self.blocks.iter().filter(|b| b.upper == upper || b.halvings == 0);
            PlotSeries { name: name.into(), style, dashed: false, points: blocks.filter_map(point).collect() }
        };
        let mut series = vec![corner_series("lower corner", 0, false)];
        if self.blocks.iter().any(|b| b.upper) {
            series.push(corner_series("upper corner", 1, true));
        }
        series.extend(proportional(&series[0].points));
        Plot {
            name: "performance-scale".into(),
            title: format!("Model size of parts of the box at {} dB", self.quality),
            x: PlotAxis::logarithmic("particles in the part"),
            y: PlotAxis::logarithmic("bytes of the model"),
            series,
            levels: vec![],
        }
    }
}

/// Slope of a line through logarithms, by least squares.
pub(super) fn power(points: impl Iterator<Item = [f64; 2]>) -> Option<f64> {
    let logs: Vec<[f64; 2]> = points.map(|p| p.map(f64::ln)).collect();
    let mean = |k: usize| logs.iter().map(|p| p[k]).sum::<f64>() / logs.len() as f64;
    let [mx, my] = [mean(0), mean(1)];
    let sum = |term: &dyn Fn(&[f64; 2]) -> f64| logs.iter().map(term).sum::<f64>();
    let slope = sum(&|p| (p[0] - mx) * (p[1] - my)) / sum(&|p| (p[0] - mx).powi(2));
    (logs.len() > 1 && slope.is_finite()).then_some(slope)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_slopes_of_logarithms() {
        let points = [1.0f64, 2.0, 8.0, 30.0].map(|x| [x, 5.0 * x.powf(0.7)]);
        assert!((power(points.into_iter()).unwrap() - 0.7).abs() < 1e-12);
        assert!(power(points[..1].iter().copied()).is_none());
        // The paper's own two points.
        assert!((power(paper::SCALE.into_iter()).unwrap() - 0.216).abs() < 0.001);
    }

    #[test]
    fn corners_are_parts_of_the_box() {
        let all = Bounds { min: [0.0, -1.0, 2.0], max: [8.0, 1.0, 6.0] };
        let volume = |b: &Bounds| (0..3).map(|k| b.max[k] - b.min[k]).product::<f64>();
        for halvings in 0..5 {
            for upper in [false, true] {
                let b = corner(&all, halvings, upper);
                let share = volume(&b) / volume(&all);
                assert!((share * f64::from(1 << halvings) - 1.0).abs() < 1e-5, "{halvings} {upper} {share}");
                let has = |p: [f64; 3]| (0..3).all(|k| b.min[k] <= p[k] && p[k] < b.max[k]);
                assert!(has(if upper { all.max } else { all.min }), "{halvings} {upper}");
            }
        }
    }
}
