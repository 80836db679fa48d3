//! Functions that the tests of formats share.

use crate::{Choice, Snapshot, Writer};
use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_particles::{Particles, RUN, SelectedParticles, Selection, Tiling};
use std::io::Write;
use std::path::Path;
use std::sync::Mutex;

pub struct SpeciesParticles {
    pub name: String,
    /// World positions.
    pub positions: Vec<[f64; 3]>,
    /// Empty without weights.
    pub weights: Vec<f32>,
}

pub fn scratch(content: &[u8]) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(content).unwrap();
    file
}

/// Reads a species whole, and again from its second run on.
pub fn read(snapshot: &dyn Snapshot, species: usize, choice: &Choice) -> Result<SpeciesParticles> {
    let reader = snapshot.reader(species, choice)?;
    let runs = reader.count().div_ceil(RUN as u64);
    let gather = |from: u64| -> Result<Vec<([f64; 3], f32)>> {
        let parts: Vec<Mutex<Vec<([f64; 3], f32)>>> = (from..runs).map(|_| Mutex::default()).collect();
        reader.read(from..runs, &Context::SILENT, &|run, chunk| {
            let origin = reader.origin();
            let at = |i: usize| std::array::from_fn(|k| origin[k] + f64::from(chunk.position[k][i]));
            let weight = |i: usize| chunk.weight.map_or(0.0, |w| w[i]);
            let mut part = parts[(run - from) as usize].lock().unwrap();
            assert!(part.is_empty() && chunk.len() <= RUN);
            *part = (0..chunk.len()).map(|i| (at(i), weight(i))).collect();
            Ok(())
        })?;
        Ok(parts.into_iter().flat_map(|part| part.into_inner().unwrap()).collect())
    };
    let all = gather(0)?;
    assert_eq!(all.len() as u64, reader.count());
    if runs > 1 {
        assert!(gather(1)? == all[RUN..], "a later run differs");
    }
    let name = snapshot.description().species[species].name.clone();
    let (positions, weights) = all.into_iter().unzip();
    Ok(SpeciesParticles { name, positions, weights: if reader.has_weights() { weights } else { Vec::new() } })
}

/// Position and weight of each particle of a species; 0 without weights.
pub fn rows(snapshot: &dyn Snapshot, species: usize, choice: &Choice) -> Result<Vec<[f64; 4]>> {
    let got = read(snapshot, species, choice)?;
    let weight = |i: usize| got.weights.get(i).map_or(0.0, |w| f64::from(*w));
    Ok(got.positions.iter().enumerate().map(|(i, &[x, y, z])| [x, y, z, weight(i)]).collect())
}

pub fn open_bytes(name: &str, bytes: &[u8]) -> Result<Box<dyn Snapshot>> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join(name);
    std::fs::write(&path, bytes).unwrap();
    Choice::default().open(&[path])
}

pub fn hex(text: &str) -> Vec<u8> {
    (0..text.len() / 2).map(|i| u8::from_str_radix(&text[2 * i..2 * i + 2], 16).unwrap()).collect()
}

pub fn gzip(content: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::GzEncoder::new(Vec::new(), flate2::Compression::fast());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

pub fn zlib(content: &[u8]) -> Vec<u8> {
    let mut encoder = flate2::write::ZlibEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

/// A deflate stream, and the CRC-32 of its content.
pub fn deflate(content: &[u8]) -> (Vec<u8>, u32) {
    let mut encoder = flate2::write::DeflateEncoder::new(Vec::new(), flate2::Compression::default());
    encoder.write_all(content).unwrap();
    let mut sum = flate2::Crc::new();
    sum.update(content);
    (encoder.finish().unwrap(), sum.sum())
}

/// Writes all particles to `path`, and checks the number of bytes that it gives.
pub fn written(particles: &Particles, path: &Path, name: &str) -> u64 {
    let selected_particles =
        SelectedParticles::new(particles, Tiling::single(), Selection::all(), &Context::SILENT).unwrap();
    let bytes =
        Writer::for_output(path, Some(name)).unwrap().write(&selected_particles, path, &Context::SILENT).unwrap();
    assert_eq!(bytes, std::fs::metadata(path).unwrap().len());
    bytes
}

/// A file of tests/fixtures or tests/data, at a frame or the last, and what the field `name` of a species holds.
pub fn fixture(path: &str, frame: Option<i64>) -> Box<dyn Snapshot> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(path);
    Choice { frame, ..Choice::default() }.open(&[path]).unwrap()
}

/// The numbers of a field of three components, or three fields, as they are stored.
pub fn vectors(snapshot: &dyn Snapshot, species: usize, name: &str) -> Vec<[f64; 3]> {
    let choice = Choice { positions: Some(name.into()), ..Choice::default() };
    read(snapshot, species, &choice).unwrap().positions
}

/// The error of opening or reading the bytes.
pub fn fault(bytes: &[u8]) -> String {
    let file = scratch(bytes);
    let snapshot = match Choice::default().open(&[file.path().to_path_buf()]) {
        Err(e) => return e.to_string(),
        Ok(snapshot) => snapshot,
    };
    match (0..snapshot.description().species.len()).find_map(|s| read(&*snapshot, s, &Choice::default()).err()) {
        Some(e) => e.to_string(),
        None => "it was read".into(),
    }
}
