//! Bad input: one clear line, a non-zero exit, no output file left.

use crate::common::{fails, listing, particlegs, sample, snapshot};
use std::path::Path;

/// Runs `compress` on a folder of columns; demands the failure and that nothing was written.
fn refused(columns: &[Vec<f32>], code: i32, text: &str) {
    let dir = tempfile::tempdir().unwrap();
    snapshot(&dir.path().join("in"), columns);
    fails(particlegs().current_dir(&dir).args(["compress", "in", "-o", "m.pgs"]), code, text);
    assert_eq!(listing(dir.path()), ["in"]);
}

#[test]
fn snapshots_that_are_none() {
    let v = |n: usize| vec![1.0f32; n];
    refused(&[v(3), v(2), v(3)], 3, "2 values");
    refused(&[v(0), v(0), v(0)], 3, "no particles");
    refused(&[v(3), v(3)], 3, "missing");
    refused(&[vec![1.0, f32::NAN, f32::INFINITY], v(3), v(3)], 3, "2 with a position that is not finite");
    refused(&[vec![1.0, f32::NAN, f32::INFINITY], v(3), v(3)], 3, "the first has index 1");
    refused(&[v(3), v(3), v(3), vec![1.0, 0.0, 1.0]], 3, "weight");
    let dir = tempfile::tempdir().unwrap();
    fails(particlegs().current_dir(&dir).args(["compress", "nowhere", "-o", "m.pgs"]), 6, "nowhere");
    std::fs::write(dir.path().join("x"), [0u8; 7]).unwrap();
    fails(particlegs().current_dir(&dir).args(["compress", "x", "x", "x", "-o", "m.pgs"]), 3, "multiple of 4");
    assert_eq!(listing(dir.path()), ["x"]);
}

#[test]
fn invalid_particles_are_dropped_on_request() {
    let dir = tempfile::tempdir().unwrap();
    snapshot(&dir.path().join("in"), &[vec![1.0, f32::NAN, 2.0], vec![0.0; 3], vec![0.0; 3]]);
    let mut c = particlegs();
    c.current_dir(&dir).args(["compress", "in", "-o", "m.pgs", "--skip-invalid", "--certificate=none"]);
    let out = c.output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    assert!(String::from_utf8_lossy(&out.stdout).contains("2 particles"));
}

#[test]
fn arguments_out_of_range() {
    let dir = tempfile::tempdir().unwrap();
    let run = |args: &[&str], text: &str| {
        let mut c = particlegs();
        c.current_dir(&dir).arg("compress").arg(sample()).args(["-o", "m.pgs"]).args(args);
        fails(&mut c, 2, text);
        assert!(listing(dir.path()).is_empty());
    };
    run(&["--opacity", "0"], "--opacity");
    run(&["--opacity", "1.5"], "--opacity");
    run(&["--radius=-1"], "--radius");
    run(&["--ratio", "0"], "positive");
    run(&["--ratio", "nan"], "positive");
    run(&["--size", "11 parsecs"], "parsecs");
    run(&["--box=1,-2,3"], "box");
    run(&["--threads", "0"], "--threads");
}

#[test]
fn sizes_below_the_smallest_name_it() {
    let dir = tempfile::tempdir().unwrap();
    let mut c = particlegs();
    c.current_dir(&dir).arg("compress").arg(sample()).args(["-o", "m.pgs", "--size", "100B", "--effort", "fast"]);
    fails(&mut c, 5, "smallest file");
    assert!(listing(dir.path()).is_empty());
}

#[test]
fn outputs_that_cannot_be_written() {
    let dir = tempfile::tempdir().unwrap();
    let mut c = particlegs();
    c.current_dir(&dir).arg("compress").arg(sample()).args(["-o", "no/such/folder/m.pgs"]);
    fails(&mut c, 6, "no/such/folder");
    let mut c = particlegs();
    c.current_dir(&dir).arg("compress").arg(sample()).arg("-o").arg(Path::new("."));
    fails(&mut c, 6, "folder");
}

/// A disk that takes 16 kB of a model of 52: a limit on the size of files, which needs no rights.
#[cfg(unix)]
#[test]
fn a_full_disk_leaves_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let mut c = assert_cmd::Command::new("sh");
    // Blocks of 512 bytes; the signal is ignored, so that the write itself fails.
    c.args(["-c", "trap '' XFSZ; ulimit -f 32; exec \"$@\"", "sh"]).arg(assert_cmd::cargo::cargo_bin("particlegs"));
    c.arg("compress").arg(sample()).args(["--effort", "fast", "--ratio", "60", "--certificate=none", "-o"]);
    fails(c.arg(dir.path().join("m.pgs")), 6, "m.pgs");
    assert_eq!(listing(dir.path()), [""; 0]);
}
