//! What the end-to-end tests share.
#![allow(dead_code, missing_docs)]

use assert_cmd::Command;
use std::path::{Path, PathBuf};

/// The binary under test.
pub fn particlegs() -> Command {
    Command::cargo_bin("particlegs").expect("the binary is built")
}

/// The bundled snapshot.
pub fn sample() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64")
}

/// Writes raw columns into a new folder.
pub fn snapshot(folder: &Path, columns: &[Vec<f32>]) {
    std::fs::create_dir_all(folder).unwrap();
    for (name, column) in ["xx.f32", "yy.f32", "zz.f32", "ww.f32"].iter().zip(columns) {
        let bytes: Vec<u8> = column.iter().flat_map(|v| v.to_le_bytes()).collect();
        std::fs::write(folder.join(name), bytes).unwrap();
    }
}

/// Runs and demands failure with `code`, one `error:` line that holds `text`, and nothing on stdout.
pub fn fails(command: &mut Command, code: i32, text: &str) {
    let out = command.output().unwrap();
    let err = String::from_utf8_lossy(&out.stderr);
    assert_eq!(out.status.code(), Some(code), "{err}");
    let lines: Vec<&str> = err.lines().filter(|l| l.starts_with("error:")).collect();
    assert_eq!(lines.len(), 1, "{err}");
    assert!(lines[0].contains(text), "{err}");
    assert!(!err.contains("panicked"), "{err}");
}

/// Files in a folder, sorted.
pub fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
