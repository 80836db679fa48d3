//! What the targets of the particle formats share.

use particlegs_formats::{AtomSelection, Choice};
use particlegs_core::context::Context;
use particlegs_particles::RUN;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

/// The file that each input is written to; readers map files.
fn file() -> &'static PathBuf {
    static FILE: OnceLock<PathBuf> = OnceLock::new();
    FILE.get_or_init(|| {
        let memory = PathBuf::from("/dev/shm");
        let folder = if memory.is_dir() { memory } else { std::env::temp_dir() };
        folder.join(format!("particlegs-fuzz-{}", std::process::id()))
    })
}

/// Any bytes as a file of the format of a target, such as `format_lammps_data`: described, and every species read to its
/// end.
pub fn fuzz_format(target: &str, data: &[u8]) {
    std::fs::write(file(), data).expect("room for the input");
    let name = target.trim_start_matches("format_").replace('_', "-");
    assert!(Choice::formats().any(|format| format == name), "there is no format {name}");
    read(&Choice { format: Some(name), ..Choice::default() }, file());
}

/// Any first line as a selection, and the rest as the topology of a trajectory of 50 atoms.
pub fn fuzz_topology(data: &[u8]) {
    let (text, topology) = data.split_at(data.iter().position(|&b| b == b'\n').unwrap_or(data.len()));
    std::fs::write(file(), topology.get(1..).unwrap_or_default()).expect("room for the input");
    let select = AtomSelection::parse(&String::from_utf8_lossy(text)).ok();
    let trajectory = concat!(env!("CARGO_MANIFEST_DIR"), "/../crates/particlegs-formats/tests/fixtures/mdanalysis.xtc");
    read(&Choice { topology: Some(file().clone()), select, ..Choice::default() }, trajectory.as_ref());
}

/// Reads every species to its end.
fn read(options: &Choice, path: &Path) {
    let Ok(snapshot) = options.open(&[path.into()]) else { return };
    for (index, species) in snapshot.description().species.iter().enumerate() {
        let Ok(reader) = snapshot.reader(index, &Choice::default()) else { continue };
        assert_eq!(reader.count(), species.count);
        let _ = reader.read(0..reader.count().div_ceil(RUN as u64), &Context::SILENT, &|run, chunk| {
            let n = reader.count().min((run + 1) * RUN as u64) - run * RUN as u64;
            assert!(chunk.position.iter().chain(&chunk.weight).all(|c| c.len() as u64 == n));
            Ok(())
        });
    }
}
