//! Whole commands of our program as child processes, with their memory.

use super::clock::{Machine, digits};
use super::command::{CommandRun, Cost, RawCopy, run};
use super::growth::{GrowthPoint, not};
use super::point_gaussian::PointGaussian;
use crate::lab::{Lab, ModelBuild};
use crate::results::{ResultTable, Spread, TableCell};
use crate::snapshot::Snapshot;
use particlegs_core::picture::Size;
use particlegs_core::{Error, Result};
use std::process::Command;

const TIMES: usize = 3;

pub(super) struct CommandTiming {
    pub what: String,
    pub runs: Vec<CommandRun>,
}

/// Decoding a model's file, and one picture of the model and of all particles.
pub(super) fn measure(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    build: &ModelBuild,
    sizes: &[Size],
    raw: &RawCopy<'_>,
    machine: &Machine,
) -> Result<Vec<CommandTiming>> {
    let model = || {
        let path = raw.folder()?.join("model.pgs");
        if !path.exists() {
            std::fs::write(&path, &build.bytes).map_err(|e| Error::io(&path, e))?;
        }
        Ok::<_, Error>(path)
    };
    let hash = blake3::hash(&build.bytes).to_hex()[..16].to_string();
    let times = |key: String, make: &dyn Fn(&std::path::Path) -> Result<Command>| {
        let inputs = (&snapshot.hash, &hash, &key, machine);
        let run_all = || {
            let folder = raw.folder()?;
            let one = |i: usize| {
                // Commands replace no files, so each gets its own output.
                let out = folder.join(format!("{}-{i}.png", key.replace(' ', "-")));
                run(&mut make(&out)?, "", folder, lab.context)
            };
            (0..TIMES).map(one).collect::<Result<Vec<CommandRun>>>()
        };
        lab.store.result_if("timed-command", &inputs, run_all, |runs| !runs.iter().any(CommandRun::failed))
    };
    let drawing = |name: &'static str, input: &dyn Fn() -> Result<std::path::PathBuf>, size: &Size| {
        let size = format!("{}x{}", size.width, size.height);
        times(format!("{name} {size}"), &|out| {
            let mut command = Command::new(&lab.settings.program);
            command.arg(name).arg(input()?).args(["--size", &size, "--distance", "0.7", "-o"]).arg(out);
            Ok(command)
        })
    };
    let info = times("info".into(), &|_| {
        let mut command = Command::new(&lab.settings.program);
        command.arg("info").arg(model()?);
        Ok(command)
    })?;
    let mut all = vec![CommandTiming { what: "`info`: decode the model file".into(), runs: info }];
    for size in sizes {
        let picture = format!("one picture of {}x{}", size.width, size.height);
        let runs = drawing("render", &model, size)?;
        all.push(CommandTiming { what: format!("`render`: {picture} of the model"), runs });
        let runs = drawing("reference", &|| raw.snapshot(), size)?;
        all.push(CommandTiming { what: format!("`reference`: {picture} of all particles"), runs });
    }
    Ok(all)
}

/// The table, which also has the compression and VTK.
pub(super) fn table(
    grown: &[GrowthPoint],
    timed: &[CommandTiming],
    vtk: &[(Size, std::result::Result<PointGaussian, String>)],
) -> ResultTable {
    let mut table = ResultTable::new(
        "performance-commands",
        "Whole commands: time and memory",
        &["command", "seconds", "CPU seconds", "peak memory, MiB", "load"],
    );
    if let Some(all) = grown.iter().find(|g| g.what == "all") {
        row(&mut table, "`compress`: the model at that ratio, with its certificate", std::slice::from_ref(&all.ran));
    }
    timed.iter().for_each(|t| row(&mut table, &t.what, &t.runs));
    for (size, vtk_result) in vtk {
        let label = format!("VTK, including Python: load and draw all frames of {}x{}", size.width, size.height);
        let ran = match vtk_result {
            Ok(v) => CommandRun { cost: Some(v.cost.clone()), said: String::new() },
            // The notes say why.
            Err(_) => CommandRun { cost: None, said: String::new() },
        };
        row(&mut table, &label, &[ran]);
    }
    table
}

fn row(table: &mut ResultTable, label: &str, runs: &[CommandRun]) {
    let costs: Vec<&Cost> = runs.iter().filter_map(|r| r.cost.as_ref()).collect();
    let name = TableCell::text(label);
    match costs[..] {
        [] => {
            let why = runs.first().map_or("", |r| &r.said);
            let why = if why.is_empty() { "not measured".into() } else { not(why) };
            table.row([name, TableCell::text(why), TableCell::Empty, TableCell::Empty, TableCell::Empty]);
        }
        [one] => table.row(std::iter::once(name).chain(one.cells())),
        _ => {
            let spread = |measure: &dyn Fn(&Cost) -> Option<f64>, most: usize| {
                let values: Vec<f64> = costs.iter().filter_map(|c| measure(c)).collect();
                match Spread::new(&values) {
                    Some(s) => TableCell::spread(&values, digits(s.median).min(most)),
                    None => TableCell::text("not measured: no /proc"),
                }
            };
            let load = costs.last().and_then(|c| c.load);
            table.row([
                name,
                spread(&|c| Some(c.seconds), 3),
                spread(&|c| c.processor, 2),
                spread(&|c| c.peak.map(|b| b as f64 / 1048576.0), 1),
                TableCell::number(load, 1),
            ]);
        }
    }
}
