//! A film of a series, and the moment of each picture.

use crate::film_options::FilmLength;
use crate::focus::FocusPath;
use particlegs_core::camera::{View, ViewSet, frame_number};
use particlegs_core::codec::{SeriesDecoder, SeriesFile};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::Model;
use particlegs_core::{Error, Result};
use std::sync::Mutex;

pub struct SeriesFilm<'a> {
    decoder: Mutex<SeriesDecoder<'a>>,
    /// Time of the clock in each picture.
    times: Vec<f64>,
    /// Text that is written into each picture.
    pub stamps: Vec<String>,
    /// Centre of each picture (world units), if it moves.
    centers: Option<Vec<[f64; 3]>>,
}

impl<'a> SeriesFilm<'a> {
    /// Each frame once, or so many pictures, evenly from the first frame to the last.
    pub fn new(series: &'a SeriesFile<'a>, place: &str, length: FilmLength) -> Result<Self> {
        let times: Vec<f64> = series.there().map(|i| series.frames[i].time).collect();
        let (Some(first), Some(last)) = (times.first(), times.last()) else {
            return Err(Error::input(place, "the series has no frames"));
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
        let stamps = moments.iter().map(|&time| series.moment_text(time, &units)).collect();
        let decoder = Mutex::new(SeriesDecoder::new(series));
        Ok(SeriesFilm { stamps, times: moments, decoder, centers: None })
    }

    /// Follows a path; gives what the first picture is about.
    pub fn follow(&mut self, path: &FocusPath) -> Option<[f64; 3]> {
        self.centers = Some(self.times.iter().map(|time| path.at(*time)).collect());
        self.centers.iter().flatten().next().copied()
    }

    /// Moves each camera, all of which look at what the first picture is about, along with what its picture is about.
    pub fn move_views(&self, set: &mut ViewSet) {
        for (view, center) in set.views.iter_mut().zip(self.centers.iter().flatten()) {
            let camera = &mut view.camera;
            let offset: [f64; 3] = each_axis(|k| camera.position[k] - camera.focal_point[k]);
            (camera.focal_point, camera.position) = (*center, each_axis(|k| center[k] + offset[k]));
        }
    }

    /// The model that a view of the film shows.
    pub fn model(&self, view: &View, context: &Context<'_>) -> Result<Model> {
        let time = frame_number(&view.name).and_then(|picture| self.times.get(picture));
        let time = time.ok_or_else(|| Error::argument(format!("view `{}` is not of the film", view.name)))?;
        self.decoder.lock().unwrap_or_else(|e| e.into_inner()).model_at(*time, context)
    }
}
