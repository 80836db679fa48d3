//! The ways that all formats of text share: windows, runs, compression, faults, any bytes.

use super::lines::LINE_LIMIT;
use crate::Choice;
use crate::testing::{SpeciesParticles, gzip, read, scratch};
use std::io::Write;

fn open(content: &[u8], format: &str) -> particlegs_core::Result<Vec<SpeciesParticles>> {
    let file = scratch(content);
    let options = Choice { format: Some(format.into()), frame: None, ..Choice::default() };
    let snapshot = options.open(&[file.path().to_path_buf()])?;
    (0..snapshot.description().species.len()).map(|s| read(&*snapshot, s, &Choice::default())).collect()
}

fn bzip2(content: &[u8]) -> Vec<u8> {
    let mut encoder = bzip2::write::BzEncoder::new(Vec::new(), bzip2::Compression::fast());
    encoder.write_all(content).unwrap();
    encoder.finish().unwrap()
}

fn zstd(content: &[u8]) -> Vec<u8> {
    ruzstd::encoding::compress_to_vec(content, ruzstd::encoding::CompressionLevel::Fastest)
}

/// More than two runs of two species, one of them rare.
fn dump(atoms: usize) -> Vec<u8> {
    let head = format!("ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n{atoms}\nITEM: BOX BOUNDS ff ff ff\n0 9\n0 9\n0 9\n");
    let row = |i: usize| format!("{} {i}.5 {} {}\n", if i % 1000 == 7 { 12 } else { 3 }, i * 2, i * 3);
    format!("{head}ITEM: ATOMS type x y z\n{}", (0..atoms).map(row).collect::<String>()).into_bytes()
}

#[test]
fn runs_are_the_same_from_any_source_by_any_number_of_threads() {
    let atoms = 150_000;
    let plain = dump(atoms);
    for content in [plain.clone(), gzip(&plain), bzip2(&plain), zstd(&plain)] {
        for threads in [1, 5] {
            let pool = rayon_core::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            let got = pool.install(|| open(&content, "lammps")).unwrap();
            assert_eq!((&got[0].name[..], &got[1].name[..]), ("type 3", "type 12"));
            let expected = |rare: bool| (0..atoms).filter(move |i| (i % 1000 == 7) == rare);
            for (got, rare) in [(&got[0], false), (&got[1], true)] {
                let all = expected(rare).map(|i| [i as f64 + 0.5, (i * 2) as f64, (i * 3) as f64]);
                assert!(all.eq(got.positions.iter().copied()));
            }
        }
    }
}

#[test]
fn tables_with_comments_are_read_by_runs_too() {
    let rows = 100_000;
    let row = |i: usize| format!("{i},{},1{}\n", i + 1, if i.is_multiple_of(100) { "\n# a comment" } else { "" });
    let text = format!("# made\nx,y,z\n{}", (0..rows).map(row).collect::<String>());
    for content in [text.clone().into_bytes(), gzip(text.as_bytes())] {
        let got = open(&content, "csv").unwrap();
        assert!(got[0].positions.iter().enumerate().all(|(i, p)| *p == [i as f64, (i + 1) as f64, 1.0]));
        assert_eq!(got[0].positions.len(), rows);
    }
    let broken = text.replace("\n70000,", "\n7000O,");
    for content in [broken.clone().into_bytes(), gzip(broken.as_bytes())] {
        let message = open(&content, "csv").err().unwrap().to_string();
        assert!(message.contains("line 70703 column 1 (`x`): `7000O` is not a number"), "{message}");
    }
}

#[test]
fn more_types_than_species_are_one() {
    let atoms = 100;
    let head = String::from_utf8(dump(atoms)).unwrap().split("ITEM: ATOMS").next().unwrap().to_string();
    let rows: String = (0..atoms).map(|i| format!("{i} 1 2 3\n")).collect();
    let got = open(format!("{head}ITEM: ATOMS type x y z\n{rows}").as_bytes(), "lammps").unwrap();
    assert_eq!((got.len(), &got[0].name[..], got[0].positions.len()), (1, "atoms", atoms));
}

#[test]
fn long_lines_are_refused() {
    let line = |blanks: usize| [b"x,y,z\n1,2,3\n".to_vec(), vec![b' '; blanks], b"1,2,3\n4,5,6".to_vec()].concat();
    for (content, good) in
        [(line(LINE_LIMIT - 100), true), (line(LINE_LIMIT + 1), false), (line(5 * LINE_LIMIT), false)]
    {
        for content in [gzip(&content), content] {
            match open(&content, "csv") {
                Ok(got) => assert!(good && got[0].positions.len() == 3),
                Err(e) => assert!(!good && e.to_string().contains("line 3 is longer than"), "{e}"),
            }
        }
    }
}

#[test]
fn broken_streams_are_named() {
    for (name, whole) in [("gzip", gzip(&dump(3000))), ("bzip2", bzip2(&dump(3000))), ("zstd", zstd(&dump(3000)))] {
        let message = |content: &[u8]| open(content, "lammps").err().map_or("it was read".into(), |e| e.to_string());
        assert!(message(&whole[..whole.len() - 5]).contains(&format!("the {name} data end early")));
        let mut wrong = whole.clone();
        let at = wrong.len() - 6;
        wrong[at] ^= 4;
        assert!(message(&wrong).contains(&format!("the {name} data are damaged after")), "{}", message(&wrong));
    }
}

/// Any cut and any bit of small files of each format: an answer, whatever it is.
#[test]
fn any_bytes_get_an_answer() {
    let tilted = "ITEM: UNITS\nlj\nITEM: TIME\n1\nITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n2\nITEM: BOX BOUNDS xy xz yz pp pp pp\n0 9 1\n0 9 0\n0 9 0\n\
        ITEM: ATOMS id type xs ys zs mass\n1 1 0 .5 0 2\n2 3 0 0 1e-1 3\n";
    let extended = "2\nLattice=\"2 0 0 0 3 0 1 0 4\" Properties=species:S:1:pos:R:3 pbc=\"T F T\"\nH 1 2 3\nO 1 2 3\n";
    let table = "# made\nx [kpc],y [kpc],z [kpc],mass\n1,2,3,4\n4,\"5\",6,7\n";
    for (format, text) in [("lammps", tilted), ("xyz", extended), ("csv", table)] {
        for content in [text.as_bytes().to_vec(), gzip(text.as_bytes()), bzip2(text.as_bytes()), zstd(text.as_bytes())]
        {
            for cut in 0..content.len() {
                let _ = open(&content[..cut], format);
            }
            for bit in 0..8 * content.len() {
                let mut flipped = content.clone();
                flipped[bit / 8] ^= 1 << (bit % 8);
                let _ = open(&flipped, format);
            }
        }
    }
}
