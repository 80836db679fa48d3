//! Training runs end to end: the same bytes whatever the threads and however often a run was broken;
//! stops, limits, blocks, fine-tuning, and what is refused.
#![cfg(unix)]

use crate::common::{fails, particlegs, snapshot};
use std::path::{Path, PathBuf};
use std::process::{Child, Stdio};
use std::sync::OnceLock;
use std::time::{Duration, Instant};

const LAWS: [&str; 2] = ["optical-depth", "alpha-blend"];

/// A folder with a small configuration; its state is saved after every step.
fn folder() -> (tempfile::TempDir, PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let config = "evaluate_every = 8\nevaluate_views = 2\ncheckpoint_seconds = 0.0\ncameras.frames = 8\n\
        [[stages]]\niterations = 24\nsize = [96, 64]\noversample = 2\ncrop = [0, 0]\ninternal = 0.2\n\
        densify = { every = 5, until = 20, threshold = 1e-6 }\n\
        [[stages]]\niterations = 16\nsize = [160, 96]\noversample = 1\ncrop = [96, 64]\ninternal = 0.0\n\
        densify = { every = 0, until = 0, threshold = 0.0 }\n";
    std::fs::write(dir.path().join("tiny.toml"), config).unwrap();
    let path = dir.path().to_path_buf();
    (dir, path)
}

/// A command in the folder.
fn tool(dir: &Path, arguments: &[&str]) -> assert_cmd::Command {
    let mut c = particlegs();
    c.current_dir(dir).args(arguments);
    c
}

/// Arguments of a small training run.
fn training<'a>(law: &'a str, out: &'a str) -> Vec<&'a str> {
    let run =
        ["--train", "fast", "--law", law, "--config", "tiny.toml", "--effort", "fast", "--size", "20kB", "--force"];
    [&["compress", SAMPLE, "-o", out, "--certificate=none", "--threads", "2"][..], &run].concat()
}

const SAMPLE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../samples/nbody64");

/// The bytes of the small training run of a law, unbroken: made once.
fn whole(law: &'static str) -> &'static [u8] {
    static WHOLE: [OnceLock<Vec<u8>>; 2] = [OnceLock::new(), OnceLock::new()];
    WHOLE[usize::from(law == LAWS[1])].get_or_init(|| {
        let (_dir, dir) = folder();
        unbroken(&dir, &training(law, "m.pgs"), "m.pgs")
    })
}

/// The bytes of an unbroken run.
fn unbroken(dir: &Path, arguments: &[&str], out: &str) -> Vec<u8> {
    tool(dir, arguments).arg("--quiet").assert().success();
    assert!(!dir.join(format!("{out}.checkpoint")).exists(), "the checkpoint goes when the run ends well");
    std::fs::read(dir.join(out)).unwrap()
}

fn spawn(dir: &Path, arguments: &[&str]) -> Child {
    let mut c = std::process::Command::new(assert_cmd::cargo::cargo_bin("particlegs"));
    c.current_dir(dir).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Waits until a file is there, or the process has ended.
fn wait_for(path: &Path, child: &mut Child) {
    while !path.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(2));
    }
}

fn signal(child: &Child, name: &str) {
    std::process::Command::new("kill").args([name, &child.id().to_string()]).status().unwrap();
}

#[test]
fn same_bytes_for_any_threads_and_without_simd() {
    let (_dir, dir) = folder();
    for law in LAWS {
        let one = whole(law);
        assert!(one.len() <= 20_000 && one.len() > 19_500, "{law}: {} bytes", one.len());
        let mut arguments = training(law, "m.pgs");
        arguments[6] = "1";
        assert!(one == unbroken(&dir, &arguments, "m.pgs"), "{law}: threads change the bytes");
        tool(&dir, &training(law, "p.pgs")).env("PARTICLEGS_SIMD", "off").arg("-q").assert().success();
        assert!(one == std::fs::read(dir.join("p.pgs")).unwrap(), "{law}: SIMD changes the bytes");
    }
}

/// SIGKILL at odd moments, again and again, loses nothing but time.
#[test]
fn killed_runs_go_on_to_the_same_bytes() {
    let (_dir, dir) = folder();
    for law in LAWS {
        let whole = whole(law);
        let checkpoint = dir.join("m.pgs.checkpoint");
        let mut kills = 0;
        for wait in [3, 120, 37, 260, 71] {
            let mut arguments = training(law, "m.pgs");
            if checkpoint.exists() {
                arguments.push("--resume");
            }
            let mut child = spawn(&dir, &arguments);
            wait_for(&checkpoint, &mut child);
            std::thread::sleep(Duration::from_millis(wait + if arguments.contains(&"--resume") { 400 } else { 0 }));
            child.kill().unwrap();
            kills += u32::from(!child.wait().unwrap().success());
            if dir.join("m.pgs").exists() {
                break;
            }
            assert!(checkpoint.exists());
        }
        assert!(kills > 0, "{law}: every run ended before it was killed");
        if checkpoint.exists() {
            tool(&dir, &training(law, "m.pgs")).args(["--resume", "-q"]).assert().success();
        }
        assert!(whole == std::fs::read(dir.join("m.pgs")).unwrap(), "{law}: broken {kills} times");
        assert!(!checkpoint.exists());
        std::fs::remove_file(dir.join("m.pgs")).unwrap();
    }
}

/// Ctrl-C and SIGTERM leave the best so far, and the run goes on to the same bytes; other work and broken
/// files are told from the run's own checkpoint.
#[test]
fn stopped_runs_leave_the_best_and_go_on() {
    let (_dir, dir) = folder();
    for (law, name) in LAWS.into_iter().zip(["-INT", "-TERM"]) {
        let mut arguments = training(law, "m.pgs");
        // Going on needs no --force.
        arguments.retain(|a| *a != "--force");
        arguments.extend(["--iterations", "60"]);
        let mut child = spawn(&dir, &arguments);
        let checkpoint = dir.join("m.pgs.checkpoint");
        wait_for(&checkpoint, &mut child);
        std::thread::sleep(Duration::from_millis(60));
        signal(&child, name);
        assert_eq!(child.wait().unwrap().code(), Some(130), "{law}");
        let told = tool(&dir, &["verify", "m.pgs"]).output().unwrap();
        assert!(told.status.success() && String::from_utf8_lossy(&told.stdout).contains(law));
        fails(&mut tool(&dir, &arguments), 8, "an interrupted run has left it");
        let kept = std::fs::read(&checkpoint).unwrap();
        std::fs::write(&checkpoint, &kept[..kept.len() / 2]).unwrap();
        fails(tool(&dir, &arguments).arg("--resume"), 3, "truncated or altered");
        std::fs::write(&checkpoint, &kept).unwrap();
        fails(tool(&dir, &arguments).args(["--resume", "--seed", "7"]), 3, "of another command");
        tool(&dir, &arguments).args(["--resume", "-q"]).assert().success();
        assert!(!checkpoint.exists());
        let mut whole = training(law, "whole.pgs");
        whole.extend(["--iterations", "60"]);
        assert!(unbroken(&dir, &whole, "whole.pgs") == std::fs::read(dir.join("m.pgs")).unwrap(), "{law}");
        fails(tool(&dir, &arguments).arg("--resume"), 2, "no checkpoint to continue from");
        fails(&mut tool(&dir, &arguments), 8, "exists already and is not replaced");
        std::fs::remove_file(dir.join("m.pgs")).unwrap();
    }
}

/// --minutes holds for the whole command and is said to be over; log and curves are there.
#[test]
fn minutes_bound_the_whole_run() {
    let (_dir, dir) = folder();
    let mut arguments = training("optical-depth", "m.pgs");
    arguments.extend(["--iterations", "1000000", "--minutes", "0.06", "--log", "log.jsonl", "--json", "r.json"]);
    let start = Instant::now();
    let out = tool(&dir, &arguments).output().unwrap();
    assert!(out.status.success() && start.elapsed().as_secs_f64() < 30.0);
    assert!(String::from_utf8_lossy(&out.stderr).contains("ended by the time limit"));
    let report: serde_json::Value = serde_json::from_slice(&std::fs::read(dir.join("r.json")).unwrap()).unwrap();
    let run = &report["trained"][0];
    assert!(run["iterations"].as_u64().unwrap() < run["of"].as_u64().unwrap(), "{run}");
    let log = std::fs::read_to_string(dir.join("log.jsonl")).unwrap();
    let lines: Vec<serde_json::Value> = log.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(lines[0]["iteration"], 0);
    assert!(lines.last().unwrap()["held_out_masked_psnr"].is_f64(), "the last state is scored");
    for name in ["log-psnr.svg", "log-psnr.png"] {
        assert!(dir.join(name).exists(), "{name}");
    }
    assert!(!dir.join("m.pgs.checkpoint").exists());
}

/// Blocks of the published law: the job's file is that of `compress`, with the network of block 0, of
/// the size asked for; a stopped block goes on; the merged model is fine-tuned to its own size.
#[test]
fn blocks_and_fine_tuning() {
    let (_dir, dir) = folder();
    let blocks = [&training("alpha-blend", "m.pgs")[..], &["--blocks", "2"]].concat();
    let direct = unbroken(&dir, &blocks, "m.pgs");
    assert!(direct.len() <= 20_000 && direct.len() > 19_000, "{} bytes", direct.len());
    let mut plan = blocks.clone();
    (plan[0], plan[3]) = ("plan", "job");
    tool(&dir, &plan).arg("-q").assert().success();
    tool(&dir, &["scatter", "job", "-q"]).assert().success();
    let mut child = spawn(&dir, &["block", "job", "1"]);
    wait_for(&dir.join("job/blocks/00001.checkpoint"), &mut child);
    signal(&child, "-USR1");
    assert_eq!(child.wait().unwrap().code(), Some(75));
    for block in ["1", "0"] {
        tool(&dir, &["block", "job", block, "-q"]).assert().success();
    }
    tool(&dir, &["merge", "job", "-o", "of-job.pgs", "-q"]).assert().success();
    assert!(direct == std::fs::read(dir.join("of-job.pgs")).unwrap());
    let network = |name: &str| {
        let bytes = std::fs::read(dir.join(name)).unwrap();
        particlegs::codec::decode(&bytes, name).unwrap().vizmapper().unwrap().clone()
    };
    assert_eq!(network("m.pgs"), network("job/blocks/00000.pgs"));
    assert_ne!(network("m.pgs"), network("job/blocks/00001.pgs"));

    let tune =
        ["finetune", "m.pgs", SAMPLE, "-o", "tuned.pgs", "--config", "tiny.toml", "--certificate=none", "--force"];
    let tuned = unbroken(&dir, &tune, "tuned.pgs");
    assert!(tuned.len() <= direct.len() && tuned.len() + 500 > direct.len(), "{} bytes", tuned.len());
    assert!(tuned == unbroken(&dir, &[&tune[..], &["--threads", "1"]].concat(), "tuned.pgs"));
    let model = particlegs::codec::decode(&tuned, "tuned.pgs").unwrap();
    assert!(
        model.metadata.recipe.to_string().starts_with("finetune --seed 42") && model.metadata.recipe.fitted().is_none()
    );
    let ranges = model.vizmapper().unwrap().ranges;
    assert!((ranges.scale - 0.3).abs() < 1e-6 && (ranges.floor - 0.1).abs() < 1e-6);
    tool(&dir, &["verify", "tuned.pgs", "-q"]).assert().success();

    // By number, at the nominal precision; never fewer than it has.
    let own = particlegs::codec::decode(&direct, "m.pgs").unwrap().gaussians();
    tool(&dir, &tune).args(["--gaussians", &(2 * own).to_string(), "--json", "said.json", "-q"]).assert().success();
    let said: serde_json::Value = serde_json::from_slice(&std::fs::read(dir.join("said.json")).unwrap()).unwrap();
    assert_eq!(said["step_factor"], 1.0);
    assert!(said["gaussians"].as_u64().unwrap() <= 2 * own as u64);
    fails(tool(&dir, &tune).args(["--gaussians", "3"]), 5, &format!("the model has {own}"));

    snapshot(&dir.join("other"), &[vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 5.0], vec![0.0, 4.0, 2.0]]);
    let of = |model: &str, data: &str| tool(&dir, &["finetune", model, data, "-o", "x.pgs", "--config", "tiny.toml"]);
    fails(&mut of("m.pgs", "other"), 3, "not the snapshot that m.pgs was made of");
    tool(&dir, &["compress", SAMPLE, "-o", "plain.pgs", "--effort", "fast", "--certificate=none", "-q"])
        .assert()
        .success();
    fails(&mut of("plain.pgs", SAMPLE), 2, "only alpha-blend models can be fine-tuned");
    fails(of("m.pgs", SAMPLE).args(["--size", "5kB"]), 5, "the head and the network alone");
}

/// Weights are not kept by the published law: a weighted snapshot has the same size and the same job.
#[test]
fn weighted_snapshots_in_blocks() {
    let (_dir, dir) = folder();
    let mut state = 9u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 24) as f32
    };
    let mut columns: Vec<Vec<f32>> = (0..4).map(|_| (0..3000).map(|_| 10.0 * next()).collect()).collect();
    columns[3].iter_mut().for_each(|w| *w += 0.5);
    snapshot(&dir.join("weighted"), &columns);
    let mut arguments = training("alpha-blend", "m.pgs");
    (arguments[1], arguments[16]) = ("weighted", "12kB");
    arguments.extend(["--blocks", "2", "--iterations", "10"]);
    let direct = unbroken(&dir, &arguments, "m.pgs");
    assert!(direct.len() <= 12_000, "{}", direct.len());
    (arguments[0], arguments[3]) = ("plan", "job");
    tool(&dir, &arguments).arg("-q").assert().success();
    tool(&dir, &["scatter", "job", "-q"]).assert().success();
    for block in ["1", "0"] {
        tool(&dir, &["block", "job", block, "-q"]).assert().success();
    }
    tool(&dir, &["merge", "job", "-o", "of-job.pgs", "-q"]).assert().success();
    assert!(direct == std::fs::read(dir.join("of-job.pgs")).unwrap());
}

#[test]
fn configurations_come_back_and_faults_are_named() {
    let (_dir, dir) = folder();
    for which in ["all", "changed"] {
        let print = ["compress", "--train", "best", "--law", "alpha-blend", "--scale", "0.1", "--print-config", which];
        let printed = tool(&dir, &print).output().unwrap();
        assert!(printed.status.success(), "{}", String::from_utf8_lossy(&printed.stderr));
        std::fs::write(dir.join("again.toml"), &printed.stdout).unwrap();
        let mut again = tool(&dir, &["compress", "--train", "best", "--law", "alpha-blend", "--config", "again.toml"]);
        let again = again.args(["--print-config", which]).output().unwrap();
        assert_eq!(String::from_utf8_lossy(&printed.stdout), String::from_utf8_lossy(&again.stdout));
    }
    let cases = [
        ("bogus = 1", 3, "unknown field `bogus`"),
        ("evaluate_every = \"often\"", 3, "evaluate_every"),
        ("[cameras]\norbits = 1 2", 3, "line 2"),
        ("stages = []", 2, "no stage has iterations"),
        ("evaluate_every = 0", 2, "evaluate_every"),
        ("cameras.radius = [2.0, 1.0]", 2, "cameras.radius"),
        ("cameras.held_out = 1.0", 2, "cameras.held_out"),
        ("loss.dssim = nan", 2, "loss.dssim"),
        ("law = \"alpha-blend\"", 3, "trains by optical-depth"),
    ];
    for (text, code, told) in cases {
        std::fs::write(dir.join("tiny.toml"), text).unwrap();
        fails(&mut tool(&dir, &training("optical-depth", "m.pgs")), code, told);
    }
    std::fs::remove_file(dir.join("tiny.toml")).unwrap();
    fails(&mut tool(&dir, &training("optical-depth", "m.pgs")), 6, "tiny.toml");
}

#[test]
fn what_cannot_be_is_refused_before_the_work() {
    let (_dir, dir) = folder();
    let plain = |more: &[&str]| tool(&dir, &[&["compress", SAMPLE, "-o", "m.pgs"][..], more].concat());
    for option in [&["--resume"][..], &["--minutes", "3"], &["--log", "l.jsonl"], &["--scale", "0.5"]] {
        fails(&mut plain(option), 2, "--train fast|best|paper");
    }
    fails(&mut plain(&["--law", "alpha-blend"]), 2, "--train");
    let trained = |more: &[&str]| {
        let mut c = plain(&["--train", "fast", "--config", "tiny.toml", "--effort", "fast"]);
        c.args(more);
        c
    };
    fails(&mut trained(&["--minutes", "0"]), 2, "--minutes");
    fails(&mut trained(&["--scale", "2"]), 2, "--scale");
    fails(&mut trained(&["--iterations", "0"]), 2, "--iterations");
    fails(&mut trained(&["--law", "alpha-blend", "--size", "5kB"]), 5, "the head and the network alone");
    fails(&mut trained(&["--log", "nowhere/l.jsonl"]), 6, "nowhere/l.jsonl");
    fails(&mut trained(&["--memory", "1GB", "--scratch", "nowhere"]), 6, "nowhere");
    snapshot(&dir.join("two"), &[vec![0.0, 1.0, 2.0, 3.0], vec![1.0; 4], vec![2.0; 4], vec![1.0, 1.0, 8.0, 8.0]]);
    let mut layers = tool(&dir, &["compress", "two", "-o", "m.pgs", "--layers", "mass", "--train", "fast"]);
    fails(layers.args(["--law", "alpha-blend", "--config", "tiny.toml"]), 2, "the alpha-blend law has one layer");
    // A log that cannot be written to costs no model.
    let out = trained(&["--log", "/dev/full", "--certificate=none", "--iterations", "60"]).output().unwrap();
    let told = String::from_utf8_lossy(&out.stderr);
    assert!(out.status.success() && told.contains("nothing more is logged"), "{told}");
    // Nor is there a checkpoint where a folder has its name.
    std::fs::create_dir(dir.join("m.pgs.checkpoint")).unwrap();
    fails(&mut trained(&["--certificate=none"]), 6, "m.pgs.checkpoint");
}
