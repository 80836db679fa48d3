//! Rate and distortion: bytes of a file against the quality of its pictures, of models and of what else there is
//! (paper, table "Rate-distortion comparison" and its figure).

use super::Experiment;
use crate::found::{Axis, Cell, Found, Plot, Point, Series, Table};
use crate::lab::{Lab, Recipe, Snapshot};
use crate::views::{Score, Truth, mean, mean_of};
use particlegs::Result;
use serde::{Deserialize, Serialize};

pub(super) const EXPERIMENT: Experiment = Experiment {
    name: "rate-distortion",
    title: "Pictures of models and of other compressors' particles by size of file",
    paper: "tab:rd, fig:rd",
    trains: false,
    weight: 100,
    run,
};

/// One method at one size.
#[derive(Clone, Debug, Serialize, Deserialize)]
struct Measured {
    /// Bytes of the file.
    bytes: u64,
    /// Scores of its pictures.
    scores: Vec<Score>,
}

fn run(lab: &Lab<'_>, snapshots: &[Snapshot]) -> Result<Found> {
    let snapshot = &snapshots[0];
    let raw = snapshot.particles.raw_bytes();
    let first = lab.model(snapshot, &Recipe::ratio(263.0, lab.settings.seed))?;
    let truth = Truth::of(lab, snapshot, &first.model.metadata)?;
    let mut table = Table::new(
        "rate-distortion",
        "Quality of pictures by size of file",
        &["method", "ratio", "bytes", "masked PSNR, dB", "far", "mid", "near", "PSNR, dB", "SSIM"],
    );
    let mut points = Vec::new();
    for ratio in lab.settings.ratios.clone() {
        let recipe = Recipe::ratio(ratio, lab.settings.seed);
        let inputs = ("optical depth", &snapshot.hash, &recipe, lab.settings.frames, format!("{:?}", truth.size));
        let measured = lab.store.result("rate", &inputs, || {
            let made = lab.model(snapshot, &recipe)?;
            Ok(Measured { bytes: made.bytes.len() as u64, scores: truth.of_model(lab, &made.model)? })
        })?;
        let (s, of) = (&measured.scores, |o| mean_of(&measured.scores, o, |s| s.masked));
        let reached = raw as f64 / measured.bytes as f64;
        let masked = mean(s, |s| s.masked);
        points.extend(masked.map(|m| Point::new(reached, m)));
        table.row([
            Cell::text("optical depth"),
            Cell::number(reached, 1),
            Cell::count(measured.bytes),
            Cell::number(masked, 2),
            Cell::number(of("far"), 2),
            Cell::number(of("mid"), 2),
            Cell::number(of("near"), 2),
            Cell::number(mean(s, |s| s.psnr), 2),
            Cell::number(mean(s, |s| s.ssim), 4),
        ]);
    }
    let plot = Plot {
        name: "rate-distortion".into(),
        title: "Quality of pictures by size of file".into(),
        x: Axis::logarithmic("raw bytes over bytes of the file"),
        y: Axis::linear("masked PSNR, dB"),
        series: vec![Series { name: "optical depth".into(), style: 0, dashed: false, points }],
        levels: vec![],
    };
    Ok(Found { tables: vec![table], plots: vec![plot], ..Found::default() })
}
