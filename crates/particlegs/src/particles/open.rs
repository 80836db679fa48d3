//! Opens raw float32: a folder, or three or four files; checks the values of any snapshot.

use super::{Column, ParticleLayer, Particles, Positions, SnapshotMeta, sidecar, sidecar::Sidecar};
use crate::{Error, Result};
use rayon::prelude::*;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::Arc;

/// Opens raw float32: one folder with xx.f32, yy.f32, zz.f32 (and ww.f32), or the three or four files
/// in that order, mapped, not copied. A meta.json beside them tells box, units and layers. Values
/// are as they are ([`check_values`]).
///
/// # Errors
/// [`Error::Io`] where a file cannot be read; [`Error::Input`] for columns of different lengths and
/// no particles.
pub fn open_raw(paths: &[PathBuf]) -> Result<Particles> {
    let particles = match paths {
        [] => return Err(Error::argument("no snapshot was named")),
        [folder] => open_folder(folder)?,
        [_, _, _] | [_, _, _, _] => open_columns(paths)?,
        more => {
            return Err(Error::argument(format!(
                "{} files were named; raw data are a folder or three or four columns",
                more.len()
            )));
        }
    };
    if particles.is_empty() {
        return Err(Error::input(&paths[0], "no particles"));
    }
    Ok(particles)
}

fn open_folder(folder: &Path) -> Result<Particles> {
    let files: Vec<PathBuf> = ["xx.f32", "yy.f32", "zz.f32"].iter().map(|f| folder.join(f)).collect();
    if let Some(missing) = files.iter().find(|f| !f.exists()) {
        return Err(Error::input_hint(
            missing,
            "missing",
            "a snapshot folder holds xx.f32, yy.f32, zz.f32 and, with weights, ww.f32",
        ));
    }
    let weights = folder.join("ww.f32");
    let mut particles = if weights.exists() {
        open_columns(&[files[0].clone(), files[1].clone(), files[2].clone(), weights])?
    } else {
        open_columns(&files)?
    };
    particles.meta = sidecar::read(folder, &folder.join("meta.json"))?.meta;
    Ok(particles)
}

fn open_columns(paths: &[PathBuf]) -> Result<Particles> {
    let columns: Vec<Column> = paths.iter().map(|p| map_raw(p)).collect::<Result<_>>()?;
    for (path, column) in paths.iter().zip(&columns) {
        if column.len() != columns[0].len() {
            return Err(Error::input(
                path,
                format!("{} values, but {} has {}", column.len(), paths[0].display(), columns[0].len()),
            ));
        }
    }
    let columns_len = columns[0].len();
    let mut columns = columns.into_iter();
    let mut next = || columns.next().expect("three columns at least");
    let positions = Positions::Columns([next(), next(), next()]);
    let weights = columns.next();
    let folder = paths[0].parent().unwrap_or(Path::new("."));
    let sidecar = folder.join("meta.json");
    let Sidecar { mut meta, kinds } = sidecar::read(folder, &sidecar)?;
    meta.name = paths[0].file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
    if kinds.last().is_some_and(|k| k.range.end != columns_len) {
        let what = format!("its `layers` do not hold the {columns_len} particles beside it");
        return Err(Error::input(&sidecar, what));
    }
    Ok(Particles { positions, weights, origin: [0.0; 3], meta, kinds })
}

/// Maps a raw little-endian float32 file.
fn map_raw(path: &Path) -> Result<Column> {
    let (map, length) = map_file(path)?;
    if length % 4 != 0 {
        return Err(Error::input(path, format!("{length} bytes is not a multiple of 4: not a float32 column")));
    }
    Ok(match map {
        None => Column::owned(Vec::new()),
        Some(map) => Column::Mapped { map, offset: 0, len: length / 4 },
    })
}

/// Maps a file and tells its length; `None` for an empty one, which cannot be mapped.
///
/// # Errors
/// [`Error::Io`]; [`Error::Input`] for what is no regular file.
pub fn map_file(path: &Path) -> Result<(Option<Arc<memmap2::Mmap>>, usize)> {
    let file = File::open(path).map_err(|e| Error::io(path, e))?;
    let metadata = file.metadata().map_err(|e| Error::io(path, e))?;
    if !metadata.is_file() {
        return Err(Error::input(path, "not a regular file"));
    }
    if metadata.len() == 0 {
        return Ok((None, 0));
    }
    // SAFETY: the mapping is read only; a file that another program truncates while we read it
    // ends this process with SIGBUS, as with every mapped reader; nothing is written from it.
    let map = unsafe { memmap2::Mmap::map(&file) }.map_err(|e| Error::io(path, e))?;
    let length = map.len();
    Ok((Some(Arc::new(map)), length))
}

/// Checks every value: particles with NaN, infinite or (weights) non-positive values are refused, or
/// dropped into fresh columns.
///
/// # Errors
/// [`Error::Input`] at `place`: how many, and the first.
pub fn check_values(particles: Particles, place: &str, drop: bool) -> Result<Particles> {
    let parts = particles.par_chunks(|start, chunk| {
        let mut bad = 0u64;
        let mut first = None;
        // NaN and infinity have the largest exponents; one maximum tells for the whole chunk
        // whether a closer look is needed.
        let largest = |c: &[f32]| c.iter().fold(0, |m: u32, v| m.max(v.to_bits() & 0x7fff_ffff));
        let suspicious = chunk.position.iter().any(|c| largest(c) >= f32::INFINITY.to_bits())
            || chunk.weight.is_some_and(|w| w.iter().any(|&v| !valid_weight(v)));
        if suspicious {
            for i in 0..chunk.len() {
                if !valid(&chunk, i) {
                    bad += 1;
                    first.get_or_insert(start + i);
                }
            }
        }
        (bad, first)
    });
    let bad: u64 = parts.iter().map(|p| p.0).sum();
    if bad == 0 {
        return Ok(particles);
    }
    let first = parts.iter().find_map(|p| p.1).unwrap_or(0);
    if !drop {
        return Err(Error::input_hint(
            place,
            format!("{bad} particles are invalid (NaN, infinite, or weight not positive), the first at index {first}"),
            "`--skip-invalid` drops them; `--weights none` ignores masses",
        ));
    }
    if bad == particles.len() as u64 {
        return Err(Error::input(place, format!("all {bad} particles are invalid")));
    }
    Ok(keep_valid(&particles))
}

fn valid_weight(w: f32) -> bool {
    w > 0.0 && w.is_finite()
}

fn valid(chunk: &super::Chunk<'_>, i: usize) -> bool {
    chunk.position.iter().all(|c| c[i].is_finite()) && chunk.weight.is_none_or(|w| valid_weight(w[i]))
}

fn keep_valid(particles: &Particles) -> Particles {
    let parts = particles.par_chunks(|start, chunk| {
        let keep: Vec<usize> = (0..chunk.len()).filter(|&i| valid(&chunk, i)).collect();
        let pick = |c: &[f32]| keep.iter().map(|&i| c[i]).collect::<Vec<f32>>();
        let of_kind = |kind: &ParticleLayer| keep.iter().filter(|&&i| kind.range.contains(&(start + i))).count();
        (chunk.position.map(pick), chunk.weight.map(pick), particles.kinds.iter().map(of_kind).collect::<Vec<_>>())
    });
    let column = |k: usize| Column::owned(parts.par_iter().flat_map_iter(|p| p.0[k].iter().copied()).collect());
    let mut end = 0;
    let kinds = particles.kinds.iter().enumerate().map(|(i, kind)| {
        let start = end;
        end += parts.iter().map(|p| p.2[i]).sum::<usize>();
        ParticleLayer { range: start..end, ..kind.clone() }
    });
    Particles {
        positions: Positions::Columns([column(0), column(1), column(2)]),
        weights: particles
            .weights
            .as_ref()
            .map(|_| Column::owned(parts.iter().flat_map(|p| p.1.iter().flatten().copied()).collect())),
        origin: particles.origin,
        meta: particles.meta.clone(),
        kinds: kinds.filter(|k| !k.range.is_empty()).collect(),
    }
}

/// Metadata of a file that says nothing but its name.
pub(super) fn named(path: &Path) -> SnapshotMeta {
    let name = path.file_name().map(|n| n.to_string_lossy().into_owned());
    SnapshotMeta { name: name.unwrap_or_else(|| "snapshot".into()), ..SnapshotMeta::default() }
}
