//! Pictures of the model, and of particles drawn from it, against pictures of all particles (paper, figure "Three-way
//! comparison").

use super::crops::{BRIGHTENED, close_up, whole};
use crate::lab::{Lab, ModelBuild, Style, or_made};
use crate::results::{Pictures, Plot, PlotAxis, PlotSeries, Point, ResultTable, Spread, TableCell};
use crate::snapshot::Snapshot;
use crate::views::{self, ReferenceViews, Score, cache_key, kept_picture, mean_of_values, orbit};
use particlegs_core::Result;
use particlegs_core::camera::View;
use particlegs_core::picture::Gray8;
use particlegs_fit::recover::Method;

/// The paper's means over its frames, dB (\ThreeWayGsAvg, \ThreeWayRecAvg).
const PAPER: [(&str, f64); 2] = [("model", 27.56), ("count", 16.95)];
/// Recovery methods shown: the paper's, and ours with better spacing and counts.
const METHODS: [Method; 3] = [Method::Count, Method::Stratified, Method::Spaced];
const ORBITS: [&str; 3] = ["far", "mid", "near"];

/// Scores of the model or of one recovery method.
struct RendererScores {
    name: String,
    scores: Vec<Score>,
    pictures: Vec<Gray8>,
}

impl RendererScores {
    fn label(&self) -> String {
        if self.name == "model" { "the model".into() } else { format!("particles by {}", self.name) }
    }
}

pub(super) struct ThreeWayComparison {
    pub tables: Vec<ResultTable>,
    pub plots: Vec<Plot>,
    pub pictures: Vec<Pictures>,
    pub note: String,
}

/// Compares a model's `pictures` and `scores` with those of particles drawn from it.
pub(super) fn three_way(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    build: &ModelBuild,
    truth: &ReferenceViews,
    pictures: Vec<Gray8>,
    scores: Vec<Score>,
) -> Result<ThreeWayComparison> {
    let mut ways = vec![RendererScores { name: "model".into(), pictures, scores }];
    for method in METHODS {
        ways.push(drawn(lab, snapshot, build, truth, method)?);
    }
    Ok(ThreeWayComparison {
        tables: vec![table(&ways)],
        plots: vec![plot(&ways)],
        pictures: vec![shown(truth, &ways)],
        note: note(&ways, truth),
    })
}

/// Particles drawn from the model in the truth's views, as ParaView draws them.
fn drawn(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    build: &ModelBuild,
    truth: &ReferenceViews,
    method: Method,
) -> Result<RendererScores> {
    let seed = lab.settings.seed;
    let hash = blake3::hash(&build.bytes).to_hex().to_string();
    let mut particles = None;
    let draw = |view: &View| {
        let inputs = ("recovered", &snapshot.hash, &hash, method.name(), seed, cache_key(view, truth.size));
        kept_picture(lab, &inputs, || {
            let particles = or_made(&mut particles, || lab.drawn(build.model.clone(), method, seed))?;
            lab.draws_particles(particles, particles.bounds(), Style::Paraview)?(view, truth.size)
        })
    };
    let pictures: Vec<Gray8> = truth.views.iter().map(draw).collect::<Result<_>>()?;
    let scores = super::scores(truth, &pictures)?;
    Ok(RendererScores { name: method.name().into(), pictures, scores })
}

/// Masked PSNR of the views of one orbit, or of all.
fn masked(scores: &[Score], orbit_name: Option<&str>) -> Vec<f64> {
    scores.iter().filter(|s| orbit_name.is_none_or(|o| orbit(&s.view) == o)).filter_map(views::masked).collect()
}

fn table(ways: &[RendererScores]) -> ResultTable {
    let title = "Masked PSNR against all particles: median over frames, and range, dB";
    let columns = ["picture of", "far", "mid", "near", "all views", "mean of all views", "paper: mean"];
    let mut t = ResultTable::new("three-way", title, &columns);
    for way in ways {
        let orbits = ORBITS.iter().map(|o| TableCell::decibels(&masked(&way.scores, Some(o))));
        let all = masked(&way.scores, None);
        let mean = TableCell::decibels(mean_of_values(&all).as_slice());
        let paper = PAPER.iter().find(|p| p.0 == way.name).map(|p| p.1);
        let rest = [TableCell::decibels(&all), mean, TableCell::number(paper, 2)];
        t.row([TableCell::text(way.label())].into_iter().chain(orbits).chain(rest));
    }
    t
}

/// Masked PSNR by view, orbit after orbit.
fn plot(ways: &[RendererScores]) -> Plot {
    let series = ways.iter().enumerate().map(|(style, way)| PlotSeries {
        name: if way.name == "model" { "model".into() } else { format!("particles by {}", way.name) },
        style,
        dashed: style > 0,
        points: (way.scores.iter().enumerate())
            .filter_map(|(i, s)| Some(Point::new(i as f64 + 1.0, views::masked(s)?)))
            .collect(),
    });
    let levels = ways.iter().take(2).filter_map(|way| {
        let name = if way.name == "model" { "model, median" } else { "count, median" };
        Some((name.to_string(), Spread::new(&masked(&way.scores, None))?.median))
    });
    let frames = ways.first().map_or(0, |w| masked(&w.scores, Some("far")).len());
    Plot {
        name: "three-way-decibels".into(),
        title: "Pictures of the model and of particles drawn from it, against all particles".into(),
        x: PlotAxis::linear(format!("view: 1 to {frames} far, to {} mid, to {} near", 2 * frames, 3 * frames)),
        y: PlotAxis::linear("masked PSNR, dB"),
        series: series.collect(),
        levels: levels.collect(),
    }
}

/// A whole far view and a close-up of a near one: all particles, model, particles drawn by `count`.
fn shown(truth: &ReferenceViews, ways: &[RendererScores]) -> Pictures {
    let mut panels = Vec::new();
    for orbit_name in ["far", "near"] {
        let Some(i) = truth.views.iter().position(|v| orbit(&v.name) == orbit_name) else { continue };
        let cut = |p: &Gray8| if orbit_name == "far" { whole(p) } else { close_up(p) };
        panels.push((format!("{orbit_name}: all particles"), cut(&truth.pictures[i])));
        for way in ways.iter().take(2) {
            let name = way.label();
            let score = way.scores[i].masked.map_or("identical".into(), |v| format!("{v:.2} dB"));
            panels.push((format!("{orbit_name}: {name}, {score}"), cut(&way.pictures[i])));
        }
    }
    // Panels need one size.
    super::same_size(&mut panels);
    Pictures {
        name: "three-way".into(),
        title: "All particles, the model, and particles drawn from it".into(),
        caption: format!(
            "Top: the first far view. Bottom: the centre 30 % of the first near view. {BRIGHTENED} Decibels are the \
             masked PSNR of whole views at original levels against all particles, measured in this run."
        ),
        columns: 3,
        colours: None,
        panels,
    }
}

fn note(ways: &[RendererScores], truth: &ReferenceViews) -> String {
    let same = views::identical_note(ways.iter().map(|w| (w.name.clone(), &w.scores[..])));
    let same = same.map_or(String::new(), |words| format!(" {words}"));
    let median = |way: &RendererScores| Spread::new(&masked(&way.scores, None)).map(|s| s.median);
    let gap = ways.first().and_then(median).zip(ways.get(1).and_then(median)).map(|(a, b)| a - b);
    let gap = gap.map_or("not measured".into(), |g| format!("{g:.1} dB"));
    format!(
        "Three-way comparison: {} views, with radius and opacity drawn from the published ranges. Particles drawn \
         from the model (first seed) and all particles are rendered by ParaView's rules. The median of the model is \
         {gap} above that of particles drawn by `count` (paper: 11 dB). Drawn particles have their own shot noise, \
         which differs from the truth's even if the density is perfect.{same}",
        truth.views.len()
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::picture::Size;

    fn way(name: &str, values: &[(&str, f64)]) -> RendererScores {
        let score = |(view, v): &(&str, f64)| Score { view: (*view).into(), psnr: None, masked: Some(*v), ssim: None };
        let picture = Gray8::black(Size { width: 1, height: 1 });
        RendererScores {
            name: name.into(),
            scores: values.iter().map(score).collect(),
            pictures: vec![picture; values.len()],
        }
    }

    #[test]
    fn tables_show_medians_and_the_papers_numbers() {
        let model = way("model", &[("far_00", 30.0), ("far_01", 32.0), ("near_00", 28.0)]);
        let t = table(&[model, way("spaced", &[("far_00", 20.0)])]);
        assert_eq!(t.rows[0][1], TableCell::Spread { value: 31.0, range: [30.0, 32.0], digits: 2 });
        assert_eq!((&t.rows[0][2], &t.rows[0][3]), (&TableCell::Empty, &TableCell::number(28.0, 2)));
        assert_eq!((&t.rows[0][5], &t.rows[0][6]), (&TableCell::number(30.0, 2), &TableCell::number(27.56, 2)));
        assert_eq!((&t.rows[1][0], &t.rows[1][6]), (&TableCell::text("particles by spaced"), &TableCell::Empty));
    }
}
