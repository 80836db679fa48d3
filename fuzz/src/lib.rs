//! What the targets of the particle formats share.

use particlegs_formats::Choice;
use particlegs_pipeline::context::Context;
use particlegs_pipeline::particles::RUN;
use std::path::PathBuf;
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

/// Any bytes as a file of format `name`: described, and every species read to its end.
pub fn fuzz_format(name: &str, data: &[u8]) {
    std::fs::write(file(), data).expect("room for the input");
    let options = Choice { format: Some(name.into()), ..Choice::default() };
    let Ok(snapshot) = options.open(&[file().clone()]) else { return };
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
