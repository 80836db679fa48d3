//! Every number of a decoded model as hexadecimal bits, one line a Gaussian, for comparison with another reader
//! of docs/format.md: `decoded_bits MODEL.pgs`.

use particlegs::codec;
use particlegs::model::{
    Block, CellDensity, Certificate, Effort, GoalKind, GroupClass, LawKind, Limit, LookPictures, Measures, Model,
    PictureScore, PictureScores, PicturesAt, PowerAgreement, Reached, Science, ScienceOf,
};
use std::io::{BufWriter, Write};

fn bits(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| format!("{:016x}", v.to_bits())).collect::<Vec<_>>().join(" ")
}

fn head(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    let m = &model.metadata;
    let hash: String = m.source_hash.iter().map(|b| format!("{b:02x}")).collect();
    let law = match m.law {
        LawKind::OpticalDepth => 1,
        LawKind::AlphaBlend => 2,
    };
    writeln!(out, "law {law} particles {} hash {hash}", m.count)?;
    let bounds = m.bounds.min.into_iter().chain(m.bounds.max);
    let reals = [m.mass].into_iter().chain(bounds).chain([m.default_radius, m.default_opacity]);
    writeln!(out, "reals {}", bits(reals))?;
    writeln!(out, "source {}", m.source)?;
    writeln!(out, "effort {}", m.recipe.fitted().map_or("none", Effort::name))?;
    model.certificate.as_ref().map_or(Ok(()), |c| certificate(c, out))?;
    let Some(network) = model.vizmapper() else { return Ok(()) };
    let r = network.ranges;
    writeln!(out, "ranges {}", bits([r.scale, r.opacity, r.floor]))?;
    let parameters = network.parameters.iter().flat_map(|p| p.to_le_bytes());
    writeln!(out, "network {}", parameters.map(|b| format!("{b:02x}")).collect::<String>())
}

fn certificate(c: &Certificate, out: &mut dyn Write) -> std::io::Result<()> {
    let density = bits([c.density_correlation, c.density_mae]);
    writeln!(out, "certificate {} {} {} {} {density}", c.width, c.height, c.seed, c.grid)?;
    let or_none = |v: Option<f64>| v.map_or("none".into(), |v| bits([v]));
    for s in c.orbits.iter().flat_map(|o| [o.paraview, o.paraview_no_fxaa, o.expected]) {
        let (own, best) = (or_none(s.masked_psnr), or_none(s.noise_free_masked_psnr));
        writeln!(out, "score {own} {} {best} {}", bits([s.ssim]), bits([s.noise_free_ssim]))?;
    }
    c.science.as_ref().map_or(Ok(()), |s| statistics(s, out))?;
    measures(&c.measures, out)
}

fn measures(m: &Measures, out: &mut dyn Write) -> std::io::Result<()> {
    let mut line = |tag: u8, numbers: Vec<Option<f64>>| {
        let words: Vec<String> = numbers.into_iter().map(|v| v.map_or("none".into(), |v| bits([v]))).collect();
        writeln!(out, "measure {tag} {}", words.join(" "))
    };
    if let Some(d) = &m.densities {
        let own = |d: &CellDensity| {
            [d.edge, d.particles, d.correlation, d.mean_absolute_error, d.uniform_mean_absolute_error].map(Some)
        };
        line(1, d.iter().flat_map(own).collect())?;
    }
    if let Some(s) = &m.spacing {
        line(2, [s.median, s.regularity, s.drawn_median, s.drawn_regularity].map(Some).to_vec())?;
    }
    if let Some(h) = &m.held_out {
        let bands = h.transfer.iter().flat_map(|t| [t.deviation, Some(t.scatter)]);
        line(3, [h.bits, h.error, h.kernel_bits, h.volume, h.k_max].map(Some).into_iter().chain(bands).collect())?;
    }
    if let Some(g) = &m.groups {
        let own = |c: &GroupClass| {
            let (groups, number, mass) = (Some(c.groups as f64), Some(c.number_scatter), Some(c.mass_scatter));
            [groups, c.number, number, c.completeness, c.purity, c.mass, mass]
        };
        line(4, g.iter().flat_map(own).collect())?;
    }
    if let Some(p) = &m.pictures {
        let size = [p.width, p.height].map(|v| Some(f64::from(v)));
        line(5, size.into_iter().chain(p.settings.iter().flat_map(setting)).collect())?;
    }
    if let Some(s) = &m.subset {
        let scores = s.orbits.iter().flatten().flat_map(|s| score(*s));
        line(6, [s.kept, s.bytes].map(|v| Some(v as f64)).into_iter().chain(scores).collect())?;
    }
    if let Some(p) = &m.mass_power {
        let limit = |l: Limit| match l {
            Limit::NotMeasured => -1.0,
            Limit::Never => 0.0,
            Limit::At(k) => k,
        };
        let own = |p: &PowerAgreement| [p.largest_deviation, Some(limit(p.within_1_percent_to))];
        line(7, std::iter::once(&p.whole).chain(p.layers.iter().flatten()).flat_map(own).collect())?;
    }
    if let Some(s) = &m.sample {
        let corners = s.bounds.min.into_iter().chain(s.bounds.max);
        line(8, [s.particles as f64].into_iter().chain(corners).map(Some).collect())?;
    }
    if let Some(blocks) = m.blocks {
        line(9, vec![Some(f64::from(blocks))])?;
    }
    if let Some(Reached { goal, reached }) = &m.goal {
        let kinds = [GoalKind::Psnr, GoalKind::PowerSpectrum, GoalKind::Correlation, GoalKind::Groups];
        let kind = kinds.iter().position(|k| *k == goal.kind).map_or(0.0, |i| i as f64 + 1.0);
        line(10, [kind, goal.asked, goal.at, *reached].map(Some).to_vec())?;
    }
    Ok(())
}

fn setting(p: &PicturesAt) -> Vec<Option<f64>> {
    let look = |l: &LookPictures| {
        let of = |s: PictureScores| {
            [Some(s.model), Some(s.noise_free), Some(s.all_black), Some(s.uniform_box), s.subset].map(score)
        };
        let scores = [l.mean, l.worst].into_iter().flat_map(of).flatten();
        [Some(f64::from(l.worst_view))].into_iter().chain(scores).collect::<Vec<_>>()
    };
    let head = [Some(p.radius), Some(p.opacity), Some(f64::from(u8::from(p.close)))];
    head.into_iter().chain(look(&p.paraview)).chain(look(&p.expected)).collect()
}

fn score(s: Option<PictureScore>) -> [Option<f64>; 2] {
    [s.and_then(|s| s.masked_psnr), s.map(|s| s.ssim)]
}

fn statistics(s: &Science, out: &mut dyn Write) -> std::io::Result<()> {
    let power = [s.power_within_1_percent_to, s.power_within_5_percent_to];
    let all = power.into_iter().chain([s.r_above_0_99_to, s.r_above_0_9_to, s.groups_within_10_percent_from]);
    let word = |limit| match limit {
        Limit::NotMeasured => "not measured".to_string(),
        Limit::Never => "never".into(),
        Limit::At(v) => bits([v]),
    };
    let limits: Vec<String> = all.map(word).collect();
    let of = match s.of {
        ScienceOf::DrawnParticles => 0,
        ScienceOf::Mixture => 1,
    };
    writeln!(out, "stat {of} {} {} {}", s.spectrum_grid, bits([s.k_max]), limits.join(" "))
}

fn block(b: &Block, out: &mut dyn Write) -> std::io::Result<()> {
    let corners = b.bounds.min.into_iter().chain(b.bounds.max);
    let g = &b.gaussians;
    writeln!(out, "block {} {} {}", b.count, bits([b.mass].into_iter().chain(corners)), g.len())?;
    let own = g.law.alpha_blend();
    let extra = [g.masses(), own.map(|l| &l.opacity), own.map(|l| &l.grey)];
    for i in 0..g.len() {
        let own = g.mean_of(i).into_iter().chain(g.cov_of(i).0).chain([g.count[i]]);
        writeln!(out, "{}", bits(own.chain(extra.iter().flatten().map(|c| c[i]))))?;
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("decoded_bits MODEL.pgs")?;
    let model = codec::decode(&std::fs::read(&path)?, &path)?;
    let mut out = BufWriter::new(std::io::stdout().lock());
    head(&model, &mut out)?;
    for layer in &model.layers {
        writeln!(out, "layer {} {}", layer.name, layer.content.len())?;
        layer.content.iter().try_for_each(|b| block(b, &mut out))?;
    }
    Ok(out.flush()?)
}
