//! `runs.bin`: bounds and hash of every run of the snapshot.

use particlegs_core::math::each_axis;
use particlegs_core::{Error, Result};
use particlegs_files::input::{Begins, Form, read_own};
use particlegs_files::output;
use particlegs_particles::RunHash;
use particlegs_particles::blocks::RunScan;
use std::path::Path;

const MAGIC: &[u8; 8] = b"PGSRUNS1";
/// Six coordinates, a flag, two hashes.
const WIDTH: usize = 24 + 1 + 64;

pub(super) fn write(path: &Path, id: &[u8; 32], runs: &[RunScan]) -> Result<()> {
    let mut bytes = Vec::with_capacity(44 + WIDTH * runs.len());
    bytes.extend(MAGIC);
    bytes.extend(id);
    for run in runs {
        run.min.iter().chain(&run.max).for_each(|v| bytes.extend(v.to_le_bytes()));
        bytes.push(u8::from(run.hash.weights.is_some()));
        bytes.extend(run.hash.positions);
        bytes.extend(run.hash.weights.unwrap_or([0; 32]));
    }
    bytes.extend(crc32fast::hash(&bytes).to_le_bytes());
    output::write_bytes(path, &bytes)
}

/// Reads `count` runs of plan `id`.
pub(super) fn read(path: &Path, id: &[u8; 32], count: u64) -> Result<Vec<RunScan>> {
    let broken = |fault: &str| Error::input_with(path, fault, "run `plan` again, in another folder");
    let most = count.saturating_mul(WIDTH as u64).saturating_add(44);
    let form = Form { title: "the runs of this plan", begins: Begins::With(MAGIC), most, expansion: 2 };
    let bytes = match read_own(path, form) {
        Ok(bytes) => bytes.ok_or_else(|| broken("the file is missing"))?,
        Err(Error::Input { what, .. }) => return Err(broken(&what)),
        Err(e) => return Err(e),
    };
    let body = bytes.len().checked_sub(4).filter(|n| *n >= 40).ok_or_else(|| broken("the file is incomplete"))?;
    let (body, crc) = bytes.split_at(body);
    if &body[..8] != MAGIC || crc32fast::hash(body).to_le_bytes() != crc {
        return Err(broken("the file is incomplete or was changed"));
    }
    if body[8..40] != id[..] || (body.len() - 40) as u64 != count.saturating_mul(WIDTH as u64) {
        return Err(broken("the file belongs to another plan"));
    }
    Ok(body[40..].chunks_exact(WIDTH).map(run).collect())
}

fn run(bytes: &[u8]) -> RunScan {
    let real = |i: usize| f32::from_le_bytes(std::array::from_fn(|b| bytes[4 * i + b]));
    let hash = |from: usize| std::array::from_fn(|b| bytes[from + b]);
    RunScan {
        min: each_axis(real),
        max: each_axis(|k| real(3 + k)),
        hash: RunHash { positions: hash(25), weights: (bytes[24] == 1).then(|| hash(57)) },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_come_back_and_other_files_do_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("runs.bin");
        let run = |i: u8, weights| RunScan {
            min: [f32::from(i), -1.5, 0.0],
            max: [9.0, f32::from(i), 1e-30],
            hash: RunHash { positions: [i; 32], weights },
        };
        let runs = [run(1, None), run(2, Some([7; 32]))];
        write(&path, &[5; 32], &runs).unwrap();
        assert_eq!(read(&path, &[5; 32], 2).unwrap(), runs);
        assert!(read(&path, &[6; 32], 2).unwrap_err().to_string().contains("another plan"));
        assert!(read(&path, &[5; 32], 3).is_err() && read(&path, &[5; 32], u64::MAX).is_err());
        let mut bytes = std::fs::read(&path).unwrap();
        for cut in [0, 3, 43, bytes.len() - 1] {
            std::fs::write(&path, &bytes[..cut]).unwrap();
            assert!(read(&path, &[5; 32], 2).is_err(), "{cut}");
        }
        bytes[60] ^= 1;
        std::fs::write(&path, &bytes).unwrap();
        assert!(read(&path, &[5; 32], 2).is_err());
    }
}
