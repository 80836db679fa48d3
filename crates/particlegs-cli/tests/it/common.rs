//! What the end-to-end tests share.

use assert_cmd::Command;
use std::path::{Path, PathBuf};

/// The binary under test.
pub fn particlegs() -> Command {
    Command::cargo_bin("particlegs").expect("the binary is built")
}

/// Runs it with arguments.
pub fn run(arguments: &[&str]) -> assert_cmd::assert::Assert {
    particlegs().args(arguments).assert()
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

/// Waits until a process catches a signal: its handler is set up.
#[cfg(target_os = "linux")]
pub fn wait_for_handler(child: &std::process::Child, signal: u32) {
    let status = format!("/proc/{}/status", child.id());
    waited(&format!("a handler of signal {signal}"), || {
        let status = std::fs::read_to_string(&status).unwrap();
        let mask = status
            .lines()
            .find_map(|l| l.strip_prefix("SigCgt:"))
            .map_or(0, |m| u64::from_str_radix(m.trim(), 16).expect("a mask of signals"));
        mask >> (signal - 1) & 1 == 1
    });
}

/// Waits until a process has written so many bytes.
#[cfg(target_os = "linux")]
pub fn wait_for_bytes(child: &std::process::Child, bytes: u64) {
    let io = format!("/proc/{}/io", child.id());
    waited(&format!("{bytes} bytes written"), || {
        let io = std::fs::read_to_string(&io).unwrap();
        let written = io.lines().find_map(|l| l.strip_prefix("wchar:")).expect("what was written");
        written.trim().parse::<u64>().unwrap() >= bytes
    });
}

/// Asks every millisecond, for a minute at most.
pub fn waited(what: &str, mut ready: impl FnMut() -> bool) {
    let start = std::time::Instant::now();
    while !ready() {
        assert!(start.elapsed().as_secs() < 60, "waited a minute for {what}");
        std::thread::sleep(std::time::Duration::from_millis(1));
    }
}

/// Sends a signal by name, as `-INT`.
pub fn signal(child: &std::process::Child, name: &str) {
    let sent = std::process::Command::new("kill").args([name, &child.id().to_string()]).status();
    assert!(sent.unwrap().success(), "{name}: the process has ended before");
}

/// Files in a folder, sorted.
pub fn listing(folder: &Path) -> Vec<String> {
    let mut names: Vec<String> =
        std::fs::read_dir(folder).unwrap().map(|e| e.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}
