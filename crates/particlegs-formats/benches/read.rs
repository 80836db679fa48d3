//! Speed of readers: two million particles in each format that is written, file in the page cache.

use divan::{Bencher, counter::ItemsCount};
use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_formats::{Choice, Writer};
use particlegs_particles::{Particles, SelectedParticles, Selection, Storage, Tiling};

fn main() {
    divan::main();
}

#[divan::bench(args = ["npy", "hdf5", "vtp", "dump"], sample_count = 5)]
fn read(bencher: Bencher, ending: &str) {
    let n = 2_000_000;
    let [x, y, z] = [0, 1, 2].map(|k| (0..n).map(|i| 100.0 * Random::new(1, k, i).uniform() as f32).collect());
    let particles = Particles::from_columns(x, y, z);
    let folder = tempfile::tempdir().expect("a scratch folder");
    let file = folder.path().join("snapshot").with_extension(ending);
    let selected_particles =
        SelectedParticles::new(&particles, Tiling::single(), Selection::all(), &Context::SILENT).expect("all");
    let writer = Writer::for_output(&file, None).expect("a known ending");
    writer.write(&selected_particles, &file, &Context::SILENT).expect("room for 100 MB");
    bencher.counter(ItemsCount::new(n)).bench(|| {
        Choice::default()
            .read(std::slice::from_ref(&file), &Storage::Memory, &Context::SILENT)
            .expect("what was written")
    });
}
