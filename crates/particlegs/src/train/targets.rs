//! The pictures to learn from: drawn from all particles when they are first asked for, kept on disk
//! within a limit.

use super::config::Stage;
use super::learner::Crop;
use crate::camera::View;
use crate::picture::{Plane, Size};
use crate::progress::Progress;
use crate::reference::Reference;
use crate::splat::Look;
use crate::{Error, Result};
use std::collections::HashMap;
use std::fs::File;
use std::io::{Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

/// Levels of a kept pixel.
const LEVELS: f32 = 65_535.0;

/// Targets of one stage.
pub(crate) struct Targets<'a> {
    reference: &'a Reference<'a>,
    look: Look,
    size: Size,
    oversample: usize,
    folder: PathBuf,
    /// A file without a name, gone with the process; `None` before the first target.
    file: Option<File>,
    /// Where in the file each target lies, in targets.
    places: HashMap<u64, u64>,
    /// Targets that the file may hold.
    most: u64,
}

impl<'a> Targets<'a> {
    /// For a stage; at most `bytes` are kept in a scratch file in `folder`.
    pub fn new(reference: &'a Reference<'a>, look: Look, stage: &Stage, folder: &Path, bytes: u64) -> Self {
        let size = Size { width: stage.size[0], height: stage.size[1] };
        Targets {
            reference,
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
    ///
    /// # Errors
    /// [`Error::Io`] of the scratch file; those of the reference renderer.
    pub fn get(&mut self, key: u64, view: &View, crop: &Crop, progress: &dyn Progress) -> Result<Plane> {
        if let Some(&place) = self.places.get(&key) {
            return self.read(place, crop);
        }
        let levels = self.draw(view, progress)?;
        let place = self.places.len() as u64;
        if place < self.most {
            self.write(place, &levels)?;
            self.places.insert(key, place);
        }
        let Size { width, .. } = self.size;
        let rows = (crop.corner[1]..crop.corner[1] + crop.size.height)
            .flat_map(|row| &levels[row * width + crop.corner[0]..][..crop.size.width]);
        Ok(Plane { size: crop.size, data: rows.map(|&l| f32::from(l) / LEVELS).collect() })
    }

    /// The whole picture, from `oversample` times as many pixels along either side.
    fn draw(&self, view: &View, progress: &dyn Progress) -> Result<Vec<u16>> {
        let k = self.oversample;
        let large = Size { width: self.size.width * k, height: self.size.height * k };
        let quantised = |v: f32| (v * LEVELS + 0.5) as u16;
        if self.look != Look::Expected {
            let picture = self.reference.draw(view, large, self.look, progress)?;
            let at = |i: usize| f32::from(picture.data[i]) / 255.0;
            return Ok(averaged(self.size, k, at).map(quantised).collect());
        }
        let tau = self.reference.optical_depth(view, large, progress)?;
        Ok(averaged(self.size, k, |i| -(-tau.data[i]).exp_m1()).map(quantised).collect())
    }

    fn write(&mut self, place: u64, levels: &[u16]) -> Result<()> {
        let bytes: Vec<u8> = levels.iter().flat_map(|l| l.to_le_bytes()).collect();
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
            return Err(Error::input(&self.folder, "the scratch file of targets is gone".to_string()));
        };
        let first = place * self.size.pixels() as u64 + (crop.corner[1] * self.size.width) as u64;
        let mut bytes = vec![0u8; 2 * self.size.width * crop.size.height];
        file.seek(SeekFrom::Start(2 * first)).and_then(|_| file.read_exact(&mut bytes)).map_err(fail)?;
        let rows = bytes.chunks_exact(2 * self.size.width);
        let pixels = rows.flat_map(|row| row[2 * crop.corner[0]..][..2 * crop.size.width].chunks_exact(2));
        let data = pixels.map(|p| f32::from(u16::from_le_bytes([p[0], p[1]])) / LEVELS).collect();
        Ok(Plane { size: crop.size, data })
    }
}

/// Means of squares of `k` times `k` pixels of a picture that is `k` times as large.
fn averaged(size: Size, k: usize, at: impl Fn(usize) -> f32) -> impl Iterator<Item = f32> {
    let wide = size.width * k;
    (0..size.pixels()).map(move |p| {
        let (x, y) = (p % size.width * k, p / size.width * k);
        let sum: f32 = (0..k * k).map(|q| at((y + q / k) * wide + x + q % k)).sum();
        sum / (k * k) as f32
    })
}
