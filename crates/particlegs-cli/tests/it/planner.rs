//! `compress` and jobs share a planner: the same snapshot gives the same exit code, notes and bytes.

use crate::common::{TestFolder, fixture, particlegs, said, words};
use std::ffi::OsString;
use std::fmt::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Outcome of making a model.
#[derive(Debug, Default, PartialEq)]
struct Outcome {
    code: i32,
    /// Lines of standard error, each once.
    told: Vec<String>,
    bytes: Option<Vec<u8>>,
}

impl Outcome {
    /// Runs a command; returns whether it succeeded.
    fn run(&mut self, words: &[OsString]) -> bool {
        let out = particlegs().args(words).output().unwrap();
        let text = said(&out);
        assert!(!text.contains("panicked"), "{text}");
        let is_notice = |line: &&str| ["note:", "warning:", "error:"].iter().any(|word| line.starts_with(word));
        for line in text.lines().filter(is_notice) {
            if !self.told.iter().any(|known| known == line) {
                self.told.push(line.into());
            }
        }
        self.code = out.status.code().unwrap();
        self.code == 0
    }

    fn of_compress(input: &Path, folder: &Path) -> Self {
        let (mut outcome, model) = (Outcome::default(), folder.join("compressed.pgs"));
        if outcome.run(&[with("compress", input), with("-o", &model), words(PLAN)].concat()) {
            outcome.bytes = Some(std::fs::read(&model).unwrap());
        }
        outcome
    }

    fn of_job(input: &Path, folder: &Path) -> Self {
        let (mut outcome, job, model) = (Outcome::default(), folder.join("job"), folder.join("merged.pgs"));
        let block = |number: &str| [with("block", &job), words(number)].concat();
        if outcome.run(&[with("plan", input), with("-o", &job), words(PLAN)].concat())
            && outcome.run(&block("0"))
            && outcome.run(&block("1"))
            && outcome.run(&[with("merge", &job), with("-o", &model), words("--force")].concat())
        {
            outcome.bytes = Some(std::fs::read(&model).unwrap());
        }
        outcome
    }
}

const PLAN: &str = "--blocks 2 --gaussians 20 --certificate none --force";

fn with(word: &str, path: &Path) -> Vec<OsString> {
    vec![word.into(), path.into()]
}
/// A LAMMPS dump of 300 particles in a box of 10, tilted by `tilt`, of which the first `out` lie `by` further along x.
fn dump(path: &Path, tilt: f64, out: usize, by: f64) {
    let mut text = format!(
        "ITEM: TIMESTEP\n0\nITEM: NUMBER OF ATOMS\n300\nITEM: BOX BOUNDS xy xz yz pp pp pp\n0 {} {tilt}\n0 10 0\n0 10 0\n\
         ITEM: ATOMS id type x y z\n",
        10.0 + tilt
    );
    for i in 0..300 {
        let at = |step: usize| (i * step % 297) as f64 / 30.0;
        let y = at(11);
        let x = at(7) + tilt * y / 10.0 + if i < out { by } else { 0.0 };
        writeln!(text, "{} 1 {x} {y} {}", i + 1, at(13)).unwrap();
    }
    std::fs::write(path, text).unwrap();
}

#[test]
fn compress_and_a_job_agree_on_every_fixture() {
    let dir = TestFolder::new();
    // Errors of a job name files by their real paths.
    let at = |name: &str| dir.path().canonicalize().unwrap().join(name);
    let entries = std::fs::read_dir(fixture("").canonicalize().unwrap()).unwrap();
    let mut inputs: Vec<PathBuf> = entries.map(|e| e.unwrap().path()).collect();
    inputs.sort();
    let good = inputs.len();
    for whole in inputs.clone().iter().step_by(3) {
        let bytes = std::fs::read(whole).unwrap();
        let cut = at(&format!("cut-{}", whole.file_name().unwrap().to_string_lossy()));
        std::fs::write(&cut, &bytes[..bytes.len() * 3 / 5]).unwrap();
        inputs.push(cut);
    }
    for (name, tilt, out, by) in
        [("tilted-far", 5.0, 5, 40.0), ("tilted-out", 5.0, 5, 12.0), ("far", 0.0, 5, 40.0), ("out", 0.0, 5, 12.0)]
    {
        let path = at(&format!("{name}.lammpstrj"));
        dump(&path, tilt, out, by);
        inputs.push(path);
    }
    let (left, outcomes) = (Mutex::new(inputs.into_iter()), Mutex::new(Vec::new()));
    std::thread::scope(|scope| {
        for thread in 0..2 {
            let folder = at(&format!("{thread}"));
            std::fs::create_dir(&folder).unwrap();
            let (left, outcomes) = (&left, &outcomes);
            scope.spawn(move || {
                while let Some(input) = { left.lock().unwrap().next() } {
                    let ways = [Outcome::of_compress(&input, &folder), Outcome::of_job(&input, &folder)];
                    outcomes.lock().unwrap().push((input, ways));
                }
            });
        }
    });
    let outcomes = outcomes.into_inner().unwrap();
    for (input, [compress, job]) in &outcomes {
        assert_eq!(compress, job, "{}", input.display());
    }
    let outcome_of = |name: &str| &outcomes.iter().find(|o| o.0.ends_with(name)).unwrap().1[0];
    let tells = |name: &str, text: &str| outcome_of(name).told.iter().any(|line| line.contains(text));
    assert!(
        tells("tilted-far.lammpstrj", "5 of 300 particles are more than a box length")
            && tells("far.lammpstrj", "more than a box length outside")
    );
    assert!(tells("tilted-out.lammpstrj", "are outside the periodic box") && tells("out.lammpstrj", "5 of 300"));
    assert!(tells("3n_f4.npy", "no periodic box"));
    assert_eq!([outcome_of("tilted-far.lammpstrj").code, outcome_of("tilted-out.lammpstrj").code], [3, 0]);
    let model_count = outcomes.iter().filter(|o| o.1[0].bytes.is_some()).count();
    assert!(model_count > good / 2 && model_count < outcomes.len(), "{model_count} models of {} files", outcomes.len());
}
