//! Outputs that change while a command runs: neither the changes nor the results are lost.
#![cfg(target_os = "linux")]

use crate::common::{TestFolder, contents, listing, pipe, process, said, snapshot, waited};
use std::collections::BTreeMap;
use std::ffi::OsString;
use std::io::Write;
use std::os::unix::fs::OpenOptionsExt;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

const O_NONBLOCK: i32 = 0o4000;

/// A command that reads PIPE and writes OUT, with files before and changes during the run.
struct ReadCase {
    words: &'static str,
    /// Name of OUT, and the input whose bytes come through PIPE.
    files: [&'static str; 2],
    /// Files and folders (they end in `/`) below OUT's folder, before and meanwhile: `from > to`.
    before: &'static str,
    meanwhile: &'static str,
    /// Outputs that the command makes nevertheless.
    beside: &'static str,
}

const fn case(
    words: &'static str,
    files: [&'static str; 2],
    [before, meanwhile, beside]: [&'static str; 3],
) -> ReadCase {
    ReadCase { words, files, before, meanwhile, beside }
}

const COMPRESS: &str = "compress PIPE -o OUT --certificate none --effort fast --gaussians 4 -q";

const CASES: &[ReadCase] = &[
    case("recover PIPE -o OUT --force", ["out", "m.pgs"], ["snap > out", "notes > out/notes", ""]),
    case("recover PIPE -o OUT --force", ["out", "m.pgs"], ["snap > out", "notes > out/xx.f32", ""]),
    case("recover PIPE -o OUT --force", ["out", "m.pgs"], ["snap > out", "snap > out/sub", ""]),
    case("recover PIPE -o OUT", ["out", "m.pgs"], ["", "snap > out", ""]),
    case("convert PIPE -o OUT --force", ["out", "a.npy"], ["snap > out", "notes > out/notes", ""]),
    case(COMPRESS, ["m.pgs", "a.npy"], ["", "n.pgs > m.pgs", "m-1.pgs"]),
    case(COMPRESS, ["m.pgs", "a.npy"], ["", "notes > m.pgs", "m-1.pgs"]),
    case(
        "compress PIPE -o OUT --certificate none --effort fast --gaussians 4 --force",
        ["m.pgs", "a.npy"],
        ["m.pgs > m.pgs", "n.pgs > m.pgs", "m-1.pgs"],
    ),
    case("simplify PIPE -o OUT --gaussians 3", ["s.pgs", "m.pgs"], ["", "n.pgs > s.pgs", "s-1.pgs"]),
    case("export PIPE -o OUT", ["s.ply", "m.pgs"], ["", "notes > s.ply", "s-1.ply"]),
    case("export PIPE -o OUT --grid 8", ["d.npy", "m.pgs"], ["", "b.npy > d.npy", ""]),
    case("render PIPE --out OUT --size 64x48", ["views", "m.pgs"], ["snap > views", "notes > views/view.png", ""]),
    case("stats SNAP PIPE -o OUT --only moments --no-plots", ["s", "m.pgs"], ["snap > s", "notes > s/stats.json", ""]),
    case("info PIPE --json OUT", ["i.json", "m.pgs"], ["", "notes > i.json", "i-1.json"]),
    case("verify OUT PIPE --store --format npy", ["m.pgs", "a.npy"], ["m.pgs > m.pgs", "n.pgs > m.pgs", "m-1.pgs"]),
];

/// Files that commands read, and the binary.
struct PipeFiles(TestFolder);

impl PipeFiles {
    fn new() -> PipeFiles {
        let dir = TestFolder::new();
        let columns = |seed: u32| -> Vec<Vec<f32>> {
            let number = |i: u32, k: u32| (i * (37 + 14 * k) + seed) % 16_001;
            (0..3).map(|k| (0..16_000).map(|i| number(i, k) as f32 * 0.001).collect()).collect()
        };
        snapshot(&dir.at("snap"), &columns(1));
        snapshot(&dir.at("other"), &columns(5));
        dir.write("notes", "my notes");
        for words in [
            "convert snap -o a.npy -q",
            "convert other -o b.npy -q",
            "compress a.npy -o m.pgs --certificate none --effort fast --gaussians 8 -q",
            "compress b.npy -o n.pgs --certificate none --effort fast --gaussians 5 -q",
        ] {
            dir.once(words);
        }
        PipeFiles(dir)
    }

    fn command(&self, folder: &Path) -> Command {
        let mut c = process(folder);
        c.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::piped());
        c
    }

    /// Copies `from > to` into a folder, over what is there.
    fn put(&self, change: &str, folder: &Path) {
        if let Some((from, to)) = change.split_once(" > ") {
            let status = Command::new("cp").arg("-r").arg(self.0.at(from)).arg(folder.join(to)).status();
            assert!(status.unwrap().success(), "{change}");
        }
    }

    /// Runs the command of a case, and applies the change while it reads.
    fn run(&self, case: &ReadCase, folder: &Path, change: impl FnOnce()) -> Output {
        let [out, input] = case.files;
        let fifo = folder.join("pipe");
        pipe(&fifo);
        let words = case.words.split(' ').map(|w| match w {
            "PIPE" => "pipe".into(),
            "OUT" => out.into(),
            "SNAP" => self.0.at("snap").into_os_string(),
            other => OsString::from(other),
        });
        let mut child = self.command(folder).args(words).spawn().unwrap();
        let bytes = self.0.bytes(input);
        // With a limit, since a failed command reads nothing.
        let open = || std::fs::File::options().write(true).custom_flags(O_NONBLOCK).open(&fifo);
        let mut to = open();
        waited("a reader of the pipe", || {
            to = open();
            to.is_ok() || child.try_wait().unwrap().is_some()
        });
        let Ok(to) = to else { panic!("{}: {:?}", case.words, child.wait_with_output()) };
        // By then all outputs have been checked: before a model, and after the first 64 KiB of particles.
        let (first, last) = bytes.split_at(bytes.len() - 1);
        write(&to, first);
        std::thread::sleep(std::time::Duration::from_millis(200));
        change();
        write(&to, last);
        drop(to);
        let out = child.wait_with_output().unwrap();
        std::fs::remove_file(&fifo).unwrap();
        out
    }
}

/// Writes everything to a slow reader.
fn write(mut to: &std::fs::File, mut bytes: &[u8]) {
    waited("a pipe to be read", || match to.write(bytes) {
        Err(e) => e.kind() != std::io::ErrorKind::WouldBlock,
        Ok(n) => {
            bytes = &bytes[n..];
            bytes.is_empty()
        }
    });
}

#[test]
fn files_that_change_while_a_command_runs_are_not_lost() {
    let w = PipeFiles::new();
    let check = |case: &ReadCase| {
        let folder = tempfile::tempdir().unwrap();
        let label = format!("{} ({})", case.words, case.meanwhile);
        w.put(case.before, folder.path());
        let mut old_files = BTreeMap::new();
        let out = w.run(case, folder.path(), || {
            w.put(case.meanwhile, folder.path());
            old_files = contents(folder.path());
        });
        let err = said(&out);
        assert_eq!(out.status.code(), Some(8), "{label}: {err}");
        let now = contents(folder.path());
        old_files.iter().for_each(|(path, bytes)| assert!(now.get(path) == Some(bytes), "{label}: {}", path.display()));
        let new_files: Vec<&PathBuf> = now.keys().filter(|path| !old_files.contains_key(*path)).collect();
        assert_eq!(new_files.is_empty(), case.beside.is_empty(), "{label}: {new_files:?} {err}");
        let beside = folder.path().join(case.beside);
        assert!(new_files.iter().all(|path| path.starts_with(&beside)), "{label}: {new_files:?}");
        assert!(listing(folder.path()).iter().all(|n| !n.starts_with(".particlegs")), "{label}");
    };
    std::thread::scope(|s| {
        let all: Vec<_> = CASES.iter().map(|case| s.spawn(|| check(case))).collect();
        all.into_iter().for_each(|thread| thread.join().unwrap());
    });
}

#[test]
fn of_two_compressions_to_one_name_one_fails_unless_they_are_the_same() {
    let w = PipeFiles::new();
    for (other, code) in [("b.npy", 8), ("a.npy", 0)] {
        let folder = tempfile::tempdir().unwrap();
        let case = case(COMPRESS, ["m.pgs", "a.npy"], [""; 3]);
        let out = w.run(&case, folder.path(), || {
            // The source's name is in the file.
            std::fs::create_dir(folder.path().join("in")).unwrap();
            std::fs::copy(w.0.at(other), folder.path().join("in/pipe")).unwrap();
            let words = COMPRESS.replace("PIPE", "in/pipe").replace("OUT", "m.pgs");
            assert!(w.command(folder.path()).args(words.split(' ')).status().unwrap().success());
        });
        assert_eq!(out.status.code(), Some(code), "{other}: {}", said(&out));
        assert_eq!(folder.path().join("m-1.pgs").exists(), code == 8);
    }
}

/// Folders are filled under another name, so that another file can appear meanwhile.
#[test]
fn a_folder_with_new_files_is_not_replaced() {
    let w = PipeFiles::new();
    for (words, change) in [
        ("convert SNAP -o out --force --tile 6,6,6", "notes > out/notes"),
        ("recover MODEL -o out --force --particles 3000000", "notes > out/xx.f32"),
    ] {
        let folder = tempfile::tempdir().unwrap();
        std::fs::create_dir(folder.path().join("here")).unwrap();
        let (here, out) = (folder.path().join("here"), folder.path().join("here/out"));
        w.put("other > out", &here);
        let words = words.replace("SNAP", w.0.at("snap").to_str().unwrap());
        let words = words.replace("MODEL", w.0.at("m.pgs").to_str().unwrap());
        w.0.write("snap/meta.json", "{\"box\": [17, 17, 17]}");
        let child = w.command(&here).args(words.split(' ')).spawn().unwrap();
        waited("files beside the folder", || listing(&here).len() == 2);
        w.put(change, &here);
        let contents_before = contents(&out);
        let output = child.wait_with_output().unwrap();
        let err = said(&output);
        assert_eq!(output.status.code(), Some(8), "{words}: {err}");
        assert!(err.contains("while this command ran") && err.contains("out-1"), "{words}: {err}");
        assert_eq!(contents(&out), contents_before, "{words}");
        assert_eq!(listing(&here), ["out", "out-1"]);
        assert!(out.with_file_name("out-1").join("xx.f32").metadata().unwrap().len() > 10_000_000, "{words}");
    }
}
