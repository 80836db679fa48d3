//! Plots of statistics, and the central slices.

use particlegs_core::Result;
use particlegs_core::model::per_length;
use particlegs_core::picture::{Colormap, Rgb8, Size};
use particlegs_figure::{
    self, ColourBar, EdgeAxis, Figure, FigureImage, FigureSpace, FileKind, Panel, PaperColour, Plot, PlotAxis, Point,
    Series, png_file::PngMetadata, write_plots,
};
use particlegs_files::output::write_bytes;
use particlegs_files::png::write_png;
use particlegs_measure::stats::{
    AxisProfile, Convention, DensityReport, JointHistogram, MultipoleShell, NearestDistances, PairCounts, Shell,
    SizeClass, Statistics,
};
use std::path::Path;

/// Axis labels with the unit of length, if it is known.
pub struct AxisUnits {
    length: String,
    wave: String,
    pub volume: String,
}

impl AxisUnits {
    pub fn new(unit: Option<&str>) -> Self {
        let brackets = |of: fn(&str) -> String| unit.map_or(String::new(), |u| format!(" [{}]", of(u)));
        let cubed = |u: &str| if u.contains(['/', ' ']) { format!("({u})³") } else { format!("{u}³") };
        AxisUnits { length: brackets(str::to_string), wave: brackets(per_length), volume: brackets(cubed) }
    }
}

/// Writes all plots of the statistics, in these formats.
pub fn write_all(folder: &Path, s: &Statistics, unit: Option<&str>, kinds: &[FileKind]) -> Result<()> {
    let units = AxisUnits::new(unit);
    let of_particles = groups(s).into_iter().chain(neighbours(s, &units)).chain(rdf(s, &units));
    let of_velocities = multipoles(s, &units).into_iter().chain(momentum(s, &units));
    let figures = spectra(s, &units).into_iter().chain(xi(s, &units)).chain(of_particles).chain(of_velocities);
    for figure in figures.chain(profiles(s, &units)).chain(halo_profile(s, &units)) {
        write_plots(folder, &figure, kinds)?;
    }
    if let Some(all) = &s.joint {
        let figure = joint(all);
        for kind in kinds {
            let (em, space) = match kind {
                FileKind::Png => (SLICE_LETTERS, FigureSpace::Pixels),
                _ => (POINTS, FigureSpace::Width(PAGE)),
            };
            let bytes = particlegs_figure::layout(&figure, em, space)?.bytes(*kind, &PngMetadata::default())?;
            write_bytes(&folder.join(format!("joint.{}", kind.name())), &bytes)?;
        }
    }
    if let Some(d) = &s.density {
        write_plots(folder, &pdf(d), kinds)?;
        for axis in 0..3 {
            let picture = slices(d, axis)?;
            let path = folder.join(format!("slice_{}.png", ["x", "y", "z"][axis]));
            write_png(&path, picture.size, picture.data.as_flattened())?;
        }
    }
    Ok(())
}

/// Styles of the curves of both sides, and of a third.
const TRUTH: usize = 8;
const OTHER: usize = 1;
const THIRD: usize = 0;

/// A plot, and below it the ratio of its curves, if any.
type ChartParts = Vec<Plot>;
type Points = Vec<(f64, f64)>;

fn curve(name: &str, style: usize, dashed: bool, points: Points) -> Series {
    let points = points.into_iter().filter(|p| p.1.is_finite()).map(|(x, y)| Point::new(x, y)).collect();
    Series { name: name.into(), style, dashed, points }
}

fn log(label: impl Into<String>) -> PlotAxis {
    PlotAxis::logarithmic(label)
}

fn even(label: impl Into<String>) -> PlotAxis {
    PlotAxis::linear(label)
}

fn pair([a, b]: [Points; 2]) -> Vec<Series> {
    vec![curve("truth", TRUTH, false, a), curve("other", OTHER, false, b)]
}

fn chart(name: &str, title: &str, axes: [PlotAxis; 2], mut series: Vec<Series>, ratio: Points) -> ChartParts {
    let [x, y] = axes;
    // Lines skip values that a logarithmic axis cannot show.
    series.iter_mut().for_each(|s| s.points.retain(|p| !y.log || p.y > 0.0));
    let below = (!ratio.is_empty()).then(|| ratio_plot(&x, ratio));
    let plot = Plot { name: name.into(), title: title.into(), x, y, series, levels: Vec::new() };
    [plot].into_iter().chain(below).collect()
}

/// Values of both sides at the same places, and their ratio if the truth's is above `least`.
fn compared(name: &str, title: &str, axes: [PlotAxis; 2], rows: &[(f64, [f64; 2])], least: f64) -> ChartParts {
    let side = |k: usize| rows.iter().map(|(at, values)| (*at, values[k])).collect();
    let known = rows.iter().filter(|(_, [truth, _])| *truth > least);
    chart(name, title, axes, pair([side(0), side(1)]), known.map(|(at, [truth, other])| (*at, other / truth)).collect())
}

/// other / truth, from 0.85 to 1.15 or as far as it goes within 0 to 2, in bands of 5 % and 10 %.
fn ratio_plot(x: &PlotAxis, mut ratio: Points) -> Plot {
    ratio.retain(|p| p.1.is_finite());
    let reach = (1.15 * ratio.iter().map(|p| (p.1 - 1.0).abs()).fold(0.0, f64::max)).clamp(0.15, 1.0);
    ratio.iter_mut().for_each(|p| p.1 = p.1.clamp(1.0 - reach, 1.0 + reach));
    Plot {
        name: String::new(),
        title: String::new(),
        x: x.clone(),
        y: PlotAxis::ratios("other / truth", [1.0 - reach, 1.0 + reach]),
        series: vec![curve("", OTHER, false, ratio)],
        levels: vec![(String::new(), 1.0)],
    }
}

fn spectra(s: &Statistics, u: &AxisUnits) -> Vec<ChartParts> {
    let Some(p) = &s.spectra else { return Vec::new() };
    let of = |side: usize| p.shells.iter().map(|h| (h.k, h.power[side])).collect::<Vec<_>>();
    let corrected = match s.options.convention {
        Convention::Correct => "shot noise subtracted",
        Convention::Paper => "shot noise included",
    };
    let picked = |pick: fn(&Shell) -> Option<f64>| p.shells.iter().filter_map(|h| Some((h.k, pick(h)?))).collect();
    let k = log(format!("k{}", u.wave));
    let power = [k.clone(), log(format!("P(k){}", u.volume))];
    let title = format!("Power spectrum ({corrected})");
    let curves = vec![
        curve("with shot noise", OTHER, false, picked(|h| h.r)),
        curve("without shot noise", THIRD, false, picked(|h| h.r_without_noise.filter(|r| *r < 1.5))),
    ];
    let mut coherence = chart("coherence", "Cross-correlation coefficient", [k, even("r(k)")], curves, Vec::new());
    coherence[0].levels = [1.0, 0.99, 0.9].map(|level| (String::new(), level)).into();
    vec![chart("power", &title, power, pair([of(0), of(1)]), picked(|h| h.ratio)), coherence]
}

/// P0 and the size of P2; the ratio is that of P0.
fn multipoles(s: &Statistics, u: &AxisUnits) -> Option<ChartParts> {
    let m = s.multipoles.as_ref()?;
    let of = |pick: fn(&MultipoleShell) -> f64| m.shells.iter().map(|h| (h.k, pick(h))).collect::<Points>();
    let series = vec![
        curve("P0, truth", TRUTH, false, of(|h| h.monopole[0])),
        curve("P0, other", OTHER, false, of(|h| h.monopole[1])),
        curve("|P2|, truth", TRUTH, true, of(|h| h.quadrupole[0].abs())),
        curve("|P2|, other", OTHER, true, of(|h| h.quadrupole[1].abs())),
    ];
    let axes = [log(format!("k{}", u.wave)), log(format!("P(k){}", u.volume))];
    let ratio = m.shells.iter().filter(|h| h.monopole[0] > 0.0).map(|h| (h.k, h.monopole[1] / h.monopole[0]));
    let title = "Multipoles in redshift space (shot noise subtracted); below, P0";
    Some(chart("multipoles", title, axes, series, ratio.collect()))
}

fn momentum(s: &Statistics, u: &AxisUnits) -> Option<ChartParts> {
    let m = s.momentum.as_ref()?;
    let rows: Vec<_> = m.shells.iter().map(|h| (h.k, h.power)).collect();
    let unit = match (&s.velocity_unit, u.volume.trim().trim_matches(['[', ']'])) {
        (Some(velocity), volume) if !volume.is_empty() => format!(" [({velocity})² {volume}]"),
        _ => String::new(),
    };
    let axes = [log(format!("k{}", u.wave)), log(format!("P(k) of (1 + delta) v{unit}"))];
    Some(compared("momentum", "Power spectrum of the momentum (shot noise subtracted)", axes, &rows, 0.0))
}

fn xi(s: &Statistics, u: &AxisUnits) -> Option<ChartParts> {
    let middle = |e: &[f64], i: usize| (e[i] * e[i + 1]).sqrt();
    let axes = [log(format!("r{}", u.length)), log("xi(r)")];
    let of = |edges: &[f64], xi: [&[f64]; 2]| {
        let rows: Vec<_> = (0..xi[0].len()).map(|i| (middle(edges, i), [xi[0][i], xi[1][i]])).collect();
        compared("xi", "Two-point correlation", axes.clone(), &rows, 0.0)
    };
    let by_pairs = s.xi_by_pairs.as_ref().map(|[a, b]| of(&a.edges, [&a.xi, &b.xi]));
    let mut by_transform = s.xi_by_transform.as_ref().map(|x| of(&x.edges, x.xi.each_ref().map(|v| &v[..])));
    for curve in by_transform.iter_mut().flat_map(|parts| &mut parts[0].series) {
        (curve.name, curve.dashed) = (format!("{}, by transform", curve.name), true);
    }
    let mut all = by_pairs.into_iter().chain(by_transform);
    let mut whole = all.next()?;
    let mut more = all.flatten();
    whole[0].series.extend(more.next().into_iter().flat_map(|plot| plot.series));
    if whole.len() == 1 {
        whole.extend(more);
    }
    Some(whole)
}

fn groups(s: &Statistics) -> Option<ChartParts> {
    let of = |c: &SizeClass| {
        let to = c.to.map_or(c.from as f64 * std::f64::consts::SQRT_2, |t| (t + 1) as f64);
        ((c.from as f64 * to).sqrt(), c.groups.map(|n| n as f64))
    };
    let rows: Vec<_> = s.groups.as_ref()?.histogram.iter().map(of).collect();
    let axes = [log("particles in a group"), log("groups per bin")];
    Some(compared("groups", "Friends-of-friends groups by size", axes, &rows, 0.0))
}

fn neighbours(s: &Statistics, u: &AxisUnits) -> Option<ChartParts> {
    let of = |d: &NearestDistances| {
        (0..d.counts.len())
            .map(|i| ((d.edges[i] * d.edges[i + 1]).sqrt(), d.counts[i] as f64 / d.sampled as f64))
            .collect::<Vec<_>>()
    };
    let [a, b] = s.neighbours.as_ref()?.each_ref().map(of);
    // Both histograms share one grid of edges, but may have other ends.
    let ratio = a
        .iter()
        .filter(|p| p.1 > 1e-4)
        .filter_map(|p| Some((p.0, b.iter().find(|q| (q.0 / p.0 - 1.0).abs() < 1e-6)?.1 / p.1)))
        .collect();
    let axes = [log(format!("distance{}", u.length)), even("share per bin (20 per decade)")];
    Some(chart("neighbours", "Distance to the nearest neighbour", axes, pair([a, b]), ratio))
}

fn pdf(d: &DensityReport) -> ChartParts {
    let all: f64 = d.cells.iter().map(|n| *n as f64).product();
    let [truth, other] = &d.pdf.cells;
    let rows = d.pdf.edges.windows(2).zip(truth.iter().zip(other));
    let of = |(e, (a, b)): (&[f64], (&u64, &u64))| (10f64.powf(0.5 * (e[0] + e[1])), [*a, *b].map(|n| n as f64 / all));
    let axes = [log("density / mean"), log("share of cells per bin (10 per decade)")];
    compared("density_pdf", "Distribution of density", axes, &rows.map(of).collect::<Vec<_>>(), 0.0)
}

/// Above this g(r), a linear axis would show only the peak.
const TALL: f64 = 30.0;
/// Below this g(r) of the truth, ratios mean nothing.
const LEAST_G: f64 = 0.2;

fn rdf(s: &Statistics, u: &AxisUnits) -> Option<ChartParts> {
    let counts = s.rdf.as_ref()?;
    let [a, b] = counts.each_ref().map(PairCounts::g);
    let middles = counts[0].edges.windows(2).map(|e| 0.5 * (e[0] + e[1]));
    let rows: Vec<_> = middles.zip(a.iter().zip(&b)).map(|(r, (a, b))| (r, [*a, *b])).collect();
    let g = PlotAxis { log: a.iter().chain(&b).any(|g| *g > TALL), ..even("g(r)") };
    let axes = [even(format!("r{}", u.length)), g];
    let mut plots = compared("rdf", "Radial distribution function", axes, &rows, LEAST_G);
    plots[0].levels = vec![(String::new(), 1.0)];
    Some(plots)
}

fn profiles(s: &Statistics, u: &AxisUnits) -> Vec<ChartParts> {
    s.profiles.iter().flatten().zip(["x", "y", "z"]).map(|(p, axis)| profile(p, axis, u)).collect()
}

fn profile(p: &AxisProfile, axis: &str, u: &AxisUnits) -> ChartParts {
    let share = |side: usize, i: usize| if p.mean[side] > 0.0 { p.density[side][i] / p.mean[side] } else { 0.0 };
    let middles = p.edges.windows(2).map(|e| 0.5 * (e[0] + e[1]));
    let rows: Vec<_> = middles.enumerate().map(|(i, at)| (at, [share(0, i), share(1, i)])).collect();
    let axes = [even(format!("{axis}{}", u.length)), even("density / mean")];
    compared(&format!("profile_{axis}"), &format!("Density along {axis}"), axes, &rows, 0.0)
}

/// Mean density of shells around all centres, and median of enclosed masses.
fn halo_profile(s: &Statistics, u: &AxisUnits) -> Option<ChartParts> {
    let h = s.haloes.as_ref()?;
    let scale = h.radius.unwrap_or(1.0);
    let of = |side: usize| {
        let density = |shell: usize| (0..h.radii.len()).map(|i| h.density(i, shell)[side]).sum::<f64>();
        let middle = |shell: usize| scale * (h.edges[shell] * h.edges[shell + 1]).sqrt();
        let per = h.count as f64 * h.mean_density[side];
        (0..h.edges.len() - 1).map(|shell| (middle(shell), density(shell) / per)).collect()
    };
    let ratio = h.edges.iter().zip(&h.median).filter_map(|(edge, median)| Some((scale * edge, (*median)?)));
    let r = h.radius.map_or("r / largest radius".into(), |_| format!("r{}", u.length));
    let title = format!("Density around {} centres; below, mass within r (median)", h.count);
    let axes = [log(r), log("density / mean of the box")];
    Some(chart("halo_profile", &title, axes, pair([of(0), of(1)]), ratio.collect()))
}

/// Font size of slices, pixels; of a page of histograms, points, and its width.
const SLICE_LETTERS: f64 = 16.0;
const POINTS: f64 = 9.0;
const PAGE: f64 = 500.0;
/// Shares of a cell that have colours, below the largest.
const LEAST_SHARE: f64 = 1e-4;

/// Truth and other side by side, a row a particle type: the logarithm of the share of mass in a cell over the largest.
fn joint(all: &[JointHistogram]) -> Figure {
    let color = |share: f64| match share.log10() / -LEAST_SHARE.log10() + 1.0 {
        v if v >= 0.0 => Colormap::Viridis.color(v as f32),
        _ => [255; 3],
    };
    let mut panels = Vec::new();
    for j in all {
        let [columns, rows] = j.edges.each_ref().map(|e| e.len() - 1);
        // About 400 pixels along an edge, each cell a square of pixels.
        let scale = (400 / columns).max(1);
        let size = Size { width: columns * scale, height: rows * scale };
        let largest = j.share.iter().flatten().copied().fold(0.0, f64::max);
        let axes = [0, 1].map(|k| {
            let unit = j.units[k].as_ref().map_or(String::new(), |u| format!(" [{u}]"));
            let [low, high] = [j.edges[k][0], j.edges[k][j.edges[k].len() - 1]];
            let (name, [low, high]) = match j.logarithmic[k] {
                true => (format!("log10 {}", j.fields[k]), [low.log10(), high.log10()]),
                false => (j.fields[k].clone(), [low, high]),
            };
            EdgeAxis { label: name + &unit, low, high }
        });
        for (share, side) in j.share.iter().zip(["truth", "other"]) {
            let pixel = |at: usize| {
                let (across, up) = (at % size.width / scale, rows - 1 - at / size.width / scale);
                color(share[across * rows + up] / largest)
            };
            let picture = Rgb8 { size, data: (0..size.pixels()).map(pixel).collect() };
            panels.push(Panel {
                caption: Some(format!("{}: {side}", j.layer)),
                axes: Some(axes.clone()),
                ..Panel::plain(FigureImage::Color(picture))
            });
        }
    }
    let title = "mass in a cell / largest".into();
    let bar = ColourBar::logarithmic(title, [LEAST_SHARE, 1.0], |share| Colormap::Viridis.color(share));
    Figure { bar: Some(bar), ground: PaperColour::White, ..Figure::plain(panels, 2) }
}

/// Truth and other side by side, the logarithm of density from a tenth to a thousand times the mean.
fn slices(d: &DensityReport, axis: usize) -> Result<Rgb8> {
    let [columns, rows] = [[1, 2], [0, 2], [0, 1]][axis].map(|k: usize| d.cells[k]);
    // About 480 pixels along the longer side, each cell a square of pixels; the first axis is horizontal.
    let scale = (480 / columns.max(rows).max(1)).max(1);
    let size = Size { width: columns * scale, height: rows * scale };
    let picture = |values: &Vec<f32>| {
        let pixel = |at: usize| {
            let (across, up) = (at % size.width / scale, rows - 1 - at / size.width / scale);
            Colormap::Inferno.color((values[across * rows + up].log10() + 1.0) / 4.0)
        };
        Rgb8 { size, data: (0..size.pixels()).map(pixel).collect() }
    };
    let panel = |(values, name): (&Vec<f32>, &str)| Panel {
        caption: Some(name.to_string()),
        ..Panel::plain(FigureImage::Color(picture(values)))
    };
    let bar = ColourBar::logarithmic("density / mean".into(), [0.1, 1000.0], |share| Colormap::Inferno.color(share));
    let panels = d.slices[axis].iter().zip(["truth", "other"]).map(panel).collect();
    let whole = Figure { bar: Some(bar), ..Figure::plain(panels, 2) };
    particlegs_figure::raster(&particlegs_figure::layout(&whole, SLICE_LETTERS, FigureSpace::Pixels)?)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn units_of_volume_are_cubes() {
        assert_eq!(["Mpc/h", "kpc"].map(|u| AxisUnits::new(Some(u)).volume), [" [(Mpc/h)³]", " [kpc³]"]);
        assert_eq!(AxisUnits::new(None).volume, "");
    }
}
