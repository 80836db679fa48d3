//! The Gaussians as a table of text: a line each, units in the names of the columns.

use super::gaussians::{LayerGaussian, all, has_opacities};
use super::{Notes, RUN, written};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::{Model, Quantity};
use particlegs_core::text::{cell, one_line};
use std::f64::consts::LN_10;
use std::path::Path;

const COVARIANCES: [&str; 6] = ["xx", "xy", "xz", "yy", "yz", "zz"];

pub fn write(model: &Model, notes: &Notes, out: &Path, context: &Context<'_>) -> Result<u64> {
    let names: Vec<String> = model.layers.iter().map(|l| cell(&l.name)).collect();
    let [masses, opacities] = [model.has_masses(), has_opacities(model)];
    // A number takes about ten letters.
    let expected = 120 * model.gaussians() as u64;
    written(out, expected, context, |sink| {
        for line in notes.lines() {
            sink.put(format!("# {line}\n").as_bytes())?;
        }
        sink.put(head(model).as_bytes())?;
        let mut run = String::new();
        for (number, one) in all(model).enumerate() {
            row(&mut run, &one, masses, opacities);
            model.metadata.fields.iter().for_each(|q| field(&mut run, &one, q));
            run += &names[one.layer];
            run.push('\n');
            if (number + 1).is_multiple_of(RUN) {
                sink.check()?;
                sink.put(run.as_bytes())?;
                run.clear();
            }
        }
        sink.put(run.as_bytes())
    })
}

fn head(model: &Model) -> String {
    let m = &model.metadata;
    let unit = |unit: Option<&str>, power: &str| match unit.map(one_line) {
        None => String::new(),
        // `kpc/h^2` would square h alone.
        Some(u) if !power.is_empty() && u.contains(['/', ' ']) => format!(" [({u}){power}]"),
        Some(u) => format!(" [{u}{power}]"),
    };
    let mut names: Vec<String> =
        ["x", "y", "z"].iter().map(|k| format!("{k}{}", unit(m.units.length_text(), ""))).collect();
    names.extend(COVARIANCES.iter().map(|k| format!("covariance_{k}{}", unit(m.units.length_text(), "^2"))));
    names.push("count".into());
    if model.has_masses() {
        names.push(format!("{}{}", m.weight_name().unwrap_or("mass"), unit(m.units.mass_text(), "")));
    }
    if has_opacities(model) {
        names.extend(["opacity".into(), "grey".into()]);
    }
    for q in &m.fields {
        let unit = unit(q.unit.as_ref().map(|u| &u.text[..]), "");
        for name in q.component_names() {
            let of_dispersion = if q.logarithmic { " [dex]" } else { &unit };
            names.extend([format!("{name}{unit}"), format!("dispersion_{name}{of_dispersion}")]);
        }
    }
    names.push("layer".into());
    let names: Vec<String> = names.iter().map(|n| cell(n)).collect();
    names.join(",") + "\n"
}

/// The numbers of a Gaussian, each with a comma behind it: as many digits as give the same number again.
fn row(out: &mut String, one: &LayerGaussian<'_>, masses: bool, opacities: bool) {
    let mut buffer = zmij::Buffer::new();
    let mean = one.of.mean_of(one.i);
    let numbers = mean.into_iter().chain(one.of.cov_of(one.i).0).chain([one.of.count[one.i]]);
    let numbers = numbers.chain(masses.then(|| one.mass())).chain(one.splat().into_iter().filter(|_| opacities));
    for number in numbers {
        let text = buffer.format(number);
        *out += text.strip_suffix(".0").unwrap_or(text);
        out.push(',');
    }
}

/// Means of a field and dispersions about them, component by component; empty where the layer lacks it.
fn field(out: &mut String, one: &LayerGaussian<'_>, q: &Quantity) {
    let numbers = one.field(q);
    let components = numbers.mean.len();
    let mut buffer = zmij::Buffer::new();
    for k in 0..components {
        // The diagonal of a matrix that is stored row by row.
        let dispersion = numbers.spread[k * (components + 1)].sqrt();
        let dispersion = if q.logarithmic { dispersion / LN_10 } else { dispersion };
        for number in [numbers.mean[k], dispersion] {
            if number.is_finite() {
                let text = buffer.format(number);
                *out += text.strip_suffix(".0").unwrap_or(text);
            }
            out.push(',');
        }
    }
}
