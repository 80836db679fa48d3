//! Inputs that are pipes, devices, broken links, of the wrong kind, or with malicious names: each gives one clear line,
//! without hanging or taking memory.
#![cfg(unix)]

use crate::common::{TestFolder, errors, fails, fixture, pipe, process, said, snapshot, success, words};
use serde_json::Value;
use std::ffi::OsStr;
use std::io::Write;
use std::os::unix::ffi::OsStrExt;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// The binary, to run in the background.
fn started(folder: &Path, text: &str) -> Command {
    let mut command = process(folder);
    command.args(words(text)).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// A few particles and a model of them, in a new folder.
fn small() -> TestFolder {
    let dir = TestFolder::new();
    let column = |k: u32| (0..64u32).map(|i| (i * (k + 7) % 61) as f32).collect::<Vec<f32>>();
    snapshot(&dir.at("in"), &[column(0), column(3), column(5)]);
    dir.runs("compress in -o m.pgs --gaussians 4 --certificate=none -q");
    dir
}

/// The commands that read a model, a views file, a configuration or a snapshot at `NAME`.
const READERS: [&str; 10] = [
    "info NAME",
    "render NAME --out pictures",
    "simplify NAME -o s.pgs --gaussians 2",
    "verify NAME",
    "recover NAME -o drawn",
    "convert NAME -o copy",
    "merge NAME m.pgs -o both.pgs",
    "eval NAME in",
    "render m.pgs --views NAME --out pictures",
    "compress in -o n.pgs --train fast --config NAME",
];

#[test]
fn endless_devices_are_left_after_their_first_bytes() {
    let dir = small();
    for reader in READERS {
        let arguments = reader.replace("NAME", "/dev/zero");
        // With a few gigabytes of address space, unbounded reading would end by a signal.
        let mut c = Command::new("timeout");
        c.current_dir(dir.path()).args(["20", "bash", "-c", "ulimit -v 4000000; exec \"$0\" \"$@\""]);
        let out = c.arg(env!("CARGO_BIN_EXE_particlegs")).args(arguments.split(' ')).output().unwrap();
        let text = said(&out);
        assert!(matches!(out.status.code(), Some(3 | 4)), "{arguments:?}: {:?} {text}", out.status);
        assert_eq!(errors(&text), 1, "{arguments:?}: {text}");
    }
    for name in ["n.pgs", "s.pgs", "both.pgs", "drawn", "copy"] {
        assert!(!dir.at(name).exists(), "{name}");
    }
}

#[test]
fn waiting_for_a_pipe_is_reported_and_can_be_interrupted() {
    let dir = small();
    pipe(&dir.at("pipe"));
    let logs = tempfile::tempdir().unwrap();
    let start = |(i, reader): (usize, &&str)| {
        let arguments = reader.replace("NAME", "pipe");
        let log = logs.path().join(i.to_string());
        let child = started(dir.path(), &arguments).stderr(std::fs::File::create(&log).unwrap()).spawn().unwrap();
        (arguments, log, child)
    };
    // All wait in parallel; each must say so before it is stopped.
    for (arguments, log, mut child) in READERS.iter().enumerate().map(start).collect::<Vec<_>>() {
        let within = |done: &mut dyn FnMut() -> bool| {
            (0..600).any(|_| {
                std::thread::sleep(Duration::from_millis(100));
                done()
            })
        };
        let says = || std::fs::read_to_string(&log).unwrap().contains("waiting for data from pipe");
        let is_waiting = within(&mut || says());
        let alive = child.try_wait().unwrap().is_none();
        assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
        let ended = within(&mut || child.try_wait().unwrap().is_some());
        let _ = child.kill();
        assert!(is_waiting && alive, "{arguments:?} does not wait: {}", std::fs::read_to_string(&log).unwrap());
        assert!(ended, "{arguments:?} goes on waiting after SIGTERM");
    }
}

#[test]
fn pipes_and_standard_input_are_read() {
    let dir = small();
    let output_of = |arguments: &str, file: &Path| {
        let bytes = std::fs::read(file).unwrap();
        let mut child = started(dir.path(), arguments).stdin(Stdio::piped()).spawn().unwrap();
        let mut to = child.stdin.take().unwrap();
        let writer = std::thread::spawn(move || to.write_all(&bytes));
        let out = child.wait_with_output().unwrap();
        writer.join().unwrap().unwrap();
        assert!(out.status.success(), "{arguments:?}: {}", said(&out));
        String::from_utf8(out.stdout).unwrap()
    };
    let model = dir.at("m.pgs");
    for name in ["-", "/dev/stdin"] {
        assert_eq!(output_of(&format!("verify {name}"), &model).matches("64 particles").count(), 1);
        assert!(output_of(&format!("info {name}"), &model).contains("image law optical-depth"));
    }
    for name in ["species.hdf5", "header.csv.gz", "plain.xyz", "two_frames.dump.gz"] {
        let text = output_of("info -", &fixture(name));
        let [file_text, _] = dir.runs(&format!("info FIXTURES/{name}"));
        let rest = |t: &str| t.lines().filter(|l| !l.starts_with("files")).collect::<Vec<_>>().join("\n");
        assert_eq!(rest(&text), rest(&file_text), "{name}");
        assert!(text.contains("files              -"), "{text}");
        output_of("compress - -o piped.pgs --gaussians 2 --certificate=none --force", &fixture(name));
    }
    // Errors in the data name the file as the user did.
    let mut child = started(dir.path(), "compress - -o x.pgs").stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(b"\x01\x02\x03").unwrap();
    let text = String::from_utf8(child.wait_with_output().unwrap().stderr).unwrap();
    assert!(text.starts_with("error: standard input: the file format is unknown"), "{text}");
}

#[test]
fn the_wrong_kind_of_input_names_the_right_command() {
    let dir = small();
    std::fs::copy(fixture("species.hdf5"), dir.at("snap.hdf5")).unwrap();
    dir.write("picture.png", b"\x89PNG\r\n\x1a\n");
    std::fs::create_dir(dir.at("empty")).unwrap();
    dir.runs("plan in -o job --blocks 2 --gaussians 4 -q");
    let refused = |words: &str| {
        let out = dir.command(words).output().unwrap();
        assert_eq!(out.status.code(), Some(3), "{words}: {}", said(&out));
        said(&out)
    };
    for (name, description, command) in [
        ("snap.hdf5", "a snapshot (HDF5", "`particlegs compress`"),
        ("in", "a snapshot (raw", "`particlegs compress`"),
        ("job", "a job folder", "`particlegs merge`"),
        ("job/runs.bin", "a file of a job", "`particlegs merge`"),
        ("picture.png", "a picture (PNG)", "name a model file"),
        ("empty", "a folder", "name a model file"),
    ] {
        let text = refused(&format!("render {name} --out pictures"));
        assert!(text.contains(&format!("{name}: {description}")) && text.contains("not a model file"), "{text}");
        assert!(text.contains(command), "{text}");
    }
    for (name, description, command) in [
        ("m.pgs", "a model file, not a snapshot", "`particlegs recover`"),
        ("job", "a job folder, not a snapshot", "`particlegs merge`"),
        ("picture.png", "a picture (PNG), not a snapshot", "name a snapshot"),
    ] {
        let text = refused(&format!("compress {name} -o n.pgs"));
        assert!(text.contains(&format!("{name}: {description}")) && text.contains(command), "{text}");
    }
    assert!(!dir.at("n.pgs").exists() && !dir.at("pictures").exists());
}

#[test]
fn a_bound_on_memory_is_not_the_machine() {
    let dir = small();
    let out = dir.command("compress in -o n.pgs --memory 100MiB").output().unwrap();
    let text = said(&out);
    assert_eq!(out.status.code(), Some(7), "{text}");
    assert!(text.contains("are allowed") && text.contains("`--memory`") && !text.contains("machine"), "{text}");
}

#[test]
fn foreign_text_does_not_reach_the_terminal_raw() {
    let dir = small();
    let name = "Evil\u{1b}]0;title\u{7}\u{9b}2J\u{202e}\nrow";
    let meta = serde_json::json!({ "length_unit": name, "layers": [{ "name": name, "particles": 64 }] });
    dir.write("in/meta.json", meta.to_string());
    let views = serde_json::json!({ "width": 8, "height": 8, "fov_deg": 30.0, "views": [{ "name": name }] });
    dir.write("views.json", views.to_string());
    let escaped = "Evil\\u{1b}]0;title\\u{7}\\u{9b}2J\\u{202e}";
    for (arguments, shown) in [
        (&["info", "in"][..], true),
        (&["compress", "in", "-o", "e.pgs", "--gaussians", "2", "--certificate=none"], false),
        (&["info", "e.pgs"], true),
        (&["render", "e.pgs", "--layer", name, "--size", "16x16", "--out", "x"], false),
        (&["render", "e.pgs", "--layer", "none", "--out", "x"], true),
        (&["info", name], false),
        (&["block", "in", &format!("env:{name}")], false),
        (&["info", "in", "--json", "-"], false),
        (&["render", "e.pgs", "--views", "views.json", "--out", "x"], false),
    ] {
        let out = dir.command("").args(arguments).output().unwrap();
        let text = String::from_utf8([out.stdout, out.stderr].concat()).unwrap();
        assert!(!text.contains(|c: char| c != '\n' && (c.is_control() || c == '\u{202e}')), "{arguments:?}: {text:?}");
        assert!(!shown || text.contains(escaped), "{arguments:?}: {text}");
        // No table row is wrapped.
        assert!(!text.lines().any(|l| l.starts_with("row")), "{arguments:?}: {text}");
    }
}

#[test]
fn paths_need_not_be_utf8() {
    let dir = small();
    let odd = |name: &[u8]| dir.path().join(OsStr::from_bytes(name));
    let (snapshot, model, folder) = (odd(b"in\xff"), odd(b"m\xfe.pgs"), odd(b"out\xfd"));
    std::fs::rename(dir.at("in"), &snapshot).unwrap();
    let run = |arguments: &[&dyn AsRef<OsStr>]| -> Value {
        let mut c = dir.command("");
        let [out, text] = success(c.args(arguments.iter().map(|a| a.as_ref())).args(["--json", "-"]));
        assert!(!text.contains("panicked"), "{text}");
        serde_json::from_str(&out).unwrap()
    };
    let report = run(&[&"compress", &snapshot, &"-o", &model, &"--gaussians", &"4", &"--certificate=none"]);
    assert!(report["output"].as_str().unwrap().contains('\u{fffd}'));
    // The same again also reports.
    run(&[&"compress", &snapshot, &"-o", &model, &"--gaussians", &"4", &"--certificate=none"]);
    run(&[&"info", &snapshot]);
    run(&[&"info", &model]);
    run(&[&"render", &model, &"--size", &"16x16", &"--out", &folder]);
    run(&[&"simplify", &model, &"-o", &odd(b"s\xff.pgs"), &"--gaussians", &"2"]);
    run(&[&"recover", &model, &"-o", &odd(b"drawn\xff")]);
    run(&[&"recover", &model, &"-o", &odd(b"drawn\xff")]);
    run(&[&"convert", &snapshot, &"-o", &odd(b"copy\xff.hdf5")]);
    run(&[&"merge", &model, &"-o", &odd(b"merged\xff.pgs")]);
    // A job's manifest is JSON, so such a path is refused at once.
    fails(dir.command("plan -o job").arg(&snapshot), 2, "UTF-8");
    assert!(!dir.at("job").exists());
}

#[test]
fn stated_units_are_compared_with_what_files_say() {
    let dir = small();
    dir.write("in/meta.json", r#"{"length_unit": "Angstrom", "box": 70}"#);
    let outputs_with = |more: &str| {
        // Each run makes another model.
        let _ = std::fs::remove_file(dir.at("u.pgs"));
        ["info in", "compress in -o u.pgs --gaussians 2 --certificate=none"]
            .map(|words| dir.runs(&format!("{words} {more}")).concat())
    };
    let nm = "the unit of length is nm as stated, not Angstrom";
    assert!(outputs_with("--length-unit nm").iter().all(|t| t.contains(nm)));
    assert!(outputs_with("--length-unit Angstrom").iter().all(|t| !t.contains("as stated")));
    assert!(outputs_with("--length-unit parsecs-ish").iter().all(|t| t.contains("is not a known unit of length")));
    assert!(outputs_with("--mass-unit Msun/h").iter().all(|t| !t.contains("known")));
    assert!(outputs_with("--box 80").iter().all(|t| t.contains("the box is 80 x 80 x 80")));
}

#[test]
fn a_file_truncated_while_read_gives_one_line() {
    let dir = TestFolder::new();
    let n = 3_000_000;
    let column = |k: u64| (0..n).map(|i| (i * (7 + k) % 99_991) as f32).collect::<Vec<f32>>();
    snapshot(&dir.at("in"), &[column(0), column(3), column(5)]);
    let files = ["xx.f32", "yy.f32", "zz.f32"].map(|f| dir.at("in").join(f));
    let before = dir.listing();
    let compress = "compress in -o m.pgs --ratio 50 --certificate=none --threads 1";
    let mut child = started(dir.path(), compress).spawn().unwrap();
    // Truncate it as soon as the columns are mapped.
    let maps = format!("/proc/{}/maps", child.id());
    let mapped = (0..2000).any(|_| {
        std::thread::sleep(Duration::from_millis(2));
        std::fs::read_to_string(&maps).is_ok_and(|m| m.contains("zz.f32"))
    });
    if mapped {
        files.iter().for_each(|f| std::fs::File::options().write(true).open(f).unwrap().set_len(4).unwrap());
    } else {
        child.kill().unwrap();
    }
    let out = child.wait_with_output().unwrap();
    let text = said(&out);
    assert!(mapped, "the columns were not mapped: {text}");
    assert_eq!(out.status.code(), Some(6), "{:?}: {text}", out.status);
    assert_eq!(text.lines().filter(|l| l.starts_with("error: a file ended while being read")).count(), 1, "{text}");
    assert_eq!(dir.listing(), before);
}
