//! HDF5 snapshots: the files of others, and files broken in every byte and bit.

mod support;

use particlegs_core::Result;
use particlegs_core::context::Context;
use particlegs_core::model::{Cosmology, Epoch, Layer, Mass as LayerMass, Units};
use particlegs_core::space::Cell;
use particlegs_formats::{Choice, Snapshot, SpeciesMass, Weights, Writer};
use particlegs_particles::{
    Column, LayerFields, Number, Particles, PhysicalUnit, SelectedParticles, Selection, SourceField, Storage, Tiling,
};
use std::path::{Path, PathBuf};
use std::sync::Mutex;
use std::time::Duration;
use support::{ResourceUse, measured, positions};

#[global_allocator]
static COUNTING: support::CountingAllocator = support::CountingAllocator;

/// Allocations are counted for the whole process: tests that count take turns.
static TURN: Mutex<()> = Mutex::new(());

/// Snapshots as simulation codes lay them out, fifty particles of the bundled sample each.
fn snapshots() -> PathBuf {
    support::data("snapshots")
}

fn opened(paths: &[PathBuf]) -> Result<Box<dyn Snapshot>> {
    Choice { format: Some("hdf5".into()), ..Choice::default() }.open(paths)
}

fn write(particles: &Particles, path: &Path) -> Result<u64> {
    let selected_particles =
        SelectedParticles::new(particles, Tiling::single(), Selection::all(), &Context::SILENT).unwrap();
    Writer::for_output(path, Some("hdf5"))?.write(&selected_particles, path, &Context::SILENT)
}

#[test]
fn good_files_give_what_the_table_says() {
    let nbody = [[2.25999, 24.304, 23.8309], [2.64513, 24.3222, 23.354], [1.2701, 0.176479, 24.7273]];
    let kpc = nbody.map(|p| p.map(|v| 1000.0 * v));
    let table = [
        ("gadget4_single", nbody, Some(25.0), Some("Mpc/h"), Some(true)),
        ("gadget4_multi.0", nbody, Some(25.0), Some("Mpc/h"), Some(true)),
        ("gadget4_multi.2", nbody, Some(25.0), Some("Mpc/h"), Some(true)),
        ("gadget4_latest_f8", nbody, Some(25.0), Some("Mpc/h"), Some(true)),
        ("gadget3_contiguous", nbody, Some(25.0), Some("Mpc/h"), Some(true)),
        ("gadget_be_lzf", nbody, Some(25.0), Some("Mpc/h"), Some(true)),
        ("swift_dmo", nbody, Some(25.0), Some("Mpc"), Some(true)),
        ("fire_multitype", kpc, Some(25000.0), None, Some(true)),
        ("arepo_still", nbody, Some(25.0), Some("Mpc"), Some(false)),
        ("without_box", nbody, None, Some("Mpc"), Some(false)),
    ];
    for (name, first, size, unit, comoving) in table {
        let snapshot = opened(&[snapshots().join(format!("{name}.hdf5"))]).unwrap();
        let d = snapshot.description();
        println!("{name}: {} {:?}\n  {:?}\n  {:?}", d.format, d.meta, d.species, d.notes);
        assert_eq!(d.species.iter().map(|s| s.count).sum::<u64>(), 50, "{name}");
        assert_eq!(d.meta.cell.and_then(|c| c.lengths()), size.map(|l: f64| [l; 3]), "{name}");
        assert_eq!(d.meta.units.length_text(), unit, "{name}");
        assert_eq!(d.meta.units.comoving, comoving, "{name}");
        // A header's cosmology is that of an expanding space, and of no other. This one of SWIFT's has h alone.
        let matter = (comoving == Some(true) && name != "swift_dmo").then_some(0.31);
        assert_eq!(d.meta.cosmology.omega_matter, matter, "{name}");
        for (i, species) in d.species.iter().enumerate() {
            let reader = snapshot.reader(i, &Choice::default()).unwrap();
            let (all, masses) = positions(&*reader).unwrap();
            assert_eq!(all.len() as u64, species.count, "{name}");
            assert_eq!(reader.has_weights(), matches!(species.mass, SpeciesMass::Field(_)), "{name}");
            assert!(masses.iter().all(|m| *m > 0.0), "{name}");
            for (p, q) in all.iter().zip(&first).filter(|_| i == 0) {
                let near = (0..3).all(|k| (p[k] - q[k]).abs() <= 1e-5 * q[k].abs() + 1e-6);
                assert!(near, "{name}: {p:?} is not {q:?}");
            }
        }
    }
}

/// Of cut-outs and subsets the header is often that of the snapshot that they were taken of.
#[test]
fn headers_of_other_snapshots_are_said_or_refused() {
    let notes = |name: &str, count: u64, choice: &Choice| {
        let snapshot = choice.open(&[snapshots().join(name)])?;
        let d = snapshot.description();
        assert_eq!(d.species.iter().map(|s| s.count).sum::<u64>(), count);
        Ok::<_, particlegs_core::Error>(d.notes.join("\n"))
    };
    let (free, strict) = (Choice::default(), Choice { strict: true, ..Choice::default() });
    // One of 448 files of 10^10 particles; 900 particles where the header says 262144.
    let cut = notes("cutout_99.hdf5", 15, &free).unwrap();
    assert!(cut.contains("the snapshot has 448 files"), "{cut}");
    assert!(cut.contains("says 4298967296 particles of type 0, but the files have 5"), "{cut}");
    let subset = notes("subset_stale.hdf5", 9, &free).unwrap();
    assert!(subset.contains("has 9 rows, but NumPart_ThisFile in the header says 262144"), "{subset}");
    for name in ["cutout_99.hdf5", "subset_stale.hdf5"] {
        assert!(matches!(notes(name, 0, &strict), Err(particlegs_core::Error::Input { .. })), "{name}");
    }
    assert!(!notes("gadget4_single.hdf5", 50, &strict).unwrap().contains("says"));
}

#[test]
fn all_files_of_a_snapshot_may_be_named() {
    let paths = [0, 1, 2].map(|i| snapshots().join(format!("gadget4_multi.{i}.hdf5")));
    let (whole, _) = positions(&*opened(&paths).unwrap().reader(0, &Choice::default()).unwrap()).unwrap();
    let single = opened(&[snapshots().join("gadget4_single.hdf5")]).unwrap();
    let (single, _) = positions(&*single.reader(0, &Choice::default()).unwrap()).unwrap();
    assert!(whole == single);
}

/// Reads broken bytes: an error or not, but soon, in little memory and without a panic.
fn survives(bytes: &[u8], path: &Path, label: &dyn Fn() -> String) {
    std::fs::write(path, bytes).unwrap();
    let read = || support::read_everything(path, Some("hdf5")).map_err(|e| e.to_string());
    let ResourceUse { result, time, peak, largest } = measured(read);
    assert!(result.is_ok(), "panic: {}", label());
    assert!(time < Duration::from_secs(1), "slow: {}", label());
    assert!(largest < 64 << 20 && peak < 100 << 20, "{largest} bytes at once, {peak} in all: {}", label());
    if let Ok(Err(text)) = result {
        assert!(!text.contains('\n'), "{text}: {}", label());
    }
}

/// A file cut at every `step`-th byte, and with every `step`-th bit of its first `flipped` bytes turned.
fn broken(file: &Path, step: usize, flipped: usize) {
    let _turn = TURN.lock().unwrap_or_else(|e| e.into_inner());
    let good = std::fs::read(file).unwrap();
    let scratch = tempfile::tempdir().unwrap();
    let path = scratch.path().join("broken.hdf5");
    for cut in (0..good.len()).step_by(step) {
        survives(&good[..cut], &path, &|| format!("{} cut at {cut}", file.display()));
    }
    let mut bytes = good;
    for bit in (0..8 * bytes.len().min(flipped)).step_by(step) {
        bytes[bit / 8] ^= 1 << (bit % 8);
        survives(&bytes, &path, &|| format!("{} with bit {bit} turned", file.display()));
        bytes[bit / 8] ^= 1 << (bit % 8);
    }
}

/// Files of this crate's own, of every layout.
fn fixtures() -> Vec<PathBuf> {
    support::files(&support::data("hdf5"))
}

#[test]
fn every_layout_gives_the_same_numbers() {
    let mut seen = 0;
    for path in fixtures() {
        let name = path.file_stem().unwrap().to_str().unwrap().to_string();
        if name.starts_with("bad_") || name.starts_with("multi.") {
            continue;
        }
        let snapshot = opened(&[path]).unwrap();
        let d = snapshot.description();
        assert_eq!((d.species.len(), d.species[0].count), (1, 100), "{name}");
        let moment = d.meta.epoch.time.or(d.meta.epoch.scale_factor);
        assert_eq!((moment, d.meta.cosmology.hubble.is_some()), (Some(0.5), name == "swift"), "{name}");
        let (all, masses) = positions(&*snapshot.reader(0, &Choice::default()).unwrap()).unwrap();
        let (scale, shift) = match &name[..] {
            "scale_offset" => (8.0, 0.0),
            "nbit_integer" => (200.0, 199.0),
            _ => (1.0, 0.0),
        };
        for (i, p) in all.iter().enumerate() {
            let i = i as f64;
            assert_eq!(*p, [i / 8.0, i / 4.0 + 1.0, i / 2.0 + 2.0].map(|v| v * scale - shift), "{name} {i}");
        }
        match &name[..] {
            "swift" => {
                assert_eq!((d.meta.units.length_text(), d.meta.units.comoving), (Some("Mpc"), Some(true)));
                assert_eq!(d.meta.cell.unwrap().lengths(), Some([64.0, 64.0, 32.0]));
                assert!(d.species[0].aliases.contains(&"dmparticles".into()));
                assert_eq!((&d.species[0].mass, masses), (&SpeciesMass::Field("Masses".into()), vec![0.25; 100]));
            }
            "high_word" => assert_eq!(d.meta.units.length_text(), Some("AU")),
            _ => assert_eq!((&d.species[0].mass, &d.meta.units.length), (&SpeciesMass::Each(2.5), &None), "{name}"),
        }
        seen += 1;
    }
    assert_eq!(seen, 20);
}

#[test]
fn chunks_wider_than_runs() {
    let path = support::data("hdf5/large/wide_chunks.hdf5");
    let snapshot = opened(&[path]).unwrap();
    let reader = snapshot.reader(0, &Choice::default()).unwrap();
    let (all, masses) = positions(&*reader).unwrap();
    assert_eq!((all.len(), masses.len()), (300_000, 300_000));
    for (i, (p, m)) in all.iter().zip(&masses).enumerate() {
        assert_eq!((*p, *m), ([i % 8, i % 16, i >> 16].map(|v| v as f64), (i % 4 + 1) as f32));
    }
    // Three scalar fields do for positions, any scalar for weights.
    let fields =
        Choice { positions: Some("Masses, Masses,Masses".into()), weights: Weights::None, ..Choice::default() };
    let (all, _) = positions(&*snapshot.reader(0, &fields).unwrap()).unwrap();
    assert_eq!(all[170_001], [2.0; 3]);
    let missing = Choice { positions: Some("Velocities".into()), ..Choice::default() };
    let error = snapshot.reader(0, &missing).err().unwrap();
    assert!(error.hint().to_string().contains("Coordinates"), "{error} {}", error.hint());
}

#[test]
fn a_type_may_be_missing_in_the_first_file() {
    let paths: Vec<PathBuf> = fixtures().into_iter().filter(|p| p.to_string_lossy().contains("multi.")).collect();
    for given in [&paths[..1], &paths[1..], &paths[..]] {
        let snapshot = opened(given).unwrap();
        let species = &snapshot.description().species;
        assert_eq!(
            species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(),
            [("PartType0", 5), ("PartType1", 100)]
        );
        let (gas, _) = positions(&*snapshot.reader(0, &Choice::default()).unwrap()).unwrap();
        let (dark, _) = positions(&*snapshot.reader(1, &Choice::default()).unwrap()).unwrap();
        assert_eq!((gas[4], dark[99]), ([0.5, 2.0, 4.0], [12.375, 25.75, 51.5]));
    }
    let folder = tempfile::tempdir().unwrap();
    let alone = folder.path().join("multi.0.hdf5");
    std::fs::copy(&paths[0], &alone).unwrap();
    let error = opened(&[alone]).err().unwrap().to_string();
    assert!(error.contains("multi.1.hdf5"), "{error}");
}

#[test]
fn what_is_not_read_is_named() {
    let why = |name: &str| {
        let path = support::data("hdf5").join(name);
        let error = support::read_everything(&path, Some("hdf5")).unwrap_err();
        format!("{error} ({})", error.hint())
    };
    assert!(why("bad_external.hdf5").contains("elsewhere.hdf5"), "{}", why("bad_external.hdf5"));
    assert!(why("bad_hole.hdf5").contains("from 50 on were never written"), "{}", why("bad_hole.hdf5"));
    assert!(why("bad_virtual.hdf5").contains("missing: "), "{}", why("bad_virtual.hdf5"));
}

#[test]
fn broken_files_do_no_harm() {
    let old = fixtures().into_iter().find(|p| p.ends_with("gzip_shuffle_fletcher.hdf5")).unwrap();
    let new = fixtures().into_iter().find(|p| p.ends_with("latest_fixed_array.hdf5")).unwrap();
    broken(&old, 19, 4096);
    broken(&new, 19, 4096);
    broken(&virtual_set("latest.hdf5"), 101, usize::MAX);
}

/// Every 101st cut and bit of all files of this crate's own, whatever their layout; `broken.rs`
/// takes every one of the smallest.
#[test]
#[ignore = "takes a minute"]
fn broken_files_of_every_layout_do_no_harm() {
    for path in fixtures() {
        println!("{}", path.display());
        broken(&path, 101, usize::MAX);
    }
}

/// The beginnings of snapshots as codes write them.
#[test]
#[ignore = "takes half a minute"]
fn broken_snapshots_do_no_harm() {
    for name in ["swift_dmo", "gadget4_latest_f8", "gadget_be_lzf", "fire_multitype"] {
        println!("{name}");
        broken(&snapshots().join(format!("{name}.hdf5")), 103, 8192);
    }
}

/// Particles in layers, in memory: `counts` of each, the last one with weights.
fn particles_of(counts: &[(&str, usize)]) -> Particles {
    let n: usize = counts.iter().map(|c| c.1).sum();
    let column = |a: f32| (0..n).map(|i| a * (i as f32).sqrt()).collect::<Vec<f32>>();
    let (mut start, mut layers) = (0, Vec::new());
    for (i, &(name, count)) in counts.iter().enumerate() {
        let mass = if i + 1 == counts.len() { LayerMass::Weights(None) } else { LayerMass::Each(0.75) };
        layers.push(Layer { name: name.into(), mass, content: start..start + count });
        start += count;
    }
    let weights = (0..n).map(|i| 1.0 + (i % 7) as f32 / 3.0).collect();
    let mut particles = Particles::from_columns(column(0.5), column(-0.25), column(1.75))
        .with_weights(Column::owned(weights))
        .with_layers(layers);
    particles.meta.cell = Some(Cell::orthogonal([64.0; 3]));
    particles.meta.units = Units::new(Some("kpc/h"), Some("1e10 Msun/h"), Some(true));
    particles.meta.epoch.scale_factor = Some(0.5);
    particles.meta.cosmology =
        Cosmology { hubble: Some(0.7), omega_matter: Some(0.3), omega_lambda: Some(0.7), omega_baryon: Some(0.05) };
    particles
}

#[test]
fn what_is_written_is_read_back_bit_for_bit() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.hdf5");
    let particles = particles_of(&[("PartType4", 200_000), ("dm", 10), ("PartType0", 70_001)]);
    let bytes = write(&particles, &path).unwrap();
    assert_eq!(bytes, std::fs::metadata(&path).unwrap().len());
    let snapshot = opened(&[path]).unwrap();
    let d = snapshot.description();
    assert!(d.notes.is_empty(), "{:?}", d.notes);
    let meta = &particles.meta;
    assert_eq!((d.meta.units.length_text(), d.meta.units.mass_text()), (Some("kpc/h"), Some("1e10 Msun/h")));
    assert_eq!((d.meta.units.comoving, d.meta.epoch), (Some(true), meta.epoch));
    assert_eq!(d.meta.cosmology, meta.cosmology);
    assert_eq!(d.meta.cell, meta.cell);
    let masses: Vec<&SpeciesMass> = d.species.iter().map(|s| &s.mass).collect();
    assert_eq!(masses, [&SpeciesMass::Field("Masses".into()), &SpeciesMass::Each(0.75), &SpeciesMass::Each(0.75)]);
    let layers = particles.layers();
    for (species, layer) in [(0, 2), (1, 1), (2, 0)] {
        let reader = snapshot.reader(species, &Choice::default()).unwrap();
        assert!(reader.in_place().is_some());
        let part = particles.of_layer(&layers[layer]);
        let (all, masses) = positions(&*reader).unwrap();
        assert!(all.iter().enumerate().all(|(i, p)| *p == part.position(i)) && all.len() == part.len());
        assert_eq!(masses, part.weights().map(|w| &w[..]).unwrap_or(&[]));
    }
}

/// One truth in km/s, as sources state it: it goes out as Gadget has it, and is the same again.
#[test]
fn velocities_go_out_over_the_root_of_a_whatever_their_source_has() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.hdf5");
    let field = |components: u32, name: &str, unit: Option<&str>, physical: Option<f64>| SourceField {
        name: name.into(),
        number: Number::F32,
        components,
        unit: unit.map(String::from),
        attributes: vec![("a-scale exponent".into(), 0.0)],
        physical: physical.map(|factor| PhysicalUnit { factor, note: String::new() }),
    };
    let three = |unit: &str| ["vx", "vy", "vz"].map(|n| field(1, n, Some(unit), None)).to_vec();
    let sources = [
        (vec![field(3, "velocity", Some("km/s"), None)], 1.0),
        (vec![field(3, "Velocities", None, Some(50.0))], 50.0),
        (vec![field(3, "Velocity", Some("words"), Some(0.25))], 0.25),
        (three("comoving km/s"), 0.25),
        (three("cm/s"), 1e-5),
    ];
    for (fields, factor) in sources {
        for (scale_factor, root) in [(Some(0.25), 0.5), (None, 1.0)] {
            // Comoving ones need the scale factor.
            if scale_factor.is_none() && fields.len() == 3 && factor == 0.25 {
                continue;
            }
            let mut particles = particles_of(&[("dm", 2)]);
            particles.meta.epoch =
                Epoch { scale_factor, time: scale_factor.is_none().then_some(2.3), ..Epoch::default() };
            particles.meta.units.comoving = scale_factor.map(|_| true);
            let columns = [100.0, 20.0, -30.0].map(|v: f64| vec![v / factor, 2.0 * v / factor]).to_vec();
            let layer_fields = LayerFields::from_columns(fields.clone(), columns);
            let selected_particles =
                SelectedParticles::new(&particles, Tiling::single(), Selection::all(), &Context::SILENT).unwrap();
            Writer::for_output(&path, None)
                .unwrap()
                .write(&selected_particles.with_fields(vec![layer_fields]), &path, &Context::SILENT)
                .unwrap();
            let snapshot = opened(std::slice::from_ref(&path)).unwrap();
            let velocity = vectors(&*snapshot, "Velocities")[1].map(|v| v * root);
            let near = velocity.iter().zip([200.0, 40.0, -60.0]).all(|(v, w)| (v - w).abs() < 1e-4);
            assert!(near, "{fields:?} {scale_factor:?} {velocity:?}");
            let stated = snapshot.attributes(0, "Velocities");
            let power = if scale_factor.is_some() { 0.5 } else { 0.0 };
            assert_eq!(stated.iter().find(|a| a.0 == "a_scaling").unwrap().1, power);
            assert!(stated.contains(&("to_cgs".into(), 1e5)) && stated.iter().all(|a| a.0 != "a-scale exponent"));
        }
    }
    // Of a unit that is not known, they would be read as Gadget's.
    let particles = particles_of(&[("dm", 2)]);
    let layer_fields = LayerFields::from_columns(vec![field(3, "vel", None, None)], vec![vec![1.0; 2]; 3]);
    let selected_particles =
        SelectedParticles::new(&particles, Tiling::single(), Selection::all(), &Context::SILENT).unwrap();
    Writer::for_output(&path, None)
        .unwrap()
        .write(&selected_particles.with_fields(vec![layer_fields]), &path, &Context::SILENT)
        .unwrap();
    let snapshot = opened(std::slice::from_ref(&path)).unwrap();
    assert!(snapshot.description().species[0].fields.iter().all(|f| !f.name.to_lowercase().starts_with("vel")));
}

/// The file kept was read with h5py 3.16 and pynbody 2.8. `PARTICLEGS_KEEP=1` writes it anew, to be checked again.
#[test]
fn the_bytes_written_are_those_that_others_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.hdf5");
    let particles = particles_of(&[("PartType4", 50), ("dm", 10), ("PartType0", 100)]);
    write(&particles, &path).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    let fixture = support::data("hdf5/large/written.hdf5");
    if std::env::var_os("PARTICLEGS_KEEP").is_some() {
        std::fs::write(&fixture, &bytes).unwrap();
    }
    assert!(bytes == std::fs::read(&fixture).unwrap());
}

/// A slab by permuted and negative vectors, as SWIFT has them.
#[test]
fn slabs_go_out_and_come_back() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.hdf5");
    let mut particles = particles_of(&[("dm", 10)]);
    particles.meta.cell = Cell::stated([0.0; 3], [[0.0, 32.0, 0.0], [-64.0, 0.0, 0.0], [0.0; 3]], [true; 3]);
    write(&particles, &path).unwrap();
    let snapshot = opened(&[path]).unwrap();
    let d = snapshot.description();
    let cell = d.meta.cell.unwrap();
    assert_eq!((cell.lengths(), cell.periodic), (Some([64.0, 32.0, 0.0]), [true, true, false]));
    assert_eq!(cell.origin, [-64.0, 0.0, 0.0]);
    assert!(d.notes.iter().any(|n| n.contains("64 x 32 x 0") && n.contains("periodic in xy")), "{:?}", d.notes);
}

#[test]
fn what_the_layout_does_not_hold_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("out.hdf5");
    let mut particles = particles_of(&[("a", 1), ("b", 1), ("c", 1), ("d", 1), ("e", 1), ("f", 1), ("g", 1)]);
    let refused = |particles: &Particles| write(particles, &path).unwrap_err().to_string();
    assert!(refused(&particles).contains("7 layers"));
    particles = particles.with_layers(Vec::new());
    particles.meta.cell.as_mut().unwrap().vectors[1][0] = 3.0;
    assert!(refused(&particles).contains("orthogonal"));
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
}

#[test]
fn tables_at_the_top_or_in_groups_are_read() {
    let file = |name: &str| support::data("tables").join(name);
    let want: Vec<[f64; 3]> = (0..5).map(|i| [0, 1, 2].map(|k| f64::from(3 * i + k) / 4.0)).collect();
    let read = |name: &str| {
        let snapshot = opened(&[file(name)]).unwrap();
        let d = snapshot.description().clone();
        let readers =
            (0..d.species.len()).map(|i| positions(&*snapshot.reader(i, &Choice::default()).unwrap()).unwrap());
        (readers.collect::<Vec<_>>(), d)
    };
    let (got, d) = read("columns.hdf5");
    assert_eq!((&got[0].0, &got[0].1), (&want, &vec![2.0; 5]));
    assert_eq!((d.meta.units.length_text(), d.meta.cell.unwrap().lengths()), (Some("Mpc"), Some([10.0; 3])));
    let mut names: Vec<&str> = d.species[0].fields.iter().map(|f| &f.name[..]).collect();
    names.sort_unstable();
    assert_eq!((&d.species[0].positions[..], names), ("x,y,z", vec!["mass", "vx", "x", "y", "z"]));
    let (got, d) = read("positions.hdf5");
    assert_eq!((&got[0].0, d.meta.cell, &d.species[0].name[..]), (&want, None, "particles"));
    let (got, d) = read("groups.hdf5");
    assert_eq!((&got[0].0[..], &got[1].0[..]), (&want[..3], &want[..2]));
    assert_eq!(d.species.iter().map(|s| &s.name[..]).collect::<Vec<_>>(), ["gas", "stars"]);
}

/// Names and places of data sets that users choose.
#[test]
fn tables_are_found_where_users_put_them() {
    let open = |name: &str, choice: &Choice| choice.open(&[support::data("tables").join(name)]);
    let read_table = |choice: &Choice, name: &str| {
        let snapshot = open(name, choice).unwrap();
        let rows = support::particles(&*snapshot, 0, choice).unwrap();
        (snapshot.description().clone(), rows[4][..3].to_vec())
    };
    let any = Choice::default();
    let (d, last) = read_table(&any, "nested.hdf5");
    assert_eq!((&d.species[0].name[..], last), ("run/dm", vec![3.0, 3.25, 3.5]));
    for (frame, number) in [(None, 11), (Some(3), 3)] {
        let (d, last) = read_table(&Choice { frame, ..Choice::default() }, "steps.hdf5");
        let frames = d.frames.unwrap();
        assert_eq!((frames.count, frames.chosen, d.species.len()), (12, number, 1));
        assert_eq!((&d.species[0].name[..], last[0]), ("particles", 3.0 + number as f64));
    }
    assert!(read_table(&any, "only.hdf5").0.notes[0].contains("`a`, the only array of three columns"));
    let error = open("several.hdf5", &any).err().unwrap();
    assert!(error.to_string().contains("not clear") && error.hint().to_string().contains("a, b"), "{error}");
    let b = Choice { positions: Some("b".into()), ..Choice::default() };
    assert_eq!(read_table(&b, "several.hdf5").0.species[0].positions, "b");
    assert!(open("steps.hdf5", &Choice { frame: Some(12), ..Choice::default() }).is_err());
}

/// Positions of a field in all species, one after the other.
fn vectors(snapshot: &dyn Snapshot, name: &str) -> Vec<[f64; 3]> {
    let choice = Choice { positions: Some(name.into()), ..Choice::default() };
    let species = 0..snapshot.description().species.len();
    let rows = species.flat_map(|s| support::particles(snapshot, s, &choice).unwrap());
    rows.map(|[x, y, z, _]| [x, y, z]).collect()
}

/// Files of MDAnalysis, and of h5py in chunks of several frames and parts of rows.
#[test]
fn h5md_frames_are_read_from_any_chunks() {
    let at = |name: &str, frame| support::open(&support::fixtures().join(name), None, frame).unwrap();
    let by_mdanalysis = support::data("molecules").join("mdanalysis.h5md");
    let velocity = |i: usize| [0, 1, 2].map(|k| (3 * i + k) as f64 / 8.0 - 5.0);
    for frame in [0, 2] {
        let snapshot = support::open(&by_mdanalysis, None, Some(frame)).unwrap();
        let d = snapshot.description();
        assert_eq!((d.frames.unwrap().count, d.meta.epoch.time), (3, Some(0.5 * frame as f64)));
        assert_eq!(d.meta.units.length_text(), Some("nm"));
        for (i, v) in vectors(&*snapshot, "velocity").into_iter().enumerate() {
            assert!((0..3).all(|k| (v[k] - velocity(i)[k]).abs() < 1e-5), "{i}: {v:?}");
        }
    }
    for (chosen, frame) in [(Some(1), 1), (Some(2), 2), (None, 4)] {
        let snapshot = at("byhand.h5md", chosen);
        let d = snapshot.description();
        let frames = d.frames.unwrap();
        assert_eq!((frames.count, frames.chosen, frames.step), (5, frame, Some(100 * frame as i64)));
        assert_eq!(d.meta.epoch.time, Some(1.0 + 0.25 * frame as f64));
        assert_eq!(
            d.species.iter().map(|s| (&s.name[..], s.count)).collect::<Vec<_>>(),
            [("species 1", 25), ("species 2", 25)]
        );
        let keep = Choice { keep_unwrapped: true, frame: chosen, ..Choice::default() };
        let unwrapped_snapshot = keep.open(&[support::fixtures().join("byhand.h5md")]).unwrap();
        let sample = support::sample(50);
        for (n, seen) in vectors(&*unwrapped_snapshot, "position").into_iter().enumerate() {
            let row = n % 25 * 2 + n / 25;
            assert!((0..3).all(|k| (seen[k] - sample[row][k] - 100.0 * frame as f64).abs() < 1e-4), "{n}: {seen:?}");
            let v = vectors(&*unwrapped_snapshot, "velocity")[n];
            assert!((0..3).all(|k| (v[k] - velocity(row)[k] - frame as f64).abs() < 1e-9), "{n}: {v:?}");
        }
        // They lie far outside the box, where they are not wrapped.
        assert!(vectors(&*snapshot, "position").iter().flatten().all(|v| (-1e-3..=25.001).contains(v)));
    }
    assert!(support::open(&support::fixtures().join("byhand.h5md"), None, Some(5)).is_err());
}

/// Arrays of frames as MDTraj writes them.
#[test]
fn arrays_of_frames_are_trajectories() {
    let snapshot = support::open(&support::fixtures().join("mdtraj.h5"), None, Some(0)).unwrap();
    let meta = &snapshot.description().meta;
    assert_eq!((meta.units.length_text(), meta.epoch.time), (Some("nm"), Some(2.5)));
    let zeros = support::open(&support::data("tables").join("frames.hdf5"), None, None).unwrap();
    assert_eq!(zeros.description().frames.unwrap().count, 2);
    assert_eq!(vectors(&*zeros, "coordinates"), [[0.0; 3]; 4]);
}

/// opencosmo wrote it.
#[test]
fn opencosmo_states_box_units_and_cosmology() {
    let snapshot = support::open(&support::fixtures().join("opencosmo.hdf5"), None, None).unwrap();
    let d = snapshot.description();
    assert_eq!((&d.format[..], &d.species[0].name[..]), ("HDF5, OpenCosmo (halo_particles)", "halo_particles"));
    assert_eq!((d.meta.epoch.scale_factor, d.meta.cosmology.hubble), (Some(0.5), Some(0.68)));
    assert_eq!((d.meta.units.length_text(), d.meta.units.comoving), (Some("comoving Mpc/h"), Some(true)));
    assert_eq!(d.meta.cell.unwrap().lengths(), Some([25.0; 3]));
    assert_eq!(vectors(&*snapshot, "vx,vy,vz")[49], [13.375, 13.5, 13.625]);
}

/// Files whose sets lie in other files, and what is refused.
fn virtual_set(name: &str) -> PathBuf {
    support::data("virtual").join(name)
}

#[test]
fn virtual_data_sets_are_read_from_their_sources() {
    for name in ["earliest.hdf5", "latest.hdf5"] {
        let snapshot = opened(&[virtual_set(name)]).unwrap();
        let mut all = (Vec::new(), Vec::new());
        for (species, count) in [20, 30].into_iter().enumerate() {
            let reader = snapshot.reader(species, &Choice::default()).unwrap();
            let (places, masses) = positions(&*reader).unwrap();
            assert_eq!((snapshot.description().species[species].count, places.len()), (count, count as usize));
            all.0.extend(places);
            all.1.extend(masses);
        }
        assert_eq!(all.0, support::sample(50), "{name}");
        assert!(all.1.iter().zip(1..).all(|(&m, id)| m == (1 + id % 3) as f32), "{name}: {:?}", all.1);
        let files: Vec<PathBuf> =
            [name, "masses.hdf5", "parts/part.0.hdf5", "parts/part.1.hdf5"].map(virtual_set).into();
        assert_eq!(snapshot.description().files, files);
    }
}

#[test]
fn virtual_data_sets_that_are_not_read_say_why() {
    for (name, reason) in [
        ("missing", "a source file of this virtual data set is missing: "),
        ("outside", "is in another folder: ../snapshots/arepo_still.hdf5"),
        ("nested", "nested virtual data sets"),
        ("gap", "rows 5 to 11 have no source"),
        ("twice", "two sources provide row 3"),
        ("longer", "it has 10 rows of 3 numbers, but"),
        ("every_second", "one source provides rows in several places"),
        ("columns", "a row is split over several sources"),
        ("unlimited", "it grows with its sources"),
        ("pattern", "its source files are named by a pattern"),
    ] {
        let error =
            support::read_everything(&virtual_set(&format!("{name}.hdf5")), Some("hdf5")).unwrap_err().to_string();
        assert!(error.contains(reason) && !error.contains('\n'), "{name}: {error}");
    }
}

#[test]
fn frames_of_h5md_have_no_values_of_other_steps() {
    let path = support::data("molecules").join("sparse.h5md");
    for frame in 0..7 {
        let choice = Choice { frame: Some(frame), ..Choice::default() };
        let snapshot = choice.open(std::slice::from_ref(&path)).unwrap();
        let d = snapshot.description();
        let names: Vec<&str> = d.species[0].fields.iter().map(|f| &f.name[..]).collect();
        let (_, fields) =
            choice.clone().read_fields(std::slice::from_ref(&path), &Storage::Memory, &Context::SILENT).unwrap();
        let expected_velocity = 100.0 + 10.0 * frame as f64;
        match frame % 2 {
            0 => {
                assert_eq!(names, ["position", "velocity"], "{frame}");
                let number = fields[0].fields.iter().position(|f| f.name == "velocity").unwrap();
                assert_eq!(fields[0].values(number, 2).unwrap(), vec![vec![expected_velocity; 2]; 3], "{frame}");
            }
            _ => {
                assert_eq!(names, ["position"], "{frame}");
                let why = format!("frame {frame} has no velocity: the file stores it for every 2nd frame");
                assert!(d.notes.contains(&why), "{:?}", d.notes);
                assert_eq!(d.absent.iter().filter(|f| f.why == why).count(), 1);
            }
        }
        let force = format!("frame {frame} has no force: the file stores it at other steps than positions");
        assert!(d.notes.contains(&force), "{:?}", d.notes);
        let cell = d.meta.cell.and_then(|c| c.lengths());
        assert_eq!(cell, (frame % 3 == 0).then_some([expected_velocity; 3]), "{frame}");
    }
}
