//! Bad input: one clear line, a non-zero exit, no output file left.

use crate::common::{TestFolder, fails, snapshot, words};

/// Runs `compress` on a folder of columns; it must fail and write nothing.
fn refused(columns: &[Vec<f32>], code: i32, text: &str) {
    let dir = TestFolder::new();
    snapshot(&dir.at("in"), columns);
    dir.fails("compress in -o m.pgs", code, text);
    assert_eq!(dir.listing(), ["in"]);
}

#[test]
fn files_that_are_no_snapshots() {
    let v = |n: usize| vec![1.0f32; n];
    refused(&[v(3), v(2), v(3)], 3, "2 values");
    refused(&[v(0), v(0), v(0)], 3, "no particles");
    refused(&[v(3), v(3)], 3, "missing");
    refused(&[vec![1.0, f32::NAN, f32::INFINITY], v(3), v(3)], 3, "2 with a position that is not finite");
    refused(&[vec![1.0, f32::NAN, f32::INFINITY], v(3), v(3)], 3, "the first has index 1");
    refused(&[v(3), v(3), v(3), vec![1.0, 0.0, 1.0]], 3, "weight");
    let dir = TestFolder::new();
    dir.fails("compress nowhere -o m.pgs", 6, "nowhere");
    dir.write("x", [0u8; 7]);
    dir.fails("compress x x x -o m.pgs", 3, "multiple of 4");
    assert_eq!(dir.listing(), ["x"]);
}

#[test]
fn invalid_particles_are_dropped_on_request() {
    let dir = TestFolder::new();
    snapshot(&dir.at("in"), &[vec![1.0, f32::NAN, 2.0], vec![0.0; 3], vec![0.0; 3]]);
    let [said, _] = dir.runs("compress in -o m.pgs --skip-invalid --certificate=none");
    assert!(said.contains("2 particles"));
}

#[test]
fn arguments_out_of_range() {
    let dir = TestFolder::new();
    for (option, text) in [
        ("--opacity=0", "the opacity must be above 0"),
        ("--opacity=1.5", "the opacity must be above 0"),
        ("--radius=-1", "the particle radius must be positive"),
        ("--ratio=0", "positive"),
        ("--ratio=nan", "positive"),
        ("--size=11 parsecs", "parsecs"),
        ("--box=1,-2,3", "box"),
        ("--threads=0", "--threads"),
    ] {
        fails(dir.command("compress SAMPLE -o m.pgs").arg(option), 2, text);
        assert!(dir.listing().is_empty());
    }
}

#[test]
fn sizes_below_the_smallest_name_it() {
    let dir = TestFolder::new();
    dir.fails("compress SAMPLE -o m.pgs --size 100B --effort fast", 5, "smallest possible file");
    assert!(dir.listing().is_empty());
}

#[test]
fn outputs_that_cannot_be_written() {
    let dir = TestFolder::new();
    dir.fails("compress SAMPLE -o no/such/folder/m.pgs", 6, "no/such/folder");
    dir.fails("compress SAMPLE -o .", 8, "is a folder, but a file must be written");
}

/// A limit on file sizes acts like a full disk, and needs no root: 16 kB of a 52 kB model fit.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_nothing() {
    let dir = TestFolder::new();
    let mut c = assert_cmd::Command::new("sh");
    // Blocks of 512 bytes; the signal is ignored, so that the write itself fails.
    c.args(["-c", "trap '' XFSZ; ulimit -f 32; exec \"$@\"", "sh"]).arg(assert_cmd::cargo::cargo_bin("particlegs"));
    c.args(words("compress SAMPLE --effort fast --ratio 60 --certificate=none -o"));
    fails(c.arg(dir.at("m.pgs")), 6, "m.pgs");
    assert_eq!(dir.listing(), [""; 0]);
}
