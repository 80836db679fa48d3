//! Bad input, and work that needs more memory than there is: one clear line, a non-zero exit, no output file left.

use crate::common::{TestFolder, fails, snapshot, words};
#[cfg(target_os = "linux")]
use crate::common::{equal_gaussians, errors, limited, said};

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

/// A folder with a model of equal Gaussians.
#[cfg(target_os = "linux")]
fn folder(n: usize) -> TestFolder {
    let dir = TestFolder::new();
    dir.write("m.pgs", equal_gaussians(n));
    dir
}

#[cfg(target_os = "linux")]
#[test]
fn pictures_that_do_not_match_are_refused() {
    let dir = folder(3);
    for style in ["paraview", "density"] {
        let out = limited(&dir, 1024, &format!("render m.pgs --out p --size 32768x32768 --style {style}"));
        let text = said(&out);
        assert_eq!(out.status.code(), Some(7), "{style}: {text}");
        assert!(text.contains("needs about") && errors(&text) == 1, "{text}");
    }
}

/// A small file may contain many Gaussians: their memory is checked before decoding.
#[cfg(target_os = "linux")]
#[test]
#[ignore = "slow"]
fn models_that_do_not_match_are_refused() {
    let dir = folder(1_000_000);
    let bytes = dir.bytes("m.pgs").len();
    assert!(bytes < 1_000_000, "{bytes} bytes");
    for arguments in [
        "verify m.pgs",
        "render m.pgs -o p --size 64x64",
        "simplify m.pgs -o s.pgs --gaussians 9",
        "merge m.pgs -o n.pgs",
    ] {
        let out = limited(&dir, 128, arguments);
        let text = said(&out);
        assert_eq!(out.status.code(), Some(7), "{arguments}: {text}");
        assert!(text.contains("bytes of memory"), "{arguments}: {text}");
    }
    assert_eq!(limited(&dir, 2048, "verify m.pgs").status.code(), Some(0));
}
