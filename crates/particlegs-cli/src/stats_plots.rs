//! Statistics as pictures: one figure each, and the central slices.

use crate::figure::{self, BarPlacement, ColourBar, FigureImage, FigureSpace, Panel, PaperColour};
use crate::plots::{Chart, ChartCurve, write};
use particlegs::Result;
use particlegs::model::per_length;
use particlegs::picture::{Colormap, Rgb8, Size, write_png};
use particlegs::stats::{AxisProfile, Convention, DensityReport, NearestDistances, PairCounts, Shell, Statistics};
use std::path::Path;

/// Axis labels in the unit of length, where it is known.
struct AxisUnits {
    length: String,
    wave: String,
    volume: String,
}

impl AxisUnits {
    fn new(unit: Option<&str>) -> Self {
        match unit {
            None => AxisUnits { length: String::new(), wave: String::new(), volume: String::new() },
            Some(u) => AxisUnits {
                length: format!(" [{u}]"),
                wave: format!(" [{}]", per_length(u)),
                volume: if u.contains(['/', ' ']) { format!(" [({u})³]") } else { format!(" [{u}³]") },
            },
        }
    }
}

/// Writes every figure that the statistics have.
pub fn write_all(folder: &Path, s: &Statistics, unit: Option<&str>) -> Result<()> {
    let units = AxisUnits::new(unit);
    let of_particles = groups(s).into_iter().chain(neighbours(s, &units)).chain(rdf(s, &units));
    let figures = spectra(s, &units).into_iter().chain(xi(s, &units)).chain(of_particles);
    for figure in figures.chain(profiles(s, &units)).chain(halo_profile(s, &units)) {
        write(folder, &figure)?;
    }
    if let Some(d) = &s.density {
        write(folder, &pdf(d))?;
        for axis in 0..3 {
            let picture = slices(d, axis)?;
            let path = folder.join(format!("slice_{}.png", ["x", "y", "z"][axis]));
            write_png(&path, picture.size, picture.data.as_flattened())?;
        }
    }
    Ok(())
}

fn pair(points: [Vec<(f64, f64)>; 2]) -> Vec<ChartCurve> {
    let [a, b] = points;
    vec![
        ChartCurve { name: "truth", side: 0, dots: false, points: a },
        ChartCurve { name: "other", side: 1, dots: false, points: b },
    ]
}

fn spectra(s: &Statistics, u: &AxisUnits) -> Vec<Chart<'static>> {
    let Some(p) = &s.spectra else { return Vec::new() };
    let of = |side: usize| p.shells.iter().map(|h| (h.k, h.power[side])).collect::<Vec<_>>();
    let corrected = match s.options.convention {
        Convention::Correct => "shot noise subtracted",
        Convention::Paper => "shot noise included",
    };
    let r = |name, side, pick: fn(&Shell) -> Option<f64>| ChartCurve {
        name,
        side,
        dots: false,
        points: p.shells.iter().filter_map(|h| Some((h.k, pick(h)?))).collect(),
    };
    vec![
        Chart {
            name: "power",
            title: format!("Power spectrum ({corrected})"),
            x: format!("k{}", u.wave),
            y: format!("P(k){}", u.volume),
            log_x: true,
            log_y: true,
            curves: pair([of(0), of(1)]),
            ratio: p.shells.iter().filter_map(|h| Some((h.k, h.ratio?))).collect(),
            levels: vec![],
        },
        Chart {
            name: "coherence",
            title: "Cross-correlation coefficient".into(),
            x: format!("k{}", u.wave),
            y: "r(k)".into(),
            log_x: true,
            log_y: false,
            curves: vec![
                r("with shot noise", 1, |h| h.r),
                r("without shot noise", 2, |h| h.r_without_noise.filter(|r| *r < 1.5)),
            ],
            ratio: vec![],
            levels: vec![1.0, 0.99, 0.9],
        },
    ]
}

fn xi(s: &Statistics, u: &AxisUnits) -> Option<Chart<'static>> {
    let middle = |e: &[f64], i: usize| (e[i] * e[i + 1]).sqrt();
    let mut curves = Vec::new();
    let mut ratio = Vec::new();
    if let Some([a, b]) = &s.xi_by_pairs {
        let of = |c: &PairCounts| (0..c.xi.len()).map(|i| (middle(&c.edges, i), c.xi[i])).collect::<Vec<_>>();
        curves.extend(pair([of(a), of(b)]));
        let above = |i: &usize| a.xi[*i] > 0.0;
        ratio = (0..a.xi.len()).filter(above).map(|i| (middle(&a.edges, i), b.xi[i] / a.xi[i])).collect();
    }
    if let Some(x) = &s.xi_by_transform {
        for (side, name) in [(0, "truth, by transform"), (1, "other, by transform")] {
            let points = (0..x.xi[side].len()).map(|i| (middle(&x.edges, i), x.xi[side][i])).collect();
            curves.push(ChartCurve { name, side, dots: true, points });
        }
        if ratio.is_empty() {
            let of = |i: usize| (middle(&x.edges, i), x.xi[1][i] / x.xi[0][i]);
            ratio = (0..x.xi[0].len()).filter(|i| x.xi[0][*i] > 0.0).map(of).collect();
        }
    }
    (!curves.is_empty()).then(|| Chart {
        name: "xi",
        title: "Two-point correlation".into(),
        x: format!("r{}", u.length),
        y: "xi(r)".into(),
        log_x: true,
        log_y: true,
        curves,
        ratio,
        levels: vec![],
    })
}

fn groups(s: &Statistics) -> Option<Chart<'static>> {
    let g = s.groups.as_ref()?;
    let middle = |i: usize| {
        let c = &g.histogram[i];
        (c.from as f64 * c.to.map_or(c.from as f64 * std::f64::consts::SQRT_2, |t| (t + 1) as f64)).sqrt()
    };
    let of = |side: usize| (0..g.histogram.len()).map(|i| (middle(i), g.histogram[i].groups[side] as f64)).collect();
    Some(Chart {
        name: "groups",
        title: "Friends-of-friends groups by size".into(),
        x: "particles in a group".into(),
        y: "groups per bin".into(),
        log_x: true,
        log_y: true,
        curves: pair([of(0), of(1)]),
        ratio: (0..g.histogram.len()).filter_map(|i| Some((middle(i), g.histogram[i].ratio?))).collect(),
        levels: vec![],
    })
}

fn neighbours(s: &Statistics, u: &AxisUnits) -> Option<Chart<'static>> {
    let of = |d: &NearestDistances| {
        (0..d.counts.len())
            .map(|i| ((d.edges[i] * d.edges[i + 1]).sqrt(), d.counts[i] as f64 / d.sampled as f64))
            .collect::<Vec<_>>()
    };
    let [a, b] = s.neighbours.as_ref()?.each_ref().map(of);
    // Both histograms have edges of one lattice, if not the same ends.
    let ratio = a
        .iter()
        .filter(|p| p.1 > 1e-4)
        .filter_map(|p| Some((p.0, b.iter().find(|q| (q.0 / p.0 - 1.0).abs() < 1e-6)?.1 / p.1)))
        .collect();
    Some(Chart {
        name: "neighbours",
        title: "Distance to the nearest neighbour".into(),
        x: format!("distance{}", u.length),
        y: "share per bin (20 per decade)".into(),
        log_x: true,
        log_y: false,
        curves: pair([a, b]),
        ratio,
        levels: vec![],
    })
}

fn pdf(d: &DensityReport) -> Chart<'static> {
    let middle = |i: usize| 10f64.powf(0.5 * (d.pdf.edges[i] + d.pdf.edges[i + 1]));
    let all: f64 = d.cells.iter().map(|n| *n as f64).product();
    let of =
        |side: usize| (0..d.pdf.cells[side].len()).map(|i| (middle(i), d.pdf.cells[side][i] as f64 / all)).collect();
    let ratio = |i: usize| {
        let [a, b] = [0, 1].map(|side| d.pdf.cells[side][i] as f64);
        (a > 0.0).then(|| (middle(i), b / a))
    };
    Chart {
        name: "density_pdf",
        title: "Distribution of density".into(),
        x: "density / mean".into(),
        y: "share of cells per bin (10 per decade)".into(),
        log_x: true,
        log_y: true,
        curves: pair([of(0), of(1)]),
        ratio: (0..d.pdf.cells[0].len()).filter_map(ratio).collect(),
        levels: vec![],
    }
}

/// g(r) above which an axis that is not logarithmic shows nothing but its peak.
const TALL: f64 = 30.0;
/// g(r) of the truth below which a ratio says nothing.
const LEAST_G: f64 = 0.2;

fn rdf(s: &Statistics, u: &AxisUnits) -> Option<Chart<'static>> {
    let counts = s.rdf.as_ref()?;
    let middle = |i: usize| 0.5 * (counts[0].edges[i] + counts[0].edges[i + 1]);
    let [a, b] = counts.each_ref().map(PairCounts::g);
    let of = |g: &[f64]| g.iter().enumerate().map(|(i, g)| (middle(i), *g)).collect::<Vec<_>>();
    Some(Chart {
        name: "rdf",
        title: "Radial distribution function".into(),
        x: format!("r{}", u.length),
        y: "g(r)".into(),
        log_x: false,
        log_y: a.iter().chain(&b).any(|g| *g > TALL),
        curves: pair([of(&a), of(&b)]),
        ratio: (0..a.len()).filter(|i| a[*i] > LEAST_G).map(|i| (middle(i), b[i] / a[i])).collect(),
        levels: vec![1.0],
    })
}

fn profiles(s: &Statistics, u: &AxisUnits) -> Vec<Chart<'static>> {
    let names = [("profile_x", "x"), ("profile_y", "y"), ("profile_z", "z")];
    let profiles = s.profiles.iter().flatten();
    profiles.zip(names).map(|(p, (file, axis))| profile(p, file, axis, u)).collect()
}

fn profile(p: &AxisProfile, file: &'static str, axis: &str, u: &AxisUnits) -> Chart<'static> {
    let share = |side: usize, i: usize| if p.mean[side] > 0.0 { p.density[side][i] / p.mean[side] } else { 0.0 };
    let at = |i: usize| 0.5 * (p.edges[i] + p.edges[i + 1]);
    let bins = p.edges.len() - 1;
    let of = |side: usize| (0..bins).map(|i| (at(i), share(side, i))).collect();
    Chart {
        name: file,
        title: format!("Density along {axis}"),
        x: format!("{axis}{}", u.length),
        y: "density / mean".into(),
        log_x: false,
        log_y: false,
        curves: pair([of(0), of(1)]),
        ratio: (0..bins).filter(|i| share(0, *i) > 0.0).map(|i| (at(i), share(1, i) / share(0, i))).collect(),
        levels: vec![],
    }
}

/// The mean density of shells about all centres, and the median of enclosed masses.
fn halo_profile(s: &Statistics, u: &AxisUnits) -> Option<Chart<'static>> {
    let h = s.haloes.as_ref()?;
    let scale = h.radius.unwrap_or(1.0);
    let of = |side: usize| {
        let density = |shell: usize| (0..h.radii.len()).map(|i| h.density(i, shell)[side]).sum::<f64>();
        let middle = |shell: usize| scale * (h.edges[shell] * h.edges[shell + 1]).sqrt();
        let per = h.count as f64 * h.mean_density[side];
        (0..h.edges.len() - 1).map(|shell| (middle(shell), density(shell) / per)).collect()
    };
    let ratio = h.edges.iter().zip(&h.median).filter_map(|(edge, median)| Some((scale * edge, (*median)?)));
    Some(Chart {
        name: "halo_profile",
        title: format!("Density about {} centres; below, mass within r (median)", h.count),
        x: if h.radius.is_some() { format!("r{}", u.length) } else { "r / largest radius".into() },
        y: "density / mean of the box".into(),
        log_x: true,
        log_y: true,
        curves: pair([of(0), of(1)]),
        ratio: ratio.collect(),
        levels: vec![],
    })
}

/// Height of letters about slices, pixels.
const SLICE_LETTERS: f64 = 16.0;

/// Truth and other side by side, the logarithm of density from a tenth to a thousand times the mean.
fn slices(d: &DensityReport, axis: usize) -> Result<Rgb8> {
    let [columns, rows] = [[1, 2], [0, 2], [0, 1]][axis].map(|k: usize| d.cells[k]);
    // About 480 pixels along the longer side, cells as squares of pixels; the first axis across.
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
    let whole = figure::Figure {
        title: None,
        panels: d.slices[axis].iter().zip(["truth", "other"]).map(panel).collect(),
        columns: 2,
        bar: Some(bar),
        legend: Vec::new(),
        place: BarPlacement::Outside,
        page: PaperColour::White,
        ground: PaperColour::Black,
    };
    figure::raster(&figure::layout(&whole, SLICE_LETTERS, FigureSpace::Pixels)?)
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
