//! Opens raw float32: a folder, or three or four files; checks the values of any snapshot.

use super::meta::{self, Sidecar};
use super::storage::CHUNK;
use super::{ChunkBuffer, Column, Particles, Storage};
use particlegs_core::{Error, Hint, Result};
use particlegs_files::input::map_file;
use std::path::{Path, PathBuf};

impl Particles {
    /// Opens raw float32: one folder with xx.f32, yy.f32, zz.f32 (and ww.f32), or the three or four files
    /// in that order, mapped, not copied. A meta.json beside them tells box, units and layers. Values
    /// are as they are ([`Particles::checked`]).
    pub fn open_raw(paths: &[PathBuf]) -> Result<Particles> {
        let particles = match paths {
            [] => return Err(Error::argument("no snapshot was named")),
            [folder] => open_folder(folder)?,
            [_, _, _] | [_, _, _, _] => open_columns(paths)?,
            more => {
                return Err(Error::argument(format!(
                    "raw data must be one folder, or three or four column files, not {} files",
                    more.len()
                )));
            }
        };
        if particles.is_empty() {
            return Err(Error::input(&paths[0], "the snapshot has no particles"));
        }
        Ok(particles)
    }
}

fn open_folder(folder: &Path) -> Result<Particles> {
    let files: Vec<PathBuf> = ["xx.f32", "yy.f32", "zz.f32"].iter().map(|f| folder.join(f)).collect();
    if let Some(missing) = files.iter().find(|f| !f.exists()) {
        return Err(Error::input_with(
            missing,
            "the file is missing",
            "a snapshot folder must contain xx.f32, yy.f32, zz.f32 and, if there are weights, ww.f32",
        ));
    }
    let weights = folder.join("ww.f32");
    let mut particles = if weights.exists() {
        open_columns(&[files[0].clone(), files[1].clone(), files[2].clone(), weights])?
    } else {
        open_columns(&files)?
    };
    // Columns on their own are named after the first file; here the folder is the snapshot.
    particles.meta.name = meta::read(folder, &folder.join("meta.json"))?.meta.name;
    Ok(particles)
}

fn open_columns(paths: &[PathBuf]) -> Result<Particles> {
    let columns: Vec<Column> = paths.iter().map(|p| map_raw(p)).collect::<Result<_>>()?;
    for (path, column) in paths.iter().zip(&columns) {
        if column.len() != columns[0].len() {
            return Err(Error::input(
                path,
                format!("the file has {} values, but {} has {}", column.len(), paths[0].display(), columns[0].len()),
            ));
        }
    }
    let folder = paths[0].parent().unwrap_or(Path::new("."));
    let sidecar = folder.join("meta.json");
    let Sidecar { mut meta, origin, layers } = meta::read(folder, &sidecar)?;
    meta.name = paths[0].file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    if layers.last().is_some_and(|l| l.content.end != columns[0].len()) {
        let message = format!("the particles of its `layers` do not add up to the {} in the columns", columns[0].len());
        return Err(Error::input(&sidecar, message));
    }
    Particles::from_column_list(columns, origin, meta, layers).with_layer_masses()
}

/// Maps a raw little-endian float32 file.
fn map_raw(path: &Path) -> Result<Column> {
    let (map, length) = map_file(path)?;
    if length % 4 != 0 {
        return Err(Error::input(path, format!("its {length} bytes are not a multiple of 4, as float32 needs")));
    }
    Ok(match map {
        None => Column::owned(Vec::new()),
        Some(map) => Column::mapped(map, 0, length / 4),
    })
}

impl Particles {
    /// Checks every value: particles with NaN, infinite or (weights) non-positive values are refused, or
    /// dropped into fresh columns of a [`Storage`].
    pub fn checked(self, place: &str, drop: Option<&Storage>) -> Result<Particles> {
        let invalid = self.par_chunks(|_, chunk| invalid(&chunk)).into_iter();
        let invalid =
            invalid.enumerate().fold(InvalidParticles::default(), |all, (i, later)| all.and((i * CHUNK) as u64, later));
        match (invalid.count(), drop) {
            (0, _) => Ok(self),
            (_, None) => Err(invalid.refusal(place)),
            (count, Some(_)) if count == self.len() as u64 => {
                Err(Error::input(place, format!("all {count} particles are invalid")))
            }
            (count, Some(storage)) => keep_valid(&self, self.len() - count as usize, storage),
        }
    }
}

/// Invalid particles of a stretch, and the first of them.
#[derive(Clone, Copy, Debug, Default)]
pub struct InvalidParticles {
    /// Particles whose position is not finite.
    positions: u64,
    /// Others whose weight is no weight.
    weights: u64,
    first: u64,
}

impl InvalidParticles {
    pub(crate) fn count(self) -> u64 {
        self.positions + self.weights
    }

    /// With those of a later stretch, which begins at index `start`.
    pub(crate) fn and(self, start: u64, later: InvalidParticles) -> InvalidParticles {
        let first = if self.count() > 0 { self.first } else { start + later.first };
        InvalidParticles { positions: self.positions + later.positions, weights: self.weights + later.weights, first }
    }

    pub(crate) fn refusal(self, place: &str) -> Error {
        let faults = [
            (self.positions, "a position that is not finite"),
            (self.weights, "a mass or weight that is not between 0 and 3e38"),
        ];
        let faults = faults.into_iter().filter(|(count, _)| *count > 0);
        let said: Vec<String> = faults.map(|(count, fault)| format!("{count} with {fault}")).collect();
        let message = format!("there are invalid particles: {}; the first has index {}", said.join(", "), self.first);
        let hint = Hint::default().option("skip-invalid", "").words(" leaves them out; ");
        Error::input_with(place, message, hint.option("mass-field", "none").words(" ignores masses"))
    }
}

/// Finds the particles of a run that no fit can take.
pub fn invalid(chunk: &super::Chunk<'_>) -> InvalidParticles {
    // NaN and infinity have the largest exponents; one maximum tells for the whole chunk whether a
    // closer look is needed.
    let largest = |c: &[f32]| c.iter().fold(0, |m: u32, v| m.max(v.to_bits() & 0x7fff_ffff));
    let suspicious = chunk.position.iter().any(|c| largest(c) >= f32::INFINITY.to_bits())
        || chunk.weight.is_some_and(|w| w.iter().any(|&v| !valid_weight(v)));
    if !suspicious {
        return InvalidParticles::default();
    }
    (0..chunk.len()).filter(|&i| !valid(chunk, i)).fold(InvalidParticles::default(), |all, i| {
        let unplaced = chunk.position.iter().any(|c| !c[i].is_finite());
        all.and(0, InvalidParticles { positions: unplaced.into(), weights: (!unplaced).into(), first: i as u64 })
    })
}

fn valid_weight(w: f32) -> bool {
    w > 0.0 && w.is_finite()
}

fn valid(chunk: &super::Chunk<'_>, i: usize) -> bool {
    chunk.position.iter().all(|c| c[i].is_finite()) && chunk.weight.is_none_or(|w| valid_weight(w[i]))
}

fn keep_valid(particles: &Particles, count: usize, storage: &Storage) -> Result<Particles> {
    let weighted = particles.weights().is_some();
    let mut columns = storage.columns("the valid particles", if weighted { 4 } else { 3 }, count)?;
    let (mut layers, mut end, mut buffer) = (Vec::new(), 0, ChunkBuffer::default());
    for layer in particles.layers() {
        let first = end;
        for start in layer.content.clone().step_by(CHUNK) {
            let chunk = particles.chunk(start..layer.content.end.min(start + CHUNK), &mut buffer);
            for i in (0..chunk.len()).filter(|&i| valid(&chunk, i)) {
                (0..3).for_each(|k| columns[k][end] = chunk.position[k][i]);
                chunk.weight.iter().for_each(|w| columns[3][end] = w[i]);
                end += 1;
            }
        }
        layers.push(layer.with(first..end));
    }
    Particles::from_buffers(columns, particles.origin, particles.meta.clone(), layers)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_of_different_masses_weigh_their_particles() {
        let dir = tempfile::tempdir().unwrap();
        for name in ["xx", "yy", "zz"] {
            std::fs::write(dir.path().join(name).with_extension("f32"), [0u8; 12]).unwrap();
        }
        let open = |masses: [f64; 2]| {
            let layer = |name: &str, n: usize, mass: f64| {
                format!("{{\"name\": \"{name}\", \"particles\": {n}, \"particle_mass\": {mass}}}")
            };
            let text = format!("{{\"layers\": [{}, {}]}}", layer("dm", 1, masses[0]), layer("gas", 2, masses[1]));
            std::fs::write(dir.path().join("meta.json"), text).unwrap();
            Particles::open_raw(&[dir.path().to_path_buf()]).unwrap()
        };
        assert_eq!(&open([5.0, 0.5]).weights().unwrap()[..], &[5.0, 0.5, 0.5]);
        assert!(open([5.0, 0.5]).layers().iter().all(|l| !l.mass.is_weighted()));
        let alike = open([2.0, 2.0]);
        assert!(alike.weights().is_none() && alike.meta.particle_mass == Some(2.0));
    }
}
