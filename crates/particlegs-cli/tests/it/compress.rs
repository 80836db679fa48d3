//! `compress` end to end: sizes, counts, and the same bytes for any number of threads.

use crate::common::{TestFolder, snapshot};
#[cfg(target_os = "linux")]
use crate::common::{process, signal, wait_for_bytes, wait_for_handler, words};

fn compress(dir: &TestFolder, name: &str, options: &str) -> Vec<u8> {
    dir.makes(&format!("compress SAMPLE -o {name} {options} --certificate=none --quiet --force"))
}

#[test]
fn same_bytes_for_any_threads_and_without_simd() {
    let dir = TestFolder::new();
    for effort in ["fast", "default"] {
        let options = |threads: u32| format!("--effort {effort} --ratio 300 --threads {threads}");
        let one = compress(&dir, "1.pgs", &options(1));
        assert!(one == compress(&dir, "2.pgs", &options(2)), "{effort}: threads change the bytes");
        let words = format!("compress SAMPLE -o p.pgs {} --certificate=none --quiet --force", options(2));
        dir.command(&words).env("PARTICLEGS_SIMD", "off").assert().success();
        assert!(one == dir.bytes("p.pgs"), "{effort}: SIMD changes the bytes");
    }
}

#[test]
fn blocks_hold_all_particles_and_draw_the_same() {
    let dir = TestFolder::new();
    let options = |threads: u32| format!("--effort fast --ratio 100 --blocks 5 --threads {threads}");
    let bytes = compress(&dir, "b.pgs", &options(2));
    assert!(bytes == compress(&dir, "b1.pgs", &options(1)), "threads change the bytes");
    let target = 262_144 * 12 / 100;
    assert!(bytes.len() <= target && target - bytes.len() <= 5 * 256, "{} of {target}", bytes.len());
    let model = particlegs_core::codec::decode(&bytes, "b.pgs").unwrap();
    let counts: Vec<u64> = model.blocks().map(|b| b.count).collect();
    assert_eq!((counts.len(), counts.iter().sum::<u64>()), (5, 262_144));
    assert!(counts.iter().all(|c| c.abs_diff(262_144 / 5) <= 3), "{counts:?}");
    for bad in ["0", "262145"] {
        let words = format!("compress SAMPLE -o bad.pgs --blocks {bad} -q");
        dir.command(&words).assert().failure().code(2);
        assert!(!dir.at("bad.pgs").exists());
    }
}

#[test]
fn requested_sizes_are_reached() {
    let dir = TestFolder::new();
    let raw = 262_144 * 12;
    // With a certificate, in a small file, where it matters most.
    for (ratio, certificate) in [(30, "none"), (300, "none"), (2000, "quick")] {
        let fit = format!("--effort fast --ratio {ratio} --certificate={certificate}");
        let bytes = dir.makes(&format!("compress SAMPLE -o {ratio}.pgs {fit} --quiet")).len();
        let target = raw / ratio;
        assert!(bytes <= target && target - bytes <= 256.max(target / 50), "ratio {ratio}: {bytes} of {target}");
    }
}

#[test]
fn odd_snapshots_work() {
    let dir = TestFolder::new();
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
        snapshot(&dir.at(name), &columns);
        // A certificate also for degenerate particles: a point, a line, numbers near the largest.
        let measured = if ["one", "line", "huge"].contains(&name) { "quick" } else { "none" };
        for (effort, certificate) in [("fast", measured), ("default", "none")] {
            let model = &format!("{name}-{effort}.pgs");
            let fit = format!("--effort {effort} --gaussians 10 --certificate={certificate}");
            dir.runs(&format!("compress {name} -o {model} {fit}"));
            assert_eq!(dir.says(&format!("info {model}"))["metadata"]["particles"], columns[0].len(), "{name}");
            dir.runs(&format!("render {model} --style expected --size 64x48 --out pictures"));
        }
    }
}

/// The binary as a child that can be signalled.
#[cfg(target_os = "linux")]
fn spawned(dir: &TestFolder, text: &str) -> std::process::Child {
    process(dir.path()).args(words(&format!("{text} --quiet SAMPLE"))).spawn().unwrap()
}

/// A process killed at any moment leaves no partial file under the output's name.
#[cfg(target_os = "linux")]
#[test]
fn killing_is_safe() {
    use std::os::unix::process::ExitStatusExt;
    let dir = TestFolder::new();
    let killed = |words: &str, out: &str, wait: &dyn Fn(&std::process::Child)| {
        let mut child = spawned(&dir, &format!("{words} -o {out}"));
        wait(&child);
        child.kill().unwrap();
        assert_eq!(child.wait().unwrap().signal(), Some(9), "{out}: done before it was killed");
        assert!(!dir.at(out).exists(), "{out} is there");
    };
    for milliseconds in [5, 50, 300] {
        let wait = |_: &_| std::thread::sleep(std::time::Duration::from_millis(milliseconds));
        killed("compress --gaussians 20000", "m.pgs", &wait);
    }
    // While the output itself is written: 201 MB, of which 1 MB is.
    killed("convert --tile 4,4,4", "tiled.npy", &|child| wait_for_bytes(child, 1 << 20));
}

/// A first SIGINT stops cleanly with exit 130 and no output.
#[cfg(target_os = "linux")]
#[test]
fn interrupting_is_clean() {
    let dir = TestFolder::new();
    for milliseconds in [0, 300] {
        let child = spawned(&dir, "compress --gaussians 20000 -o m.pgs");
        wait_for_handler(&child, 2);
        std::thread::sleep(std::time::Duration::from_millis(milliseconds));
        signal(&child, "-INT");
        let out = child.wait_with_output().unwrap();
        assert_eq!(out.status.code(), Some(130));
        assert_eq!(dir.listing(), [""; 0]);
    }
}
