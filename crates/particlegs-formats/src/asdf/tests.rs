//! Files that asdf's library wrote (tests/fixtures/abacus.py); their positions and boxes are compared in tests/all_files.rs.

use super::*;
use crate::testing::{fixture, vectors};

fn data(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(name)
}

/// A file of the name `name` in `folder`, with some text in it replaced.
fn copy(folder: &Path, name: &str, from: &str, [old, new]: [&str; 2]) -> PathBuf {
    let mut bytes = std::fs::read(data("fixtures").join(from)).unwrap();
    if let Some(at) = memchr::memmem::find(&bytes, old.as_bytes()).filter(|_| !old.is_empty()) {
        bytes.splice(at..at + old.len(), new.bytes());
    }
    std::fs::write(folder.join(name), bytes).unwrap();
    folder.join(name)
}

#[test]
fn velocities_are_unpacked_in_km_per_second() {
    // What a step of a number is: of 12 bits in 6000 km/s, and of a cell's scale.
    for (name, step) in [("rvint_lz4", 6000.0 / 2048.0), ("rvint_plain", 6000.0 / 2048.0), ("pack9_blsc", 0.371)] {
        let snapshot = fixture(&format!("fixtures/{name}.asdf"), None);
        for (i, v) in vectors(&*snapshot, 0, "vel").iter().flatten().enumerate() {
            assert!((v - (i as f64 - 75.0)).abs() <= 0.5001 * step, "{name} {i}: {v}");
        }
        assert_eq!(snapshot.description().species[0].fields[1].unit.as_deref(), Some("km/s"));
        assert!(snapshot.attributes(0, "vel").contains(&("to_cgs".to_string(), 1e5)));
    }
    let arrays = fixture("fixtures/arrays_bzp2.asdf", None);
    assert_eq!(vectors(&*arrays, 0, "vel")[49], [72.0, 73.0, 74.0]);
    assert_eq!((arrays.attributes(0, "vel"), &arrays.description().species[0].fields[1].unit), (vec![], &None));
}

#[test]
fn the_header_states_units_and_cosmology() {
    let snapshot = fixture("fixtures/rvint_lz4.asdf", None);
    let Description { meta, species, notes, .. } = snapshot.description();
    assert_eq!((meta.units.length_text(), meta.units.mass_text()), (Some("Mpc/h"), Some("Msun/h")));
    assert_eq!((meta.units.comoving, meta.epoch.scale_factor), (Some(true), Some(0.5)));
    let cosmology = meta.cosmology;
    assert_eq!((cosmology.hubble, cosmology.omega_matter, cosmology.omega_lambda), (Some(0.7), Some(0.3), Some(0.7)));
    assert_eq!(meta.cell.unwrap().origin, [-12.5; 3]);
    assert_eq!(species[0].mass, SpeciesMass::Each(0.5e10));
    let names: Vec<&str> = species[0].fields.iter().map(|f| &f.name[..]).collect();
    assert_eq!(names, ["pos", "vel", "packedpid"]);
    assert_eq!(notes[..], ["it has 50 of the simulation's 64 particles"]);
    let cone = fixture("data/others/light_cone.asdf", None);
    assert_eq!((cone.description().meta.cell, cone.description().meta.epoch.scale_factor), (None, None));
}

#[test]
fn slabs_of_a_snapshot_are_read_together() {
    let dir = tempfile::tempdir().unwrap();
    let slab = |name: &str, other| copy(dir.path(), name, "pack9_blsc.asdf", other);
    let all = ["007", "008", "009"].map(|n| slab(&format!("slab{n}.L0.pack9.asdf"), [""; 2]));
    slab("slab010.L0.pack9.asdf", ["ScaleFactor: 0.5", "ScaleFactor: 0.6"]);
    slab("slab010.field.pack9.asdf", [""; 2]);
    let open = |paths: &[PathBuf]| Choice::default().open(paths);
    let snapshot = open(&all[1..2]).unwrap();
    assert_eq!((&snapshot.description().files, snapshot.description().species[0].count), (&all.to_vec(), 150));
    assert_eq!(vectors(&*snapshot, 0, "vel")[149], vectors(&*fixture("fixtures/pack9_blsc.asdf", None), 0, "vel")[49]);
    assert_eq!(open(&all[..2]).unwrap().description().species[0].count, 100);
    let other = dir.path().join("slab010.L0.pack9.asdf");
    assert!(open(&[all[0].clone(), other]).err().unwrap().to_string().contains("the header differs"));
    std::fs::remove_file(&all[1]).unwrap();
    assert!(open(&all[..1]).err().unwrap().to_string().contains("missing"));
    let numbered = ["field_rv_A_003.asdf", "LightCone0_Step0600.asdf", "a.asdf", "slab.asdf"].map(|name| {
        let path = copy(dir.path(), name, "rvint_lz4.asdf", [""; 2]);
        open(&[path]).unwrap().description().files.len()
    });
    assert_eq!(numbered, [1; 4]);
}

#[test]
fn files_without_positions_are_named() {
    let error = Choice::default().open(&[data("data/others/pids.asdf")]).err().unwrap();
    assert!(error.to_string().ends_with("its arrays are: packedpid"), "{error}");
    let dir = tempfile::tempdir().unwrap();
    let refused = |from: &str, other| {
        let path = copy(dir.path(), "a.asdf", from, other);
        Choice::default().open(&[path]).err().map(|e| e.to_string()).unwrap_or_default()
    };
    assert!(refused("pack9_blsc.asdf", ["VelZSpace_to_kms", "Other"]).contains("has no VelZSpace_to_kms"));
    assert!(refused("rvint_plain.asdf", ["datatype: int32", "datatype: uint32"]).contains("type and shape"));
    assert!(refused("rvint_plain.asdf", ["source: 0", "source: b.asdf"]).contains("in another file"));
}

#[test]
fn a_stream_takes_the_memory_of_its_arrays_alone() {
    let content = vec![7u8; 1 << 22];
    let packed = crate::testing::zlib(&content);
    let header = |size: u64| {
        let word = |n: u64| n.to_be_bytes();
        let used = packed.len() as u64;
        [&b"\xd3BLK\0\x30\0\0\0\0zlib"[..], &word(used), &word(used), &word(size), &[0; 16], &packed].concat()
    };
    let open = |size: u64, needed: u64| {
        let bytes = header(size);
        let headers = blocks::headers(&bytes, 0).unwrap();
        let bytes = Bytes::Owned(Arc::new(bytes));
        let block = blocks::AsdfBlock::open(Path::new("a.asdf"), &bytes, (0, needed), &headers[0], 1)?;
        let (content, start) = block.plain().map(|(bytes, start)| (bytes.clone(), start)).unwrap();
        Ok::<_, Error>((content.len(), start, content[0]))
    };
    let size = content.len() as u64;
    assert_eq!(open(size, 24).unwrap(), (24, 0, 7));
    for wrong in [size - 1, size + 1, 1 << 40] {
        let error = open(wrong, 24).unwrap_err().to_string();
        assert!(error.contains(&format!("its header says {wrong} bytes, the data hold others")), "{error}");
    }
}
