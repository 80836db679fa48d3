//! Every number of a decoded model as hexadecimal bits, one line a Gaussian, for comparison with another reader
//! of docs/format.md: `decoded_bits MODEL.pgs`.

use particlegs_core::codec;
use particlegs_core::context::Context;
use particlegs_core::model::{Block, Certificate, Effort, LawKind, MetricValue, Model, Unit};
use std::io::{BufWriter, Write};

fn bits(values: impl IntoIterator<Item = f64>) -> String {
    values.into_iter().map(|v| format!("{:016x}", v.to_bits())).collect::<Vec<_>>().join(" ")
}

fn head(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    let m = &model.metadata;
    let digits = |bytes: &[u8]| bytes.iter().map(|b| format!("{b:02x}")).collect::<String>();
    let (hash, fields_hash) = (digits(&m.source_hash), m.fields_hash.map_or("none".into(), |hash| digits(&hash)));
    let law = match m.law {
        LawKind::OpticalDepth => 1,
        LawKind::AlphaBlend => 2,
    };
    writeln!(out, "law {law} particles {} hash {hash} fields {fields_hash}", m.count)?;
    let bounds = m.bounds.min.into_iter().chain(m.bounds.max);
    let reals = [m.mass].into_iter().chain(bounds).chain([m.default_radius, m.default_opacity]);
    writeln!(out, "reals {}", bits(reals))?;
    writeln!(out, "source {}", m.source)?;
    snapshot(model, out)?;
    writeln!(out, "effort {}", m.recipe.fitted().map_or("none", Effort::name))?;
    model.certificate.as_ref().map_or(Ok(()), |c| certificate(c, out))?;
    let Some(network) = model.vizmapper() else { return Ok(()) };
    let r = network.ranges;
    writeln!(out, "ranges {}", bits([r.scale, r.opacity, r.floor]))?;
    let parameters = network.parameters.iter().flat_map(|p| p.to_le_bytes());
    writeln!(out, "network {}", parameters.map(|b| format!("{b:02x}")).collect::<String>())
}

fn snapshot(model: &Model, out: &mut dyn Write) -> std::io::Result<()> {
    let (m, u, c, e) = (&model.metadata, &model.metadata.units, &model.metadata.cosmology, &model.metadata.epoch);
    let or_none = |v: Option<f64>| v.map_or("none".into(), |v| bits([v]));
    let text = |u: &Option<Unit>| u.as_ref().map_or("none".to_string(), |u| u.text.clone());
    for (name, unit) in [("length", &u.length), ("mass", &u.mass), ("time", &u.time)] {
        let si = unit.as_ref().map(|u| u.si);
        let exponents = si.flatten().map_or([0.0; 2], |si| [si.a.into(), si.h.into()]);
        let size = si.map(|si| format!(" {} {}", or_none(si.map(|si| si.factor)), bits(exponents)));
        writeln!(out, "unit of {name} {}{}", text(unit), size.unwrap_or_default())?;
    }
    let or_word = |v: Option<String>| v.unwrap_or_else(|| "None".into());
    let (comoving, frame) = (u.comoving.map(|c| u8::from(c).to_string()), e.frame.map(|f| f.to_string()));
    writeln!(
        out,
        "comoving {} frame {} {}",
        or_word(comoving),
        or_word(frame),
        or_word(e.step.map(|s| s.to_string()))
    )?;
    let words = |v: &[Option<f64>]| v.iter().map(|v| or_none(*v)).collect::<Vec<_>>().join(" ");
    let cosmology = words(&[c.hubble, c.omega_matter, c.omega_lambda, c.omega_baryon]);
    writeln!(out, "moment {} cosmology {cosmology}", words(&[e.scale_factor, e.time]))?;
    for q in m.quantities(model.layers.iter().any(|l| l.mass.is_weighted())) {
        writeln!(out, "kept {} {} {} {}", q.name, q.kind as u8 + 1, q.bytes, text(&q.unit))?;
    }
    for layer in &model.layers {
        writeln!(out, "layer's mass {} {}", u8::from(layer.mass.is_weighted()), or_none(layer.mass.unit()))?;
    }
    Ok(())
}

/// A line a group: its tag, then its numbers.
fn certificate(c: &Certificate, out: &mut dyn Write) -> std::io::Result<()> {
    let or_none = |v: Option<f64>| v.map_or("none".into(), |v| bits([v]));
    for (group, entries) in c.groups() {
        let Some(entries) = entries else { continue };
        let words = entries.iter().map(|e| match e.value {
            MetricValue::None => "none".to_string(),
            MetricValue::Never => "never".into(),
            MetricValue::Count(n) => n.to_string(),
            MetricValue::Real(v) => bits([v]),
            MetricValue::Score(s) => format!("{} {}", or_none(s.masked_psnr), bits([s.ssim])),
        });
        writeln!(out, "group {} {}", group.tag, words.collect::<Vec<_>>().join(" "))?;
    }
    Ok(())
}

fn block(b: &Block, out: &mut dyn Write) -> std::io::Result<()> {
    let corners = b.bounds.min.into_iter().chain(b.bounds.max);
    let g = &b.gaussians;
    writeln!(out, "block {} {} {}", b.count, bits([b.mass].into_iter().chain(corners)), g.len())?;
    let alpha_blend = g.law.alpha_blend();
    let extra = [g.masses(), alpha_blend.map(|l| &l.opacity), alpha_blend.map(|l| &l.grey)];
    for i in 0..g.len() {
        let numbers = g.mean_of(i).into_iter().chain(g.cov_of(i).0).chain([g.count[i]]);
        writeln!(out, "{}", bits(numbers.chain(extra.iter().flatten().map(|c| c[i]))))?;
    }
    for (name, field) in g.fields.iter() {
        writeln!(out, "field {name}")?;
        for i in 0..g.len() {
            writeln!(out, "{}", bits(field.columns().map(|c| c[i])))?;
        }
    }
    for (name, field) in g.fields.iter() {
        for (other, column) in field.correlations.iter() {
            writeln!(out, "correlation {name} {other}")?;
            writeln!(out, "{}", bits(column.iter().copied()))?;
        }
    }
    Ok(())
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).ok_or("decoded_bits MODEL.pgs")?;
    let bytes = std::fs::read(&path)?;
    // Of a series the last frame.
    let model = if codec::is_series(&bytes) {
        let series = codec::SeriesFile::read(&bytes, &path)?;
        codec::SeriesDecoder::new(&series).frame(series.frames.len() - 1, &Context::SILENT)?.clone().into_model()
    } else {
        codec::decode(&bytes, &path)?
    };
    let mut out = BufWriter::new(std::io::stdout().lock());
    head(&model, &mut out)?;
    for layer in &model.layers {
        writeln!(out, "layer {} {}", layer.name, layer.content.len())?;
        layer.content.iter().try_for_each(|b| block(b, &mut out))?;
    }
    Ok(out.flush()?)
}
