//! The measured snapshots, and their positions as compressors take them.

use crate::PositionColumns;
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_formats::Catalogue;
use particlegs_particles::{Column, Particles, Positions, Selection, SnapshotMeta, Storage};
use std::path::PathBuf;

pub struct Snapshot {
    /// Name in tables.
    pub name: String,
    pub path: PathBuf,
    pub particles: Particles,
    /// Start of the hash that models carry, in hexadecimal, and of a hash of what that leaves out: box, units,
    /// cosmology and reading options.
    pub hash: String,
}

impl Snapshot {
    /// Particles from `path`, read with `options` if there were any.
    pub fn new(name: String, path: PathBuf, particles: Particles, options: Option<&str>) -> Snapshot {
        let start = |hash: blake3::Hash, digits: usize| hash.to_hex()[..digits].to_string();
        let said = SnapshotMeta { name: String::new(), ..particles.meta.clone() };
        let said = blake3::hash(&serde_json::to_vec(&(said, options)).unwrap_or_default());
        let hash = start(blake3::Hash::from_bytes(particles.source_hash()), 24) + "-" + &start(said, 8);
        Snapshot { name, path, particles, hash }
    }

    /// Two random halves of the particles; they depend only on the seed.
    pub fn halves(&self, seed: u64, context: &Context<'_>) -> Result<[Particles; 2]> {
        let half = Selection { sample: Some(self.particles.len() as u64 / 2), seed, ..Selection::all() };
        let taken = |selection| self.particles.select(selection, &Storage::Memory, context);
        Ok([taken(half)?, taken(Selection { left_out: true, ..half })?])
    }

    /// Size of the positions in float32, to which ratios refer.
    pub fn position_bytes(&self) -> u64 {
        12 * self.particles.len() as u64
    }

    /// Note on ratios, if particles have individual masses.
    pub fn weights_note(&self) -> Option<String> {
        (self.particles.raw_bytes() > self.position_bytes()).then(|| {
            format!(
                "The particles of {} have individual masses. Our models store them within the listed bytes; the \
                 other compressors store only positions. Ratios count positions only.",
                self.name
            )
        })
    }

    /// Centres of haloes in `centres.csv` beside the snapshot's file or in its folder, world units. None without it.
    pub fn centres(&self, context: &Context<'_>) -> Result<Vec<[f64; 3]>> {
        let folder = if self.path.is_dir() { Some(self.path.as_path()) } else { self.path.parent() };
        let Some(path) = folder.map(|f| f.join("centres.csv")).filter(|p| p.is_file()) else { return Ok(Vec::new()) };
        let meta = &self.particles.meta;
        let list = Catalogue::read(&path, context)?.convert(&meta.unit_system(), None);
        let (centres, _) = list.map_err(|message| Error::input(path.display().to_string(), message))?;
        Ok(centres.into_iter().map(|(at, _)| at).collect())
    }

    /// Unit of positions in tables.
    pub fn unit(&self) -> &str {
        self.particles.meta.units.length_text().unwrap_or("length units")
    }

    /// Mean spacing of the particles, world units.
    pub fn spacing(&self) -> f64 {
        particlegs_particles::Domain::from_particles(&self.particles).spacing(self.particles.len())
    }
}

/// Positions in columns, relative to the particles' origin, since float32 has few digits far from it.
pub fn columns_of(p: &Particles) -> PositionColumns {
    [0, 1, 2].map(|k| (0..p.len()).map(|i| (p.position(i)[k] - p.origin[k]) as f32).collect())
}

/// Particles from such columns, with the origin and box of `self`.
pub fn particles_of(columns: PositionColumns, like: &Particles) -> Particles {
    Particles::new(Positions::Columns(columns.map(Column::owned)), like.origin, like.meta.clone())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Another box is another snapshot, though the positions are the same, whether a file or a user says so.
    #[test]
    fn the_hash_covers_box_and_options_but_not_the_name() {
        let hash_of = |lengths: Option<[f64; 3]>, name: &str, options| {
            let mut particles = Particles::from_columns(vec![1.0; 3], vec![2.0; 3], vec![3.0; 3]);
            particles.meta.name = name.into();
            particles.meta.state(lengths, [None; 2]).unwrap();
            Snapshot::new("s".into(), "s".into(), particles, options).hash
        };
        let hash = hash_of(None, "a", None);
        assert_eq!(hash, hash_of(None, "b", None));
        let others = [
            hash_of(Some([1.0; 3]), "a", None),
            hash_of(Some([2.0; 3]), "a", None),
            hash_of(None, "a", Some("--near")),
        ];
        assert!(others.iter().all(|h| *h != hash && h[..24] == hash[..24]) && others[0] != others[1], "{others:?}");
    }

    /// Other compressors keep positions alone: ratios are of those, and masses that only models keep are told.
    #[test]
    fn ratios_are_of_positions() {
        let plain = Particles::from_columns(vec![1.0, 2.0], vec![4.0, 5.0], vec![7.0, 8.0]);
        let weighted = plain.clone().with_weights(Column::owned(vec![1.0, 2.0]));
        let [plain, weighted] = [plain, weighted].map(|p| Snapshot::new("box".into(), "box".into(), p, None));
        assert_eq!((plain.position_bytes(), weighted.position_bytes()), (24, 24));
        assert_eq!(weighted.particles.raw_bytes(), 32);
        assert!(
            plain.weights_note().is_none()
                && weighted.weights_note().unwrap().contains("of box have individual masses")
        );
    }

    /// A snapshot far from zero comes back as it was: compressors are not given fewer digits than models.
    #[test]
    fn columns_keep_digits_far_from_the_origin() {
        let near = [vec![0.125f32, 3.0], vec![1.0, 2.0], vec![0.0, 0.5]];
        let positions = Positions::Columns(near.clone().map(Column::owned));
        let far = Particles::new(positions, [1e9, 0.0, -1e9], Particles::from_columns(vec![], vec![], vec![]).meta);
        let columns = columns_of(&far);
        assert_eq!(columns, near);
        let back = particles_of(columns, &far);
        assert_eq!([0, 1].map(|i| back.position(i)), [0, 1].map(|i| far.position(i)));
        assert_eq!(back.position(0)[0], 1e9 + 0.125);
    }
}
