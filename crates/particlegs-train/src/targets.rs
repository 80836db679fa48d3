//! The pictures to learn from: drawn from all particles when they are first asked for, kept on disk within a limit; and
//! those of held-out views, whose score says which Gaussians are the best.

use super::accelerator::TrainingSubject;
use super::cameras::Defaults;
use super::config::{Config, Stage};
use super::learner::Crop;
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::Mixture;
use particlegs_core::picture::{Gray8, Plane, Size, masked_psnr};
use particlegs_core::render::{self, Scene};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result, parallel};
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

const RUN: usize = 1 << 14;
const LEVELS: f32 = 65_535.0;

pub(crate) struct Targets<'a> {
    subject: &'a dyn TrainingSubject,
    look: ToneStyle,
    size: Size,
    oversample: usize,
    folder: PathBuf,
    /// A file without a name, gone with the process; `None` before the first target.
    file: Option<File>,
    /// Place of each target in the file, in targets.
    places: HashMap<u64, u64>,
    /// Targets that the file may hold.
    most: u64,
}

impl<'a> Targets<'a> {
    /// For a stage; at most `bytes` are kept in a scratch file in `folder`.
    pub fn new(subject: &'a dyn TrainingSubject, look: ToneStyle, stage: &Stage, folder: &Path, bytes: u64) -> Self {
        let size = Size { width: stage.size[0], height: stage.size[1] };
        Targets {
            subject,
            look,
            size,
            oversample: stage.oversample,
            folder: folder.to_path_buf(),
            file: None,
            places: HashMap::new(),
            most: bytes / (2 * size.pixels() as u64).max(1),
        }
    }

    /// Brightness in [0, 1] of a part of the picture of `view`, whose number is `key`.
    pub fn get(&mut self, key: u64, view: &View, crop: &Crop, context: &Context<'_>) -> Result<Plane> {
        if let Some(&place) = self.places.get(&key) {
            return self.read(place, crop);
        }
        let levels = self.draw(view, context)?;
        let place = self.places.len() as u64;
        if place < self.most {
            self.write(place, &levels)?;
            self.places.insert(key, place);
        }
        let from = crop.corner[1] * self.size.width;
        Ok(part(crop, self.size.width, &levels[from..]))
    }

    /// The whole picture, from `oversample` times as many pixels along either side.
    fn draw(&self, view: &View, context: &Context<'_>) -> Result<Vec<u16>> {
        let k = self.oversample;
        let large = Size { width: self.size.width * k, height: self.size.height * k };
        if self.look != ToneStyle::Expected {
            let picture = self.subject.draw(view, large, self.look, context)?;
            return Ok(averaged(self.size, k, |i| f32::from(picture.data[i]) / 255.0));
        }
        // Not by way of a picture of 8 bits: the look has no steps, and targets hold 16 bits.
        let tau = self.subject.optical_depth(view, large, context)?;
        Ok(averaged(self.size, k, |i| -(-tau.data[i]).exp_m1()))
    }

    fn write(&mut self, place: u64, levels: &[u16]) -> Result<()> {
        let mut bytes = vec![0u8; 2 * levels.len()];
        parallel::for_each(bytes.chunks_mut(2 * RUN).zip(levels.chunks(RUN)), |(bytes, levels)| {
            bytes.chunks_exact_mut(2).zip(levels).for_each(|(b, l)| b.copy_from_slice(&l.to_le_bytes()));
        });
        let fail = |e| Error::io(&self.folder, e);
        if self.file.is_none() {
            self.file = Some(tempfile::tempfile_in(&self.folder).map_err(fail)?);
        }
        let Some(file) = &mut self.file else { return Ok(()) };
        file.seek(SeekFrom::Start(place * bytes.len() as u64)).and_then(|_| file.write_all(&bytes)).map_err(fail)
    }

    fn read(&mut self, place: u64, crop: &Crop) -> Result<Plane> {
        let fail = |e| Error::io(&self.folder, e);
        let Some(file) = &mut self.file else {
            return Err(Error::input(
                &self.folder,
                "the scratch file of the training pictures has disappeared".to_string(),
            ));
        };
        // Whole rows are read, which are contiguous in the file.
        let first = place * self.size.pixels() as u64 + (crop.corner[1] * self.size.width) as u64;
        let mut bytes = vec![0u8; 2 * self.size.width * crop.size.height];
        file.seek(SeekFrom::Start(2 * first)).and_then(|_| file.read_exact(&mut bytes)).map_err(fail)?;
        let mut levels = vec![0u16; bytes.len() / 2];
        parallel::for_each(levels.chunks_mut(RUN).zip(bytes.chunks(2 * RUN)), |(levels, bytes)| {
            levels.iter_mut().zip(bytes.chunks_exact(2)).for_each(|(l, b)| *l = u16::from_le_bytes([b[0], b[1]]));
        });
        Ok(part(crop, self.size.width, &levels))
    }
}

/// Brightness of a part, from the rows of a picture of that width that begin where the part does.
fn part(crop: &Crop, width: usize, levels: &[u16]) -> Plane {
    let mut plane = Plane::zeros(crop.size);
    parallel::for_each(plane.data.chunks_mut(crop.size.width).zip(levels.chunks(width)), |(out, row)| {
        let row = &row[crop.corner[0]..];
        out.iter_mut().zip(row).for_each(|(o, &l)| *o = f32::from(l) * (1.0 / LEVELS));
    });
    plane
}

/// Levels of means of squares of `k` times `k` pixels of a picture that is `k` times as large.
fn averaged(size: Size, k: usize, at: impl Fn(usize) -> f32 + Sync) -> Vec<u16> {
    let wide = size.width * k;
    let mut out = vec![0u16; size.pixels()];
    parallel::for_each_chunk(&mut out, size.width, |y, out| {
        for (x, o) in out.iter_mut().enumerate() {
            let first = y * k * wide + x * k;
            let sum: f32 = (0..k * k).map(|q| at(first + q / k * wide + q % k)).sum();
            *o = (sum / (k * k) as f32 * LEVELS + 0.5) as u16;
        }
    });
    out
}

pub(crate) struct HeldOutViews<'a> {
    config: &'a Config,
    defaults: &'a Defaults,
    context: &'a Context<'a>,
    size: Size,
    views: Vec<View>,
    truth: Vec<Gray8>,
}

impl<'a> HeldOutViews<'a> {
    /// Draws the targets of the first `config.evaluate_views` views, at the largest stage's size.
    pub fn draw(
        subject: &dyn TrainingSubject,
        views: &[View],
        config: &'a Config,
        defaults: &'a Defaults,
        context: &'a Context<'a>,
    ) -> Result<Self> {
        let [width, height] = config.stages.iter().map(|s| s.size).max_by_key(|s| s[0] * s[1]).unwrap_or([16, 16]);
        let size = Size { width, height };
        let views: Vec<View> = views.iter().take(config.evaluate_views as usize).cloned().collect();
        let truth = views.iter().map(|view| subject.draw(view, size, config.target, context)).collect::<Result<_>>()?;
        Ok(HeldOutViews { config, defaults, context, size, views, truth })
    }

    /// Mean masked PSNR of Gaussians, dB; `None` where no view has one.
    pub fn masked_psnr(&self, mixture: &Mixture) -> Result<Option<f64>> {
        let Defaults { bounds, radius, opacity, .. } = *self.defaults;
        let scene = Scene::from_law(mixture, bounds, radius, opacity);
        let mut scores = Vec::new();
        for (view, truth) in self.views.iter().zip(&self.truth) {
            let drawn = render::draw(&scene, view, self.size, self.config.target, self.context)?;
            scores.extend(masked_psnr(&drawn, truth));
        }
        Ok((!scores.is_empty()).then(|| scores.iter().sum::<f64>() / scores.len() as f64))
    }
}
