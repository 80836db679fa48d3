//! `compress` end to end: sizes met, counts kept, same bytes whatever the threads.

use crate::common::{particlegs, sample, snapshot};
use std::path::Path;

fn compress(folder: &Path, name: &str, args: &[&str], simd: bool) -> Vec<u8> {
    let mut c = particlegs();
    c.arg("compress").arg(sample()).arg("-o").arg(folder.join(name)).args(args).args(["--quiet", "--force"]);
    if !simd {
        c.env("PARTICLEGS_SIMD", "off");
    }
    c.assert().success();
    std::fs::read(folder.join(name)).unwrap()
}

#[test]
fn same_bytes_for_any_threads_and_without_simd() {
    let dir = tempfile::tempdir().unwrap();
    for effort in ["fast", "default"] {
        let args = |t| vec!["--effort", effort, "--ratio", "300", "--certificate=none", "--threads", t];
        let one = compress(dir.path(), "1.pgs", &args("1"), true);
        assert!(one == compress(dir.path(), "2.pgs", &args("2"), true), "{effort}: threads change the bytes");
        assert!(one == compress(dir.path(), "p.pgs", &args("2"), false), "{effort}: SIMD changes the bytes");
    }
}

#[test]
fn blocks_hold_all_particles_and_draw_the_same() {
    let dir = tempfile::tempdir().unwrap();
    let args = |t| vec!["--effort", "fast", "--ratio", "100", "--blocks", "5", "--certificate=none", "--threads", t];
    let bytes = compress(dir.path(), "b.pgs", &args("2"), true);
    assert!(bytes == compress(dir.path(), "b1.pgs", &args("1"), true), "threads change the bytes");
    let target = 262_144 * 12 / 100;
    assert!(bytes.len() <= target && target - bytes.len() <= 5 * 256, "{} of {target}", bytes.len());
    let model = particlegs::codec::decode(&bytes, "b.pgs").unwrap();
    let counts: Vec<u64> = model.blocks().map(|b| b.count).collect();
    assert_eq!((counts.len(), counts.iter().sum::<u64>()), (5, 262_144));
    assert!(counts.iter().all(|c| c.abs_diff(262_144 / 5) <= 3), "{counts:?}");
    for bad in ["0", "262145"] {
        let out = dir.path().join("bad.pgs");
        let mut c = particlegs();
        c.arg("compress").arg(sample()).arg("-o").arg(&out).args(["--blocks", bad, "-q"]).assert().failure().code(2);
        assert!(!out.exists());
    }
}

#[test]
fn sizes_are_met() {
    let dir = tempfile::tempdir().unwrap();
    let raw = 262_144 * 12;
    // With a certificate where its bytes weigh most.
    for (ratio, certificate) in [(30, &["--certificate=none"][..]), (300, &["--certificate=none"]), (2000, &[])] {
        let ratio_text = ratio.to_string();
        let args = [&["--effort", "fast", "--ratio", &ratio_text][..], certificate].concat();
        let bytes = compress(dir.path(), &format!("{ratio}.pgs"), &args, true).len();
        let target = raw / ratio;
        assert!(bytes <= target && target - bytes <= 256.max(target / 50), "ratio {ratio}: {bytes} of {target}");
    }
}

#[test]
fn odd_snapshots_work() {
    let dir = tempfile::tempdir().unwrap();
    let line: Vec<f32> = (0..100).map(|i| i as f32).collect();
    let zero = vec![0.0f32; 100];
    let spread = |s: f32| -> Vec<Vec<f32>> {
        (1..4).map(|k| (0..100).map(|i| s * ((i * k * 37 % 101) as f32 / 101.0)).collect()).collect()
    };
    let cases: Vec<(&str, Vec<Vec<f32>>)> = vec![
        ("one", vec![vec![1.0], vec![2.0], vec![3.0]]),
        ("equal", vec![vec![5.0; 100]; 3]),
        ("line", vec![line.clone(), zero.clone(), zero.clone()]),
        ("plane", vec![line.clone(), line.iter().map(|v| (v * 7.0) % 13.0).collect(), zero]),
        ("tiny", spread(1e-30)),
        ("huge", spread(1e30)),
        ("far", spread(1.0).into_iter().map(|c| c.iter().map(|v| v + 1e6).collect()).collect()),
        ("weights", [spread(1.0), vec![line.iter().map(|v| v + 0.5).collect()]].concat()),
    ];
    for (name, columns) in cases {
        snapshot(&dir.path().join(name), &columns);
        // A certificate, too, of what no density or spacing is: a point, a line, numbers near the largest.
        let measured: &[&str] = if ["one", "line", "huge"].contains(&name) { &[] } else { &["--certificate=none"] };
        for (effort, certificate) in [("fast", measured), ("default", &["--certificate=none"])] {
            let model = &format!("{name}-{effort}.pgs");
            let mut c = particlegs();
            c.current_dir(&dir).args(["compress", name, "-o", model, "--effort", effort, "--gaussians", "10"]);
            c.args(certificate).assert().success();
            let n = columns[0].len();
            let out = particlegs().current_dir(&dir).args(["info", model, "--json", "-"]).output().unwrap();
            let info: serde_json::Value = serde_json::from_slice(&out.stdout).unwrap();
            assert_eq!(info["metadata"]["particles"], n, "{name}");
            let mut c = particlegs();
            c.current_dir(&dir).args(["render", model, "--style", "expected", "--size", "64x48", "--out", "pictures"]);
            c.assert().success();
        }
    }
}

/// The binary as a child that can be signalled.
#[cfg(target_os = "linux")]
fn spawned(folder: &Path, arguments: &[&str]) -> std::process::Child {
    let mut c = std::process::Command::new(assert_cmd::cargo::cargo_bin("particlegs"));
    c.current_dir(folder).args(arguments).arg("--quiet").arg(sample()).spawn().unwrap()
}

/// Killed at any moment, nothing half-written appears under the output's name.
#[cfg(target_os = "linux")]
#[test]
fn killing_is_safe() {
    use std::os::unix::process::ExitStatusExt;
    let dir = tempfile::tempdir().unwrap();
    let killed = |arguments: &[&str], out: &str, wait: &dyn Fn(&std::process::Child)| {
        let mut child = spawned(dir.path(), &[arguments, &["-o", out]].concat());
        wait(&child);
        child.kill().unwrap();
        assert_eq!(child.wait().unwrap().signal(), Some(9), "{out}: done before it was killed");
        assert!(!dir.path().join(out).exists(), "{out} is there");
    };
    for milliseconds in [5, 50, 300] {
        let wait = |_: &_| std::thread::sleep(std::time::Duration::from_millis(milliseconds));
        killed(&["compress", "--gaussians", "20000"], "m.pgs", &wait);
    }
    // While the output itself is written: 201 MB, of which 1 MB is.
    killed(&["convert", "--tile", "4,4,4"], "tiled.npy", &|child| crate::common::wait_for_bytes(child, 1 << 20));
}

/// A first SIGINT stops cleanly with exit 130 and no output.
#[cfg(target_os = "linux")]
#[test]
fn interrupting_is_clean() {
    let dir = tempfile::tempdir().unwrap();
    for milliseconds in [0, 300] {
        let child = spawned(dir.path(), &["compress", "--gaussians", "20000", "-o", "m.pgs"]);
        crate::common::wait_for_handler(&child, 2);
        std::thread::sleep(std::time::Duration::from_millis(milliseconds));
        crate::common::signal(&child, "-INT");
        let out = child.wait_with_output().unwrap();
        assert_eq!(out.status.code(), Some(130));
        assert_eq!(crate::common::listing(dir.path()), [""; 0]);
    }
}
