//! Jobs in a folder as a user, or an engine, runs them.

use crate::common::{fails, listing, particlegs, sample, snapshot};
use serde_json::Value;
use std::path::{Path, PathBuf};

/// Runs a command that succeeds and gives what it says as JSON.
fn says(arguments: &[&dyn AsRef<std::ffi::OsStr>]) -> Value {
    let out = particlegs().args(arguments.iter().map(|a| a.as_ref())).args(["--json", "-"]).output().unwrap();
    assert!(out.status.success(), "{}", String::from_utf8_lossy(&out.stderr));
    serde_json::from_slice(&out.stdout).unwrap()
}

/// The file that `compress` gives.
fn compressed(input: &Path, out: &Path, options: &[&str]) -> Vec<u8> {
    particlegs()
        .arg("compress")
        .arg(input)
        .arg("-o")
        .arg(out)
        .args(options)
        .args(["--quiet", "--force"])
        .assert()
        .success();
    std::fs::read(out).unwrap()
}

/// The file of a job whose parts are done in an odd order.
fn by_job(input: &Path, job: &Path, options: &[&str]) -> (Vec<u8>, u64) {
    let plan: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"plan", &input, &"-o", &job];
    let planned =
        says(&[&plan[..], &options.iter().map(|o| o as &dyn AsRef<std::ffi::OsStr>).collect::<Vec<_>>()].concat());
    let (blocks, chunks) = (planned["blocks"].as_u64().unwrap(), planned["chunks"].as_u64().unwrap());
    for chunk in (0..chunks).rev() {
        says(&[&"scatter", &job, &chunk.to_string()]);
    }
    for block in (0..blocks).map(|b| (b * 3 + 1) % blocks).chain(0..blocks) {
        says(&[&"block", &job, &block.to_string(), &"--threads", &(1 + block % 2).to_string()]);
    }
    let out = job.join("../of-job.pgs");
    particlegs().arg("merge").arg(job).arg("-o").arg(&out).args(["--quiet", "--force"]).assert().success();
    (std::fs::read(out).unwrap(), chunks)
}

/// A snapshot of `n` particles that lie in order along x, so that runs are together.
fn in_order(folder: &Path, n: usize) {
    let mut state = 7u64;
    let mut next = || {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (state >> 40) as f32 / (1u64 << 24) as f32
    };
    let x: Vec<f32> = (0..n).map(|i| 40.0 * i as f32 / n as f32).collect();
    let [y, z] = [0, 1].map(|_| (0..n).map(|_| next()).collect::<Vec<f32>>());
    snapshot(folder, &[x, y, z]);
}

#[test]
fn a_job_gives_the_bytes_that_compress_gives() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let options = ["--blocks", "5", "--effort", "fast"];
    let direct = compressed(&sample(), &at("direct.pgs"), &options);
    let (merged, chunks) = by_job(&sample(), &at("job"), &options);
    assert!(chunks > 1);
    assert_eq!(merged, direct);
    let bounded = compressed(&sample(), &at("bounded.pgs"), &[&options[..], &["--memory", "500MB"]].concat());
    assert_eq!(bounded, direct);
    let status = says(&[&"status", &at("job")]);
    assert_eq!(status["particles"], serde_json::json!([262_144, 262_144]));
    particlegs().arg("verify").arg(at("job")).assert().success();
    // A block is a model of its own, and nothing but the job's files is in its folder.
    particlegs().args(["info", "--quiet"]).arg(at("job/blocks/00003.pgs")).assert().success();
    assert_eq!(listing(&at("job")), ["blocks", "plan.json", "runs.bin", "scatter"]);
    // The same plan again changes nothing, done parts stay done.
    let again = says(&[&"plan", &sample(), &"-o", &at("job"), &"--blocks", &"5", &"--effort", &"fast"]);
    assert_eq!(again["planned_before"], true);
    assert_eq!(says(&[&"block", &at("job"), &"4"])["before"], true);
}

#[test]
fn what_lies_together_is_not_copied() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    in_order(&at("snapshot"), 400_000);
    let options = ["--blocks", "3", "--effort", "fast", "--certificate=none"];
    let (merged, chunks) = by_job(&at("snapshot"), &at("job"), &options);
    assert_eq!(chunks, 0);
    assert_eq!(merged, compressed(&at("snapshot"), &at("direct.pgs"), &options));
    particlegs().arg("scatter").arg(at("job")).assert().success();
}

#[test]
fn layers_weights_and_selections_go_through_a_job() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    in_order(&at("snapshot"), 150_000);
    let weights: Vec<u8> = (0..150_000).flat_map(|i| (1.0 + (i % 4) as f32).to_le_bytes()).collect();
    std::fs::write(at("snapshot/ww.f32"), weights).unwrap();
    let common = ["--blocks", "4", "--effort", "fast", "--certificate=none", "--ratio", "60"];
    for (name, more) in [
        ("weights", &[][..]),
        ("masses", &["--layers", "mass"]),
        ("region", &["--region", "3,30,0,1,0,0.7", "--every", "2"]),
        ("plain", &["--mass-field", "none"]),
    ] {
        let options = [&common[..], more].concat();
        let direct = compressed(&at("snapshot"), &at("direct.pgs"), &options);
        assert_eq!(by_job(&at("snapshot"), &at(name), &options).0, direct, "{name}");
        let bounded = [&options[..], &["--memory", "400MB"]].concat();
        assert_eq!(compressed(&at("snapshot"), &at("bounded.pgs"), &bounded), direct, "{name}");
    }
}

#[test]
fn what_is_missing_broken_or_changed_is_named() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    in_order(&at("snapshot"), 140_000);
    // Shuffled along x, so that blocks need buckets.
    let x: Vec<u8> = (0..140_000u64).flat_map(|i| ((i * 7919 % 140_000) as f32).to_le_bytes()).collect();
    std::fs::write(at("snapshot/xx.f32"), &x).unwrap();
    let job = at("job");
    says(&[&"plan", &at("snapshot"), &"-o", &job, &"--blocks", &"3", &"--effort", &"fast"]);
    let run = |name: &str, arguments: &[&str]| {
        let mut c = particlegs();
        c.arg(name).arg(&job).args(arguments);
        c
    };
    let merge = ["-o", at("m.pgs").to_str().unwrap()].map(str::to_string);
    let merge: Vec<&str> = merge.iter().map(String::as_str).collect();
    fails(&mut run("block", &["0"]), 3, "00000.bin: this chunk has not been sorted yet");
    fails(&mut run("scatter", &["3"]), 2, "chunk 3 is outside the 3");
    run("scatter", &["--quiet"]).assert().success();
    fails(&mut run("block", &["3"]), 2, "block 3 is outside the 3");
    fails(&mut run("block", &["x"]), 2, "not a number");
    fails(&mut run("block", &["env:PARTICLEGS_NO_SUCH_VARIABLE"]), 2, "is not set");
    run("block", &["env:TASK", "--quiet"]).env("TASK", "1").assert().success();
    fails(&mut run("merge", &merge), 3, "blocks not fitted yet: 0, 2 (2 of 3)");
    assert!(!at("m.pgs").exists());
    for block in ["0", "2"] {
        run("block", &[block, "--quiet"]).assert().success();
    }
    // Another plan in the same folder, and a folder that is not a job's.
    let mut other = particlegs();
    other.arg("plan").arg(at("snapshot")).arg("-o").arg(&job).args(["--blocks", "4"]);
    fails(&mut other, 8, "it already holds another plan");
    let mut other = particlegs();
    other.arg("plan").arg(at("snapshot")).arg("-o").arg(dir.path()).args(["--blocks", "4"]);
    fails(&mut other, 8, "holds `");
    // Half-written files.
    let block = job.join("blocks/00002.pgs");
    let whole = std::fs::read(&block).unwrap();
    std::fs::write(&block, &whole[..whole.len() / 2]).unwrap();
    fails(&mut run("merge", &merge), 3, "blocks/00002.pgs: it ends after");
    fails(&mut run("verify", &[]), 3, "blocks/00002.pgs: it ends after");
    run("block", &["2", "--quiet"]).assert().success();
    assert_eq!(std::fs::read(&block).unwrap(), whole);
    let chunk = job.join("scatter/00001.bin");
    let mut bytes = std::fs::read(&chunk).unwrap();
    let last = bytes.len() - 1;
    bytes[last] ^= 1;
    std::fs::write(&chunk, &bytes).unwrap();
    fails(&mut run("verify", &[]), 3, "00001.bin: its particles changed");
    std::fs::write(&chunk, &bytes[..100]).unwrap();
    fails(&mut run("scatter", &["1"]), 3, "00001.bin: half-written");
    std::fs::remove_file(&chunk).unwrap();
    // The snapshot changed after the plan.
    let mut changed = x;
    changed[4 * 70_000] ^= 1;
    std::fs::write(at("snapshot/xx.f32"), changed).unwrap();
    fails(&mut run("scatter", &["1"]), 3, "changed after `plan`: its particles 65536 to 131071");
    fails(&mut run("merge", &merge), 3, "changed after `plan`");
    fails(&mut run("verify", &[]), 3, "changed after `plan`");
    run("merge", &[&merge[..], &["--certificate=none", "--quiet"]].concat()).assert().success();
}

#[test]
fn plans_that_cannot_be_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    snapshot(&at("few"), &[vec![0.0, 1.0, 2.0], vec![0.0; 3], vec![0.0; 3]]);
    let plan = |input: &PathBuf, arguments: &[&str]| {
        let mut c = particlegs();
        c.arg("plan").arg(input).arg("-o").arg(at("job")).args(arguments);
        c
    };
    fails(&mut plan(&at("few"), &["--blocks", "4"]), 2, "4 blocks are outside 1 to 3");
    fails(&mut plan(&at("few"), &["--blocks", "0"]), 2, "0 blocks are outside");
    fails(&mut plan(&at("few"), &["--blocks", "many"]), 2, "neither a number nor `auto`");
    fails(&mut plan(&at("few"), &["--psnr", "30"]), 2, "all blocks together");
    fails(&mut plan(&at("few"), &["--min-correlation", "0.9", "--cell", "1"]), 2, "all blocks together");
    fails(&mut plan(&sample(), &["--memory", "50MB"]), 7, "needs about");
    fails(&mut plan(&sample(), &["--memory", "lots"]), 2, "size `lots`");
    assert!(!at("job").exists());
    std::fs::write(at("file"), "").unwrap();
    let mut c = particlegs();
    c.arg("plan").arg(sample()).arg("-o").arg(at("file/job")).args(["--blocks", "2"]);
    fails(&mut c, 6, "file/job");
    fails(particlegs().arg("status").arg(at("few")), 3, "no plan.json");
    let mut c = particlegs();
    c.arg("compress").arg(sample()).arg("-o").arg(at("m.pgs")).args(["--memory", "1GB", "--blocks", "2", "--scratch"]);
    fails(c.arg(at("nowhere")), 6, "nowhere");
    std::fs::create_dir(at("job")).unwrap();
    std::fs::write(at("job/plan.json"), "{\"particlegs_job\": 99}").unwrap();
    fails(particlegs().arg("status").arg(at("job")), 4, "newer program");
    std::fs::write(at("job/plan.json"), "{\"particlegs_job\": 1}").unwrap();
    fails(particlegs().arg("status").arg(at("job")), 4, "older program: plan again");
    std::fs::write(at("job/plan.json"), "{}").unwrap();
    fails(particlegs().arg("status").arg(at("job")), 3, "not a plan");
}

/// The sample in eight layers: a block has eight fits, and a checkpoint after each.
#[cfg(target_os = "linux")]
fn in_layers(folder: &Path) {
    std::fs::create_dir(folder).unwrap();
    for name in ["xx.f32", "yy.f32", "zz.f32"] {
        std::fs::copy(sample().join(name), folder.join(name)).unwrap();
    }
    let layers = (0..8).map(|i| serde_json::json!({ "name": format!("layer {i}"), "particles": 32_768 }));
    let meta = serde_json::json!({ "box": 25.0, "periodic": true, "layers": layers.collect::<Vec<_>>() });
    std::fs::write(folder.join("meta.json"), meta.to_string()).unwrap();
}

/// An engine's signal: what is finished is kept, the exit code asks to be run again.
#[cfg(target_os = "linux")]
#[test]
fn a_signal_stops_a_block_and_it_goes_on_to_the_same_bytes() {
    let dir = tempfile::tempdir().unwrap();
    let at = |name: &str| dir.path().join(name);
    let options = ["--blocks", "1", "--ratio", "150", "--certificate=none"];
    let data = at("data");
    in_layers(&data);
    let direct = compressed(&data, &at("direct.pgs"), &options);
    particlegs().arg("plan").arg(&data).arg("-o").arg(at("job")).args(options).arg("--quiet").assert().success();
    particlegs().arg("scatter").arg(at("job")).arg("--quiet").assert().success();
    let checkpoint = at("job/blocks/00000.checkpoint");
    let (mut stops, mut wait) = (0, 50);
    // Later and later, until something was finished before the signal: both signals at least once.
    while stops < 2 || !checkpoint.exists() {
        let mut c = std::process::Command::new(assert_cmd::cargo::cargo_bin("particlegs"));
        let mut child = c.arg("block").arg(at("job")).args(["0", "--quiet"]).spawn().unwrap();
        let (number, name) = if stops % 2 == 0 { (10, "-USR1") } else { (15, "-TERM") };
        crate::common::wait_for_handler(&child, number);
        std::thread::sleep(std::time::Duration::from_millis(wait));
        crate::common::signal(&child, name);
        assert_eq!(child.wait().unwrap().code(), Some(75), "{name} after {wait} ms");
        assert!(!at("job/blocks/00000.pgs").exists());
        (stops, wait) = (stops + 1, 2 * wait);
    }
    let out = particlegs().arg("block").arg(at("job")).arg("0").output().unwrap();
    let text = String::from_utf8_lossy(&out.stdout).into_owned();
    assert!(out.status.success() && text.contains("from a checkpoint with"), "{text}");
    particlegs().arg("merge").arg(at("job")).arg("-o").arg(at("m.pgs")).arg("--quiet").assert().success();
    assert_eq!(std::fs::read(at("m.pgs")).unwrap(), direct);
    assert!(!checkpoint.exists());
}
