//! Writes the log of a training run and its curves.

use crate::{Context, ProgressEvent, ProgressSink, Result};
use particlegs_figure::{FileKind, Plot, PlotAxis, PlotSeries, Point, write_plots};
use particlegs_files::input::{Begins, Form, read_own};
use particlegs_files::output;
use particlegs_files::output::FileSet;
use serde_json::Value;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Mutex;

/// Enough for years of training, with one line every fifty steps.
const FILE: Form = Form { title: "a log of training", begins: Begins::Text, most: 1 << 28, expansion: 16 };

/// A sink that writes log lines to a file.
struct LoggedProgress<'a> {
    context: &'a Context<'a>,
    path: PathBuf,
    file: Mutex<Option<Box<dyn Write + Send>>>,
}

impl ProgressSink for LoggedProgress<'_> {
    fn event(&self, event: ProgressEvent<'_>) {
        let ProgressEvent::Log(line) = event else { return self.context.sink().event(event) };
        let mut file = self.file.lock().unwrap_or_else(|e| e.into_inner());
        if let Some(Err(error)) = file.as_mut().map(|f| writeln!(f, "{line}")) {
            self.context.warn(&format!("{}: {error}; nothing more is logged", self.path.display()));
            // One warning is enough; the training goes on without its log.
            *file = None;
        }
    }

    fn message(&self, text: &str) {
        self.context.message(text);
    }
}

/// Does work with a log at `path`, then draws its curves. A resumed run appends.
pub fn logged<T>(
    path: &Path,
    append: bool,
    context: &Context<'_>,
    work: impl FnOnce(&Context<'_>) -> Result<T>,
) -> Result<T> {
    let file = output::open_log(path, append)?;
    let logged = LoggedProgress { context, path: path.to_path_buf(), file: Mutex::new(Some(file)) };
    let done = work(&context.with_sink(&logged));
    let whole = logged.file.into_inner().unwrap_or_else(|e| e.into_inner()).is_some();
    // Failing curves must not lose the run.
    if whole
        && !output::is_stream(path)?
        && let Err(error) = draw(path)
    {
        context.warn(&format!("the curves of {} could not be drawn: {error}", path.display()));
    }
    done
}

const CURVES: [&str; 2] = ["loss", "psnr"];
const KINDS: [FileKind; 2] = [FileKind::Svg, FileKind::Png];

/// Paths of the curves of a log; none if it is a stream.
pub fn curves(path: &Path) -> Result<Vec<PathBuf>> {
    if output::is_stream(path)? {
        return Ok(Vec::new());
    }
    let place = |name, kind: FileKind| folder_of(path).join(format!("{}-{name}.{}", stem(path), kind.name()));
    Ok(CURVES.iter().flat_map(|name| KINDS.map(|kind| place(name, kind))).collect())
}

fn folder_of(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn stem(path: &Path) -> String {
    path.file_stem().map_or_else(|| "training".into(), |s| s.to_string_lossy().into_owned())
}

/// Draws the curves of a log: NAME-loss and NAME-psnr, as SVG and PNG, for all its runs in order.
fn draw(path: &Path) -> Result<()> {
    let text = read_own(path, FILE)?.unwrap_or_default();
    let text = String::from_utf8_lossy(&text);
    let runs = by_run(&text);
    let (set, stem) = (FileSet::in_folder(folder_of(path))?, stem(path));
    let figure = |key: &str, name: &str, title: &str, y: &str, curve: &str| {
        let point = |l: &Value| Some(Point::new(l["iteration"].as_f64()?, l[key].as_f64()?));
        let points = |lines: &Vec<Value>| lines.iter().filter_map(point).collect();
        // Only the first run is in the legend.
        let name_of = |run: usize| if run == 0 { curve.into() } else { String::new() };
        let line = |(run, lines)| PlotSeries { name: name_of(run), style: 1, dashed: false, points: points(lines) };
        let (x, y, series) =
            (PlotAxis::linear("step"), PlotAxis::linear(y), runs.iter().enumerate().map(line).collect());
        let plot = Plot { name: format!("{stem}-{name}"), title: title.into(), x, y, series, levels: Vec::new() };
        write_plots(set.path(), &[plot], &KINDS)
    };
    figure("loss", CURVES[0], "Training loss", "loss (mean of 50 steps)", "training")?;
    figure("held_out_masked_psnr", CURVES[1], "Held-out views", "masked PSNR [dB]", "held out")?;
    set.finish().map(drop)
}

/// The lines of each run; if a resumed run repeats steps, only the last ones count.
fn by_run(text: &str) -> Vec<Vec<Value>> {
    let mut runs: Vec<Vec<Value>> = Vec::new();
    for line in text.lines().filter_map(|l| serde_json::from_str::<Value>(l).ok()) {
        let Some(run_lines) = runs.iter_mut().find(|r| r.first().is_some_and(|f| f["run"] == line["run"])) else {
            runs.push(vec![line]);
            continue;
        };
        let at = |l: &Value| l["iteration"].as_u64().unwrap_or(0);
        while run_lines.last().is_some_and(|last| at(last) > at(&line)) {
            run_lines.pop();
        }
        run_lines.push(line);
    }
    runs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_resumed_run_replaces_repeated_steps() {
        let text = "{\"iteration\":1}\n{\"iteration\":2}\nbroken\n{\"iteration\":3}\n{\"run\":\"block 1\",\"iteration\":1}\n{\"iteration\":2}\n";
        let runs = by_run(text);
        assert_eq!(runs.len(), 2);
        let steps: Vec<u64> = runs[0].iter().map(|l| l["iteration"].as_u64().unwrap()).collect();
        assert_eq!(steps, [1, 2, 2]);
    }
}
