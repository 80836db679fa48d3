//! Work that needs much memory, under a limit: an error, never an abort.
#![cfg(target_os = "linux")]

use crate::common::{TestFolder, errors, particlegs, said};
use crate::models::equal_gaussians;
use std::process::{Command, Output};

/// A folder with a model of equal Gaussians.
fn folder(n: usize) -> TestFolder {
    let dir = TestFolder::new();
    dir.write("m.pgs", equal_gaussians(n));
    dir
}

/// Runs the command with limited address space.
pub fn limited(dir: &TestFolder, mebibytes: u64, arguments: &str) -> Output {
    let binary = particlegs().get_program().to_owned();
    let script = format!("ulimit -v {}; exec \"$0\" {arguments} --threads 1 -q", mebibytes * 1024);
    Command::new("sh").current_dir(dir.path()).args(["-c", &script]).arg(binary).output().unwrap()
}

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
