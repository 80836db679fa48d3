//! Facts on a series and its frames.

use super::Series;
use crate::input::FrameChoice;
use crate::stats::{SeriesStatistics, StatsOptions};
use crate::{Context, Result};
use particlegs_core::codec::{FileInfo, FrameCoding, read_info};
use particlegs_core::model::{Certificate, Model, PictureScore};
use particlegs_measure::stats::{FrameTable, kind_of};
use serde::Serialize;
use serde_json::Value;

/// A series, and a line for each of its frames.
#[derive(Clone, Debug, Serialize)]
pub struct SeriesDescription {
    /// Size of the file.
    pub series_bytes: usize,
    /// Its clock: `scale factor`, `time`, `step` or `frame`.
    pub clock: &'static str,
    /// The frames, in order.
    pub frames: Vec<FrameDescription>,
    /// The recipe that made it.
    pub recipe: Value,
}

/// A frame of a series.
#[derive(Clone, Debug, Serialize)]
#[serde(untagged)]
pub enum FrameDescription {
    /// A frame that the file does not hold.
    Missing {
        /// Its number, from 0.
        frame: usize,
        /// `missing`.
        kind: &'static str,
    },
    /// A frame that the file holds.
    There {
        /// Its number, from 0.
        frame: usize,
        /// `keyframe` or `changes`.
        kind: &'static str,
        /// Time by the series' clock.
        time: f64,
        /// Bytes that it takes in the file.
        bytes: usize,
        /// Masked PSNR of its certificate, dB.
        masked_psnr: Option<f64>,
    },
}

/// A score of pictures: its column, unit, meaning, and its value.
type ScoreColumn = (&'static str, Option<&'static str>, &'static str, fn(PictureScore) -> Option<f64>);
const SCORES: [ScoreColumn; 2] = [
    ("masked_psnr", Some("dB"), "of noise-free pictures, stored with the frame", |s| s.masked_psnr),
    ("ssim", None, "of noise-free pictures, stored with the frame", |s| Some(s.ssim)),
];

impl Series {
    /// Facts that the file states, without decoding frames.
    ///
    /// # Errors
    /// [`crate::Error::Corrupt`].
    pub fn describe(&self) -> Result<SeriesDescription> {
        let decoder = self.decoder();
        let series = decoder.series();
        let frames = series.frames.iter().enumerate().map(|(frame, entry)| {
            let kind = kind_of(entry.kind);
            if entry.kind == FrameCoding::Missing {
                return Ok(FrameDescription::Missing { frame, kind });
            }
            let masked_psnr = series.certificate(frame)?.as_ref().and_then(Certificate::mean_psnr);
            Ok(FrameDescription::There { frame, kind, time: entry.time, bytes: entry.place.len(), masked_psnr })
        });
        let (frames, recipe) = (frames.collect::<Result<_>>()?, serde_json::from_str(&series.recipe));
        let (series_bytes, clock) = (self.bytes.len(), series.clock.name());
        Ok(SeriesDescription { series_bytes, clock, frames, recipe: recipe.unwrap_or(Value::Null) })
    }

    /// The index of a frame as a model file of its own, with its certificate in the series.
    ///
    /// # Errors
    /// [`crate::Error::Input`] for a frame that there is not; [`crate::Error::Corrupt`]; [`crate::Error::Cancelled`].
    pub fn frame_info(&self, frame: &FrameChoice, context: &Context<'_>) -> Result<FileInfo> {
        let mut decoder = self.decoder();
        let number = frame.number(decoder.series(), &self.name, context)?;
        context.note("sizes are those of the frame as a model file of its own, as `extract` writes it");
        let info = read_info(&decoder.extract(number, context)?, &decoder.series().name(number))?;
        let certificate = decoder.series().certificate(number)?;
        if certificate.is_none() && decoder.series().certificate(decoder.series().first()?)?.is_some() {
            context.note(&format!("frame {number} has no certificate: of this series, keyframes alone were measured"));
        }
        Ok(FileInfo { certificate, ..info })
    }

    /// A table of the frames: when they are, their particles, Gaussians and bytes, and what their certificates say.
    ///
    /// # Errors
    /// [`crate::Error::Corrupt`]; [`crate::Error::Cancelled`].
    pub fn table(&self, context: &Context<'_>) -> Result<FrameTable> {
        let mut decoder = self.decoder();
        let (mut frames, mut gaussians, mut scores) = (Vec::new(), Vec::new(), Vec::new());
        let numbers: Vec<usize> = decoder.series().there().collect();
        context.begin("reading frames", numbers.len() as u64);
        for &number in &numbers {
            context.check()?;
            context.advance(1);
            let model = decoder.frame(number, context)?;
            let blocks = model.layers.iter().flat_map(|l| &l.content);
            gaussians.push(Some(blocks.map(|b| b.block.gaussians.len()).sum::<usize>() as f64));
            frames.push(model.metadata.clone());
            scores.push(model.certificate);
        }
        context.end();
        let mut table = FrameTable::new(&decoder.series().frames, &frames, &decoder.series().units()?);
        table.add(("gaussians", None), "of the frame", gaussians);
        let bytes: Vec<_> = numbers.iter().map(|&i| Some(decoder.series().frames[i].place.len() as f64)).collect();
        table.add(("bytes", None), "that the frame takes in the file", bytes);
        for (name, unit, about, score_of) in SCORES {
            for (i, orbit) in ["far", "mid", "near"].into_iter().enumerate() {
                let score = |c: &Option<Certificate>| c.as_ref()?.views.orbits[i].expected.model.and_then(score_of);
                table.add((&format!("{name}_{orbit}"), unit.map(String::from)), about, scores.iter().map(score));
            }
        }
        let density = |pick: fn(&Certificate) -> f64| scores.iter().map(move |c| c.as_ref().map(pick));
        table.add(("density_correlation", None), "of densities on a grid", density(|c| c.density.correlation));
        let about = "mean absolute error of the density contrast on a grid";
        table.add(("density_error", None), about, density(|c| c.density.mean_absolute_error));
        Ok(table)
    }

    /// Statistics of every frame, of these layers or all.
    ///
    /// # Errors
    /// [`crate::Error::Argument`] for a measure that compares two inputs; [`crate::Error::Input`] for a layer that there is
    /// not; [`crate::Error::Cancelled`].
    pub fn statistics(
        &self,
        options: StatsOptions,
        layers: &[String],
        context: &Context<'_>,
    ) -> Result<SeriesStatistics> {
        let choose = |model: Model| model.only_named(layers);
        let decoder = self.decoder();
        SeriesStatistics::new(&self.name, decoder.series(), options, choose, context)
    }
}
