//! Training runs end to end: the same bytes for any threads and interruptions; stops, limits, blocks, fine-tuning, and
//! errors.
#![cfg(unix)]

use crate::common::{TestFolder, process, signal, snapshot, words};
use std::path::Path;
use std::process::{Child, Stdio};
use std::sync::OnceLock;
use std::time::Duration;

const LAWS: [&str; 2] = ["optical-depth", "alpha-blend"];

/// A folder with a small configuration; its state is saved after every step.
fn folder() -> TestFolder {
    let dir = TestFolder::new();
    let config = "evaluate_every = 8\nevaluate_views = 2\ncheckpoint_seconds = 0.0\ncameras.frames = 8\n\
        [[stages]]\niterations = 24\nsize = [96, 64]\noversample = 2\ncrop = [0, 0]\ninternal = 0.2\n\
        densify = { every = 5, until = 20, threshold = 1e-6 }\n\
        [[stages]]\niterations = 16\nsize = [160, 96]\noversample = 1\ncrop = [96, 64]\ninternal = 0.0\n\
        densify = { every = 0, until = 0, threshold = 0.0 }\n";
    dir.write("tiny.toml", config);
    dir
}

/// Options of a small training run.
fn training(law: &str) -> String {
    format!("--certificate=none --train fast --law {law} --config tiny.toml --effort fast --size 20kB")
}

/// A small training run with two threads and --force.
fn trained(law: &str, out: &str) -> String {
    format!("compress SAMPLE -o {out} {} --threads 2 --force", training(law))
}

/// The bytes of an uninterrupted small run for a law, made once.
fn whole(law: &'static str) -> &'static [u8] {
    static WHOLE: [OnceLock<Vec<u8>>; 2] = [OnceLock::new(), OnceLock::new()];
    WHOLE[usize::from(law == LAWS[1])].get_or_init(|| unbroken(&folder(), &trained(law, "m.pgs")))
}

/// The bytes of an uninterrupted run.
fn unbroken(dir: &TestFolder, words: &str) -> Vec<u8> {
    let bytes = dir.makes(&format!("{words} --quiet"));
    let left = dir.listing().into_iter().find(|name| name.ends_with(".checkpoint"));
    assert_eq!(left, None, "the checkpoint goes when the run ends well");
    bytes
}

fn spawn(dir: &TestFolder, text: &str) -> Child {
    process(dir.path()).args(words(text)).stdout(Stdio::null()).stderr(Stdio::null()).spawn().unwrap()
}

/// Waits until a file exists or the process has ended.
fn wait_for(path: &Path, child: &mut Child) {
    while !path.exists() && child.try_wait().unwrap().is_none() {
        std::thread::sleep(Duration::from_millis(2));
    }
}

/// The file of a planned job.
fn merged(dir: &TestFolder) -> Vec<u8> {
    for block in ["1", "0"] {
        dir.runs(&format!("block job {block} -q"));
    }
    dir.makes("merge job -o of-job.pgs -q")
}

#[test]
fn same_bytes_for_any_threads_and_without_simd() {
    let dir = folder();
    for law in LAWS {
        let one = whole(law);
        assert!(one.len() <= 20_000 && one.len() > 19_500, "{law}: {} bytes", one.len());
        let alone = format!("compress SAMPLE -o m.pgs {} --threads 1 --force", training(law));
        assert!(one == unbroken(&dir, &alone), "{law}: threads change the bytes");
        dir.command(&trained(law, "p.pgs")).env("PARTICLEGS_SIMD", "off").arg("-q").assert().success();
        assert!(one == dir.bytes("p.pgs"), "{law}: SIMD changes the bytes");
    }
}

/// Repeated SIGKILL loses nothing but time.
#[test]
fn killed_runs_continue_to_the_same_bytes() {
    let dir = folder();
    let checkpoint = dir.at("m.pgs.checkpoint");
    for law in LAWS {
        let (whole, words) = (whole(law), trained(law, "m.pgs"));
        let mut kills = 0;
        for wait in [3, 120, 37, 260, 71] {
            let resume = checkpoint.exists();
            let mut child = spawn(&dir, &format!("{words}{}", if resume { " --resume" } else { "" }));
            wait_for(&checkpoint, &mut child);
            std::thread::sleep(Duration::from_millis(wait + if resume { 400 } else { 0 }));
            child.kill().unwrap();
            kills += u32::from(!child.wait().unwrap().success());
            if dir.at("m.pgs").exists() {
                break;
            }
            assert!(checkpoint.exists());
        }
        assert!(kills > 0, "{law}: every run ended before it was killed");
        if checkpoint.exists() {
            dir.runs(&format!("{words} --resume -q"));
        }
        assert!(whole == dir.bytes("m.pgs"), "{law}: broken {kills} times");
        assert!(!checkpoint.exists());
        std::fs::remove_file(dir.at("m.pgs")).unwrap();
    }
}

/// Ctrl-C and SIGTERM keep the best model, and the run continues to the same bytes; checkpoints of other work and
/// broken ones are refused.
#[test]
fn stopped_runs_keep_the_best_model_and_continue() {
    let dir = folder();
    for (law, name) in LAWS.into_iter().zip(["-INT", "-TERM"]) {
        // Resuming needs no --force.
        let words = format!("compress SAMPLE -o m.pgs {} --threads 2 --iterations 60", training(law));
        let resume = format!("{words} --resume");
        let mut child = spawn(&dir, &words);
        let checkpoint = dir.at("m.pgs.checkpoint");
        wait_for(&checkpoint, &mut child);
        std::thread::sleep(Duration::from_millis(60));
        signal(&child, name);
        assert_eq!(child.wait().unwrap().code(), Some(130), "{law}");
        assert!(dir.runs("verify m.pgs")[0].contains(law));
        dir.fails(&words, 8, "left by an interrupted run");
        let checkpoint_bytes = std::fs::read(&checkpoint).unwrap();
        std::fs::write(&checkpoint, &checkpoint_bytes[..checkpoint_bytes.len() / 2]).unwrap();
        dir.fails(&resume, 3, "is truncated or has been changed");
        std::fs::write(&checkpoint, &checkpoint_bytes).unwrap();
        dir.fails(&format!("{resume} --seed 7"), 3, "belongs to another command");
        dir.runs(&format!("{resume} -q"));
        assert!(!checkpoint.exists());
        let whole = unbroken(&dir, &format!("{} --iterations 60", trained(law, "whole.pgs")));
        assert!(whole == dir.bytes("m.pgs"), "{law}");
        dir.fails(&resume, 2, "no checkpoint to continue from");
        dir.fails(&words, 8, "exists already and is not replaced");
        std::fs::remove_file(dir.at("m.pgs")).unwrap();
    }
}

/// --minutes limits the whole command, which reports it and writes log and curves.
#[test]
fn minutes_limit_the_whole_run() {
    let dir = folder();
    let bounds = "--iterations 1000000 --minutes 0.06 --log log.jsonl --json r.json";
    let [_, notes] = dir.runs(&format!("{} {bounds}", trained("optical-depth", "m.pgs")));
    assert!(notes.contains("reached its time limit"));
    let report = dir.json("r.json");
    let run = &report["trained"][0];
    assert!(run["iterations"].as_u64().unwrap() < run["of"].as_u64().unwrap(), "{run}");
    let log = dir.text("log.jsonl");
    let lines: Vec<serde_json::Value> = log.lines().map(|l| serde_json::from_str(l).unwrap()).collect();
    assert_eq!(lines[0]["iteration"], 0);
    assert!(lines.last().unwrap()["held_out_masked_psnr"].is_f64(), "the last state is scored");
    for name in ["log-psnr.svg", "log-psnr.png"] {
        assert!(dir.at(name).exists(), "{name}");
    }
    assert!(!dir.at("m.pgs.checkpoint").exists());
}

/// Blocks of the published law: the job's file equals that of `compress`, has the network of block 0 and the requested
/// size; a stopped block continues; fine-tuning keeps the size.
#[test]
fn blocks_and_fine_tuning() {
    let dir = folder();
    let direct = unbroken(&dir, &format!("{} --blocks 2", trained("alpha-blend", "m.pgs")));
    assert!(direct.len() <= 20_000 && direct.len() > 19_000, "{} bytes", direct.len());
    dir.runs(&format!("plan SAMPLE -o job {} --threads 2 --force --blocks 2 -q", training("alpha-blend")));
    dir.runs("scatter job -q");
    let mut child = spawn(&dir, "block job 1");
    wait_for(&dir.at("job/blocks/00001.checkpoint"), &mut child);
    signal(&child, "-USR1");
    assert_eq!(child.wait().unwrap().code(), Some(75));
    assert!(direct == merged(&dir));
    let network = |name: &str| dir.model(name).vizmapper().unwrap().clone();
    assert_eq!(network("m.pgs"), network("job/blocks/00000.pgs"));
    assert_ne!(network("m.pgs"), network("job/blocks/00001.pgs"));

    let tune = "finetune m.pgs SAMPLE -o tuned.pgs --config tiny.toml --certificate=none --force";
    let tuned = unbroken(&dir, tune);
    assert!(tuned.len() <= direct.len() && tuned.len() + 500 > direct.len(), "{} bytes", tuned.len());
    assert!(tuned == unbroken(&dir, &format!("{tune} --threads 1")));
    let model = particlegs_core::codec::decode(&tuned, "tuned.pgs").unwrap();
    let recipe = &model.metadata.recipe;
    assert!(recipe.to_string().starts_with("finetune --seed 42") && recipe.fitted().is_none());
    let ranges = model.vizmapper().unwrap().ranges;
    assert!((ranges.scale - 0.3).abs() < 1e-6 && (ranges.floor - 0.1).abs() < 1e-6);
    dir.runs("verify tuned.pgs -q");

    // By number, at the nominal precision, but never fewer than before.
    let gaussian_count = particlegs_core::codec::decode(&direct, "m.pgs").unwrap().gaussians();
    let report = dir.says(&format!("{tune} --gaussians {} -q", 2 * gaussian_count));
    assert_eq!(report["step_factor"], 1.0);
    assert!(report["gaussians"].as_u64().unwrap() <= 2 * gaussian_count as u64);
    dir.fails(&format!("{tune} --gaussians 3"), 5, &format!("the model already has {gaussian_count}"));

    snapshot(&dir.at("other"), &[vec![0.0, 1.0, 2.0], vec![0.0, 1.0, 5.0], vec![0.0, 4.0, 2.0]]);
    let to = "-o x.pgs --config tiny.toml";
    dir.fails(&format!("finetune m.pgs other {to}"), 3, "not the snapshot that m.pgs was made from");
    dir.runs("compress SAMPLE -o plain.pgs --effort fast --certificate=none -q");
    dir.fails(&format!("finetune plain.pgs SAMPLE {to}"), 2, "only alpha-blend models can be fine-tuned");
    dir.fails(&format!("finetune m.pgs SAMPLE {to} --size 5kB"), 5, "the header and the network");
}

/// The published law keeps no weights: a weighted snapshot has the same size and job.
#[test]
fn weighted_snapshots_in_blocks() {
    let dir = folder();
    let mut state = 9u32;
    let mut next = || {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) as f32 / (1u32 << 24) as f32
    };
    let mut columns: Vec<Vec<f32>> = (0..4).map(|_| (0..3000).map(|_| 10.0 * next()).collect()).collect();
    columns[3].iter_mut().for_each(|w| *w += 0.5);
    snapshot(&dir.at("weighted"), &columns);
    let options = training("alpha-blend").replace("20kB", "12kB") + " --threads 2 --force --blocks 2 --iterations 10";
    let direct = unbroken(&dir, &format!("compress weighted -o m.pgs {options}"));
    assert!(direct.len() <= 12_000, "{}", direct.len());
    dir.runs(&format!("plan weighted -o job {options} -q"));
    dir.runs("scatter job -q");
    assert!(direct == merged(&dir));
}

#[test]
fn configurations_survive_a_round_trip_and_errors_name_the_line() {
    let dir = folder();
    for which in ["all", "changed"] {
        let base = format!("compress --train best --law alpha-blend --print-config {which}");
        let [printed, _] = dir.runs(&format!("{base} --scale 0.1"));
        dir.write("again.toml", &printed);
        assert_eq!(printed, dir.runs(&format!("{base} --config again.toml"))[0]);
    }
    let cases = [
        ("bogus = 1", 3, "unknown field `bogus`"),
        ("evaluate_every = \"often\"", 3, "evaluate_every"),
        ("[cameras]\norbits = 1 2", 3, "line 2"),
        ("stages = []", 2, "at least one stage must have iterations"),
        ("evaluate_every = 0", 2, "evaluate_every"),
        ("cameras.radius = [2.0, 1.0]", 2, "cameras.radius"),
        ("cameras.held_out = 1.0", 2, "cameras.held_out"),
        ("loss.dssim = nan", 2, "loss.dssim"),
        ("law = \"alpha-blend\"", 3, "trains with optical-depth"),
    ];
    for (text, code, message) in cases {
        dir.write("tiny.toml", text);
        dir.fails(&trained("optical-depth", "m.pgs"), code, message);
    }
    std::fs::remove_file(dir.at("tiny.toml")).unwrap();
    dir.fails(&trained("optical-depth", "m.pgs"), 6, "tiny.toml");
}

#[test]
fn contradictions_are_refused_before_the_work() {
    let dir = folder();
    let plain = "compress SAMPLE -o m.pgs";
    for option in ["--resume", "--minutes 3", "--log l.jsonl", "--scale 0.5"] {
        dir.fails(&format!("{plain} {option}"), 2, "--train fast|best|paper");
    }
    dir.fails(&format!("{plain} --law alpha-blend"), 2, "--train");
    let trained = |more: &str| format!("{plain} --train fast --config tiny.toml --effort fast {more}");
    for (more, code, text) in [
        ("--minutes 0", 2, "the minutes of a run must be positive"),
        ("--scale 2", 2, "--scale"),
        ("--iterations 0", 2, "--iterations"),
        ("--law alpha-blend --size 5kB", 5, "the header and the network"),
        ("--log nowhere/l.jsonl", 6, "nowhere/l.jsonl"),
        ("--memory 1GB --scratch nowhere", 6, "nowhere"),
    ] {
        dir.fails(&trained(more), code, text);
    }
    snapshot(&dir.at("two"), &[vec![0.0, 1.0, 2.0, 3.0], vec![1.0; 4], vec![2.0; 4], vec![1.0, 1.0, 8.0, 8.0]]);
    let layers = "compress two -o m.pgs --layers mass --train fast --law alpha-blend --config tiny.toml";
    dir.fails(layers, 2, "the alpha-blend law supports one layer");
    // A log that cannot be written to costs no model.
    let [_, notes] = dir.runs(&trained("--log /dev/full --certificate=none --iterations 60"));
    assert!(notes.contains("nothing more is logged"), "{notes}");
    // A folder in place of the checkpoint is an error.
    std::fs::create_dir(dir.at("m.pgs.checkpoint")).unwrap();
    dir.fails(&trained("--certificate=none"), 8, "m.pgs.checkpoint");
}
