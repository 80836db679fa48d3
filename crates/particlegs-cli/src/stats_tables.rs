//! Tables of statistics: CSV files, and a summary for the terminal.

use particlegs_core::model::{decimals, per_length};
use particlegs_core::{Result, text};
use particlegs_files::output::write_bytes;
use particlegs_measure::stats::{PairCounts, SizeClass, Statistics};
use std::path::Path;

struct Csv(String);

impl Csv {
    fn new(head: &str) -> Self {
        Csv(format!("{head}\n"))
    }

    fn write(&self, folder: &Path, name: &str) -> Result<()> {
        write_bytes(&folder.join(name), self.0.as_bytes())
    }
}

macro_rules! row {
    ($csv:ident: $($value:expr),*) => {
        $csv.0 += &([$($value.to_string()),*].join(",") + "\n")
    };
}

fn maybe(v: Option<impl ToString>) -> String {
    v.map_or(String::new(), |v| v.to_string())
}

/// Writes a CSV file for every statistic measured. Lengths are in the snapshot's unit.
pub fn write(folder: &Path, s: &Statistics) -> Result<()> {
    for (spectra, name) in [(&s.spectra, "power.csv"), (&s.momentum, "momentum.csv")] {
        let Some(spectra) = spectra else { continue };
        let mut csv = Csv::new("k_low,k_high,k,modes,power_truth,power_other,cross,ratio,r,r_without_noise");
        for h in &spectra.shells {
            row!(csv:
                h.edges[0], h.edges[1], h.k, h.modes, h.power[0], h.power[1], h.cross, maybe(h.ratio), maybe(h.r),
                maybe(h.r_without_noise));
        }
        csv.write(folder, name)?;
    }
    if let Some([a, b]) = &s.xi_by_pairs {
        let mut csv = Csv::new(
            "r_low,r_high,pairs_truth,pairs_other,primaries_truth,primaries_other,expected_truth,expected_other,xi_truth,xi_other,ratio",
        );
        for i in 0..a.pairs.len() {
            row!(csv:
                a.edges[i], a.edges[i + 1], a.pairs[i], b.pairs[i], a.primaries[i], b.primaries[i], a.expected[i],
                b.expected[i], a.xi[i], b.xi[i], maybe((a.xi[i] > 0.0).then(|| b.xi[i] / a.xi[i])));
        }
        csv.write(folder, "xi_pairs.csv")?;
    }
    if let Some(x) = &s.xi_by_transform {
        let mut csv = Csv::new("r_low,r_high,xi_truth,xi_other");
        for i in 0..x.edges.len() - 1 {
            row!(csv: x.edges[i], x.edges[i + 1], x.xi[0][i], x.xi[1][i]);
        }
        csv.write(folder, "xi_transform.csv")?;
    }
    if let Some(m) = &s.multipoles {
        let mut csv = Csv::new("k_low,k_high,k,modes,p0_truth,p0_other,p2_truth,p2_other,p4_truth,p4_other");
        for h in &m.shells {
            let ([a, b], [c, d], [e, f]) = (h.monopole, h.quadrupole, h.hexadecapole);
            row!(csv: h.edges[0], h.edges[1], h.k, h.modes, a, b, c, d, e, f);
        }
        csv.write(folder, "multipoles.csv")?;
    }
    if let Some(d) = &s.dispersion {
        let mut csv =
            Csv::new("centre,x,y,z,radius,particles_truth,particles_other,dispersion_truth,dispersion_other,ratio");
        for (i, (at, radius)) in d.centers.iter().zip(&d.radii).enumerate() {
            let ([x, y, z], [n, m], [a, b]) = (*at, &d.particles, &d.dispersion);
            row!(csv: i + 1, x, y, z, radius, n[i], m[i], a[i], b[i], maybe(d.ratio(i)));
        }
        csv.write(folder, "halo_dispersion.csv")?;
    }
    write_joint(folder, s)?;
    write_density(folder, s)?;
    write_rdf(folder, s)?;
    write_profiles(folder, s)?;
    write_haloes(folder, s)?;
    write_groups(folder, s)?;
    write_neighbours(folder, s)
}

fn write_joint(folder: &Path, s: &Statistics) -> Result<()> {
    let Some(all) = &s.joint else { return Ok(()) };
    let mut csv = Csv::new("particle_type,x_low,x_high,y_low,y_high,truth,other");
    for j in all {
        let ([x, y], [a, b], name) = (&j.edges, &j.share, text::cell(&j.layer));
        for cell in 0..a.len() {
            let (i, k) = (cell / (y.len() - 1), cell % (y.len() - 1));
            row!(csv: name, x[i], x[i + 1], y[k], y[k + 1], a[cell], b[cell]);
        }
    }
    csv.write(folder, "joint.csv")
}

fn write_density(folder: &Path, s: &Statistics) -> Result<()> {
    let Some(d) = &s.density else { return Ok(()) };
    let mut csv = Csv::new("log10_density_low,log10_density_high,cells_truth,cells_other");
    for i in 0..d.pdf.edges.len() - 1 {
        row!(csv: d.pdf.edges[i], d.pdf.edges[i + 1], d.pdf.cells[0][i], d.pdf.cells[1][i]);
    }
    csv.write(folder, "density_pdf.csv")
}

fn write_rdf(folder: &Path, s: &Statistics) -> Result<()> {
    let Some(pair) = &s.rdf else { return Ok(()) };
    let mut csv = Csv::new("r_low,r_high,pairs_truth,pairs_other,ideal_truth,ideal_other,g_truth,g_other");
    let ([a, b], [of_a, of_b]) = (pair, pair.each_ref().map(PairCounts::g));
    for i in 0..of_a.len() {
        row!(csv: a.edges[i], a.edges[i + 1], a.pairs[i], b.pairs[i], a.expected[i], b.expected[i], of_a[i], of_b[i]);
    }
    csv.write(folder, "rdf.csv")
}

fn write_profiles(folder: &Path, s: &Statistics) -> Result<()> {
    let Some(profiles) = &s.profiles else { return Ok(()) };
    let mut csv = Csv::new("axis,low,high,truth,other,density_truth,density_other");
    for (axis, p) in ["x", "y", "z"].iter().zip(profiles) {
        let [a, b] = &p.density;
        let share = |side: usize, v: f64| if p.mean[side] > 0.0 { v / p.mean[side] } else { 0.0 };
        for i in 0..a.len() {
            row!(csv: axis, p.edges[i], p.edges[i + 1], share(0, a[i]), share(1, b[i]), a[i], b[i]);
        }
    }
    csv.write(folder, "profiles.csv")
}

fn write_haloes(folder: &Path, s: &Statistics) -> Result<()> {
    let Some(h) = &s.haloes else { return Ok(()) };
    let mut csv =
        Csv::new("centre,x,y,z,radius,r_low,r_high,density_truth,density_other,enclosed_truth,enclosed_other");
    for (i, (at, radius)) in h.centers.iter().zip(&h.radii).enumerate() {
        for shell in 0..h.edges.len() - 1 {
            let ([a, b], [within_a, within_b]) = (h.density(i, shell), h.enclosed_mass(i, shell + 1));
            let [x, y, z] = *at;
            let (low, high) = (h.edges[shell] * radius, h.edges[shell + 1] * radius);
            row!(csv: i + 1, x, y, z, radius, low, high, a, b, within_a, within_b);
        }
    }
    csv.write(folder, "haloes.csv")?;
    let mut csv = Csv::new("r,r_over_radius,haloes,median,quartile_low,quartile_high,total");
    for (i, edge) in h.edges.iter().enumerate() {
        let [low, high] = [0, 1].map(|q| maybe(h.quartiles[i].map(|of| of[q])));
        let radius = maybe(h.radius.map(|r| r * edge));
        row!(csv: radius, edge, h.compared[i], maybe(h.median[i]), low, high, maybe(h.total[i]));
    }
    csv.write(folder, "halo_mass.csv")
}

fn write_groups(folder: &Path, s: &Statistics) -> Result<()> {
    let Some(g) = &s.groups else { return Ok(()) };
    let mut csv = Csv::new("from,to,groups_truth,groups_other,ratio");
    for c in &g.histogram {
        row!(csv: c.from, maybe(c.to), c.groups[0], c.groups[1], maybe(c.ratio));
    }
    csv.write(folder, "groups.csv")
}

fn write_neighbours(folder: &Path, s: &Statistics) -> Result<()> {
    let Some(n) = &s.neighbours else { return Ok(()) };
    let mut csv = Csv::new("side,low,high,particles");
    for (side, d) in ["truth", "other"].iter().zip(n) {
        for i in 0..d.counts.len() {
            row!(csv: side, d.edges[i], d.edges[i + 1], d.counts[i]);
        }
    }
    csv.write(folder, "neighbours.csv")
}

fn size(c: &SizeClass) -> String {
    c.to.map_or(format!("{} and more", c.from), |t| format!("{} to {t}", c.from))
}

pub fn summary(s: &Statistics, unit: Option<&str>) -> String {
    let unit = unit.map(text::one_line);
    let unit = unit.as_deref();
    let length = unit.map_or(String::new(), |u| format!(" {u}"));
    let wave = unit.map_or(String::new(), |u| format!(" {}", per_length(u)));
    let kind = |side: usize| if s.model[side] { "model of " } else { "" };
    let mut lines =
        vec![format!("truth {}{} particles, other {}{} particles", kind(0), s.particles[0], kind(1), s.particles[1])];
    let mut line = |name: &str, value: String| lines.push(format!("{name:<36} {value}"));
    let t = &s.summary;
    if let Some(d) = &s.density {
        let [x, y, z] = d.cells;
        let each = s.particles[0] as f64 / (x * y * z) as f64;
        line("density: grid; particles per cell", format!("{x}x{y}x{z}; {}", decimals(each)));
        line("density: correlation; MAE of delta", {
            format!("{:.4}; {:.4}", d.agreement.correlation, d.agreement.mean_absolute_error)
        });
        line("density: RMSE of delta", format!("{:.4}", d.agreement.root_mean_square_error));
    }
    if let Some(p) = &s.spectra {
        let [x, y, z] = p.cells;
        let last = p.shells.last();
        line("P(k): grid; up to k", format!("{x}x{y}x{z}; {}{wave}", decimals(last.map_or(0.0, |h| h.k))));
        let deviation = t.largest_power_deviation.map_or("-".into(), |d| format!("{:.2} %", 100.0 * d));
        line("P(k): largest deviation; r at end", {
            format!("{deviation}; {}", t.r_at_k_max.map_or("-".into(), |r| format!("{r:.4}")))
        });
        let to = |v: Option<f64>| v.map_or("nowhere".into(), decimals);
        line("P(k): within 1, 5, 10 % up to k", {
            let [a, b, c] =
                [t.power_within_1_percent_to, t.power_within_5_percent_to, t.power_within_10_percent_to].map(to);
            format!("{a}, {b}, {c}{wave}")
        });
        line("r(k): at least 0.99, 0.9 up to k", format!("{}, {}{wave}", to(t.r_above_0_99_to), to(t.r_above_0_9_to)));
    }
    if s.xi_by_pairs.is_some() {
        let from = t.xi_within_10_percent_from.map_or("nowhere".into(), |r| decimals(r) + &length);
        line("xi(r): within 10 % from r on", from);
    }
    if let Some(g) = &s.groups {
        for c in &g.classes {
            let ratio = c.ratio.map_or(String::new(), |r| format!(" ({:+.1} %)", 100.0 * (r - 1.0)));
            line(&format!("groups of {} particles", size(c)), format!("{}, truth {}{ratio}", c.groups[1], c.groups[0]));
        }
        for a in g.apertures.iter().filter(|a| a.groups > 0) {
            let sizes = if a.sizes[1] == u64::MAX {
                format!("{} and more", a.sizes[0])
            } else {
                format!("{} to {}", a.sizes[0], a.sizes[1])
            };
            let median = a.median.map_or("-".into(), |m| format!("{m:.3}"));
            line(
                &format!("core mass, groups of {sizes}"),
                format!("{median} of the truth (median, radius {}{length})", decimals(a.radius)),
            );
        }
    }
    let pair = |b: f64, a: f64| format!("{}{length}, truth {}: {:.3}", decimals(b), decimals(a), b / a);
    if let Some([a, b]) = &s.neighbours {
        line("nearest neighbour, mean", pair(b.mean, a.mean));
        line("nearest neighbour, median", pair(b.median, a.median));
    }
    if s.rdf.is_some() {
        let peak = |side: usize| match (t.rdf_peak_height[side], t.rdf_peak_at[side]) {
            (Some(g), Some(r)) => format!("{g:.3} at {}{length}", decimals(r)),
            _ => "none".into(),
        };
        line("g(r): first peak", format!("{}, truth {}", peak(1), peak(0)));
        line("g(r): largest difference", t.rdf_largest_difference.map_or("-".into(), |d| format!("{d:+.3}")));
    }
    if let Some((p, axis)) = s.profiles.as_ref().zip(["x", "y", "z"].get(s.options.profile_axis)) {
        let p = &p[s.options.profile_axis];
        let [difference, noise] = [p.relative_difference, p.shot_noise].map(|v| 100.0 * v);
        line(
            &format!("profile along {axis}: RMS difference"),
            format!("{difference:.2} % of the mean density, shot noise {noise:.2} %"),
        );
        let [truth, other] = p.half_mass_height;
        line(
            &format!("profile along {axis}: half-mass height"),
            format!("{}{length}, truth {}", decimals(other), decimals(truth)),
        );
    }
    if let Some(h) = &s.haloes {
        line("haloes: centres", {
            let radius = h.radius.map_or("given".into(), |r| decimals(r) + &length);
            format!("{}, largest radius {radius}", h.count)
        });
        for share in [0.1, 0.3, 1.0] {
            let near = |i: &usize| (h.edges[*i] / share).ln().abs();
            let Some(i) = (0..h.edges.len()).min_by(|a, b| near(a).total_cmp(&near(b))) else { continue };
            let Some((median, [low, high])) = h.median[i].zip(h.quartiles[i]) else { continue };
            line(
                &format!("haloes: mass within {:.3} radii", h.edges[i]),
                format!("{median:.3} of the truth (median; quartiles {low:.3} and {high:.3})"),
            );
        }
    }
    let to = |v: Option<f64>| v.map_or("nowhere".into(), decimals);
    if let Some(m) = &s.multipoles {
        let within = [0.01, 0.05, 0.1].map(|limit| to(m.monopole_within(limit))).join(", ");
        line("P0(k): within 1, 5, 10 % up to k", within + &wave);
        let deviation = t.largest_quadrupole_deviation.map_or("-".into(), |d| format!("{d:.3}"));
        line("P2(k): largest difference / P0", deviation);
    }
    if let Some(m) = &s.momentum {
        let within = [0.01, 0.05, 0.1].map(|limit| to(m.power_within(limit))).join(", ");
        line("momentum: within 1, 5, 10 % up to k", within + &wave);
    }
    if let Some((d, (median, [low, high]))) = s.dispersion.as_ref().and_then(|d| Some((d, d.median.zip(d.quartiles)?)))
    {
        line(
            &format!("haloes: dispersion, {} centres", d.compared),
            format!("{median:.3} of the truth (median; quartiles {low:.3} and {high:.3})"),
        );
    }
    for j in s.joint.iter().flatten() {
        let name = |k: usize| if j.logarithmic[k] { format!("log {}", j.fields[k]) } else { j.fields[k].clone() };
        line(&format!("{}: {} and {}", j.layer, name(0), name(1)), {
            let [difference, noise] = [j.difference, j.noise].map(|v| 100.0 * v);
            format!("{difference:.2} % of the mass is in other cells, sampling noise {noise:.2} %")
        });
        let r = |side: usize| j.correlation[side].map_or("-".into(), |r| format!("{r:.3}"));
        line(&format!("{}: their correlation", j.layer), format!("{}, truth {}", r(1), r(0)));
    }
    if let Some(l) = &s.likelihood {
        line(
            "likelihood of the particles",
            format!("{:.3} +- {:.3} bits per particle above uniform ({} particles)", l.bits, l.error, l.sampled),
        );
        line("needles", format!("{:.2} % of {} Gaussians", 100.0 * l.needles, l.gaussians));
    }
    lines.join("\n")
}
