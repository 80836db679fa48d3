//! The log of a training run, line by line, and its curves.

use crate::common::Context;
use crate::plots::{self, Curve, Figure};
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use serde_json::Value;
use std::fs::File;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// A caller's progress whose log lines go to a file.
struct Logged<'a> {
    context: &'a Context,
    path: PathBuf,
    file: Mutex<Option<File>>,
}

impl Progress for Logged<'_> {
    fn begin(&self, phase: &str, total: u64) {
        self.context.begin(phase, total);
    }

    fn advance(&self, steps: u64) {
        self.context.advance(steps);
    }

    fn end(&self) {
        self.context.end();
    }

    fn message(&self, text: &str) {
        self.context.message(text);
    }

    fn log(&self, line: &str) {
        let mut file = self.file.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(Err(error)) = file.as_mut().map(|f| writeln!(f, "{line}")) {
            self.context.message(&format!("warning: {}: {error}; the log ends here", self.path.display()));
            *file = None;
        }
    }

    fn cancelled(&self) -> bool {
        self.context.cancelled()
    }
}

/// Does work whose log lines are appended to `path`, then draws their curves beside it.
pub fn logged<T>(path: &Path, context: &Context, work: impl FnOnce(&dyn Progress) -> Result<T>) -> Result<T> {
    let file = File::options().create(true).append(true).open(path).map_err(|e| Error::io(path, e))?;
    let logged = Logged { context, path: path.to_path_buf(), file: Mutex::new(Some(file)) };
    let done = work(&logged);
    draw(path)?;
    done
}

/// The curves of a log: NAME-loss and NAME-psnr, SVG and PNG.
fn draw(path: &Path) -> Result<()> {
    let text = std::fs::read_to_string(path).map_err(|e| Error::io(path, e))?;
    let lines = in_order(&text);
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    let stem = path.file_stem().map_or_else(|| "training".into(), |s| s.to_string_lossy().into_owned());
    let curve = |key: &str, name| {
        let point = |l: &Value| Some((l["iteration"].as_f64()?, l[key].as_f64()?));
        Curve { name, side: 1, dots: false, points: lines.iter().filter_map(point).collect() }
    };
    let figure = |name: &str, title: &str, y: &str, curve: Curve| {
        let name = format!("{stem}-{name}");
        let figure = Figure {
            name: &name,
            title: title.into(),
            x: "step".into(),
            y: y.into(),
            log_x: false,
            log_y: false,
            curves: vec![curve],
            ratio: Vec::new(),
            levels: Vec::new(),
        };
        plots::write(folder, &figure)
    };
    figure("loss", "Training loss", "loss, mean of 50 steps", curve("loss", "training"))?;
    let scores = curve("held_out_masked_psnr", "held out");
    figure("psnr", "Held-out views", "masked PSNR, dB", scores)
}

/// The lines of a log; those that a resumed run went over again count once, the last time.
fn in_order(text: &str) -> Vec<Value> {
    let mut kept: Vec<Value> = Vec::new();
    for line in text.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()) {
        let at = |l: &Value| l["iteration"].as_u64().unwrap_or(0);
        while kept.last().is_some_and(|last| at(last) > at(&line)) {
            kept.pop();
        }
        kept.push(line);
    }
    kept
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_run_replaces_what_it_does_again() {
        let text = "{\"iteration\":1}\n{\"iteration\":2}\nbroken\n{\"iteration\":3}\n{\"iteration\":2}\n";
        let steps: Vec<u64> = in_order(text).iter().map(|l| l["iteration"].as_u64().unwrap()).collect();
        assert_eq!(steps, [1, 2, 2]);
    }
}
