//! What people and programs read: results on stdout, everything else on stderr.

use particlegs::Error;
use serde::Serialize;
use std::io::Write;
use std::path::Path;
use std::process::ExitCode;

/// One line and a hint on stderr; the exit code of docs/guide/exit-codes.md.
pub fn failure(error: &Error) -> ExitCode {
    if matches!(error, Error::Io { source, .. } if source.kind() == std::io::ErrorKind::BrokenPipe) {
        return ExitCode::SUCCESS;
    }
    eprintln!("error: {}", error.to_string().replace('\n', " "));
    if !error.hint().is_empty() {
        eprintln!("hint: {}", error.hint());
    }
    ExitCode::from(error.exit_code())
}

/// A line of the result, on stdout.
pub fn line(text: &str) -> particlegs::Result<()> {
    writeln!(std::io::stdout(), "{text}").map_err(|e| Error::io("standard output", e))
}

/// The result as JSON: to a file, or to stdout for `-`.
pub fn json(target: &Path, value: &impl Serialize) -> particlegs::Result<()> {
    let mut text = serde_json::to_vec_pretty(value).expect("results are plain data");
    text.push(b'\n');
    if target == Path::new("-") {
        std::io::stdout().write_all(&text).map_err(|e| Error::io("standard output", e))
    } else {
        particlegs::output::write_bytes(target, &text)
    }
}

/// A certificate as a table.
pub fn certificate(c: &particlegs::model::Certificate) -> String {
    let db = |v: Option<f64>| v.map_or("identical".to_string(), |v| format!("{v:.2} dB"));
    let mut text = format!("measured at encoding, one {}x{} frame an orbit (masked PSNR, SSIM; beside it the noise-free picture's):", c.width, c.height);
    for (name, orbit) in ["far", "mid", "near"].iter().zip(&c.orbits) {
        for (look, s) in [
            ("paraview", &orbit.paraview),
            ("paraview-no-fxaa", &orbit.paraview_no_fxaa),
            ("expected", &orbit.expected),
        ] {
            text += &format!("\n  {name:<5}{look:<18}{:>10} {:.4}", db(s.masked_psnr), s.ssim);
            if look != "expected" {
                text += &format!("   noise-free {:>10} {:.4}", db(s.noise_free_masked_psnr), s.noise_free_ssim);
            }
        }
    }
    text + &format!(
        "\n  density on a grid of {} cells: correlation {:.4}, mean absolute error of delta {:.4}",
        c.grid, c.density_correlation, c.density_mae
    )
}
