//! A film of a series: the moment of each picture, and its centre, the middle of some mass or of a halo.

use crate::film_options::FilmLength;
use crate::view_options::PictureCenter;
use particlegs_core::camera::{CenteredCell, View, ViewSet, frame_number};
use particlegs_core::codec::{SeriesClock, SeriesDecoder, SeriesFile};
use particlegs_core::context::Context;
use particlegs_core::math::each_axis;
use particlegs_core::model::Model;
use particlegs_core::space::{Bounds, Cell};
use particlegs_core::{Error, Result};
use particlegs_files::input::name_of;
use particlegs_formats::Catalogue;
use particlegs_measure::stats::mass_center_near;
use particlegs_particles::Domain;
use std::path::{Path, PathBuf};
use std::str::FromStr;
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
                // Rounding must not put the last picture beyond the last frame.
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

/// A halo of a list, `haloes.csv:12`: the file, and the halo's id, or its row from 1 if the list has no ids.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct HaloNumber {
    /// A list of centres.
    pub file: PathBuf,
    /// Id or row.
    pub number: u64,
}

impl FromStr for HaloNumber {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<HaloNumber, String> {
        let parts = text.rsplit_once(':').and_then(|(file, number)| Some((file, number.parse().ok()?)));
        let (file, number) = parts.filter(|p| !p.0.is_empty()).ok_or("write FILE:NUMBER, such as haloes.csv:12")?;
        Ok(HaloNumber { file: file.into(), number })
    }
}

/// The middle of the picture in each frame of a series: time of the clock, place (world units) and domain.
pub struct FocusPath {
    frames: Vec<(f64, [f64; 3], Domain)>,
}

impl FocusPath {
    /// The middle of chosen mass in each frame.
    pub fn of_mass(
        series: &SeriesFile<'_>,
        center: &PictureCenter,
        place: &str,
        context: &Context<'_>,
    ) -> Result<Self> {
        let mut decoder = SeriesDecoder::new(series);
        let (mut frames, mut without) = (Vec::new(), None);
        context.begin("centres of mass", series.there().count() as u64);
        for number in series.there() {
            let model = decoder.frame(number, context)?.clone().into_model();
            match center.of_model(&model, &format!("{place}, frame {number}"), context) {
                Ok(middle) => frames.push((series.frames[number].time, middle, Domain::from_model(&model))),
                // A species may appear later.
                Err(error) => {
                    without.get_or_insert((number, error));
                }
            }
            context.advance(1);
        }
        context.end();
        match without {
            Some((_, error)) if frames.is_empty() => return Err(error),
            Some((number, _)) => {
                context.warn(&format!(
                    "frame {number} has no mass to be centred on: the camera takes its place from the frames beside it"
                ));
            }
            None => {}
        }
        Ok(FocusPath { frames })
    }

    /// A halo from the frame of its list on, forwards and backwards: in each next frame the centre of the mass within its
    /// radius about the place where it is expected.
    pub fn of_halo(series: &SeriesFile<'_>, halo: &HaloNumber, place: &str, context: &Context<'_>) -> Result<Self> {
        let HaloNumber { file, number } = halo;
        let list = Catalogue::read(file, context)?;
        let row = list.place_of(*number);
        let row = row.ok_or_else(|| Error::input(name_of(file), format!("it lists no halo {number}")))?;
        let numbers: Vec<usize> = series.there().collect();
        let start = start(series, &numbers, list.scale_factor(), file, context)?;
        let mut decoder = SeriesDecoder::new(series);
        let model = decoder.frame(numbers[start], context)?.clone().into_model();
        let to = (model.metadata.unit_system(), model.metadata.cell);
        let (stated, radius) = list.placed(file, to, context)?[row];
        let radius = radius.ok_or_else(|| {
            let message = format!("halo {number} has no radius");
            Error::input_with(name_of(file), message, "name a column `radius` or `r200m`")
        })?;
        let lost = |frame: usize| {
            let when = series.clock.text(series.frames[frame].time, &model.metadata.units);
            format!("frame {frame} ({when}) has no mass near the place of halo {number}")
        };
        let domain = Domain::from_model(&model);
        let first = mass_center_near(&domain, &model, stated, radius)
            .ok_or_else(|| Error::input(place, lost(numbers[start])))?;
        let at_start = (series.frames[numbers[start]].time, first, domain);
        context.begin("following the halo", numbers.len() as u64 - 1);
        let mut walk = |to: &mut dyn Iterator<Item = usize>| -> Result<Vec<(f64, [f64; 3], Domain)>> {
            let mut track = vec![at_start];
            for frame in to {
                let model = decoder.frame(frame, context)?.clone().into_model();
                let (time, domain) = (series.frames[frame].time, Domain::from_model(&model));
                let Some(center) = mass_center_near(&domain, &model, expected(&track, time), radius) else {
                    // A halo has not always been there.
                    context.warn(&format!("{}: from there on the camera stays", lost(frame)));
                    break;
                };
                track.push((time, center, domain));
                context.advance(1);
            }
            Ok(track)
        };
        let after = walk(&mut numbers[start + 1..].iter().copied())?;
        let mut frames = walk(&mut numbers[..start].iter().rev().copied())?;
        context.end();
        frames.reverse();
        frames.extend(after.into_iter().skip(1));
        Ok(FocusPath { frames })
    }

    /// The place at a time of the clock; between frames on the straight line from one to the next.
    fn at(&self, time: f64) -> [f64; 3] {
        let after = self.frames.partition_point(|f| f.0 < time).min(self.frames.len() - 1);
        let (to, next, domain) = &self.frames[after];
        let (from, before, _) = &self.frames[after.saturating_sub(1)];
        if to <= from || time >= *to {
            return *next;
        }
        let (share, way) = ((time - from) / (to - from), domain.shortest_way(each_axis(|k| next[k] - before[k])));
        domain.in_box(each_axis(|k| before[k] + share * way[k]))
    }
}

/// The frame that a list of haloes belongs to, by its place among `numbers`.
fn start(
    series: &SeriesFile<'_>,
    numbers: &[usize],
    scale_factor: Option<f64>,
    file: &Path,
    context: &Context<'_>,
) -> Result<usize> {
    let list = name_of(file);
    let Some(a) = scale_factor.filter(|_| series.clock == SeriesClock::ScaleFactor) else {
        context.note(&format!("{list} states no scale factor: its haloes are taken for those of frame {}", numbers[0]));
        return Ok(0);
    };
    let off = |i: &usize| (series.frames[numbers[*i]].time - a).abs();
    let nearest = (0..numbers.len()).min_by(|i, j| off(i).total_cmp(&off(j))).unwrap_or(0);
    let spacing = [nearest.checked_sub(1), Some(nearest + 1)].into_iter().flatten().filter_map(|i| numbers.get(i));
    let time = series.frames[numbers[nearest]].time;
    let widest = spacing.map(|i| (series.frames[*i].time - time).abs()).fold(0.0, f64::max);
    // A moment within the series is at most half the way to the next frame from the nearest one.
    if off(&nearest) > (0.5 * widest).max(0.01 * a) {
        let message = format!("its scale factor is {a}, and the nearest frame's is {time}");
        return Err(Error::input_with(list, message, "name a list of a moment within the series"));
    }
    if off(&nearest) > 1e-6 * a {
        let frame = numbers[nearest];
        context.note(&format!("{list} is of scale factor {a}: frame {frame} is the nearest, of {time}"));
    }
    Ok(nearest)
}

/// The expected place of a centre that moves on evenly.
fn expected(track: &[(f64, [f64; 3], Domain)], time: f64) -> [f64; 3] {
    match track {
        [.., (t0, a, domain), (t1, b, _)] => {
            let (way, share) = (domain.shortest_way(each_axis(|k| b[k] - a[k])), (time - t1) / (t1 - t0));
            each_axis(|k| b[k] + share * way[k])
        }
        [(_, only, _)] => *only,
        [] => [0.0; 3],
    }
}

/// The model with each Gaussian where it is nearest to a place, in a box that repeats.
pub fn centred(mut model: Model, center: [f64; 3]) -> Model {
    let Some(cell) = model.metadata.cell.map(|cell| cell.reduced()) else { return model };
    let Some(about) = CenteredCell::new(center, cell) else { return model };
    for block in model.layers.iter_mut().flat_map(|l| &mut l.content) {
        let gaussians = &mut block.gaussians;
        for i in 0..gaussians.len() {
            let shift = about.shift(gaussians.mean_of(i));
            (0..3).for_each(|k| gaussians.mean[k][i] += shift[k]);
        }
    }
    model.metadata.bounds = bounds_about(&model.metadata.bounds, &cell, center);
    model
}

/// Bounds of what lies in a cell about a place, as wide as before along axes that do not repeat.
fn bounds_about(bounds: &Bounds, cell: &Cell, center: [f64; 3]) -> Bounds {
    let mut around = Bounds::empty();
    let half = each_axis(|k| 0.5 * (0..3).map(|a| cell.vectors[a][k]).sum::<f64>());
    for corner in cell.corners() {
        around.include(each_axis(|k| corner[k] - cell.origin[k] - half[k] + center[k]));
    }
    match cell.periodic {
        [true, true, true] => around,
        // In a tilted cell no axis of the world is free of the vectors that repeat.
        _ if cell.lengths().is_none() => around.union(bounds),
        repeats => Bounds {
            min: each_axis(|k| if repeats[k] { around.min[k] } else { bounds.min[k] }),
            max: each_axis(|k| if repeats[k] { around.max[k] } else { bounds.max[k] }),
        },
    }
}
