//! Picture comparisons: the close-up of artefacts, truth beside model beside the best other compressor, and the
//! three-way comparison (paper, figures fig:artifact, fig:qualitative and fig:three_way).

mod crops;
mod three_way;

use super::Experiment;
use super::rates::COMPARED as RATIO;
use crate::lab::{Lab, ModelBuild, ModelSettings, Style, or_made};
use crate::method::{BoundReport, CompressionMethod, FileContent, MethodOutput};
use crate::results::{ExperimentResults, Pictures, ResultTable, TableCell};
use crate::snapshot::Snapshot;
use crate::views::{
    ReferenceViews, Score, cache_key, identical_note, kept_picture, masked, mean, mean_of, orbit, ssim,
};
use crops::{BRIGHTENED, close_up, whole};
use particlegs_core::camera::View;
use particlegs_core::picture::{Gray8, Rgb8};
use particlegs_core::{Error, Result};
use particlegs_measure::score::evaluation_views;

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "figures",
    title: "Pictures side by side: close-ups, other compressors, particles drawn from the model",
    paper: "fig:artifact, fig:qualitative, fig:three_way",
    trains: false,
    weight: 40,
    run,
};

/// Views per orbit of the three-way comparison; its median over frames needs more than other experiments.
const FRAMES: usize = 6;
/// The compressor whose artefacts the paper shows.
const STREAKS: &str = "SZ3";

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<ExperimentResults> {
    let snapshot = &snapshots[0];
    let build = lab.model(snapshot, &ModelSettings::ratio(RATIO, lab.settings.seed))?;
    let frames = if lab.settings.quick { 2 } else { FRAMES.max(lab.settings.frames) };
    let views = evaluation_views(&build.model.metadata, lab.settings.size, lab.settings.seed, frames);
    let truth = ReferenceViews::in_views(lab, snapshot, views)?;
    let pictures = of_model(lab, &build, &truth)?;
    let scores = scores(&truth, &pictures)?;
    let shown = FigureViews::new(&truth, &pictures, &scores);
    let (others, failed) = at_size(lab, snapshot, build.bytes.len() as u64, &shown.truth)?;
    let three = three_way::three_way(lab, snapshot, &build, &truth, pictures, scores)?;
    let mut results = ExperimentResults { notes: notes(&build, snapshot, &others), ..ExperimentResults::default() };
    results.notes.push(three.note);
    let pictures = others.iter().map(|o| (o.name.clone(), &o.scores[..]));
    results.notes.extend(identical_note([("the model".to_string(), &shown.scores[..])].into_iter().chain(pictures)));
    results.notes.extend(failed);
    results.tables = vec![table(&shown, &build, &others, snapshot)];
    results.tables.extend(three.tables);
    results.plots = three.plots;
    results.pictures = [artefact(&shown, &others), qualitative(&shown, &others)].into_iter().flatten().collect();
    results.pictures.extend(three.pictures);
    Ok(results)
}

/// The model's pictures of the views, cached.
fn of_model(lab: &Lab<'_>, build: &ModelBuild, truth: &ReferenceViews) -> Result<Vec<Gray8>> {
    let hash = blake3::hash(&build.bytes).to_hex().to_string();
    let mut draw = None;
    let picture = |view: &View| {
        kept_picture(lab, &("model", &hash, cache_key(view, truth.size)), || {
            or_made(&mut draw, || lab.draws_model(&build.model))?(view, truth.size)
        })
    };
    truth.views.iter().map(picture).collect()
}

/// The first far and the first near view: all particles, and the model.
struct FigureViews {
    truth: ReferenceViews,
    model: Vec<Gray8>,
    scores: Vec<Score>,
}

impl FigureViews {
    fn new(truth: &ReferenceViews, pictures: &[Gray8], scores: &[Score]) -> FigureViews {
        let first = |orbit_name: &str| truth.views.iter().position(|v| orbit(&v.name) == orbit_name);
        let chosen: Vec<usize> = [first("far"), first("near")].into_iter().flatten().collect();
        let select = |list: &[Gray8]| chosen.iter().map(|i| list[*i].clone()).collect::<Vec<_>>();
        let views = chosen.iter().map(|i| truth.views[*i].clone()).collect();
        let pictured =
            ReferenceViews { views, size: truth.size, bounds: truth.bounds, pictures: select(&truth.pictures) };
        FigureViews {
            truth: pictured,
            model: select(pictures),
            scores: chosen.iter().map(|i| scores[*i].clone()).collect(),
        }
    }

    /// One row of panels per view: all particles, the model and another method, each cropped by `cut`.
    fn panels(&self, other: &MethodPictures, cut: impl Fn(&Gray8) -> Rgb8) -> Vec<(String, Rgb8)> {
        let mut panels = Vec::new();
        for (i, view) in self.truth.views.iter().enumerate() {
            let said = |s: &Score| s.masked.map_or("identical".into(), |v| format!("{v:.2} dB"));
            let orbit_name = orbit(&view.name);
            panels.push((format!("{orbit_name}: all particles"), cut(&self.truth.pictures[i])));
            panels.push((format!("{orbit_name}: the model, {}", said(&self.scores[i])), cut(&self.model[i])));
            panels.push((format!("{orbit_name}: {}, {}", other.name, said(&other.scores[i])), cut(&other.pictures[i])));
        }
        panels
    }
}

/// The method with the best pictures, among those whose names begin so, if there are any.
fn best<'a>(others: &'a [MethodPictures], begins: &str) -> Option<&'a MethodPictures> {
    // If none has the name, the best of all is shown.
    let named = others.iter().any(|o| o.name.starts_with(begins));
    let chosen = others.iter().filter(|o| !named || o.name.starts_with(begins));
    chosen.max_by(|a, b| a.masked().unwrap_or(0.0).total_cmp(&b.masked().unwrap_or(0.0)))
}

fn artefact(shown: &FigureViews, others: &[MethodPictures]) -> Option<Pictures> {
    let other = best(others, STREAKS)?;
    let title = format!("Close up: all particles, the model and {} at one file size", other.name);
    let caption = "The centre 30 % of the first far and the first near view, as ParaView draws all particles.";
    Some(beside(shown, other, "artefact", title, caption, close_up))
}

fn qualitative(shown: &FigureViews, others: &[MethodPictures]) -> Option<Pictures> {
    let other = best(others, "")?;
    let title = format!("Far and near: all particles, the model and the best other compressor, {}", other.name);
    Some(beside(shown, other, "qualitative", title, "The whole of the first far and the first near view.", whole))
}

fn beside(
    shown: &FigureViews,
    other: &MethodPictures,
    name: &str,
    title: String,
    description: &str,
    cut: fn(&Gray8) -> Rgb8,
) -> Pictures {
    let (caption, panels) = (format!("{description} {}", sizes(other)), shown.panels(other, cut));
    Pictures { name: name.into(), title, caption, columns: 3, colours: None, panels }
}

fn sizes(other: &MethodPictures) -> String {
    let said = |b: BoundReport| format!(" at a bound of {:.4} and a largest error of {:.4}", b.asked, b.largest_error);
    let bound = other.bound.map_or(String::new(), said);
    format!(
        "{BRIGHTENED} Decibels are the masked PSNR of the whole view at its original levels against all particles, \
         measured in this run; {} has {} bytes{bound}.",
        other.name, other.bytes
    )
}

/// Crops all panels around their centres to the smallest width and height.
fn same_size(panels: &mut [(String, Rgb8)]) {
    let least = |side: fn(&Rgb8) -> usize| panels.iter().map(|p| side(&p.1)).min().unwrap_or(0);
    let (width, height) = (least(|p| p.size.width), least(|p| p.size.height));
    for (_, picture) in panels {
        let (across, down) = (picture.size.width, picture.size.height);
        let (left, top) = ((across - width) / 2, (down - height) / 2);
        let row = |j: usize| &picture.data[(top + j) * across + left..][..width];
        let data = (0..height).flat_map(row).copied().collect();
        *picture = Rgb8 { size: particlegs_core::picture::Size { width, height }, data };
    }
}

fn table(shown: &FigureViews, build: &ModelBuild, others: &[MethodPictures], snapshot: &Snapshot) -> ResultTable {
    let unit = snapshot.unit();
    let (bound, error) = (format!("bound, {unit}"), format!("largest error, {unit}"));
    let columns = ["method", "ratio", "bytes", &bound, &error, "far: masked PSNR, dB", "near, dB", "mean, dB", "SSIM"];
    let mut t = ResultTable::new("figures", "Measurements of these pictures, from the same run", &columns);
    let raw = snapshot.position_bytes() as f64;
    let scored = |scores: &[Score]| {
        let decibels = |value: Option<f64>| TableCell::decibels(value.as_slice());
        let cell_of = |o| decibels(mean_of(scores, o, masked));
        [cell_of("far"), cell_of("near"), decibels(mean(scores, masked)), TableCell::number(mean(scores, ssim), 4)]
    };
    let row = |name: &str, bytes: u64, bounds: [Option<f64>; 2], scores: &[Score]| {
        let bounds = bounds.map(|b| TableCell::number(b, 4));
        let first = [TableCell::text(name), TableCell::number(raw / bytes as f64, 1), TableCell::count(bytes)];
        first.into_iter().chain(bounds).chain(scored(scores)).collect::<Vec<_>>()
    };
    t.row(row("the model", build.bytes.len() as u64, [None; 2], &shown.scores));
    for o in others {
        t.row(row(&o.name, o.bytes, [o.bound.map(|b| b.asked), o.bound.map(|b| b.largest_error)], &o.scores));
    }
    t
}

fn notes(build: &ModelBuild, snapshot: &Snapshot, others: &[MethodPictures]) -> Vec<String> {
    let names: Vec<&str> = others.iter().map(|o| o.name.as_str()).collect();
    let unit = snapshot.unit();
    let streaks = match others.iter().any(|o| o.name.starts_with(STREAKS)) {
        true => String::new(),
        false => {
            format!(" {STREAKS}, which the paper shows, was not available, so the best other compressor is shown.")
        }
    };
    vec![format!(
        "The model has ratio {:.0} and {} bytes. The other methods ({}) have a size within 1 % of the model's, or \
         their nearest; where a method has a bound ({unit}), every decoded coordinate was checked against \
         it.{streaks} Pictures of particles follow ParaView's exact rules, and the model's pictures have the same \
         look. The radius and the opacity of each view are drawn from the published ranges.",
        snapshot.position_bytes() as f64 / build.bytes.len() as f64,
        build.bytes.len(),
        names.join("; "),
    )]
}

/// A method at one size, with its pictures.
struct MethodPictures {
    name: String,
    bytes: u64,
    /// Its bound and largest error, if it has a bound.
    bound: Option<BoundReport>,
    /// Pictures of the decoded particles, one per view of the truth.
    pictures: Vec<Gray8>,
    scores: Vec<Score>,
}

impl MethodPictures {
    /// Mean masked PSNR of its pictures, dB; infinite if none differs from the truth.
    fn masked(&self) -> Option<f64> {
        mean(&self.scores, masked)
    }
}

/// Every other method at about `bytes`, drawn in the views of `truth`, and notes on those that failed.
fn at_size(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    bytes: u64,
    truth: &ReferenceViews,
) -> Result<(Vec<MethodPictures>, Vec<String>)> {
    let (mut others, mut failed) = (Vec::new(), Vec::new());
    for method in CompressionMethod::all(lab).into_iter().filter(|m| *m != CompressionMethod::OpticalDepth) {
        match other(lab, snapshot, method, bytes, truth) {
            Ok(other) => others.push(other),
            Err(e @ (Error::Cancelled | Error::Io { .. })) => return Err(e),
            Err(e) => failed.push(format!("{} was skipped: {e}", method.name(lab))),
        }
    }
    Ok((others, failed))
}

fn other(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    method: CompressionMethod,
    bytes: u64,
    truth: &ReferenceViews,
) -> Result<MethodPictures> {
    let seed = lab.settings.seed;
    let inputs = (method.source(lab), &snapshot.hash, bytes, seed);
    // Made on demand, for the first picture or number that is not cached.
    let mut cached_output: Option<MethodOutput> = None;
    let keep = || -> Result<MethodOutput> { method.keep(lab, &snapshot.particles, &snapshot.hash, bytes, seed) };
    let (size, bound) = lab.store.result("other", &inputs, || {
        let output = cached_output.insert(keep()?);
        Ok((output.bytes, output.bound))
    })?;
    let draw = |view: &View| {
        kept_picture(lab, &("other", &inputs, cache_key(view, truth.size)), || {
            let FileContent::Particles(particles, factor) = &or_made(&mut cached_output, keep)?.content else {
                return Err(Error::input(method.name(lab), "returned no particles"));
            };
            let view = View { radius: view.radius * factor, ..view.clone() };
            lab.draws_particles(particles, truth.bounds, Style::Paraview)?(&view, truth.size)
        })
    };
    let pictures: Vec<Gray8> = truth.views.iter().map(draw).collect::<Result<_>>()?;
    let scores = scores(truth, &pictures)?;
    Ok(MethodPictures { name: method.name(lab), bytes: size, bound, pictures, scores })
}

/// Scores pictures against `truth`, in its order.
fn scores(truth: &ReferenceViews, pictures: &[Gray8]) -> Result<Vec<Score>> {
    let mut pictures = pictures.iter().cloned();
    truth.score(|view| pictures.next().ok_or_else(|| Error::argument(format!("there is no picture of {}", view.name))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::picture::Size;

    fn other(name: &str, masked: f64) -> MethodPictures {
        let score = Score { view: "far_00".into(), psnr: None, masked: Some(masked), ssim: None };
        MethodPictures { name: name.into(), bytes: 1, bound: None, pictures: vec![], scores: vec![score] }
    }

    #[test]
    fn the_best_method_with_a_name_is_shown() {
        let list = [other("LCP", 20.0), other("SZ3, file order", 17.0), other("SZ3, Morton order", 18.0)];
        assert_eq!(best(&list, STREAKS).map(|o| o.name.as_str()), Some("SZ3, Morton order"));
        assert_eq!(best(&list, "").map(|o| o.name.as_str()), Some("LCP"));
        assert_eq!(best(&list[..1], STREAKS).map(|o| o.name.as_str()), Some("LCP"));
        assert!(best(&[], STREAKS).is_none());
    }

    #[test]
    fn panels_are_cut_to_one_size() {
        let picture = |width: usize, height: usize| {
            let size = Size { width, height };
            Rgb8 { size, data: (0..size.pixels()).map(|i| [i as u8; 3]).collect() }
        };
        let mut panels = vec![(String::new(), picture(4, 2)), (String::new(), picture(2, 4))];
        same_size(&mut panels);
        assert_eq!(
            (&panels[0].1.data[..], &panels[1].1.data[..]),
            (&[[1; 3], [2; 3], [5; 3], [6; 3]][..], &[[2; 3], [3; 3], [4; 3], [5; 3]][..])
        );
    }
}
