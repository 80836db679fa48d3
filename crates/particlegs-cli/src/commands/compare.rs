//! `particlegs compare A B`.

use crate::common::Common;
use clap::{Args, ValueHint};
use particlegs_core::text::one_line;
use particlegs_core::{Error, Result};
use particlegs_pictures::{FolderComparison, compare};
use std::path::PathBuf;

#[derive(Args)]
#[command(after_help = "\
Pictures are scored by PSNR, masked PSNR and SSIM; surface densities from --raw by log10(A / B) over
the pixels where B is above zero (docs/guide/pictures.md).

Examples:
  particlegs reference snapshot --views views.json --style paraview -o truth
  particlegs render model.pgs --views views.json --style paraview -o drawn
  particlegs compare drawn truth
  particlegs compare drawn/view.png truth/view.png

  particlegs reference snapshot --style density --smooth 32 --raw -o truth
  particlegs render model.pgs --style density --raw -o drawn
  particlegs compare drawn truth")]
pub struct Arguments {
    /// Picture (PNG) or --raw values to score, or a folder of them.
    #[arg(value_name = "A", value_hint = ValueHint::AnyPath)]
    a: PathBuf,
    /// What to compare it with; in a folder, the files of the same names.
    #[arg(value_name = "B", value_hint = ValueHint::AnyPath)]
    b: PathBuf,
    #[command(flatten)]
    common: Common,
}

/// Compares all pictures, and then fails if some have different sizes.
pub fn run(a: Arguments) -> Result<()> {
    let context = a.common.start()?;
    context.reads([a.a.as_path(), &a.b], false)?;
    let comparison = compare(&a.a, &a.b, &context)?;
    for (names, folder) in [(&comparison.only_in_a, &a.b), (&comparison.only_in_b, &a.a)] {
        if !names.is_empty() {
            context.message(&format!("warning: not in {}: {}", folder.display(), names.join(", ")));
        }
    }
    let tables = [(!comparison.views.is_empty()).then(|| table(&comparison)), density_table(&comparison)];
    context.finish(&tables.into_iter().flatten().collect::<Vec<_>>().join("\n\n"), &comparison)?;
    match comparison.failures().collect::<Vec<_>>()[..] {
        [] => Ok(()),
        [only] => Err(Error::input(&a.a, only)),
        [first, ..] => Err(Error::input(&a.a, format!("{first}, and others"))),
    }
}

fn table(c: &FolderComparison) -> String {
    let width = c.views.iter().map(|v| v.name.len()).max().unwrap_or(0).max(4);
    let mut text = format!("{:<width$} {:>10} {:>10} {:>8} {:>6}", "name", "PSNR", "masked", "SSIM", "max");
    let db = |v: Option<f64>, missing: &str| v.map_or(missing.to_string(), |v| format!("{v:.2} dB"));
    for v in &c.views {
        let name = one_line(&v.name);
        text += &match (&v.scores, &v.error) {
            (Some(s), _) => {
                let masked = if s.psnr.is_none() { "identical" } else { "unlit" };
                let ssim = s.ssim.map_or("-".into(), |v| format!("{v:.4}"));
                let (psnr, masked) = (db(s.psnr, "identical"), db(s.masked_psnr, masked));
                format!("\n{name:<width$} {psnr:>10} {masked:>10} {ssim:>8} {:>6}", v.largest_difference)
            }
            (None, error) => format!("\n{name:<width$} error: {}", one_line(error.as_deref().unwrap_or("not scored"))),
        };
    }
    let m = &c.mean;
    let ssim = m.ssim.map_or("-".into(), |v| format!("{v:.4}"));
    text += &format!("\n{:<width$} {:>10} {:>10} {ssim:>8}", "mean", db(m.psnr, "-"), db(m.masked_psnr, "-"));
    if m.left_out > 0 {
        text += &format!("   (without the {} views that have no masked PSNR)", m.left_out);
    }
    text
}

/// Scores of surface densities; `None` without any.
fn density_table(c: &FolderComparison) -> Option<String> {
    let mean = c.mean_density.as_ref()?;
    let width = c.densities.iter().map(|v| v.name.len()).max().unwrap_or(0).max(4);
    let dex = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.4} dex"));
    let plain = |v: Option<f64>| v.map_or("-".into(), |v| format!("{v:.4}"));
    let mut text = format!(
        "log10 of surface densities A / B\n{:<width$} {:>11} {:>12} {:>11} {:>10} {:>8}",
        "name", "RMS", "mean", "correlation", "pixels", "empty"
    );
    for v in &c.densities {
        let name = one_line(&v.name);
        text += &match (&v.scores, &v.error) {
            (Some(s), _) => {
                let (rms, mean, correlation) = (dex(s.rms_dex), dex(s.mean_dex), plain(s.correlation));
                format!("\n{name:<width$} {rms:>11} {mean:>12} {correlation:>11} {:>10} {:>8}", s.pixels, s.empty)
            }
            (None, error) => format!("\n{name:<width$} error: {}", one_line(error.as_deref().unwrap_or("not scored"))),
        };
    }
    let (rms, mean_dex, correlation) = (dex(mean.rms_dex), dex(mean.mean_dex), plain(mean.correlation));
    Some(text + &format!("\n{:<width$} {rms:>11} {mean_dex:>12} {correlation:>11}", "mean"))
}
