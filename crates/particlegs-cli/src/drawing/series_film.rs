//! A film of a series: which moment each picture shows.

use crate::sequence_args::FilmLength;
use particlegs_files::input::name_of;
use particlegs_pipeline::camera::{View, frame_number};
use particlegs_pipeline::codec::{FrameCoding, SeriesDecoder, SeriesFile};
use particlegs_pipeline::context::Context;
use particlegs_pipeline::model::Model;
use particlegs_pipeline::{Error, Result};
use std::path::Path;
use std::sync::Mutex;

pub struct SeriesFilm<'a> {
    decoder: Mutex<SeriesDecoder<'a>>,
    /// What the clock shows in each picture.
    times: Vec<f64>,
    /// What is written into each picture.
    pub stamps: Vec<String>,
}

impl<'a> SeriesFilm<'a> {
    /// Each frame once, or so many pictures, evenly from the first frame to the last.
    pub fn new(series: &'a SeriesFile<'a>, path: &Path, length: FilmLength) -> Result<Self> {
        let times: Vec<f64> = series.frames.iter().filter(|f| f.kind != FrameCoding::Missing).map(|f| f.time).collect();
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Err(Error::input(name_of(path), "the series has no frames"));
        };
        let moments = match length {
            FilmLength::All => times.clone(),
            FilmLength::Pictures(1) => vec![*first],
            FilmLength::Pictures(n) => {
                let share = |i: usize| i as f64 / (n - 1) as f64;
                (0..n).map(|i| if i + 1 == n { *last } else { first + share(i) * (last - first) }).collect()
            }
        };
        let units = series.units()?;
        let stamps = moments.iter().map(|&time| {
            let between = if series.frame_at(time).is_some() { "" } else { " (interpolated)" };
            series.clock.text(time, &units) + between
        });
        Ok(SeriesFilm { stamps: stamps.collect(), times: moments, decoder: Mutex::new(SeriesDecoder::new(series)) })
    }

    /// The model that a view of the film shows.
    pub fn model(&self, view: &View, context: &Context<'_>) -> Result<Model> {
        let time = frame_number(&view.name).and_then(|picture| self.times.get(picture));
        let time = time.ok_or_else(|| Error::argument(format!("view `{}` is not of the film", view.name)))?;
        self.decoder.lock().unwrap_or_else(|e| e.into_inner()).model_at(*time, context)
    }
}
